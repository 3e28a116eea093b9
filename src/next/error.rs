//! Why no next scan can be named.

use crate::calibration::CalibrationError;
use crate::fem::{PrepareError, SolveError};
use crate::sensitivity::{EvaluationError, InformationError};
use crate::voxel::VoxelError;

/// Why no next scan can be named.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NextError {
    /// The recordings cannot be fitted.
    #[error("the recordings cannot be fitted together: {0}")]
    Calibration(#[from] CalibrationError),
    /// A candidate cannot be evaluated.
    #[error("a candidate cannot be evaluated: {0}")]
    Evaluation(#[from] EvaluationError),
    /// No candidate is left.
    #[error(
        "none of {tried} candidates can be scanned: {reasons}; name smaller drives, or other specimens, or wider limits"
    )]
    NoCandidate {
        /// How many there were.
        tried: usize,
        /// Why each was left out.
        reasons: String,
    },
    /// A precision is asked of a parameter that the law does not have.
    #[error("a precision is asked of {name}; the fitted law has {known}")]
    UnknownParameter {
        /// Its name.
        name: String,
        /// The law's parameters.
        known: String,
    },
}

impl From<SolveError> for NextError {
    fn from(error: SolveError) -> Self {
        NextError::Evaluation(error.into())
    }
}

impl From<PrepareError> for NextError {
    fn from(error: PrepareError) -> Self {
        NextError::Evaluation(match error {
            PrepareError::Mesh(error) => error.into(),
            PrepareError::Solve(error) => error.into(),
        })
    }
}

impl From<VoxelError> for NextError {
    fn from(error: VoxelError) -> Self {
        NextError::Evaluation(error.into())
    }
}

impl From<InformationError> for NextError {
    fn from(error: InformationError) -> Self {
        NextError::Evaluation(error.into())
    }
}
