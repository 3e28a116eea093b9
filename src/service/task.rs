//! What is stored of a task: the kind and request of its job, or of a part of it, and the limits it was accepted with.

use super::recordings::Space;
use super::store::{NUMBERS_ONLY, NewTask};
use crate::job::{Job, JobError, Kind, job_of_part, kind_of_part, kind_of_task};
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
    /// Space for the recording that it may make; earlier versions stored none.
    #[serde(default)]
    pub space: Space,
}

/// As [`TaskInput`], written from a request that stays where it is.
#[derive(Serialize)]
struct StoredTask<'a> {
    kind: &'a str,
    request: &'a serde_json::Value,
    max_elements: usize,
    max_seconds: f64,
    space: Space,
}

/// The limits that a job was accepted with.
#[derive(Clone, Copy, Debug)]
pub struct TaskLimits {
    /// Most elements of a mesh.
    pub max_elements: usize,
    /// Most seconds that a task may run.
    pub max_seconds: f64,
    /// Space for recordings.
    pub space: Space,
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
pub fn tasks_of(job: &Job, limits: TaskLimits) -> Result<(Vec<NewTask>, bool), serde_json::Error> {
    let input = |kind: &Kind, request: &serde_json::Value| {
        let TaskLimits { max_elements, max_seconds, space } = limits;
        serde_json::to_string(&StoredTask { kind: kind.command, request, max_elements, max_seconds, space })
    };
    let task = |job: &Job| {
        let (key, is_numbers_only) = job.work_key();
        let cache_key = if is_numbers_only { key + NUMBERS_ONLY } else { key };
        Ok(NewTask { input: input(job.kind, &job.request)?, cache_key })
    };
    let parts = job.parts();
    if parts.is_empty() {
        return Ok((vec![task(job)?], false));
    }
    let tasks = parts.iter().map(|part| {
        let unread =
            |cache_key: String| Ok(NewTask { input: input(kind_of_part(part.kind), &part.request)?, cache_key });
        match &part.work_key {
            Some(key) => unread(format!("{key}{NUMBERS_ONLY}")),
            None => match job_of_part(part) {
                Ok(job) => task(&job),
                // A part that cannot be run is a result: it fails when its turn comes.
                Err(_) => unread(String::new()),
            },
        }
    });
    Ok((tasks.collect::<Result<_, _>>()?, true))
}
