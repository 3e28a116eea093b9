//! The loading history: `time_s,drive_mm,force_n`.

use super::RecordingError;
use std::path::Path;

/// A drive is held while it stays within this part of it,
const HOLD_PART: f64 = 0.005;
/// and within this at least, mm.
const HOLD_LEAST_MM: f64 = 0.002;

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

    /// The force (N) where the drive first passes `drive_mm`, in proportion between the readings beside it; none where
    /// it never does.
    pub fn first_force_n(&self, drive_mm: f64) -> Option<f64> {
        let place =
            self.drive_mm.windows(2).position(|d| (d[0] - drive_mm) * (d[1] - drive_mm) <= 0.0 && d[0] != d[1])?;
        let (from, to) = (self.drive_mm[place], self.drive_mm[place + 1]);
        let part = (drive_mm - from) / (to - from);
        Some(self.force_n[place] + part * (self.force_n[place + 1] - self.force_n[place]))
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

    /// The force at a drive, N: the mean over the window, where there is one with a reading; else over the longest time
    /// for which the drive was held; else, where the drive passes by, the line between the two readings about it at its
    /// first passing. None where the drive is never reached.
    pub fn force_at_n(&self, drive_mm: f64, window_s: Option<[f64; 2]>) -> Option<f64> {
        let in_window = window_s.and_then(|window| self.mean_force_n(window));
        let held = || self.longest_hold_s(drive_mm).and_then(|hold| self.mean_force_n(hold));
        let passed = || {
            let readings = || self.drive_mm.iter().zip(&self.force_n);
            let mut pairs = readings().zip(readings().skip(1));
            pairs.find_map(|((d0, f0), (d1, f1))| {
                let part = (drive_mm - d0) / (d1 - d0);
                (0.0..=1.0).contains(&part).then(|| f0 + part * (f1 - f0))
            })
        };
        in_window.or_else(held).or_else(passed)
    }

    /// The longest time for which the drive stayed at `drive_mm`, s: start and end.
    fn longest_hold_s(&self, drive_mm: f64) -> Option<[f64; 2]> {
        let tolerance_mm = (HOLD_PART * drive_mm.abs()).max(HOLD_LEAST_MM);
        let (mut longest, mut current): (Option<[f64; 2]>, Option<[f64; 2]>) = (None, None);
        for (&time, &drive) in self.time_s.iter().zip(&self.drive_mm) {
            current = ((drive - drive_mm).abs() <= tolerance_mm).then(|| [current.map_or(time, |c| c[0]), time]);
            if let Some([start, end]) = current
                && end > start
                && longest.is_none_or(|[from, to]| end - start > to - from)
            {
                longest = current;
            }
        }
        longest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(readings: &[[f64; 3]]) -> LoadCurve {
        LoadCurve {
            time_s: readings.iter().map(|r| r[0]).collect(),
            drive_mm: readings.iter().map(|r| r[1]).collect(),
            force_n: readings.iter().map(|r| r[2]).collect(),
        }
    }

    /// A ramp, a short and a long hold at one drive, a ramp.
    #[test]
    fn the_force_of_a_drive_is_that_of_its_window_its_hold_or_its_passing() {
        let c = curve(&[
            [0.0, 0.0, 0.0],
            [1.0, 2.0, 9.0],
            [2.0, 2.0, 9.0],
            [3.0, 0.0, 0.0],
            [4.0, 2.0, 6.0],
            [5.0, 2.002, 5.0],
            [6.0, 1.998, 4.0],
            [7.0, 4.0, 8.0],
        ]);
        assert_eq!(c.force_at_n(2.0, None), Some(5.0));
        assert_eq!(c.force_at_n(2.0, Some([5.5, 6.5])), Some(4.0));
        // A window without a reading says nothing.
        assert_eq!(c.force_at_n(2.0, Some([20.0, 30.0])), Some(5.0));
        assert_eq!(c.force_at_n(1.0, None), Some(4.5));
        assert_eq!(c.force_at_n(4.0, None), Some(8.0));
        assert_eq!(c.force_at_n(4.1, None), None);
    }
}
