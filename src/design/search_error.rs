//! Why a search has no result.

use super::checkpoint::CheckpointError;
use super::evaluation_failure::EvaluationFailure;
use super::study_error::StudyError;
use super::unfinished::Unfinished;

/// Why a search has no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SearchError {
    /// The study is none that designs can be searched for with.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// The base specimen cannot be evaluated, so there is nothing to compare with.
    #[error("the base specimen cannot be evaluated: {cause}; change the base, its drive or the material")]
    Base {
        /// Why.
        cause: EvaluationFailure,
    },
    /// No design could be evaluated.
    #[error("none of {tried} designs could be evaluated and kept within the limits; widen the limits or the ranges")]
    NothingFeasible {
        /// Designs tried.
        tried: usize,
    },
    /// The checkpoint.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// Stopped from outside.
    #[error("{}", unfinished.summary())]
    Stopped {
        /// What was found until then.
        unfinished: Box<Unfinished>,
    },
}
