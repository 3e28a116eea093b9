//! What a job is given by the command: recordings from folders, progress on stderr, Ctrl-C, checkpoints beside the
//! results.

use super::interrupt;
use super::time_left::{time_left, words};
use crate::job::{InputFile, JobError, Progress, Surroundings};
use crate::recording::{RawRecording, ReadLimits, ReadRecording, Recording};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// After so long without a line the last one is said again, with how long it has taken.
const LONGEST_SILENCE: Duration = Duration::from_secs(5);

/// The command's side of a job.
pub(super) struct Terminal {
    folder: Option<PathBuf>,
    begin: Instant,
    limit: Option<Duration>,
    told: Arc<Told>,
    /// Speaks where the job is silent.
    reminder: Option<JoinHandle<()>>,
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
        let begin = Instant::now();
        let told = Arc::new(Told { begin, bar, last: Mutex::new(Last::new(begin)), ends: Condvar::new() });
        let reminder = {
            let told = told.clone();
            // Without a thread for it there are no reminders.
            std::thread::Builder::new().name("progress".into()).spawn(move || told.remind()).ok()
        };
        Terminal { folder: folder.map(Path::to_path_buf), begin, limit, told, reminder }
    }

    /// Removes the bar.
    pub(super) fn clear(&self) {
        if let Some(bar) = &self.told.bar {
            bar.finish_and_clear();
        }
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.told.last().is_over = true;
        self.told.ends.notify_all();
        if let Some(reminder) = self.reminder.take() {
            // What panicked there has said so itself.
            let _ = reminder.join();
        }
    }
}

/// What was told of the progress.
struct Told {
    begin: Instant,
    bar: Option<ProgressBar>,
    last: Mutex<Last>,
    /// Wakes the reminder at the end.
    ends: Condvar,
}

/// The last progress.
struct Last {
    progress: Progress,
    /// When its stage began, and how much of it was done then.
    since: Instant,
    done_before: u64,
    /// Tenth of the stage last written.
    tenth: u64,
    written: Instant,
    is_over: bool,
}

impl Last {
    fn new(begin: Instant) -> Last {
        let progress = Progress::default();
        Last { progress, since: begin, done_before: 0, tenth: 0, written: begin, is_over: false }
    }

    /// Takes progress; whether it is worth a line: a new stage, or another tenth of it.
    fn take(&mut self, p: &Progress, now: Instant) -> bool {
        let tenth = (10 * p.done).checked_div(p.total).unwrap_or(0);
        let is_other_stage = self.progress.stage != p.stage;
        if is_other_stage {
            (self.since, self.done_before) = (now, p.done);
        }
        let is_new = is_other_stage || self.tenth < tenth;
        if is_new {
            (self.tenth, self.written) = (tenth, now);
        }
        self.progress = p.clone();
        is_new
    }

    /// The line of the last progress; `is_again` where it was written before.
    fn line(&self, is_again: bool, now: Instant) -> String {
        let Progress { stage, done, total, .. } = &self.progress;
        let best = best_gain(&self.progress);
        let elapsed = now.duration_since(self.since);
        if *total > 1 {
            let computed = done.saturating_sub(self.done_before) as usize;
            let left = time_left(computed, total.saturating_sub(*done) as usize, elapsed);
            let left = left.map_or(String::new(), |left| format!(", about {} left", words(left)));
            format!("{stage}: {done} of {total}{best}{left}")
        } else if is_again {
            format!("{stage}{best}: {} so far", words(elapsed))
        } else {
            format!("{stage}{best}")
        }
    }
}

impl Told {
    fn last(&self) -> MutexGuard<'_, Last> {
        self.last.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn write_line(&self, text: &str) {
        let line = format!("{:7.1} s  {text}", self.begin.elapsed().as_secs_f64());
        match &self.bar {
            Some(bar) => bar.suspend(|| eprintln!("{line}")),
            None => eprintln!("{line}"),
        }
    }

    /// Whether the bar shows this progress.
    fn shows_bar(&self, p: &Progress) -> bool {
        self.bar.is_some() && p.total > 1
    }

    /// Writes the last line again after a long silence, until the end.
    fn remind(&self) {
        let mut last = self.last();
        while !last.is_over {
            let silence = last.written.elapsed();
            if silence >= LONGEST_SILENCE {
                let now = Instant::now();
                last.written = now;
                if !last.progress.stage.is_empty() && !self.shows_bar(&last.progress) {
                    self.write_line(&last.line(true, now));
                }
            } else {
                let waited = self.ends.wait_timeout(last, LONGEST_SILENCE - silence);
                last = waited.unwrap_or_else(PoisonError::into_inner).0;
            }
        }
    }
}

/// The best gain so far in words, with a space before them; nothing where there is none.
fn best_gain(p: &Progress) -> String {
    p.best.map_or(String::new(), |gain| format!(" best gain {gain:.3}"))
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
        let told = &self.told;
        let now = Instant::now();
        let mut last = told.last();
        let is_new = last.take(p, now);
        if let Some(bar) = told.bar.as_ref().filter(|_| told.shows_bar(p)) {
            bar.set_draw_target(indicatif::ProgressDrawTarget::stderr());
            bar.set_length(p.total);
            bar.set_position(p.done);
            bar.set_message(format!("{}{}", p.stage, best_gain(p)));
        } else if is_new {
            told.write_line(&last.line(false, now));
        }
    }

    fn is_cancelled(&self) -> bool {
        interrupt::is_requested() || self.limit.is_some_and(|limit| self.begin.elapsed() >= limit)
    }

    fn checkpoint(&self, name: &str) -> Option<PathBuf> {
        self.folder.as_ref().map(|folder| folder.join(name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines come with a stage and with each tenth of it, and tell the time left by what this run has done.
    #[test]
    fn a_line_for_every_stage_and_tenth() {
        let begin = Instant::now();
        let at = |s: u64| begin + Duration::from_secs(s);
        let mut last = Last::new(begin);
        assert!(last.take(&Progress::stage("fitting"), at(2)));
        assert_eq!((last.line(false, at(2)), last.line(true, at(9))), ("fitting".into(), "fitting: 7 s so far".into()));
        // Ten of forty were there before.
        assert!(last.take(&Progress::new("explore", 10, 40), at(10)));
        assert_eq!(last.line(false, at(10)), "explore: 10 of 40");
        assert!(!last.take(&Progress::new("explore", 11, 40), at(11)));
        assert!(last.take(&Progress::new("explore", 20, 40), at(20)));
        assert_eq!(last.line(false, at(20)), "explore: 20 of 40, about 20 s left");
        assert!(last.take(&Progress { best: Some(1.25), ..Progress::new("explore", 40, 40) }, at(40)));
        assert_eq!(last.line(false, at(40)), "explore: 40 of 40 best gain 1.250");
    }
}
