//! The loading history: `time_s,drive_mm,force_n`.

use super::RecordingError;
use std::path::Path;

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
            return Err(fail(1, format!("the header is '{header}'; it must be time_s,drive_mm,force_n")));
        }
        let mut curve = LoadCurve::default();
        for (n, line) in lines {
            if line.trim().is_empty() {
                continue;
            }
            let numbers: Vec<Option<f64>> = line.split(',').map(|s| s.trim().parse().ok()).collect();
            let [Some(time), Some(drive), Some(force)] = numbers[..] else {
                return Err(fail(n + 1, format!("'{line}' is not three numbers")));
            };
            if ![time, drive, force].iter().all(|x: &f64| x.is_finite()) {
                return Err(fail(n + 1, format!("'{line}' has a number that is not finite")));
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
