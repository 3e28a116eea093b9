//! Calibration: from a scan's displacements and forces to the material's parameters, and the proof that a design's promise
//! is kept.

mod descend;
mod error;
mod fit;
mod noise;
mod observed;
mod step;
mod synthetic;
mod system;
mod target;
#[cfg(test)]
mod test_problem;
mod verify;

pub use error::CalibrationError;
pub use fit::{Bulk, Fit, FitOptions, FitStart, Held, fit};
pub use noise::estimate_noise_sd_mm;
pub use observed::{Observed, ObservedForce, ObservedStep, View};
pub use system::Work;
pub use target::{Objective, PAPER_BETA};
pub use synthetic::{Measurement, SyntheticScan};
pub use verify::{ParameterSpread, Verification, VerifyOptions, verify, verify_in_full};
