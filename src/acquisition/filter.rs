//! The 2×2×2 filter on displacements with gaps.

use super::AcquisitionError;
use crate::voxel::{HammingFilter, VoxelGrid, VoxelMask};

/// Displacements after the filter, one voxel less along each axis, at the corners of the acquired voxels.
pub struct FilteredField {
    /// The corners' grid.
    pub grid: VoxelGrid,
    /// Corners with at least four of their eight voxels in the acquired mask.
    pub mask: Vec<bool>,
    /// Filtered displacements, mm, in the corners' grid order; NaN where missing.
    pub displacement: Vec<[f64; 3]>,
    /// Standard deviations, mm, likewise.
    pub sd_mm: Vec<[f64; 3]>,
}

/// Applies `hamming2` to displacements and their standard deviations (mm, grid order, NaN where missing). Missing
/// voxels do not count; a component without at least half of the mask's voxels around a corner is missing there.
///
/// # Errors
/// [`AcquisitionError::Voxel`], [`AcquisitionError::Length`].
pub fn hamming_filtered(
    grid: &VoxelGrid,
    mask: &[bool],
    displacement: &[[f64; 3]],
    sd_mm: &[[f64; 3]],
) -> Result<FilteredField, AcquisitionError> {
    for (what, found) in [("mask", mask.len()), ("displacement", displacement.len()), ("sd", sd_mm.len())] {
        let expected = grid.num_voxels();
        if found != expected {
            return Err(AcquisitionError::Length { what, found, expected });
        }
    }
    let voxels: Vec<u32> = (0..mask.len() as u32).filter(|&v| mask[v as usize]).collect();
    let material_fraction = vec![1.0; voxels.len()];
    let acquired = VoxelMask { grid: grid.clone(), voxels, material_fraction };
    let filter = HammingFilter::new(&acquired)?;
    // Sums over what is there: displacement, variance and number of each component.
    let sums: Vec<[f64; 9]> = acquired
        .voxels
        .iter()
        .map(|&v| {
            let mut sum = [0.0; 9];
            for a in 0..3 {
                let (u, sd) = (displacement[v as usize][a], sd_mm[v as usize][a]);
                if u.is_finite() {
                    sum[3 * a] = u;
                    sum[3 * a + 1] = sd * sd;
                    sum[3 * a + 2] = 1.0;
                }
            }
            sum
        })
        .collect();
    let means = filter.apply(&sums)?;
    let numbers = num_sources(&acquired, filter.mask());
    let (mut u, mut sd) = (Vec::with_capacity(means.len()), Vec::with_capacity(means.len()));
    for (mean, &number) in means.iter().zip(&numbers) {
        let is_there = |a: usize| mean[3 * a + 2] >= 0.5;
        u.push([0, 1, 2].map(|a| if is_there(a) { mean[3 * a] / mean[3 * a + 2] } else { f64::NAN }));
        // Mean of n values with variances vᵢ: variance Σ vᵢ / n².
        let sd_of = |a: usize| (mean[3 * a + 1] * number).sqrt() / (mean[3 * a + 2] * number);
        sd.push([0, 1, 2].map(|a| if is_there(a) { sd_of(a) } else { f64::NAN }));
    }
    let filtered = filter.mask();
    Ok(FilteredField {
        grid: filtered.grid.clone(),
        mask: filtered.spread(&vec![true; filtered.num_voxels()], false),
        displacement: filtered.spread(&u, [f64::NAN; 3]),
        sd_mm: filtered.spread(&sd, [f64::NAN; 3]),
    })
}

/// Voxels of the acquired mask around each corner.
fn num_sources(acquired: &VoxelMask, filtered: &VoxelMask) -> Vec<f64> {
    let is_there = acquired.spread(&vec![true; acquired.num_voxels()], false);
    let count = |corner: u32| {
        let [i, j, k] = filtered.grid.indices(corner as usize);
        let at = |c: usize| acquired.grid.index([i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)]);
        (0..8).filter(|&c| is_there[at(c)]).count() as f64
    };
    filtered.voxels.iter().map(|&v| count(v)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A constant stays; its standard deviation falls by √8 inside, by √7 beside a gap.
    #[test]
    fn gaps_do_not_count() {
        let grid = VoxelGrid::new([0.0; 3], [1.0; 3], [4; 3]).unwrap();
        let mut u = vec![[2.0, 0.5, -1.0]; 64];
        u[grid.index([1, 1, 1])][1] = f64::NAN;
        let filtered = hamming_filtered(&grid, &[true; 64], &u, &[[0.1; 3]; 64]).unwrap();
        assert_eq!(filtered.grid.shape, [3; 3]);
        assert_eq!(filtered.grid.origin_mm, [0.5; 3]);
        for v in 0..27 {
            for (a, exact) in [2.0, 0.5, -1.0].into_iter().enumerate() {
                // Means of eight equal numbers.
                assert!((filtered.displacement[v][a] - exact).abs() < 1e-14);
            }
            let is_beside = filtered.grid.indices(v).iter().all(|&n| n <= 1);
            let n: f64 = if is_beside { 7.0 } else { 8.0 };
            assert!((filtered.sd_mm[v][1] - 0.1 / n.sqrt()).abs() < 1e-14);
            assert!((filtered.sd_mm[v][0] - 0.1 / 8f64.sqrt()).abs() < 1e-14);
        }
    }
}
