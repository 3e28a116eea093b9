//! What one design does with one material: the figures that designs are judged by, as logarithms but for a force that
//! may have either sign.

use super::aim::Normalisation;
use crate::sensitivity::{Covariance, Criterion, IntegratedSensitivity};
use serde::{Deserialize, Serialize};

/// Volume fraction above whose principal stretch a design is judged for tearing: the singular bonded edges, where the
/// stretch of a finite mesh means nothing, fill less.
pub const TEARING_FRACTION: f64 = 0.002;

/// What a design does with one material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// ln 𝒮 of every μᵢ and αᵢ, in the study's normalisation.
    pub log_integrated: Vec<f64>,
    /// ln of the relative standard deviation of every μᵢ and αᵢ (+∞ replaced by a large number where undetermined).
    pub log_relative_sd: Vec<f64>,
    /// ln of the D-, A-, E- and worst-parameter figures, each as a relative standard deviation.
    pub log_criteria: [f64; 4],
    /// ln of the distance of this material's scan from the closest fit of an earlier material to it, in noise standard
    /// deviations; 0 for the first material, and where the study does not ask to tell materials apart.
    #[serde(default)]
    pub log_separation: f64,
    /// ln of the sizes of errors that a diagnosis would name, in the order of what the study counts; `None` for what
    /// the design does not have. Empty where the study does not ask for them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub log_detectable: Vec<Option<f64>>,
    /// ln of the force in N.
    pub log_force: f64,
    /// Force across the plates, N; 0 of a test without plates. It may be none or have either sign: no logarithm.
    #[serde(default)]
    pub normal_force_n: f64,
    /// ln of the principal stretch exceeded in [`TEARING_FRACTION`] of the volume.
    pub log_stretch: f64,
}

/// ln of a relative standard deviation that stands for "not determined".
const UNDETERMINED: f64 = 12.0;

/// ln of a relative standard deviation, a large number where it is not determined.
pub(super) fn log_or_undetermined(value: Option<f64>) -> f64 {
    match value {
        Some(v) if v > 0.0 && v.ln() < UNDETERMINED => v.ln(),
        _ => UNDETERMINED,
    }
}

/// 𝒮 in the normalisation asked for.
pub(super) fn normalised(sensitivity: &IntegratedSensitivity, normalisation: Normalisation) -> f64 {
    match normalisation {
        Normalisation::Sum => sensitivity.sum,
        Normalisation::MeanPerVoxel => sensitivity.mean_per_voxel,
        Normalisation::VolumeIntegral => sensitivity.volume_integral,
    }
}

impl Response {
    /// All numbers in one list, in a fixed order: 𝒮 and the relative standard deviation of every μᵢ and αᵢ, then the
    /// four criteria, the separation, the force, that across the plates and the stretch, and the sizes of errors (NaN
    /// for `None`).
    pub fn to_vector(&self) -> Vec<f64> {
        let mut v = self.log_integrated.clone();
        v.extend(&self.log_relative_sd);
        v.extend(self.log_criteria);
        v.extend([self.log_separation, self.log_force, self.normal_force_n, self.log_stretch]);
        v.extend(self.log_detectable.iter().map(|size| size.unwrap_or(f64::NAN)));
        v
    }

    /// The inverse of [`Self::to_vector`] for a material with so many μᵢ and αᵢ.
    pub fn from_vector(v: &[f64], num_parameters: usize) -> Response {
        let (log_integrated, rest) = v.split_at(num_parameters);
        let (log_relative_sd, rest) = rest.split_at(num_parameters);
        Response {
            log_integrated: log_integrated.to_vec(),
            log_relative_sd: log_relative_sd.to_vec(),
            log_criteria: [rest[0], rest[1], rest[2], rest[3]],
            log_separation: rest[4],
            log_detectable: rest[8..].iter().map(|size| size.is_finite().then_some(*size)).collect(),
            log_force: rest[5],
            normal_force_n: rest[6],
            log_stretch: rest[7],
        }
    }
}

/// The relative figures of a covariance: D, A, E, worst, as relative standard deviations.
pub fn criteria_as_relative_sd(covariance: &Covariance, shear: &[usize]) -> [Option<f64>; 4] {
    let n = shear.len().max(1) as f64;
    [
        covariance.criterion(Criterion::LogDeterminant, shear).map(|d| (d / (2.0 * n)).exp()),
        covariance.criterion(Criterion::Trace, shear).map(f64::sqrt),
        covariance.criterion(Criterion::LargestEigenvalue, shear).map(f64::sqrt),
        covariance.criterion(Criterion::WorstRelativeSd, shear),
    ]
}

/// The stretch exceeded in [`TEARING_FRACTION`] of the volume, from (stretch, volume) pairs; 1 without any.
pub fn tearing_stretch(values: impl Iterator<Item = (f64, f64)>) -> f64 {
    let mut sorted: Vec<(f64, f64)> = values.collect();
    sorted.sort_by(|a, b| b.0.total_cmp(&a.0));
    let allowed = TEARING_FRACTION * sorted.iter().map(|s| s.1).sum::<f64>();
    let mut sum = 0.0;
    sorted
        .into_iter()
        .find_map(|(stretch, volume)| {
            sum += volume;
            (sum >= allowed).then_some(stretch)
        })
        .unwrap_or(1.0)
}
