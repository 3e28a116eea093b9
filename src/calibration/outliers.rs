//! Voxels that hold no displacement: noise where a mask is wrong (over a hole, past a wall), lost fringes.
//!
//! A displacement is continuous: a voxel agrees with its neighbours up to a few times what neighbours along the same
//! axis usually differ by. A voxel of noise agrees with hardly any. A group of voxels that is off as a whole, as by a
//! wrapped phase, agrees within itself and is no outlier: it says what it says.

use crate::voxel::VoxelGrid;

/// A voxel agrees with a neighbour where each component differs by less than this many times the usual difference of
/// neighbours along that axis. Strains at the bonded edges are some times those in the middle.
const AGREES: f64 = 10.0;
/// A voxel with fewer neighbours than this is not judged.
const FEWEST_NEIGHBOURS: usize = 3;
/// A voxel that agrees with no more neighbours than this is an outlier.
const MOST_AGREEING: usize = 1;

/// The voxels of `field` (mm, in the grid's order, NaN where missing) that agree with hardly any of their neighbours.
/// Only voxels that `flags` marks are looked at. `noise_sd_mm` is the noise, where it is known.
pub(super) fn outlying_voxels(
    grid: &VoxelGrid,
    flags: &[bool],
    field: &[[f64; 3]],
    noise_sd_mm: Option<[f64; 3]>,
) -> Vec<usize> {
    let is_there = |v: usize| flags[v] && field[v].iter().all(|u| u.is_finite());
    let limits = [0, 1, 2].map(|axis| usual_difference_mm(grid, &is_there, field, axis));
    let limits =
        limits.map(|usual| [0, 1, 2].map(|c| AGREES * f64::max(usual[c], noise_sd_mm.map_or(0.0, |sd| sd[c]))));
    let agrees = |v: usize, w: usize, axis: usize| {
        (0..3).all(|c| (field[v][c] - field[w][c]).abs() <= limits[axis][c].max(f64::MIN_POSITIVE))
    };
    (0..field.len())
        .filter(|&v| is_there(v))
        .filter(|&v| {
            let (mut num, mut agreeing) = (0, 0);
            for axis in 0..3 {
                for w in neighbours(grid, v, axis).into_iter().flatten().filter(|&w| is_there(w)) {
                    num += 1;
                    agreeing += usize::from(agrees(v, w, axis));
                }
            }
            num >= FEWEST_NEIGHBOURS && agreeing <= MOST_AGREEING
        })
        .collect()
}

/// The voxels before and behind a voxel along an axis.
fn neighbours(grid: &VoxelGrid, voxel: usize, axis: usize) -> [Option<usize>; 2] {
    let at = grid.indices(voxel)[axis];
    let stride = [1, grid.shape[0], grid.shape[0] * grid.shape[1]][axis];
    [(at > 0).then(|| voxel - stride), (at + 1 < grid.shape[axis]).then(|| voxel + stride)]
}

/// Median size of the difference of neighbours along an axis, per component, mm.
fn usual_difference_mm(
    grid: &VoxelGrid,
    is_there: &dyn Fn(usize) -> bool,
    field: &[[f64; 3]],
    axis: usize,
) -> [f64; 3] {
    let pairs: Vec<(usize, usize)> = (0..field.len())
        .filter(|&v| is_there(v))
        .filter_map(|v| neighbours(grid, v, axis)[1].filter(|&w| is_there(w)).map(|w| (v, w)))
        .collect();
    [0, 1, 2].map(|c| {
        let mut sizes: Vec<f64> = pairs.iter().map(|&(v, w)| (field[v][c] - field[w][c]).abs()).collect();
        let middle = sizes.len() / 2;
        if sizes.is_empty() { 0.0 } else { *sizes.select_nth_unstable_by(middle, f64::total_cmp).1 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sheared block with a column of noise and a group that is off by a constant: the noise is found, the group and
    /// the rest are not.
    #[test]
    fn noise_is_told_from_displacement() {
        let grid = VoxelGrid { origin_mm: [0.0; 3], voxel_mm: [1.0, 0.5, 1.0], shape: [12, 10, 9] };
        let num = grid.num_voxels();
        let mut field: Vec<[f64; 3]> = (0..num)
            .map(|v| {
                let x = grid.center_mm(v);
                let ripple = 0.01 * ((v * 7919) % 13) as f64 / 13.0;
                [0.8 * x[1] + 0.02 * x[0] * x[0] + ripple, 0.05 * x[2] + ripple, 0.03 * x[0] - ripple]
            })
            .collect();
        let is_noise = |v: usize| {
            let at = grid.indices(v);
            (4..7).contains(&at[0]) && (3..6).contains(&at[2])
        };
        let mut state = 1u64;
        for v in (0..num).filter(|&v| is_noise(v)) {
            field[v] = [0; 3].map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (state >> 40) as f64 / (1u64 << 24) as f64 * 6.0 - 3.0
            });
        }
        for v in (0..num).filter(|&v| grid.indices(v).iter().zip([9, 2, 1]).all(|(i, low)| (low..low + 2).contains(i)))
        {
            field[v][1] += 2.0;
        }
        let found = outlying_voxels(&grid, &vec![true; num], &field, None);
        assert!(found.iter().all(|&v| is_noise(v)), "{found:?}");
        let hidden = (0..num).filter(|&v| is_noise(v)).count();
        assert!(found.len() as f64 > 0.95 * hidden as f64, "{} of {hidden}", found.len());
    }
}
