//! What a job is given by the command: recordings from folders, progress on stderr, Ctrl-C, checkpoints beside the
//! results.

use super::interrupt;
use crate::job::{InputFile, JobError, Progress, Surroundings};
use crate::recording::{RawRecording, ReadLimits, ReadRecording, Recording};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The command's side of a job.
pub(super) struct Terminal {
    folder: Option<PathBuf>,
    begin: Instant,
    limit: Option<Duration>,
    bar: Option<ProgressBar>,
    /// Stage and tenth last written.
    last: Mutex<(String, u64)>,
}

impl Terminal {
    /// With checkpoints in `folder`; ends as by Ctrl-C after `limit`.
    pub(super) fn new(folder: Option<&Path>, limit: Option<Duration>) -> Terminal {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::hidden();
            // The template is a constant; should it be wrong, the default one serves.
            if let Ok(style) = ProgressStyle::with_template("{bar:32} {pos}/{len} {elapsed} left {eta} {msg}") {
                bar.set_style(style);
            }
            bar
        });
        let last = Mutex::new((String::new(), 0));
        Terminal { folder: folder.map(Path::to_path_buf), begin: Instant::now(), limit, bar, last }
    }

    /// Removes the bar.
    pub(super) fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    fn write_line(&self, text: &str) {
        let line = format!("{:7.1} s  {text}", self.begin.elapsed().as_secs_f64());
        match &self.bar {
            Some(bar) => bar.suspend(|| eprintln!("{line}")),
            None => eprintln!("{line}"),
        }
    }
}

fn unreadable(name: &str, error: &dyn std::fmt::Display) -> JobError {
    JobError::Unreadable { name: name.into(), message: error.to_string() }
}

impl Surroundings for Terminal {
    fn recording(&self, name: &str) -> Result<ReadRecording, JobError> {
        Recording::read_with_digest(Path::new(name), &ReadLimits::default()).map_err(|e| unreadable(name, &e))
    }

    fn raw_recording(&self, name: &str) -> Result<ReadRecording<RawRecording>, JobError> {
        RawRecording::read_with_digest(Path::new(name), &ReadLimits::default()).map_err(|e| unreadable(name, &e))
    }

    fn file(&self, name: &str) -> Result<InputFile, JobError> {
        let path = PathBuf::from(name);
        let digest = crate::file::digest_of_path(&path).map_err(|e| unreadable(name, &e))?;
        Ok(InputFile { path, digest })
    }

    fn progress(&self, p: &Progress) {
        let best = p.best.map_or(String::new(), |b| format!(" best gain {b:.3}"));
        let tenth = (10 * p.done).checked_div(p.total).unwrap_or(0);
        let is_new = {
            let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
            let is_new = last.0 != p.stage || last.1 < tenth;
            if is_new {
                *last = (p.stage.clone(), tenth);
            }
            is_new
        };
        if let Some(bar) = &self.bar
            && p.total > 1
        {
            bar.set_draw_target(indicatif::ProgressDrawTarget::stderr());
            bar.set_length(p.total);
            bar.set_position(p.done);
            bar.set_message(format!("{}{best}", p.stage));
        } else if is_new && p.total > 1 {
            self.write_line(&format!("{}: {} of {}{best}", p.stage, p.done, p.total));
        } else if is_new {
            self.write_line(&format!("{}{best}", p.stage));
        }
    }

    fn is_cancelled(&self) -> bool {
        interrupt::is_requested() || self.limit.is_some_and(|limit| self.begin.elapsed() >= limit)
    }

    fn checkpoint(&self, name: &str) -> Option<PathBuf> {
        self.folder.as_ref().map(|folder| folder.join(name))
    }
}
