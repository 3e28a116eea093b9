//! A measured load curve: stress over stretch (or shear) and time, in the order of the recording.

use super::prony::{HistoryError, check_times};
use crate::homogeneous::{Curve, CurveError, HomogeneousTest};

/// One recorded test on a specimen that was at rest, and never loaded, before it.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadCurve {
    /// Name in results.
    pub name: String,
    /// The test.
    pub test: HomogeneousTest,
    /// Times, s; empty where they were not recorded (then rates say nothing).
    pub time_s: Vec<f64>,
    /// Stretch (or amount of shear).
    pub drive: Vec<f64>,
    /// Nominal stress, kPa.
    pub nominal_stress_kpa: Vec<f64>,
    /// Samples from this index on are kept back: predicted, not fitted. 0 keeps back the whole curve, the number of
    /// samples none.
    pub num_fitted: usize,
    /// Shape factor of a cylinder in compression, diameter / (4 height), where known.
    pub shape_factor: Option<f64>,
}

impl LoadCurve {
    /// A curve that is fitted as a whole.
    ///
    /// # Errors
    /// [`LoadCurveError`].
    pub fn new(
        name: &str,
        test: HomogeneousTest,
        time_s: &[f64],
        drive: &[f64],
        nominal_stress_kpa: &[f64],
    ) -> Result<LoadCurve, LoadCurveError> {
        let curve = LoadCurve {
            name: name.into(),
            test,
            time_s: time_s.to_vec(),
            drive: drive.to_vec(),
            nominal_stress_kpa: nominal_stress_kpa.to_vec(),
            num_fitted: drive.len(),
            shape_factor: None,
        };
        curve.validate()?;
        Ok(curve)
    }

    /// The same curve, kept back as a whole.
    pub fn kept_back(self) -> LoadCurve {
        LoadCurve { num_fitted: 0, ..self }
    }

    /// Checks lengths, times and ranges.
    ///
    /// # Errors
    /// [`LoadCurveError`].
    pub fn validate(&self) -> Result<(), LoadCurveError> {
        Curve::new(&self.name, self.test, &self.drive, &self.nominal_stress_kpa)?;
        if !self.time_s.is_empty() {
            check_times(&self.time_s, self.drive.len())
                .map_err(|source| LoadCurveError::Times { name: self.name.clone(), source })?;
        }
        if let Some(s) = self.shape_factor
            && !(s > 0.0 && s < 100.0)
        {
            return Err(LoadCurveError::ShapeFactor { name: self.name.clone(), value: s });
        }
        Ok(())
    }

    /// Number of samples that are fitted.
    pub(crate) fn fitted(&self) -> usize {
        self.num_fitted.min(self.drive.len())
    }

    /// The fitted part as a curve without time.
    pub(crate) fn elastic_part(&self) -> Option<Curve> {
        let n = self.fitted();
        Curve::new(&self.name, self.test, &self.drive[..n], &self.nominal_stress_kpa[..n]).ok()
    }

    /// Direction of the last motion at every sample: 1, −1, or 0 before the first motion. Motions below `resolution`
    /// are rest.
    pub(crate) fn directions(&self) -> Vec<f64> {
        let ends = self.drive.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(*v), b.max(*v)]);
        let resolution = 2e-3 * (ends[1] - ends[0]);
        let (mut anchor, mut direction) = (self.drive[0], 0.0);
        let mut found: Vec<f64> = Vec::with_capacity(self.drive.len());
        for (i, &d) in self.drive.iter().enumerate() {
            // The anchor follows the motion, so that a slow drift counts and jitter does not.
            if (d - anchor).abs() > resolution {
                let turned = (d - anchor).signum();
                if turned * direction <= 0.0 {
                    // The turn began where the anchor was.
                    for f in found.iter_mut().rev().take_while(|f| **f == 0.0) {
                        *f = turned;
                    }
                }
                direction = turned;
                anchor = d;
            } else if direction * (d - anchor) > 0.0 {
                anchor = d;
            }
            found.push(if i == 0 { 0.0 } else { direction });
        }
        found
    }
}

/// Why a load curve is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LoadCurveError {
    /// Its stresses or states.
    #[error(transparent)]
    Curve(#[from] CurveError),
    /// Its times.
    #[error("curve {name:?}: {source}")]
    Times {
        /// The curve.
        name: String,
        /// Why.
        source: HistoryError,
    },
    /// Its shape factor.
    #[error("curve {name:?}: shape factor {value}; give diameter / (4 height), above 0 and below 100")]
    ShapeFactor {
        /// The curve.
        name: String,
        /// The value.
        value: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Up, hold, down, with jitter a tenth of the resolution: the direction of the last real motion.
    #[test]
    fn directions_follow_the_motion() {
        let mut drive: Vec<f64> = (0..=50).map(|i| 1.0 + 0.01 * f64::from(i)).collect();
        drive.extend((0..20).map(|i| 1.5 + 1e-4 * f64::from(i % 2)));
        drive.extend((1..=50).map(|i| 1.5 - 0.01 * f64::from(i)));
        let stress = drive.clone();
        let curve = LoadCurve::new("a", HomogeneousTest::Uniaxial, &[], &drive, &stress).unwrap();
        let found = curve.directions();
        assert!(found[1..70].iter().all(|d| *d > 0.0) && found[72..].iter().all(|d| *d < 0.0), "{found:?}");
    }
}
