//! What a task is given: recordings from the storage, and the runner's progress, checkpoint and cancellation.

use super::problem::BUSY;
use super::recordings::{Uploaded, read};
use super::store::Store;
use crate::file::MemoryLimit;
use crate::job::{Input, InputFile, InputForm, InputUse, JobError, Progress, ScratchFolder, Surroundings};
use crate::recording::{RawRecording, ReadLimits, ReadRecording};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Duration;

/// How often a task that waits for memory looks again.
const MEMORY_PAUSE: Duration = Duration::from_millis(500);

/// Held while a job reads its recordings. Whoever waits for memory then waits for jobs that have all of theirs and will
/// end, never for one that waits itself.
static READING: Mutex<()> = Mutex::new(());

/// What a task is given.
pub struct StoredSurroundings<'a> {
    /// Where recordings are kept.
    pub store: &'a Store,
    /// Whether to stop.
    pub is_cancelled: &'a (dyn Fn() -> bool + Sync),
    /// Progress as JSON, for whoever keeps the lease alive.
    pub progress: &'a Mutex<String>,
    /// A file whose content is kept across attempts.
    pub checkpoint: &'a Path,
    /// Most elements of a mesh.
    pub max_elements: usize,
}

impl StoredSurroundings<'_> {
    /// Pauses before the next look for something that others hold.
    fn pause(&self) -> Result<(), JobError> {
        if self.is_cancelled() {
            return Err(JobError::stopped());
        }
        std::thread::sleep(MEMORY_PAUSE);
        Ok(())
    }

    /// This job's turn to read its recordings.
    fn turn(&self) -> Result<MutexGuard<'static, ()>, JobError> {
        loop {
            match READING.try_lock() {
                Ok(turn) => return Ok(turn),
                Err(TryLockError::Poisoned(poisoned)) => return Ok(poisoned.into_inner()),
                Err(TryLockError::WouldBlock) => self.pause()?,
            }
        }
    }

    /// The recording of this identifier, whose reading holds `beside_bytes` already.
    fn uploaded(&self, name: &str, beside_bytes: u64) -> Result<Uploaded, JobError> {
        let unreadable = |message: String| JobError::Unreadable { name: name.into(), message };
        let internal = |e: &dyn std::fmt::Display| JobError::Internal(e.to_string());
        let files = self.store.upload_files(name).map_err(|e| internal(&e))?;
        if files.is_empty() {
            return Err(unreadable("the recording is gone; upload it again".into()));
        }
        let scratch = ScratchFolder::new().map_err(|e| internal(&e))?;
        for file in files {
            let mut sink = File::create_new(scratch.path().join(&file.name)).map_err(|e| internal(&e))?;
            self.store.copy_blob(&file.sha, &mut sink).map_err(|e| internal(&e))?;
        }
        let memory = MemoryLimit { beside_bytes, ..MemoryLimit::job() };
        let limits = ReadLimits { memory, ..ReadLimits::job() };
        loop {
            match read(scratch.path(), &limits) {
                Err(problem) if problem.is(BUSY) => self.pause()?,
                Err(problem) => return Err(unreadable(problem.detail)),
                Ok(found) => return Ok(found),
            }
        }
    }

    fn displacements(&self, name: &str, beside_bytes: u64) -> Result<ReadRecording, JobError> {
        match self.uploaded(name, beside_bytes)? {
            Uploaded::Displacements(read) => Ok(*read),
            Uploaded::RawPhases(_) => {
                let message = "it holds raw phases; import it first".into();
                Err(JobError::Unreadable { name: name.into(), message })
            }
        }
    }

    fn raw_phases(&self, name: &str, beside_bytes: u64) -> Result<ReadRecording<RawRecording>, JobError> {
        match self.uploaded(name, beside_bytes)? {
            Uploaded::RawPhases(read) => Ok(*read),
            Uploaded::Displacements(_) => {
                let message = "this recording already holds displacements".into();
                Err(JobError::Unreadable { name: name.into(), message })
            }
        }
    }
}

impl Surroundings for StoredSurroundings<'_> {
    /// All recordings of a job are one reading, and are read one job at a time.
    fn inputs(&self, wanted: &[InputUse]) -> Result<Vec<Input>, JobError> {
        if wanted.is_empty() {
            return Ok(Vec::new());
        }
        let _turn = self.turn()?;
        let (mut inputs, mut held_bytes) = (Vec::new(), 0);
        for InputUse { name, form, .. } in wanted {
            inputs.push(match form {
                InputForm::Displacements => {
                    let read = self.displacements(name, held_bytes)?;
                    held_bytes += read.memory.taken_bytes();
                    Input::Displacements(read)
                }
                InputForm::RawPhases => {
                    let read = self.raw_phases(name, held_bytes)?;
                    held_bytes += read.memory.taken_bytes();
                    Input::RawPhases(read)
                }
                InputForm::File => Input::File(self.file(name)?),
            });
        }
        Ok(inputs)
    }

    fn recording(&self, name: &str) -> Result<ReadRecording, JobError> {
        self.displacements(name, 0)
    }

    fn raw_recording(&self, name: &str) -> Result<ReadRecording<RawRecording>, JobError> {
        self.raw_phases(name, 0)
    }

    fn file(&self, name: &str) -> Result<InputFile, JobError> {
        let message = "jobs read uploaded recordings alone; upload other files with the import's request as import.json beside them".into();
        Err(JobError::Unreadable { name: name.into(), message })
    }

    fn progress(&self, progress: &Progress) {
        let text = serde_json::to_string(progress).unwrap_or_default();
        *self.progress.lock().unwrap_or_else(PoisonError::into_inner) = text;
    }

    fn is_cancelled(&self) -> bool {
        (self.is_cancelled)()
    }

    fn checkpoint(&self, _: &str) -> Option<PathBuf> {
        Some(self.checkpoint.to_path_buf())
    }

    fn max_elements(&self) -> usize {
        self.max_elements
    }
}
