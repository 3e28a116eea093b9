//! Why a recording was not diagnosed.

use crate::calibration::CalibrationError;
use crate::fem::{PrepareError, SolveError};
use crate::specimen::SpecimenError;

/// Why a recording was not diagnosed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DiagnosisError {
    /// The recording cannot be compared with a model.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// No model of the specimen.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    /// No equilibrium, or the work was cancelled.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// A supposed specimen cannot exist.
    #[error("a supposed specimen: {0}")]
    Specimen(SpecimenError),
    /// A cause is to be left out that there is not.
    #[error("'{name}' is no cause; there are {known}")]
    UnknownCause {
        /// Its name.
        name: &'static str,
        /// The names that there are.
        known: String,
    },
    /// A cause of one's own cannot be tested.
    #[error("the cause '{name}': {problem}")]
    OwnCause {
        /// Its name.
        name: &'static str,
        /// What is wrong with it, and what to change.
        problem: String,
    },
    /// The plate does not move along x, as causes of the set-up take it.
    #[error(
        "the specimen's drive_angle_deg is {value_deg}°; a diagnosis is of drives along x alone: calibrate it, or turn the specimen's frame"
    )]
    DriveAngle {
        /// The angle, degrees.
        value_deg: f64,
    },
    /// The faces of a made block lie off those of a drawn one that is even.
    #[error(
        "the specimen's block.wedge_mm is {value_mm} mm; a diagnosis is of blocks of even thickness alone: calibrate it, or set wedge_mm to 0"
    )]
    Wedge {
        /// The wedge, mm.
        value_mm: f64,
    },
    /// A setting is out of range.
    #[error("{name} is {value}; it must be {requirement}")]
    Setting {
        /// Which one.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        requirement: &'static str,
    },
}
