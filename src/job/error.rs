//! Why a job has no outcome.

use super::outcome::{Outcome, OutcomeError};
use crate::field::{FieldError, in_lines};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Why a job has no outcome.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JobError {
    /// Fields of the request do not hold what they may hold.
    #[error("{}", in_lines(.0))]
    Invalid(Vec<FieldError>),
    /// Something that the request names cannot be read.
    #[error("{name}: {message}")]
    Unreadable {
        /// As the request names it.
        name: String,
        /// What is wrong with it.
        message: String,
    },
    /// More is asked for than this door allows.
    #[error("{0}")]
    TooBig(FieldError),
    /// It was asked to stop.
    #[error("{summary}")]
    Stopped {
        /// How far it came.
        summary: String,
        /// What it had found by then, where that is worth keeping.
        unfinished: Option<Box<Outcome>>,
    },
    /// What an earlier run kept belongs to other work.
    #[error("{0}")]
    Checkpoint(String),
    /// The computation found no solution.
    #[error("{0}")]
    NoSolution(String),
    /// The program failed.
    #[error("{0}")]
    Internal(String),
}

impl JobError {
    /// A stop without anything worth keeping.
    pub fn stopped() -> JobError {
        JobError::Stopped { summary: "there is no result yet".into(), unfinished: None }
    }

    /// One field that does not hold what it may hold.
    pub fn at(pointer: impl Into<String>, value: impl std::fmt::Display, allowed: impl Into<String>) -> JobError {
        JobError::Invalid(vec![FieldError::new(pointer, value, allowed)])
    }

    /// `error` as the failure of a computation, or as a stop where the job was cancelled.
    pub fn unless_cancelled(is_cancelled: bool, error: &dyn std::fmt::Display) -> JobError {
        if is_cancelled { JobError::stopped() } else { JobError::NoSolution(error.to_string()) }
    }
}

impl From<FieldError> for JobError {
    fn from(error: FieldError) -> JobError {
        JobError::Invalid(vec![error])
    }
}

impl From<OutcomeError> for JobError {
    fn from(error: OutcomeError) -> JobError {
        JobError::Internal(error.to_string())
    }
}

/// Why a part of a job has no result, as it stands in the result of the whole.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Failure {
    /// In words: the value, the limit, what to change.
    pub detail: String,
    /// Fields of the request.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub errors: Vec<FieldError>,
}

impl From<&JobError> for Failure {
    fn from(error: &JobError) -> Failure {
        let errors = match error {
            JobError::Invalid(errors) => errors.clone(),
            JobError::TooBig(error) => vec![error.clone()],
            _ => Vec::new(),
        };
        Failure { detail: error.to_string(), errors }
    }
}
