//! Progress over many tasks on stderr, with the time left: a bar on a terminal, a line per twentieth elsewhere.

use super::time_left::{time_left, words};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::Instant;

/// Shows how many tasks are done.
pub(super) struct TaskBar {
    bar: Option<ProgressBar>,
    start: Instant,
    /// Twentieth last written.
    last: Mutex<Option<usize>>,
}

impl TaskBar {
    /// Starts the clock.
    pub fn new() -> TaskBar {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(1);
            // The template is a constant; should it be wrong, the default one serves.
            if let Ok(style) = ProgressStyle::with_template("{bar:32} {pos}/{len} {elapsed} {msg}") {
                bar.set_style(style);
            }
            bar
        });
        TaskBar { bar, start: Instant::now(), last: Mutex::new(None) }
    }

    /// Shows `done` of `total`, of which `resumed` were there before this run.
    pub fn show(&self, done: usize, resumed: usize, failed: usize, total: usize) {
        let elapsed = self.start.elapsed();
        let mut message = match time_left(done.saturating_sub(resumed), total.saturating_sub(done), elapsed) {
            Some(left) => format!("about {} left", words(left)),
            None => String::new(),
        };
        if failed > 0 {
            message += &format!(", {failed} failed");
        }
        if let Some(bar) = &self.bar {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
            bar.set_message(message);
            return;
        }
        let twentieth = 20 * done / total.max(1);
        if let Ok(mut last) = self.last.lock()
            && last.is_none_or(|l| l < twentieth)
        {
            if last.is_none() && resumed > 0 {
                eprintln!("resuming: {resumed} of {total} results are there");
            }
            *last = Some(twentieth);
            eprintln!(
                "{done} of {total} done, {} elapsed{}{message}",
                words(elapsed),
                if message.is_empty() { "" } else { ", " }
            );
        }
    }

    /// Removes the bar.
    pub fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
