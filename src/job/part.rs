//! A part of a job, which any worker may run.

use serde_json::Value;

/// What kind of request a part is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PartKind {
    /// An evaluation.
    Evaluation,
    /// A task of a sweep.
    SweepTask,
}

/// A part of a job.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Its kind.
    pub kind: PartKind,
    /// Its request.
    pub request: Value,
}
