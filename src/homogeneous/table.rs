//! A force over drive given by a table, interpolated without overshoot.

/// Why a table is refused, or has no value.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// Lists of different lengths, or fewer than two points.
    #[error("{drives} drives and {forces} forces; give one force per drive and at least two")]
    Length {
        /// Drives.
        drives: usize,
        /// Forces.
        forces: usize,
    },
    /// Drives do not rise, or a number is not finite.
    #[error("entry {index} of the table ({drive}, {force}) is not finite, or its drive not above the one before")]
    Entry {
        /// Index.
        index: usize,
        /// Drive.
        drive: f64,
        /// Force.
        force: f64,
    },
    /// A drive beyond the table.
    #[error("drive {drive} is outside the table ({low} to {high}); make the table longer")]
    Outside {
        /// What was asked for.
        drive: f64,
        /// Smallest drive.
        low: f64,
        /// Largest drive.
        high: f64,
    },
}

/// Monotone cubic interpolation (Fritsch and Butland 1984): C¹, no extremum that the table does not have.
#[derive(Clone, Debug, PartialEq)]
pub struct ForceTable {
    drive: Vec<f64>,
    force: Vec<f64>,
    slope: Vec<f64>,
}

/// What a drive may exceed the table by (part of its length): rounding and the last digit of a recorded drive.
const OVERRUN: f64 = 0.01;

impl ForceTable {
    /// A table of forces (N) over rising drives (mm); any other pair of units serves as well.
    ///
    /// # Errors
    /// [`TableError`].
    pub fn new(drive: &[f64], force: &[f64]) -> Result<ForceTable, TableError> {
        if drive.len() != force.len() || drive.len() < 2 {
            return Err(TableError::Length { drives: drive.len(), forces: force.len() });
        }
        for index in 0..drive.len() {
            let is_rising = index == 0 || drive[index] > drive[index - 1];
            if !(drive[index].is_finite() && force[index].is_finite() && is_rising) {
                return Err(TableError::Entry { index, drive: drive[index], force: force[index] });
            }
        }
        let n = drive.len();
        let step: Vec<f64> = (1..n).map(|i| drive[i] - drive[i - 1]).collect();
        let secant: Vec<f64> = (1..n).map(|i| (force[i] - force[i - 1]) / step[i - 1]).collect();
        let mut slope = vec![0.0; n];
        for i in 1..n - 1 {
            let (a, b) = (secant[i - 1], secant[i]);
            if a * b > 0.0 {
                let (u, v) = (2.0 * step[i] + step[i - 1], step[i] + 2.0 * step[i - 1]);
                slope[i] = (u + v) / (u / a + v / b);
            }
        }
        // Ends: three-point formula, kept within the monotone region.
        let end = |h0: f64, h1: f64, s0: f64, s1: f64| {
            let raw = ((2.0 * h0 + h1) * s0 - h0 * s1) / (h0 + h1);
            if raw * s0 <= 0.0 {
                0.0
            } else if s0 * s1 <= 0.0 && raw.abs() > 3.0 * s0.abs() {
                3.0 * s0
            } else {
                raw
            }
        };
        if n == 2 {
            slope = vec![secant[0]; 2];
        } else {
            slope[0] = end(step[0], step[1], secant[0], secant[1]);
            slope[n - 1] = end(step[n - 2], step[n - 3], secant[n - 2], secant[n - 3]);
        }
        Ok(ForceTable { drive: drive.to_vec(), force: force.to_vec(), slope })
    }

    /// A table for drives of both signs from one for drives ≥ 0: F(−d) = −F(d), F(0) = 0. That is what a shear specimen
    /// does that is its own image under a half-turn about the width.
    ///
    /// # Errors
    /// [`TableError`].
    pub fn odd(drive: &[f64], force: &[f64]) -> Result<ForceTable, TableError> {
        if drive.len() != force.len() || drive.is_empty() {
            return Err(TableError::Length { drives: drive.len(), forces: force.len() });
        }
        let positive: Vec<usize> = (0..drive.len()).filter(|&i| !(drive[i] <= 0.0)).collect();
        let both = |values: &[f64]| {
            let mirrored = positive.iter().rev().map(|&i| -values[i]);
            mirrored.chain([0.0]).chain(positive.iter().map(|&i| values[i])).collect::<Vec<f64>>()
        };
        ForceTable::new(&both(drive), &both(force))
    }

