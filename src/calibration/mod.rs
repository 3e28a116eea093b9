//! Calibration: from a scan's displacements and forces to the material's parameters, and the proof that a design's
//! promise is kept.

mod adjoint;
mod all_forces;
mod allowance;
mod bench;
mod box_means;
mod calibrate;
mod calibrate_options;
mod contours;
mod descend;
mod doubt;
mod error;
mod fit;
mod force_readings;
mod interval;
mod law;
mod measured_boundary;
mod mesh_correction;
mod models;
mod noise;
mod noise_map;
mod observed;
mod observed_forces;
mod options;
mod outcome;
mod outliers;
mod patch;
mod prediction;
mod problem;
mod profile;
mod recording_fit;
mod repeats;
mod result;
mod run;
mod stand_ins;
mod starts;
mod step;
mod stress_path;
mod stress_response;
mod study;
#[cfg(test)]
mod surface_tests;
mod synthetic;
mod system;
mod target;
mod terms;
#[cfg(test)]
mod test_problem;
mod verify;
mod weak_intervals;

pub use allowance::Allowance;
pub use bench::Bench;
pub use box_means::{BoxMeans, WorstBox};
pub use calibrate::calibrate;
pub use calibrate_options::{CalibrateOptions, TermCount};
pub use contours::{Contour, ContourOptions, contours};
pub use error::CalibrationError;
pub use fit::{Fit, FitStart, fit};
pub use force_readings::{ForceOnTheWay, LoadCell, ObservedForce};
pub use interval::{SD_OVER_SHIFT, TWO_SIDED_95};
pub use law::{Law, fit_law};
pub use measured_boundary::{Boundary, CUT_PART};
pub use noise::estimate_noise_sd_mm;
pub use observed::{Observed, ObservedStep, Placing, View};
pub use options::{Bulk, FitOptions, Held};
pub use outcome::{Calibration, Estimate, MeshComparison};
pub use prediction::SolverWork;
pub use problem::CalibrationProblem;
pub use profile::{Profile, bulk_lower_bound_kpa, profile};
pub use recording_fit::RecordingFit;
pub use repeats::{MeanScan, mean_scans};
pub use result::{
    CalibrationResult, DiscretisationResult, ObjectiveResult, ParameterResult, RatioResult, StepResult,
    ValueWithInterval, rms_misfit_mm,
};
pub use stand_ins::{STAND_IN_DRIVES_MM, StandIn, StandInOptions, stand_ins};
pub use study::{Study, StudyCase, StudyRow, study};
pub use synthetic::{Measurement, SyntheticScan};
pub use target::{Objective, PAPER_BETA};
pub use terms::{DECREMENT_THRESHOLD, DecidedBy, F_TEST_LEVEL, Rule, TermRow, TermSelection};
pub use verify::{ParameterSpread, Verification, VerifyOptions, verify, verify_in_full};
