//! The noise of a recording that does not state it.

use super::error::CalibrationError;
use crate::recording::Filter;
use crate::voxel::{VoxelGrid, unbounded_where_unmeasured};

/// Fewest differences from which a standard deviation is estimated.
const MIN_DIFFERENCES: usize = 100;
/// 1 / the 75 % point of the standard normal distribution: median |x| → standard deviation.
const MAD_TO_SD: f64 = 1.482_602_218_505_602;
/// Third differences: they take away what is quadratic in the position.
pub(super) const THIRD_DIFFERENCE: [f64; 4] = [-1.0, 3.0, -3.0, 1.0];

/// Noise per component (mm) from third differences between neighbours along the axis of the smallest voxel edge,
/// robustly: 1.4826 × median |difference| / √var, over the voxels marked in `flags`. `fields` are displacements on the
/// grid.
///
/// Third differences of independent noise have the variance Σ w² σ² = 20 σ²; after the 2×2×2 filter neighbours are
/// correlated by ½ and it is 5 σ². Of components that are not measured, the noise is infinite.
///
/// # Errors
/// [`CalibrationError::InvalidValue`] where there are too few runs of four neighbours, or no noise at all.
pub fn estimate_noise_sd_mm(
    grid: &VoxelGrid,
    flags: &[bool],
    fields: &[&[[f64; 3]]],
    filter: Filter,
) -> Result<[f64; 3], CalibrationError> {
    let axes = (0..3).filter(|&a| grid.normal_axis() != Some(a));
    let axis = axes.min_by(|&a, &b| grid.voxel_mm[a].total_cmp(&grid.voxel_mm[b])).unwrap_or(0);
    let stride = grid.stride(axis);
    let variance = match filter {
        Filter::None => 20.0f64,
        Filter::Hamming2 => 5.0,
    };
    let mut differences: [Vec<f64>; 3] = Default::default();
    for field in fields {
        for v in 0..grid.num_voxels() {
            if grid.indices(v)[axis] + THIRD_DIFFERENCE.len() > grid.shape[axis] {
                continue;
            }
            let run = [0, 1, 2, 3].map(|n| v + n * stride);
            if !run.iter().all(|&n| flags[n]) {
                continue;
            }
            for c in 0..3 {
                let d: f64 = run.iter().zip(THIRD_DIFFERENCE).map(|(&n, w)| w * field[n][c]).sum();
                if d.is_finite() {
                    differences[c].push(d.abs());
                }
            }
        }
    }
    let measured = grid.measured();
    let mut sd = unbounded_where_unmeasured(measured, [0.0; 3]);
    let all = sd.iter_mut().zip(&mut differences).zip(measured);
    for ((sd, d), _) in all.filter(|(_, is_measured)| *is_measured) {
        if d.len() < MIN_DIFFERENCES {
            return Err(CalibrationError::InvalidValue {
                name: "the number of voxel differences for the noise",
                value: d.len() as f64,
                requirement: "at least 100; state noise_sd_mm in the recording",
            });
        }
        let middle = d.len() / 2;
        let (_, median, _) = d.select_nth_unstable_by(middle, f64::total_cmp);
        *sd = MAD_TO_SD * *median / variance.sqrt();
        if !(*sd > 0.0) {
            return Err(CalibrationError::InvalidValue {
                name: "the noise estimated from the recording (mm)",
                value: *sd,
                requirement: "positive; state noise_sd_mm in the recording",
            });
        }
    }
    Ok(sd)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::voxel::{HammingFilter, VoxelMask};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn noisy(mask: &VoxelMask, sd: [f64; 3]) -> Vec<[f64; 3]> {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        mask.voxels
            .iter()
            .map(|&v| {
                let x = mask.grid.center_mm(v as usize);
                let smooth = [0.7 * x[1], 0.05 * x[1] * x[1], 0.1 * (0.5 * x[0]).sin()];
                [0, 1, 2].map(|c| {
                    let n: f64 = StandardNormal.sample(&mut rng);
                    smooth[c] + sd[c] * n
                })
            })
            .collect()
    }

    /// Known noise on a smooth field is found, before and after the filter (which leaves σ/√8).
    #[test]
    fn known_noise_is_found() {
        let specimen =
            crate::specimen::Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).unwrap();
        let mask = VoxelMask::covering(&specimen, [1.0, 0.1875, 0.75]).unwrap();
        let truth = [0.05, 0.02, 0.08];
        let values = noisy(&mask, truth);
        let spread = |mask: &VoxelMask, values: &[[f64; 3]]| {
            let flags = mask.spread(&vec![true; mask.num_voxels()], false);
            (flags, mask.spread(values, [f64::NAN; 3]))
        };
        let (flags, field) = spread(&mask, &values);
        let found = estimate_noise_sd_mm(&mask.grid, &flags, &[&field], Filter::None).unwrap();
        let filter = HammingFilter::new(&mask).unwrap();
        let filtered = filter.apply(&values).unwrap();
        // Interior only: at the faces fewer voxels are averaged.
        let mut interior = filter.mask().clone();
        let keep: Vec<bool> = interior.material_fraction.iter().map(|f| *f > 1.0 - 1e-9).collect();
        let mut flag = keep.iter();
        interior.voxels.retain(|_| *flag.next().unwrap());
        let kept: Vec<[f64; 3]> = filtered.iter().zip(&keep).filter(|(_, k)| **k).map(|(u, _)| *u).collect();
        let (flags, field) = spread(&interior, &kept);
        let smooth = estimate_noise_sd_mm(&mask_grid(&interior), &flags, &[&field], Filter::Hamming2).unwrap();
        for c in 0..3 {
            // Some 15,000 correlated differences: a percent or two.
            assert!((found[c] / truth[c] - 1.0).abs() < 0.03, "{found:?}");
            assert!((smooth[c] * 8f64.sqrt() / truth[c] - 1.0).abs() < 0.05, "{smooth:?}");
        }
    }

    fn mask_grid(mask: &VoxelMask) -> VoxelGrid {
        mask.grid.clone()
    }

    #[test]
    fn too_little_is_an_error() {
        let grid = VoxelGrid::new([0.0; 3], [1.0; 3], [5, 2, 2]).unwrap();
        let field = vec![[0.0; 3]; 20];
        assert!(estimate_noise_sd_mm(&grid, &[true; 20], &[&field], Filter::None).is_err());
    }
}
