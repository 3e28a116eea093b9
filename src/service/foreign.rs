//! Files of other programs that are uploaded in the place of a recording: beside them lies the request of an import,
//! whose `files` are names among them.

use super::problem::Problem;
use super::recordings::scratch_failed;
use crate::file::digest_of_file;
use crate::job::{InputFile, JobError, Progress, ScratchFolder, Surroundings, kind_of_command, run};
use crate::recording::{RawRecording, ReadLimits, ReadRecording};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The file that says what the others are.
pub const REQUEST_FILE: &str = "import.json";
/// The command whose request it is.
const COMMAND: &str = "import";
/// Longest request, bytes: that of a specimen with all holes and of a long loading history.
const MAX_REQUEST_BYTES: u64 = 64 << 20;

/// What an import finds where files were uploaded: these files, and nothing else.
struct Uploaded<'a> {
    folder: &'a Path,
    names: &'a BTreeSet<String>,
    limits: &'a ReadLimits,
}

impl Uploaded<'_> {
    fn nothing<T>(name: &str) -> Result<T, JobError> {
        let message = format!("it is not among the files that were uploaded with {REQUEST_FILE}");
        Err(JobError::Unreadable { name: name.into(), message })
    }
}

impl Surroundings for Uploaded<'_> {
    fn recording(&self, name: &str) -> Result<ReadRecording, JobError> {
        Self::nothing(name)
    }

    fn raw_recording(&self, name: &str) -> Result<ReadRecording<RawRecording>, JobError> {
        Self::nothing(name)
    }

    fn file(&self, name: &str) -> Result<InputFile, JobError> {
        if !self.names.contains(name) {
            return Self::nothing(name);
        }
        let path = self.folder.join(name);
        let digest = digest_of_file(&path)
            .map_err(|e| JobError::Unreadable { name: name.into(), message: e.into_io().to_string() })?;
        Ok(InputFile { path, digest })
    }

    fn read_limits(&self) -> ReadLimits {
        self.limits.clone()
    }

    fn progress(&self, _: &Progress) {}

    fn is_cancelled(&self) -> bool {
        self.limits.memory.stop.is_stopped()
    }

    fn checkpoint(&self, _: &str) -> Option<PathBuf> {
        None
    }
}

/// The recording of uploaded files of another program, in a folder of its own, and the names of its files; none where
/// no request of an import lies among them.
///
/// # Errors
/// `unsafe-upload` where the request is none, `invalid-input` and others where it does not fit the files.
pub fn recording_of(
    folder: &Path,
    names: &BTreeSet<String>,
    limits: &ReadLimits,
) -> Result<Option<(ScratchFolder, BTreeSet<String>)>, Problem> {
    if !names.contains(REQUEST_FILE) {
        return Ok(None);
    }
    let unfit = |detail: String| Problem::new("unsafe-upload", detail);
    let text = crate::file::read_text_limited(&folder.join(REQUEST_FILE), MAX_REQUEST_BYTES)
        .map_err(|e| unfit(format!("{REQUEST_FILE} cannot be read: {e}")))?;
    let request = serde_json::from_str(&text).map_err(|e| unfit(format!("{REQUEST_FILE} is not JSON: {e}")))?;
    let kind = kind_of_command(COMMAND).ok_or_else(|| Problem::new("internal", "there is no import"))?;
    let job = kind.job(&request).map_err(Problem::invalid)?;
    let found = run(&job, &Uploaded { folder, names, limits }).map_err(|e| without_path(e.into(), folder))?;
    let scratch = ScratchFolder::new().map_err(scratch_failed)?;
    let files = found.recording();
    for (name, bytes) in &files {
        std::fs::write(scratch.path().join(name), bytes).map_err(scratch_failed)?;
    }
    Ok(Some((scratch, files.into_keys().collect())))
}

/// Readers name files by their path here, which is nobody's business.
fn without_path(problem: Problem, folder: &Path) -> Problem {
    let folder = format!("{}/", folder.display());
    let mut problem = problem;
    problem.detail = problem.detail.replace(&folder, "");
    for error in &mut problem.errors {
        for text in [&mut error.detail, &mut error.error.value, &mut error.error.remedy] {
            *text = text.replace(&folder, "");
        }
    }
    problem
}
