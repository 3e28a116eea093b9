//! Calibration: from a scan's displacements and forces to the material's parameters, and the proof that a design's promise
//! is kept.

mod fit;
mod synthetic;
mod verify;

pub use fit::{CalibrationError, Fit, FitOptions, fit};
pub use synthetic::{Measurement, SyntheticScan};
pub use verify::{ParameterSpread, VerifyOptions, verify};
