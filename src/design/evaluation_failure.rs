//! Why a design has no evaluation.

use crate::fem::{PrepareError, SolveError};
use crate::sensitivity::InformationError;
use serde::{Deserialize, Serialize};

/// Why a design was not evaluated: data for the search, not an error of it.
#[derive(Clone, Debug, PartialEq, thiserror::Error, Serialize, Deserialize)]
#[non_exhaustive]
pub enum EvaluationFailure {
    /// The specimen cannot be made or meshed.
    #[error("{reason}")]
    Geometry {
        /// Why.
        reason: String,
    },
    /// No equilibrium.
    #[error("{reason}")]
    Equilibrium {
        /// Why.
        reason: String,
    },
    /// Stopped from outside.
    #[error("stopped")]
    Cancelled,
}

impl From<PrepareError> for EvaluationFailure {
    fn from(error: PrepareError) -> Self {
        match error {
            PrepareError::Mesh(e) => EvaluationFailure::Geometry { reason: e.to_string() },
            PrepareError::Solve(e) => e.into(),
        }
    }
}

impl From<SolveError> for EvaluationFailure {
    fn from(error: SolveError) -> Self {
        match error {
            SolveError::Cancelled { .. } => EvaluationFailure::Cancelled,
            other => EvaluationFailure::Equilibrium { reason: other.to_string() },
        }
    }
}

impl From<InformationError> for EvaluationFailure {
    fn from(error: InformationError) -> Self {
        EvaluationFailure::Equilibrium { reason: error.to_string() }
    }
}
