//! What every kind of request and every checked request can do.

use super::input_use::InputUse;
use super::{JobError, Outcome, Part, Progress, ResultSchema, Surroundings};
use crate::field::FieldError;
use crate::recording::{RawRecording, ReadRecording};
use crate::specimen::Specimen;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::path::PathBuf;
use utoipa::ToSchema;

/// A request of one kind: the one definition of its fields, their units, defaults and limits.
///
/// Limits of single fields stand in the attributes of the type's schema and are checked from there;
/// [`check`](Self::check) adds what concerns several fields or their content.
pub trait Request: Serialize + DeserializeOwned + ToSchema + Send + Sync + 'static {
    /// Name of the command, such as `calibrate`; also the name of the job's folder of results.
    const COMMAND: &'static str;
    /// Name in the service's addresses, such as `calibrations`.
    const COLLECTION: &'static str;
    /// What it does, in one sentence.
    const ABOUT: &'static str;

    /// A request that shows what it is like, for the document of the service.
    fn example() -> Value;

    /// What its results look like.
    fn result() -> ResultSchema;

    /// The request in `value`, whose fields fit the schema.
    ///
    /// # Errors
    /// What does not fit, each with its JSON pointer.
    fn read(value: &Value) -> Result<Self, Vec<FieldError>> {
        crate::field::read(value).map_err(|e| vec![e])
    }

    /// The request, ready to run.
    ///
    /// # Errors
    /// Everything that is wrong with it, each with its JSON pointer.
    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>>;
}

/// What is known of a recording before it is read: enough to check a mesh and to estimate a cost.
#[derive(Clone, Debug)]
pub struct RecordingOutline {
    /// The specimen as drawn.
    pub specimen: Specimen,
    /// Voxels of the mask.
    pub num_voxels: usize,
    /// Drives at which it was scanned.
    pub num_drives: usize,
}

/// A checked request.
pub trait Run: Send + Sync {
    /// What the job is called in lists.
    fn title(&self) -> String;

    /// What it reads beyond the request.
    fn inputs(&self) -> Vec<InputUse> {
        Vec::new()
    }

    /// Whether it takes recordings of a face that cameras saw, beside those of the volume.
    fn takes_surfaces(&self) -> bool {
        false
    }

    /// Whether its meshes have at most `max_elements` elements, given what is known of its recordings. Meshes once.
    ///
    /// # Errors
    /// The field that decides, with the number of elements.
    fn check_size(&self, _recordings: &[RecordingOutline], _max_elements: usize) -> Result<(), FieldError> {
        Ok(())
    }

    /// About how many processor seconds it takes, given what is known of its recordings, where that can be told before
    /// it runs. Meshes once.
    fn estimated_seconds(&self, _recordings: &[RecordingOutline]) -> Option<f64> {
        None
    }

    /// What decides the result, where other requests may have the same: its content, and whether the result is numbers
    /// alone (which those of a request with files answer too). `None` where the request itself is that content.
    fn equal_work(&self) -> Option<(Value, bool)> {
        None
    }

    /// The parts into which the work divides, each for any worker; empty for work that does not divide.
    fn parts(&self) -> Vec<Part> {
        Vec::new()
    }

    /// Does the work.
    ///
    /// # Errors
    /// [`JobError`].
    fn run(&self, context: &Context) -> Result<Outcome, JobError>;

    /// Puts the results of the [`parts`](Self::parts) together, in their order.
    ///
    /// # Errors
    /// [`JobError`].
    fn gather(&self, _results: Vec<Result<Value, super::Failure>>) -> Result<Outcome, JobError> {
        Err(JobError::Internal("this kind of job has no parts".into()))
    }
}

/// What a running job has at hand.
pub struct Context<'a> {
    /// The door's side.
    pub surroundings: &'a dyn Surroundings,
    /// SHA-256 of the kind, the canonical request and the content of every file that the job reads, hexadecimal.
    pub input_hash: String,
    /// The recordings of displacements that the request names, in its order.
    pub recordings: Vec<ReadRecording>,
    /// The raw recordings that the request names, in its order.
    pub raw_recordings: Vec<ReadRecording<RawRecording>>,
    /// The files that the request names, in its order.
    pub files: Vec<PathBuf>,
}

impl Context<'_> {
    /// Whether to stop.
    pub fn is_cancelled(&self) -> bool {
        self.surroundings.is_cancelled()
    }

    /// Tells how far the job is.
    pub fn progress(&self, progress: &Progress) {
        self.surroundings.progress(progress);
    }

    /// Tells what is done now, of so many steps.
    pub fn step(&self, stage: &str, done: usize, total: usize) {
        self.progress(&Progress::new(stage, done, total));
    }

    /// Ends a job that was cancelled.
    ///
    /// # Errors
    /// It was.
    pub fn stop_if_cancelled(&self) -> Result<(), JobError> {
        if self.is_cancelled() { Err(JobError::stopped()) } else { Ok(()) }
    }

    /// A failed computation, or a stop where the job was cancelled.
    pub fn failed(&self, error: &dyn std::fmt::Display) -> JobError {
        JobError::unless_cancelled(self.is_cancelled(), error)
    }
}
