//! A measured curve of a homogeneous test.

use super::deformation::{Deformation, HomogeneousTest};

/// Largest principal stretch ratio (or shear) that is taken for data of soft matter; beyond it a column or unit is
/// wrong.
const LARGEST_STRETCH: f64 = 50.0;

/// Nominal stresses over homogeneous states.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Name in results.
    pub name: String,
    /// The states, in the order of the recording.
    pub states: Vec<Deformation>,
    /// Nominal stress along the axis of each state, kPa.
    pub nominal_stress_kpa: Vec<f64>,
    /// Standard deviation of a stress, kPa, where known. Without it the scatter is taken in proportion to the curve's
    /// root-mean-square stress, and its factor is estimated from the fit.
    pub noise_sd_kpa: Option<f64>,
}

/// Why a curve is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CurveError {
    /// No curve, or one without points.
    #[error("curve {name:?} has {count} points; {needed} are needed")]
    TooShort {
        /// The curve.
        name: String,
        /// Its points.
        count: usize,
        /// Least number.
        needed: usize,
    },
    /// Lists of different lengths.
    #[error("curve {name:?}: {found} values of {what} for {expected} points")]
    Length {
        /// The curve.
        name: String,
        /// Which list.
        what: &'static str,
        /// Its length.
        found: usize,
        /// Needed.
        expected: usize,
    },
    /// A state or stress that cannot be.
    #[error("curve {name:?}, point {index}: {what} is {value}; {requirement}")]
    Value {
        /// The curve.
        name: String,
        /// Index of the point.
        index: usize,
        /// Which number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What is needed.
        requirement: &'static str,
    },
}

impl Curve {
    /// A curve of one test: drives (stretch or shear) and nominal stresses (kPa).
    ///
    /// # Errors
    /// [`CurveError`].
    pub fn new(
        name: &str,
        test: HomogeneousTest,
        drive: &[f64],
        nominal_stress_kpa: &[f64],
    ) -> Result<Curve, CurveError> {
        let states = drive.iter().map(|&d| test.at(d)).collect();
        let curve =
            Curve { name: name.into(), states, nominal_stress_kpa: nominal_stress_kpa.to_vec(), noise_sd_kpa: None };
        curve.validate()?;
        Ok(curve)
    }

    /// Checks lengths and ranges.
    ///
    /// # Errors
    /// [`CurveError`].
    pub fn validate(&self) -> Result<(), CurveError> {
        let (n, name) = (self.states.len(), || self.name.clone());
        if n < 2 {
            return Err(CurveError::TooShort { name: name(), count: n, needed: 2 });
        }
        if self.nominal_stress_kpa.len() != n {
            let found = self.nominal_stress_kpa.len();
            return Err(CurveError::Length { name: name(), what: "stress", found, expected: n });
        }
        for (index, (state, &stress)) in self.states.iter().zip(&self.nominal_stress_kpa).enumerate() {
            if !stress.is_finite() {
                let requirement = "leave out points without a stress";
                return Err(CurveError::Value { name: name(), index, what: "stress", value: stress, requirement });
            }
            let (numbers, requirement) = match *state {
                Deformation::Uniaxial { stretch } => ([stretch; 2], "a stretch lies between 0.02 and 50"),
                Deformation::Biaxial { stretches } => (stretches, "a stretch lies between 0.02 and 50"),
                // λ − 1/λ = γ: the same range of stretches.
                Deformation::SimpleShear { shear } => {
                    ([(0.5 * shear).asinh().exp(); 2], "an amount of shear lies between -50 and 50")
                }
            };
            for value in numbers {
                if !(1.0 / LARGEST_STRETCH..=LARGEST_STRETCH).contains(&value) {
                    return Err(CurveError::Value { name: name(), index, what: "stretch", value, requirement });
                }
            }
        }
        Ok(())
    }

    /// Root mean square of the stresses, kPa; never zero.
    pub fn scale_kpa(&self) -> f64 {
        let mean = self.nominal_stress_kpa.iter().map(|s| s * s).sum::<f64>() / self.nominal_stress_kpa.len() as f64;
        mean.sqrt().max(1e-300)
    }

    /// What a residual is divided by: the noise where known, else the scale.
    pub fn weight_kpa(&self) -> f64 {
        self.noise_sd_kpa.unwrap_or_else(|| self.scale_kpa())
    }
}

/// How well a model meets a curve.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CurveMatch {
    /// The curve's name.
    pub name: String,
    /// Points compared.
    pub num_points: usize,
    /// 1 − Σ(data − model)² / Σ(data − mean)².
    pub r_squared: f64,
    /// Root mean square of data − model, kPa.
    pub rms_error_kpa: f64,
    /// The same relative to the root mean square of the data.
    pub relative_rms_error: f64,
    /// Largest |data − model|, kPa.
    pub largest_error_kpa: f64,
}

impl CurveMatch {
    /// Compares `model` (kPa) with the curve.
    pub fn of(curve: &Curve, model: &[f64]) -> CurveMatch {
        CurveMatch::of_values(&curve.name, &curve.nominal_stress_kpa, model)
    }

    /// Compares two lists of stresses (kPa).
    pub fn of_values(name: &str, data: &[f64], model: &[f64]) -> CurveMatch {
        let n = data.len().max(1) as f64;
        let mean = data.iter().sum::<f64>() / n;
        let left: f64 = data.iter().zip(model).map(|(d, m)| (d - m).powi(2)).sum();
        let spread: f64 = data.iter().map(|d| (d - mean).powi(2)).sum();
        let square: f64 = data.iter().map(|d| d * d).sum();
        CurveMatch {
            name: name.into(),
            num_points: data.len(),
            r_squared: 1.0 - left / spread.max(1e-300),
            rms_error_kpa: (left / n).sqrt(),
            relative_rms_error: (left / square.max(1e-300)).sqrt(),
            largest_error_kpa: data.iter().zip(model).map(|(d, m)| (d - m).abs()).fold(0.0, f64::max),
        }
    }
}
