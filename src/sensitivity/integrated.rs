//! Integrated sensitivities 𝒮_ξ of one deformation field, per material parameter.

use super::pointwise::{PointwiseSensitivity, alpha_sensitivity, law_sensitivity, mu_sensitivity};
use crate::kinematics::Decomposition;
use crate::material::{Lanes, Material, Parameter, SECOND_EXPONENT};
use crate::voxel::VoxelMask;
use serde::{Deserialize, Serialize};

/// 𝒮_ξ in its three normalisations. Unit of S: 1 for μ, kPa for α. S_μ has the sign of α and S_α the sign of μ
/// everywhere, so nothing cancels in the sums. κ has no entry: its S is zero.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct IntegratedSensitivity {
    /// `mu_1`, `alpha_1`, …
    pub parameter: String,
    /// Σ over voxels of S (the paper's 𝒮). Grows as voxels shrink.
    pub sum: f64,
    /// Mean of S over voxels.
    pub mean_per_voxel: f64,
    /// ∫ S dV ≈ Σ S × material volume of the voxel, unit of S × mm³. Alone comparable across voxel sizes. Zero where a
    /// surface is seen, which has no volume.
    pub volume_integral: f64,
    /// ∫ S dA ≈ Σ S × material area of the subset over the face that cameras see, unit of S × mm²; absent for a scan of
    /// the volume.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface_integral: Option<f64>,
    /// What the mesh may put 𝒮 wrong by, relative to it: in 19 of 20 cases no more. Absent where no coarser mesh was
    /// solved.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub discretisation_relative: Option<f64>,
}

impl IntegratedSensitivity {
    /// Nothing, of the same parameter and kind of scan as `like`.
    pub(super) fn zero_like(like: &IntegratedSensitivity) -> IntegratedSensitivity {
        let surface_integral = like.surface_integral.map(|_| 0.0);
        let parameter = like.parameter.clone();
        IntegratedSensitivity {
            parameter,
            sum: 0.0,
            mean_per_voxel: 0.0,
            volume_integral: 0.0,
            surface_integral,
            discretisation_relative: None,
        }
    }

    /// Adds the sums and integrals of `count` blocks like `other`'s; means are left as they are.
    pub(super) fn add_blocks(&mut self, count: f64, other: &IntegratedSensitivity) {
        self.sum += count * other.sum;
        self.volume_integral += count * other.volume_integral;
        if let (Some(own), Some(theirs)) = (&mut self.surface_integral, other.surface_integral) {
            *own += count * theirs;
        }
    }
}

/// S_ξ with its derivatives at a point. Zero for κ, and by continuity where the mode is missing (λ = 1).
pub fn parameter_sensitivity(
    material: &Material,
    parameter: Parameter,
    stretch_amplitude: f64,
    deformation_mode: Option<f64>,
) -> PointwiseSensitivity {
    let Some(k) = deformation_mode else {
        return PointwiseSensitivity::default();
    };
    match parameter {
        Parameter::Kappa => PointwiseSensitivity::default(),
        Parameter::Mu(i) => mu_sensitivity(stretch_amplitude, k, material.terms[i].alpha),
        Parameter::Alpha(i) => {
            alpha_sensitivity(stretch_amplitude, k, material.terms[i].mu_kpa, material.terms[i].alpha)
        }
        Parameter::Law(own) => material.law.map_or_else(PointwiseSensitivity::default, |law| {
            let first = law_sensitivity(stretch_amplitude, k, &|x| law.slope_derivative(own, Lanes::splat(x)).0[0]);
            let second = law.second_mu_derivative(own) * mu_sensitivity(stretch_amplitude, k, SECOND_EXPONENT).value;
            PointwiseSensitivity { value: first.value + second, ..first }
        }),
    }
}

/// S_ξ per voxel, for maps.
pub fn sensitivity_map(material: &Material, parameter: Parameter, states: &[Decomposition]) -> Vec<f64> {
    states
        .iter()
        .map(|s| parameter_sensitivity(material, parameter, s.stretch_amplitude, s.deformation_mode).value)
        .collect()
}

