//! What is stored of a task: the kind and request of its job, or of a part of it, and the limits it was accepted with.

use super::store::{NUMBERS_ONLY, NewTask};
use crate::job::{Job, JobError, job_of_part, kind_of_part, kind_of_task};
use serde::{Deserialize, Serialize};

/// A task's input as it is stored.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskInput {
    /// The command of the kind.
    pub kind: String,
    /// The request.
    pub request: serde_json::Value,
    /// Most elements of a mesh.
    pub max_elements: usize,
    /// Most seconds that it may run.
    pub max_seconds: f64,
}

impl TaskInput {
    /// The task's job.
    ///
    /// # Errors
    /// [`JobError`]: another version of the program stored it.
    pub fn job(&self) -> Result<Job, JobError> {
        let kind =
            kind_of_task(&self.kind).ok_or_else(|| JobError::Internal(format!("no kind of job {}", self.kind)))?;
        kind.job(&self.request).map_err(JobError::Invalid)
    }
}

/// The tasks into which a job is split, and whether their results are put together at the end.
pub fn tasks_of(job: &Job, max_elements: usize, max_seconds: f64) -> Result<(Vec<NewTask>, bool), serde_json::Error> {
    let task = |job: &Job| {
        let (key, is_numbers_only) = job.work_key();
        let cache_key = if is_numbers_only { key + NUMBERS_ONLY } else { key };
        let input =
            TaskInput { kind: job.kind.command.into(), request: job.request.clone(), max_elements, max_seconds };
        Ok(NewTask { input: serde_json::to_string(&input)?, cache_key })
    };
    let parts = job.parts();
    if parts.is_empty() {
        return Ok((vec![task(job)?], false));
    }
    let tasks = parts.iter().map(|part| match job_of_part(part) {
        Ok(job) => task(&job),
        // A part that cannot be run is a result: it fails when its turn comes.
        Err(_) => {
            let input = TaskInput {
                kind: kind_of_part(part.kind).command.into(),
                request: part.request.clone(),
                max_elements,
                max_seconds,
            };
            Ok(NewTask { input: serde_json::to_string(&input)?, cache_key: String::new() })
        }
    });
    Ok((tasks.collect::<Result<_, _>>()?, true))
}
