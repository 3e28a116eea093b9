//! Homogeneous tests: closed-form and implicit responses of Ogden materials and of laws in the first invariant, and
//! fits to measured curves.
//!
//! * [`respond`]: the compressible material in one state, with derivatives; [`incompressible_stress`]: its limit.
//! * [`fit_curves`]: one to N of Ogden's terms to several curves together, chosen by decrement, F-test and BIC, or a
//!   law in the first invariant; [`compare_laws`]: all laws side by side. A law is a [`CurveLaw`].
//! * [`fit_dumbbell`]: the traditional route from a dumb-bell's force over grip displacement.
//! * [`read_csv`]: curves from text; [`read_biaxial_csv`]: tests with two stretches and their two stresses.

mod branches;
mod compressible;
mod csv;
mod csv_axes;
mod csv_biaxial;
mod csv_columns;
mod csv_error;
mod csv_text;
mod csv_unit;
mod curve;
mod curve_law;
mod deformation;
mod dumbbell;
mod fit;
mod fit_options;
mod law_comparison;
mod loading_path;
mod result;
mod selection;
#[cfg(feature = "calibration")]
mod stand_in;
mod starts;
mod statistics;
mod stress_unit;
mod table;

pub use crate::material::ShearTerm;
pub use branches::Unloading;
pub use compressible::{HomogeneousError, Response, respond};
pub use csv::{CsvCurve, CsvOptions, CsvReading, Turned, read_csv};
pub use csv_biaxial::{BiaxialCsv, read_biaxial_csv};
pub use csv_error::{CsvColumn, CsvError};
pub use curve::{BiaxialStress, Curve, CurveError, CurveMatch};
pub use curve_law::{CurveLaw, LawValue, OgdenTerms};
pub use deformation::{Deformation, HomogeneousTest, incompressible_derivative, incompressible_stress};
pub use dumbbell::{DumbbellError, DumbbellFit, DumbbellOptions, GaugePoint, fit_dumbbell, gauge_stretches};
pub use fit::{BULK_OVER_SHEAR, LawFit, fit_law, fit_terms, fitted_material, matches_of, model_stress};
pub use fit_options::{CurveFitError, CurveFitOptions};
pub use law_comparison::{LawComparison, LawEvidence, LawLeftOut, MIN_BIC_DIFFERENCE, compare_laws};
pub use loading_path::is_stable;
pub use result::{CurveFit, CurveFitSequence, CurveParameter, Interval, fit_curves};
pub use selection::{
    F_LEVEL, MIN_DECREMENT, ModelEvidence, Selection, bic, compare, independent_count, neighbour_correlation,
};
#[cfg(feature = "calibration")]
pub use stand_in::{GAUGE_STRETCHES, TRUTH, UniaxialRow, UniaxialStandIn, UniaxialStandInOptions, uniaxial_stand_in};
pub use statistics::{erf, f_exceedance, t_quantile};
pub use stress_unit::StressUnit;
pub use table::{ForceTable, TableError};
