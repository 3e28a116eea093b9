//! Progress on stderr: a bar with the best gain so far on a terminal, a line per tenth elsewhere.

use crate::design::Progress;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Mutex;

/// Shows the stages of a search.
pub(super) struct Bar {
    bar: Option<ProgressBar>,
    /// Stage and tenth last written.
    last: Mutex<(&'static str, usize)>,
}

impl Bar {
    /// Hidden until something is shown.
    pub fn new() -> Bar {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(1);
            // The template is a constant; should it be wrong, the default one serves.
            if let Ok(style) =
                ProgressStyle::with_template("{prefix:>8} {bar:32} {pos}/{len} {elapsed} left {eta} {msg}")
            {
                bar.set_style(style);
            }
            bar
        });
        Bar { bar, last: Mutex::new(("", 0)) }
    }

    /// Shows one report.
    pub fn show(&self, p: &Progress) {
        let best = p.best.map_or(String::new(), |b| format!("best gain {b:.3}"));
        if let Some(bar) = &self.bar {
            if bar.prefix() != p.stage {
                bar.reset();
                bar.set_prefix(p.stage);
            }
            bar.set_length(p.total as u64);
            bar.set_position(p.done as u64);
            bar.set_message(best);
            return;
        }
        let tenth = 10 * p.done / p.total.max(1);
        if let Ok(mut last) = self.last.lock()
            && (last.0 != p.stage || last.1 < tenth)
        {
            *last = (p.stage, tenth);
            eprintln!("{}: {} of {} {best}", p.stage, p.done, p.total);
        }
    }

    /// Removes the bar.
    pub fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
