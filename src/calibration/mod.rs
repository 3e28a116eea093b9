//! Calibration: from a scan's displacements and forces to the material's parameters, and the proof that a design's promise
//! is kept.

mod adjoint;
mod allowance;
mod calibrate;
mod contours;
mod descend;
mod error;
mod fit;
mod noise;
mod observed;
mod problem;
mod profile;
mod result;
mod stability;
mod stand_ins;
mod starts;
mod step;
mod stress_path;
mod study;
mod synthetic;
mod system;
mod target;
mod terms;
#[cfg(test)]
mod test_problem;
mod verify;

pub use allowance::Allowance;
pub use calibrate::{CalibrateOptions, Calibration, Estimate, MeshComparison, TermCount, calibrate};
pub use contours::{Contour, ContourOptions, contours};
pub use error::CalibrationError;
pub use fit::{Bulk, Fit, FitOptions, FitStart, Held, fit};
pub use noise::estimate_noise_sd_mm;
pub use observed::{Observed, ObservedForce, ObservedStep, View};
pub use problem::{CalibrationProblem, RecordingFit};
pub use profile::{Profile, bulk_lower_bound_kpa, profile};
pub use result::{
    CalibrationResult, DiscretisationResult, ObjectiveResult, ParameterResult, RatioResult, StepResult,
    ValueWithInterval, rms_misfit_mm,
};
pub use stability::{least_relative_stiffness, smallest_stiffness_kpa};
pub use stand_ins::{STAND_IN_DRIVES_MM, StandIn, StandInOptions, stand_ins};
pub use study::{Study, StudyCase, StudyRow, study};
pub use synthetic::{Measurement, SyntheticScan};
pub use system::Work;
pub use target::{Objective, PAPER_BETA};
pub use terms::{DECREMENT_THRESHOLD, F_TEST_LEVEL, Rule, TermRow, TermSelection};
pub use verify::{ParameterSpread, Verification, VerifyOptions, verify, verify_in_full};
