//! Progress over many tasks on stderr, with the time left: a bar on a terminal, a line per twentieth elsewhere.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

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

/// Time left at the mean speed of this run.
fn time_left(computed: usize, left: usize, elapsed: Duration) -> Option<Duration> {
    (computed > 0 && left > 0).then(|| elapsed.mul_f64(left as f64 / computed as f64))
}

fn words(time: Duration) -> String {
    let s = time.as_secs_f64().round() as u64;
    match (s / 3600, s / 60 % 60, s % 60) {
        (0, 0, s) => format!("{s} s"),
        (0, m, s) => format!("{m} min {s} s"),
        (h, m, _) => format!("{h} h {m} min"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_counts_this_run_alone() {
        assert_eq!(time_left(0, 5, Duration::from_secs(3)), None);
        assert_eq!(time_left(10, 5, Duration::from_secs(30)), Some(Duration::from_secs(15)));
        assert_eq!(words(Duration::from_secs(3725)), "1 h 2 min");
    }
}