    /// Smallest and largest drive.
    pub fn range(&self) -> [f64; 2] {
        [self.drive[0], self.drive[self.drive.len() - 1]]
    }

    /// Force and its slope at a drive.
    ///
    /// # Errors
    /// [`TableError::Outside`] for a drive more than 1 % of the table's length beyond it; up to there the end's slope
    /// goes on.
    pub fn at(&self, drive: f64) -> Result<(f64, f64), TableError> {
        let [low, high] = self.range();
        let margin = OVERRUN * (high - low);
        if !(drive >= low - margin && drive <= high + margin) {
            return Err(TableError::Outside { drive, low, high });
        }
        let last = self.drive.len() - 1;
        if drive <= low {
            return Ok((self.force[0] + self.slope[0] * (drive - low), self.slope[0]));
        }
        if drive >= high {
            return Ok((self.force[last] + self.slope[last] * (drive - high), self.slope[last]));
        }
        let i = self.drive.partition_point(|d| *d <= drive).clamp(1, last) - 1;
        let h = self.drive[i + 1] - self.drive[i];
        let t = (drive - self.drive[i]) / h;
        let (f0, f1, m0, m1) = (self.force[i], self.force[i + 1], h * self.slope[i], h * self.slope[i + 1]);
        let (a, b) = (2.0 * (f0 - f1) + m0 + m1, 3.0 * (f1 - f0) - 2.0 * m0 - m1);
        Ok((f0 + t * (m0 + t * (b + t * a)), (m0 + t * (2.0 * b + 3.0 * t * a)) / h))
    }

    /// Forces at many drives.
    ///
    /// # Errors
    /// [`TableError::Outside`].
    pub fn forces(&self, drives: &[f64]) -> Result<Vec<f64>, TableError> {
        drives.iter().map(|&d| self.at(d).map(|(f, _)| f)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Through its points, monotone between them, slope = derivative, straight lines exact.
    #[test]
    fn interpolates_without_overshoot() {
        let (drive, force) = ([0.0, 1.0, 2.0, 4.0, 7.0], [0.0, 1.0, 1.1, 5.0, 5.0]);
        let table = ForceTable::new(&drive, &force).unwrap();
        let mut before = -1e-12;
        for i in 0..=700 {
            let d = 0.01 * f64::from(i);
            let (f, slope) = table.at(d).unwrap();
            assert!(f >= before - 1e-12, "{d}");
            before = f;
            if i > 0 && i < 700 {
                let h = 1e-6;
                let difference = (table.at(d + h).unwrap().0 - table.at(d - h).unwrap().0) / (2.0 * h);
                // One-sided curvatures at the nodes: h times a jump of at most 10.
                assert!((difference - slope).abs() < 1e-5, "{d}: {difference} {slope}");
            }
        }
        for (d, f) in drive.iter().zip(force) {
            assert!((table.at(*d).unwrap().0 - f).abs() < 1e-12);
        }
        let line = ForceTable::odd(&[1.0, 3.0], &[2.0, 6.0]).unwrap();
        assert!((line.at(-2.3).unwrap().0 + 4.6).abs() < 1e-12);
        assert!(matches!(line.at(3.5), Err(TableError::Outside { .. })));
    }

    #[test]
    fn bad_tables_are_refused() {
        assert!(matches!(ForceTable::new(&[0.0], &[0.0]), Err(TableError::Length { .. })));
        assert!(matches!(ForceTable::new(&[0.0, 0.0], &[0.0, 1.0]), Err(TableError::Entry { index: 1, .. })));
        assert!(matches!(ForceTable::odd(&[f64::NAN, 1.0], &[0.0, 1.0]), Err(TableError::Entry { .. })));
    }
}
