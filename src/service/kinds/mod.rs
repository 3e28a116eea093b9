//! Kinds of jobs, one file each: what a request must hold, the library call that answers it, what it leaves behind.

mod designs;
mod diagnoses;
mod evaluations;
mod schemas;
mod sweeps;

pub use designs::Designs;
pub use diagnoses::{Diagnoses, DiagnosisRequest};
pub use evaluations::{EvaluationRequest, Evaluations, mesh_of, plan_evaluation, scan_of};
pub use schemas::*;
pub use sweeps::{SweepAxis, SweepRequest, Sweeps};

use super::problem::Problem;
use super::store::{NewTask, TaskResult};
use crate::recording::Recording;
use serde::{Deserialize, Serialize};
use std::path::Path;
use utoipa::ToSchema;

/// How far a task is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TaskProgress {
    /// Stage, such as `explore`.
    pub stage: String,
    /// Finished in this stage.
    #[schema(minimum = 0)]
    pub done: u64,
    /// Of.
    #[schema(minimum = 0)]
    pub total: u64,
    /// Best figure so far: a design's gain over the base specimen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub best: Option<f64>,
}

/// What a request comes to.
pub struct Plan {
    /// For lists.
    pub title: String,
    /// What there is to run.
    pub tasks: Vec<NewTask>,
    /// Whether [`JobKind::gather`] puts the results together.
    pub has_gather: bool,
}

/// Limits on the size of what is asked for.
#[derive(Clone, Copy, Debug)]
pub struct SizeLimits {
    /// Most elements of a mesh.
    pub max_elements: usize,
    /// Most tasks of a job.
    pub max_tasks: usize,
}

/// Why a task has no result.
pub enum RunError {
    /// Asked to stop.
    Stopped,
    /// It cannot succeed.
    Failed(Box<Problem>),
}

impl From<Problem> for RunError {
    fn from(problem: Problem) -> Self {
        RunError::Failed(Box::new(problem))
    }
}

/// What a running task is given.
pub struct RunContext<'a> {
    /// Whether to stop.
    pub is_cancelled: &'a (dyn Fn() -> bool + Sync),
    /// Takes progress.
    pub progress: &'a (dyn Fn(TaskProgress) + Sync),
    /// Reads an uploaded recording.
    pub recording: &'a dyn Fn(&str) -> Result<Recording, Problem>,
    /// A file whose content is kept across attempts.
    pub checkpoint: &'a Path,
}

/// A kind of job.
pub trait JobKind: Send + Sync {
    /// Name, as in the address.
    fn name(&self) -> &'static str;

    /// The uploaded recording that a request names; its existence is checked before the job is taken.
    fn recording<'a>(&self, _body: &'a serde_json::Value) -> Option<&'a str> {
        None
    }

    /// Validates a request's body and says what there is to run.
    ///
    /// # Errors
    /// A [`Problem`] with pointers.
    fn plan(&self, body: &serde_json::Value, limits: &SizeLimits) -> Result<Plan, Problem>;

    /// Runs a task.
    ///
    /// # Errors
    /// [`RunError`].
    fn run(&self, input: &serde_json::Value, context: &RunContext) -> Result<TaskResult, RunError>;

    /// Puts the tasks' results (or their problems) together, in order.
    ///
    /// # Errors
    /// [`RunError`].
    fn gather(
        &self,
        _body: &serde_json::Value,
        _results: Vec<Result<serde_json::Value, Problem>>,
    ) -> Result<TaskResult, RunError> {
        Err(Problem::new("internal", "this kind of job has nothing to put together").into())
    }
}

/// The kinds that this program runs.
pub fn kind_named(name: &str) -> Option<&'static dyn JobKind> {
    const KINDS: &[&dyn JobKind] = &[&Evaluations, &Designs, &Sweeps, &Diagnoses];
    KINDS.iter().copied().find(|kind| kind.name() == name)
}

/// JSON of a result, pretty, with a final newline.
fn json_bytes<T: Serialize>(value: &T) -> Result<Vec<u8>, Problem> {
    let mut bytes = serde_json::to_vec_pretty(value).map_err(|e| Problem::new("internal", e.to_string()))?;
    bytes.push(b'\n');
    Ok(bytes)
}