/// 𝒮 of every μᵢ and αᵢ over the voxels of `mask`, whose states stand in the mask's order; each of them stands for
/// `voxels_each` voxels of the scan.
pub fn integrate_over_voxels(
    material: &Material,
    states: &[Decomposition],
    mask: &VoxelMask,
    voxels_each: f64,
) -> Vec<IntegratedSensitivity> {
    let (voxel_volume, subset_area) = (mask.grid.voxel_volume_mm3(), mask.grid.subset_area_mm2());
    material
        .shear_parameters()
        .map(|parameter| {
            let (mut sum, mut integral) = (0.0, 0.0);
            for (value, fraction) in sensitivity_map(material, parameter, states).iter().zip(&mask.material_fraction) {
                sum += value;
                integral += fraction * value;
            }
            IntegratedSensitivity {
                parameter: parameter.name(),
                sum: voxels_each * sum,
                mean_per_voxel: sum / states.len().max(1) as f64,
                volume_integral: integral * voxel_volume,
                surface_integral: subset_area.map(|area| integral * area),
                discretisation_relative: None,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::decompose;
    use crate::material::OgdenTerm;
    use crate::voxel::{Histogram2d, HistogramAxis, VoxelGrid};

    fn material() -> Material {
        Material {
            bulk_kpa: 2200.0,
            terms: vec![OgdenTerm { mu_kpa: 16.0, alpha: 1.9 }, OgdenTerm { mu_kpa: 0.35, alpha: 8.0 }],
            law: None,
        }
    }

    fn shear(gamma: f64) -> Decomposition {
        decompose(&[[1.0, gamma, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    }

    /// Homogeneous simple shear: S_μ = (λ^α − λ^−α)/λ, S_α = μ ln λ (λ^α + λ^−α)/λ, times voxels or volume.
    #[test]
    fn homogeneous_shear() {
        let grid = VoxelGrid::new([0.0; 3], [1.0, 0.2, 0.5], [4, 1, 1]).unwrap();
        let mask = VoxelMask { grid, voxels: vec![0, 1, 2, 3], material_fraction: vec![1.0, 0.5, 1.0, 0.75] };
        let mut states = vec![shear(0.8); 3];
        states.push(shear(0.0));
        let lambda: f64 = 0.4 + 1.16f64.sqrt();
        let found = integrate_over_voxels(&material(), &states, &mask, 1.0);
        let names: Vec<&str> = found.iter().map(|s| s.parameter.as_str()).collect();
        assert_eq!(names, ["mu_1", "alpha_1", "mu_2", "alpha_2"]);
        for (term, pair) in material().terms.iter().zip(found.chunks(2)) {
            let (up, down) = (lambda.powf(term.alpha), lambda.powf(-term.alpha));
            let exact = [(up - down) / lambda, term.mu_kpa * lambda.ln() * (up + down) / lambda];
            for (s, exact) in pair.iter().zip(exact) {
                // Closed form; rounding only. The voxel at rest counts as zero.
                assert!((s.sum / (3.0 * exact) - 1.0).abs() < 1e-12);
                assert!((s.mean_per_voxel / (0.75 * exact) - 1.0).abs() < 1e-12);
                assert!((s.volume_integral / (2.5 * 0.1 * exact) - 1.0).abs() < 1e-12);
            }
        }
    }

    /// The sum over voxels equals the sum over a fine histogram's bins.
    #[test]
    fn histogram_sums_agree() {
        let states: Vec<Decomposition> = (0..2000).map(|n| shear(0.2 + 0.0005 * f64::from(n))).collect();
        let histogram = Histogram2d::of(
            states.iter().map(|s| (s.stretch_amplitude, s.deformation_mode)),
            HistogramAxis { low: 1.0, high: 2.0, num_bins: 400 },
            HistogramAxis { low: 0.0, high: 1.0, num_bins: 101 },
        )
        .unwrap();
        for parameter in material().shear_parameters() {
            let sum: f64 = sensitivity_map(&material(), parameter, &states).iter().sum();
            let bins = histogram.sum_over_bins(|l, k| parameter_sensitivity(&material(), parameter, l, Some(k)).value);
            // Bin width 0.0025 in λ: at most half of it times the logarithmic slope (below 20), mostly cancelling.
            assert!((bins / sum - 1.0).abs() < 2e-3);
        }
    }
}
