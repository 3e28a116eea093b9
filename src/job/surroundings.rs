//! What a running job is given by the door through which it came.

use super::JobError;
use super::input_use::{InputForm, InputUse};
use crate::recording::{RawRecording, ReadLimits, ReadRecording};
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use utoipa::ToSchema;

/// How far a job is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = TaskProgress)]
pub struct Progress {
    /// Stage, such as `explore`.
    pub stage: String,
    /// Finished in this stage.
    #[schema(minimum = 0)]
    pub done: u64,
    /// Of so many; 0 where the number is not known before.
    #[schema(minimum = 0)]
    pub total: u64,
    /// Best figure so far: a design's gain over the base specimen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub best: Option<f64>,
    /// The design that reached it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub best_specimen: Option<Specimen>,
}

impl Progress {
    /// `done` of `total` in `stage`.
    pub fn new(stage: impl Into<String>, done: usize, total: usize) -> Progress {
        Progress { stage: stage.into(), done: done as u64, total: total as u64, ..Progress::default() }
    }

    /// A stage of which it is not known how many follow.
    pub fn stage(text: &str) -> Progress {
        Progress { stage: text.trim().chars().take(120).collect(), ..Progress::default() }
    }
}

/// A file, or a folder of files, that a job reads itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputFile {
    /// Where it lies.
    pub path: PathBuf,
    /// SHA-256 of its content, hexadecimal.
    pub digest: String,
}

/// What a job has read under a name of its request.
#[derive(Debug)]
pub enum Input {
    /// A recording of displacements.
    Displacements(ReadRecording),
    /// A recording of wrapped phases.
    RawPhases(ReadRecording<RawRecording>),
    /// A file of a laboratory's own format, or a folder of such files.
    File(InputFile),
}

/// Recordings, progress, cancellation and a place for checkpoints.
pub trait Surroundings: Sync {
    /// All that a request names, in its order. A door on which several jobs share what memory there is reads all of it
    /// here in one go, so that no two jobs wait for what the other one holds.
    ///
    /// # Errors
    /// [`JobError`] where something is not there or cannot be read.
    fn inputs(&self, wanted: &[InputUse]) -> Result<Vec<Input>, JobError> {
        let read = |wanted: &InputUse| match wanted.form {
            InputForm::Displacements => self.recording(&wanted.name).map(Input::Displacements),
            InputForm::RawPhases => self.raw_recording(&wanted.name).map(Input::RawPhases),
            InputForm::File => self.file(&wanted.name).map(Input::File),
        };
        wanted.iter().map(read).collect()
    }

    /// The recording of displacements that a request names.
    ///
    /// # Errors
    /// [`JobError`] where there is none or it cannot be read.
    fn recording(&self, name: &str) -> Result<ReadRecording, JobError>;

    /// The recording of raw phases that a request names.
    ///
    /// # Errors
    /// [`JobError`] where there is none or it cannot be read.
    fn raw_recording(&self, name: &str) -> Result<ReadRecording<RawRecording>, JobError>;

    /// How much a job may read a file of a laboratory's own format into.
    fn read_limits(&self) -> ReadLimits {
        ReadLimits::default()
    }

    /// The file of a laboratory's own format that a request names.
    ///
    /// # Errors
    /// [`JobError`] where there is none or it cannot be read.
    fn file(&self, name: &str) -> Result<InputFile, JobError>;

    /// Takes progress.
    fn progress(&self, progress: &Progress);

    /// Whether to stop.
    fn is_cancelled(&self) -> bool;

    /// A file of this name whose content is there again when a stopped job goes on; `None` where nothing is kept.
    fn checkpoint(&self, name: &str) -> Option<PathBuf>;

    /// Most elements of a mesh.
    fn max_elements(&self) -> usize {
        usize::MAX
    }
}
