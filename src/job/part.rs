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
    /// The key of equal work, where whoever divided the work has checked the request: nobody needs to read it again
    /// before it runs. What it makes are numbers alone.
    pub work_key: Option<String>,
}
