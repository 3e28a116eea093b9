//! What the service shows of jobs.

use super::problem::Problem;
use super::store::JobRow;
use crate::job::Progress;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Where a job is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// Waiting for a worker.
    Queued,
    /// A worker is on it.
    Running,
    /// There is a result.
    Succeeded,
    /// There is a problem.
    Failed,
    /// Somebody cancelled it.
    Cancelled,
}

impl JobState {
    /// Whether nothing more will happen.
    pub fn has_ended(self) -> bool {
        !matches!(self, JobState::Queued | JobState::Running)
    }
}

/// A job.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct JobView {
    /// Identifier.
    pub id: String,
    /// Kind, as in the address it was posted to.
    pub kind: String,
    /// Title.
    pub title: String,
    /// Name of the token that submitted it.
    pub owner: String,
    /// Where it is.
    pub state: JobState,
    /// Tasks.
    #[schema(minimum = 0)]
    pub num_tasks: u64,
    /// Tasks that have ended.
    #[schema(minimum = 0)]
    pub num_done: u64,
    /// How far the running task is.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub progress: Option<Progress>,
    /// Why it failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub problem: Option<Problem>,
    /// Milliseconds since 1970.
    pub created_ms: i64,
    /// Milliseconds since 1970.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub started_ms: Option<i64>,
    /// Milliseconds since 1970.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub finished_ms: Option<i64>,
    /// Version of the program.
    pub version: String,
    /// Grows with every change; the number of the event that tells of it.
    pub revision: i64,
    /// Where the result is, once there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub result: Option<String>,
}

impl JobView {
    /// From what is stored.
    pub fn new(row: &JobRow) -> JobView {
        let when = |ms: i64| (ms > 0).then_some(ms);
        let count = |n: i64| u64::try_from(n).unwrap_or(0);
        JobView {
            state: match row.state.as_str() {
                "queued" => JobState::Queued,
                "running" => JobState::Running,
                "succeeded" => JobState::Succeeded,
                "cancelled" => JobState::Cancelled,
                _ => JobState::Failed,
            },
            progress: serde_json::from_str(&row.progress).ok(),
            problem: serde_json::from_str(&row.problem).ok(),
            result: (row.state == "succeeded").then(|| format!("/v1/jobs/{}/result", row.id)),
            id: row.id.clone(),
            kind: row.kind.clone(),
            title: row.title.clone(),
            owner: row.owner.clone(),
            num_tasks: count(row.num_tasks),
            num_done: count(row.num_done),
            created_ms: row.created_ms,
            started_ms: when(row.started_ms),
            finished_ms: when(row.finished_ms),
            version: row.version.clone(),
            revision: row.revision,
        }
    }
}

/// An event of a job's stream.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct JobEvent {
    /// `job`, or `shutdown` when the service ends.
    pub event: String,
    /// The job's revision.
    #[serde(default)]
    pub id: Option<String>,
    /// The job, as JSON.
    pub data: String,
}

/// A page of jobs, newest first.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct JobList {
    /// The jobs.
    pub jobs: Vec<JobView>,
    /// `before` of the next page, where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub next: Option<String>,
}

/// A file that a job left.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct ArtefactView {
    /// Name.
    pub name: String,
    /// Media type.
    pub media_type: String,
    /// Length, bytes.
    pub num_bytes: i64,
    /// SHA-256, hexadecimal.
    pub sha256: String,
    /// Where it is.
    pub href: String,
}

/// The files that a job left.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct ArtefactList {
    /// The files.
    pub artefacts: Vec<ArtefactView>,
}
