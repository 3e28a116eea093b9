//! The loading history: `time_s,drive_mm,force_n`.

use super::RecordingError;
use std::path::Path;

/// The beginning of a text, for a message.
pub(super) fn shortened(text: &str) -> String {
    text.chars().take(60).collect()
}

/// Drive and force over time; times do not decrease.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadCurve {
    /// Times, s.
    pub time_s: Vec<f64>,
    /// What the actuator was told, mm.
    pub drive_mm: Vec<f64>,
    /// The load cell's reading, all samples together, N.
    pub force_n: Vec<f64>,
}

impl LoadCurve {
    /// Reads CSV text with the header `time_s,drive_mm,force_n`; `path` is for messages.
    ///
    /// # Errors
    /// [`RecordingError::LoadCurve`].
    pub fn from_csv(text: &str, path: &Path) -> Result<LoadCurve, RecordingError> {
        let fail = |line: usize, message: String| RecordingError::LoadCurve { path: path.into(), line, message };
        let mut lines = text.lines().enumerate();
        let header = lines.next().map(|(_, l)| l.trim().trim_start_matches('\u{feff}').to_string()).unwrap_or_default();
        if header.split(',').map(str::trim).ne(["time_s", "drive_mm", "force_n"]) {
            return Err(fail(1, format!("the header is '{}'; it must be time_s,drive_mm,force_n", shortened(&header))));
        }
        let mut curve = LoadCurve::default();
        for (n, line) in lines {
            if line.trim().is_empty() {
                continue;
            }
            // One more than needed, so that a fourth is seen; a line of a million commas makes no list of a million.
            let mut numbers = [None; 4];
            for (number, text) in numbers.iter_mut().zip(line.split(',')) {
                *number = Some(text.trim().parse().ok());
            }
            let [Some(Some(time)), Some(Some(drive)), Some(Some(force)), None] = numbers else {
                return Err(fail(n + 1, format!("'{}' is not three numbers", shortened(line))));
            };
            if ![time, drive, force].iter().all(|x: &f64| x.is_finite()) {
                return Err(fail(n + 1, format!("'{}' has a number that is not finite", shortened(line))));
            }
            if curve.time_s.last().is_some_and(|last| time < *last) {
                return Err(fail(n + 1, format!("time {time} s comes before the line above it")));
            }
            curve.time_s.push(time);
            curve.drive_mm.push(drive);
            curve.force_n.push(force);
        }
        if curve.time_s.is_empty() {
            return Err(fail(1, "there is no reading".into()));
        }
        Ok(curve)
    }

    /// The same as CSV text.
    pub fn to_csv(&self) -> String {
        let mut text = String::from("time_s,drive_mm,force_n\n");
        for ((t, d), f) in self.time_s.iter().zip(&self.drive_mm).zip(&self.force_n) {
            text += &format!("{t},{d:.4},{f:.4}\n");
        }
        text
    }

    /// Mean force over a window, N; none where no reading lies in it.
    pub fn mean_force_n(&self, [start, end]: [f64; 2]) -> Option<f64> {
        let inside: Vec<f64> = self
            .time_s
            .iter()
            .zip(&self.force_n)
            .filter(|(t, _)| **t >= start && **t <= end)
            .map(|(_, f)| *f)
            .collect();
        (!inside.is_empty()).then(|| inside.iter().sum::<f64>() / inside.len() as f64)
    }
}
