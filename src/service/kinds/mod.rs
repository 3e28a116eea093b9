//! Kinds of jobs, one file each: what a request must hold, the library call that answers it, what it leaves behind.

mod calibrations;
mod designs;
mod diagnoses;
mod evaluations;
mod fields;
mod scans;
mod schemas;
mod sweep_table;
mod sweeps;

pub use calibrations::{CalibrationRequest, Calibrations};
pub use designs::Designs;
pub use diagnoses::{Diagnoses, DiagnosisRequest};
pub use evaluations::{EvaluationRequest, Evaluations, mesh_of, plan_evaluation, scan_of};
pub use scans::{KSpaceRequest, ScanRequest, Scans};
pub use schemas::*;
pub use sweeps::{SweepAxis, SweepRequest, SweepSample, Sweeps};

use super::problem::Problem;
use super::store::{NewTask, TaskResult};
use crate::mesh::{MeshOptions, mesh_specimen};
use crate::recording::Recording;
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
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
    /// Keeps a recording made here: files by name. Gives its identifier; an equal one is kept once.
    pub keep: &'a dyn Fn(BTreeMap<String, Vec<u8>>) -> Result<String, Problem>,
    /// A file whose content is kept across attempts.
    pub checkpoint: &'a Path,
}

/// A kind of job.
pub trait JobKind: Send + Sync {
    /// Name, as in the address.
    fn name(&self) -> &'static str;

    /// The recordings that a request names, with the pointers to their names. That they exist is checked before the job is
    /// taken.
    fn recordings(&self, _body: &serde_json::Value) -> Vec<(String, String)> {
        Vec::new()
    }

    /// Whether what is asked of a recording of `specimen` keeps the limits.
    ///
    /// # Errors
    /// A [`Problem`] `too-big-a-problem`.
    fn check_recording(
        &self,
        _body: &serde_json::Value,
        _specimen: &Specimen,
        _limits: &SizeLimits,
    ) -> Result<(), Problem> {
        Ok(())
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
    const KINDS: &[&dyn JobKind] = &[&Evaluations, &Designs, &Sweeps, &Scans, &Calibrations, &Diagnoses];
    KINDS.iter().copied().find(|kind| kind.name() == name)
}

/// Whether the mesh of a recording's specimen keeps the limit; `factor` is the element size relative to standard.
fn mesh_is_small_enough(specimen: &Specimen, factor: f64, limits: &SizeLimits) -> Result<(), Problem> {
    let mesh = mesh_specimen(specimen, &MeshOptions::scaled(specimen, factor))
        .map_err(|e| Problem::at("/mesh_factor", e.to_string()))?;
    if mesh.num_elements() <= limits.max_elements {
        return Ok(());
    }
    let (count, most) = (mesh.num_elements(), limits.max_elements);
    Err(Problem::too_big("/mesh_factor", format!("{count} elements; at most {most}: use a larger factor")))
}

/// JSON of a result, pretty, with a final newline.
fn json_bytes<T: Serialize>(value: &T) -> Result<Vec<u8>, Problem> {
    let mut bytes = serde_json::to_vec_pretty(value).map_err(|e| Problem::new("internal", e.to_string()))?;
    bytes.push(b'\n');
    Ok(bytes)
}
