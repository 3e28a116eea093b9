//! Runs a job: as a whole, or in parts on all threads.

use super::input_use::InputUse;
use super::kind::Job;
use super::part::Part;
use super::registry::kind_of_part;
use super::{Failure, Input, InputFile, JobError, Outcome, Progress, Surroundings};
use crate::recording::{RawRecording, ReadRecording};
use rayon::prelude::*;
use serde_json::Value;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Reads what the request names, hashes what goes in, and does the work.
///
/// # Errors
/// [`JobError`].
pub fn run(job: &Job, surroundings: &dyn Surroundings) -> Result<Outcome, JobError> {
    let parts = job.parts();
    if parts.is_empty() {
        return job.run_whole(surroundings);
    }
    let done = AtomicUsize::new(0);
    let results: Vec<Result<Value, Failure>> = parts
        .par_iter()
        .with_max_len(1)
        .map(|part| {
            let found = job_of_part(part).and_then(|job| job.run_whole(&PartSurroundings(surroundings)));
            let count = done.fetch_add(1, Ordering::Relaxed) + 1;
            surroundings.progress(&Progress::new("evaluate", count, parts.len()));
            let value = |outcome: Outcome| serde_json::from_str(&outcome.result);
            match found {
                Ok(outcome) => value(outcome).map_err(|e| Failure::from(&JobError::Internal(e.to_string()))),
                Err(error) => Err(Failure::from(&error)),
            }
        })
        .collect();
    if surroundings.is_cancelled() { Err(JobError::stopped()) } else { job.gather(results) }
}

/// A part as a job of its own.
///
/// # Errors
/// [`JobError::Invalid`].
pub fn job_of_part(part: &Part) -> Result<Job, JobError> {
    kind_of_part(part.kind).job(&part.request).map_err(JobError::Invalid)
}

/// The surroundings of a part: its own progress and checkpoints are of no interest.
struct PartSurroundings<'a>(&'a dyn Surroundings);

impl Surroundings for PartSurroundings<'_> {
    fn inputs(&self, wanted: &[InputUse]) -> Result<Vec<Input>, JobError> {
        self.0.inputs(wanted)
    }

    fn recording(&self, name: &str) -> Result<ReadRecording, JobError> {
        self.0.recording(name)
    }

    fn raw_recording(&self, name: &str) -> Result<ReadRecording<RawRecording>, JobError> {
        self.0.raw_recording(name)
    }

    fn file(&self, name: &str) -> Result<InputFile, JobError> {
        self.0.file(name)
    }

    fn progress(&self, _: &Progress) {}

    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }

    fn checkpoint(&self, _: &str) -> Option<PathBuf> {
        None
    }

    fn max_elements(&self) -> usize {
        self.0.max_elements()
    }
}
