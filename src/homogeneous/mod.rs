//! Homogeneous tests: closed-form and implicit responses of the Ogden material, and fits to measured curves.
//!
//! * [`respond`]: the compressible material in one state, with derivatives; [`incompressible_stress`]: its limit.
//! * [`fit_curves`]: one to N terms to several curves together, chosen by decrement, F-test and BIC.
//! * [`fit_dumbbell`]: the traditional route from a dumb-bell's force over grip displacement.
//! * [`read_csv`]: curves from text.

mod compressible;
mod csv;
mod curve;
mod deformation;
mod dumbbell;
mod fit;
mod least_squares;
mod result;
mod selection;
mod stability;
mod stand_in;
mod starts;
mod statistics;
mod table;

pub use compressible::{HomogeneousError, Response, respond};
pub use csv::{CsvCurve, CsvError, CsvOptions, StressUnit, read_csv};
pub use curve::{Curve, CurveError, CurveMatch};
pub use deformation::{
    Deformation, HomogeneousTest, ShearTerm, incompressible_derivative, incompressible_stress, power_difference,
};
pub use dumbbell::{DumbbellError, DumbbellFit, DumbbellOptions, GaugePoint, fit_dumbbell, gauge_stretches};
pub use fit::{CurveFitError, CurveFitOptions, TermFit, fit_terms, matches_of, material_of, model_stress};
pub use least_squares::{Evaluation, LeastSquaresOptions, Limit, Minimum, covariance, minimise};
pub use result::{CurveFit, CurveFitSequence, CurveParameter, Interval, fit_curves};
pub use selection::{
    F_LEVEL, MIN_DECREMENT, ModelEvidence, Selection, bic, compare, independent_count, neighbour_correlation,
};
pub use stability::{is_stable, smallest_stiffness};
pub use stand_in::{GAUGE_STRETCHES, TRUTH, UniaxialRow, UniaxialStandIn, UniaxialStandInOptions, uniaxial_stand_in};
pub use statistics::{erf, f_exceedance, t_quantile};
pub use table::{ForceTable, TableError};
