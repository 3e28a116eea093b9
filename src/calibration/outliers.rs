//! Voxels that hold no displacement: noise where a mask is wrong (over a hole, past a wall), lost fringes.
//!
//! A displacement is continuous: a voxel agrees with its neighbours up to a few times what neighbours along the same
//! axis usually differ by. A voxel of noise agrees with hardly any. A group of voxels that is off as a whole, as by a
//! wrapped phase, agrees within itself and is no outlier: it says what it says.
//!
//! At the ends of the bonded edges a displacement is so steep that voxels differ from those beside them like noise. In
//! a volume they agree with those along the edge. A face has no such axis: there a voxel is no outlier either where it
//! lies on a line with the next two along an axis, by a few times what voxels usually lie off one. Steep displacements
//! are nearly straight over three voxels, noise is not.
//!
//! Where the signal is nearly lost the noise is many times what it is elsewhere. A displacement is smooth along at
//! least one axis, even at a wall or a layer; noise is rough along all. So the roughness along the smoothest axis is
//! the noise, and voxels in whose neighbourhood it is several times the usual one are left out.

use crate::voxel::VoxelGrid;

/// A voxel agrees with a neighbour where each component differs by less than this many times the usual difference of
/// neighbours along that axis. Strains at the bonded edges are some times those in the middle.
const AGREES: f64 = 10.0;
/// A voxel with fewer neighbours than this is not judged.
const FEWEST_NEIGHBOURS: usize = 3;
/// Noise of so many times the usual one says that the signal is lost.
const LOST: f64 = 4.0;
/// Fewer second differences than this around a voxel do not say how large the noise is.
const FEWEST_DIFFERENCES: usize = 9;
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
    let mut outliers: Vec<usize> = (0..field.len())
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
        .collect();
    if grid.surface.is_some() && !outliers.is_empty() {
        let is_straight = straight_voxels(grid, &is_there, field, noise_sd_mm);
        outliers.retain(|&v| !is_straight[v]);
    }
    outliers
}

/// Whether a voxel, first, in the middle or last, lies on a line with two others in a row along an axis: each
/// component's second difference is less than [`AGREES`] times the usual one along that axis, or the noise.
fn straight_voxels(
    grid: &VoxelGrid,
    is_there: &dyn Fn(usize) -> bool,
    field: &[[f64; 3]],
    noise_sd_mm: Option<[f64; 3]>,
) -> Vec<bool> {
    let mut is_straight = vec![false; field.len()];
    for axis in 0..3 {
        let rough = [0, 1, 2].map(|c| second_differences(grid, is_there, field, axis, c));
        let limits = [0, 1, 2].map(|c| {
            let mut sizes: Vec<f64> = rough[c].iter().copied().filter(|d| d.is_finite()).collect();
            let usual = if sizes.is_empty() { 0.0 } else { median(&mut sizes) };
            AGREES * f64::max(usual, noise_sd_mm.map_or(0.0, |sd| sd[c])).max(f64::MIN_POSITIVE)
        });
        // No number where a neighbour is missing: no line.
        for v in (0..field.len()).filter(|&v| (0..3).all(|c| rough[c][v] <= limits[c])) {
            is_straight[v] = true;
            for w in neighbours(grid, v, axis).into_iter().flatten() {
                is_straight[w] = true;
            }
        }
    }
    is_straight
}

/// The voxels of `field` (as for [`outlying_voxels`]) in whose neighbourhood the noise of a component is [`LOST`] times
/// the noise that is known or the usual one, whichever is larger.
pub(super) fn lost_voxels(
    grid: &VoxelGrid,
    flags: &[bool],
    field: &[[f64; 3]],
    noise_sd_mm: Option<[f64; 3]>,
) -> Vec<usize> {
    let is_there = |v: usize| flags[v] && field[v].iter().all(|u| u.is_finite());
    let all: Vec<usize> = (0..field.len()).filter(|&v| is_there(v)).collect();
    let mut is_lost = vec![false; field.len()];
    for c in 0..3 {
        let rough = [0, 1, 2].map(|axis| second_differences(grid, &is_there, field, axis, c));
        let local: Vec<(usize, f64)> = all.iter().filter_map(|&v| Some((v, local_noise(grid, &rough, v)?))).collect();
        let mut sizes: Vec<f64> = local.iter().map(|l| l.1).collect();
        if sizes.is_empty() {
            continue;
        }
        let usual = median(&mut sizes);
        let limit = LOST * noise_sd_mm.map_or(usual, |sd| usual.max(sd[c]));
        for (v, _) in local.into_iter().filter(|l| l.1 > limit) {
            is_lost[v] = true;
        }
    }
    all.into_iter().filter(|&v| is_lost[v]).collect()
}

/// Sizes of the second differences of a component along an axis, each as the standard deviation of the noise of which
/// it would be the median size; NaN where a neighbour is missing.
fn second_differences(
    grid: &VoxelGrid,
    is_there: &dyn Fn(usize) -> bool,
    field: &[[f64; 3]],
    axis: usize,
    component: usize,
) -> Vec<f64> {
    // The variance of 1, -2, 1 times noise is 6 times the noise's; the median size of a normal number is 0.6745 σ.
    let scale = 1.0 / (6f64.sqrt() * 0.6745);
    let u = |v: usize| field[v][component];
    (0..field.len())
        .map(|v| match neighbours(grid, v, axis) {
            [Some(before), Some(behind)] if [v, before, behind].iter().all(|&w| is_there(w)) => {
                scale * (u(before) - 2.0 * u(v) + u(behind)).abs()
            }
            _ => f64::NAN,
        })
        .collect()
}

/// The noise in the neighbourhood of a voxel by the axis along which the field is smoothest; `None` where too few
/// neighbours are there to say.
fn local_noise(grid: &VoxelGrid, rough: &[Vec<f64>; 3], voxel: usize) -> Option<f64> {
    let at = grid.indices(voxel);
    let range = |axis: usize| at[axis].saturating_sub(1)..(at[axis] + 2).min(grid.shape[axis]);
    let of_axis = |along: &Vec<f64>| {
        let mut near = Vec::with_capacity(27);
        for k in range(2) {
            for j in range(1) {
                for i in range(0) {
                    near.push(along[i + grid.shape[0] * (j + grid.shape[1] * k)]);
                }
            }
        }
        near.retain(|d| d.is_finite());
        (near.len() >= FEWEST_DIFFERENCES).then(|| median(&mut near))
    };
    let by_axis: Vec<f64> = rough.iter().filter_map(of_axis).collect();
    // At an edge of the block a single axis is left, along which there may be a kink.
    if by_axis.len() < 2 { None } else { by_axis.into_iter().min_by(f64::total_cmp) }
}

/// The median of at least one number.
fn median(all: &mut [f64]) -> f64 {
    let middle = all.len() / 2;
    *all.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The voxels before and behind a voxel along an axis.
fn neighbours(grid: &VoxelGrid, voxel: usize, axis: usize) -> [Option<usize>; 2] {
    let at = grid.indices(voxel)[axis];
    let stride = grid.stride(axis);
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

    /// Noise of 0.01 mm in a sheared block with a stiff layer, ten times as much beyond x = 9: most of it is found
    /// there, and none elsewhere.
    #[test]
    fn lost_signal_is_told_from_kinks() {
        let grid = VoxelGrid { origin_mm: [0.0; 3], voxel_mm: [1.0, 0.2, 1.0], shape: [14, 20, 10], surface: None };
        let num = grid.num_voxels();
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let field: Vec<[f64; 3]> = (0..num)
            .map(|v| {
                let at = grid.indices(v);
                let x = grid.center_mm(v);
                let sd = if at[0] >= 10 { 0.1 } else { 0.01 };
                // The sum of twelve uniform numbers less six is nearly normal.
                let mut noise = || sd * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0);
                [1.1 * (x[1] - 0.5).max(0.0) + noise(), 0.1 * x[0] + noise(), noise()]
            })
            .collect();
        for noise_sd_mm in [None, Some([0.01; 3])] {
            let found = lost_voxels(&grid, &vec![true; num], &field, noise_sd_mm);
            let is_rough = |v: usize| grid.indices(v)[0] >= 10;
            let right = found.iter().filter(|&&v| is_rough(v)).count();
            let rough = (0..num).filter(|&v| is_rough(v)).count();
            // Of four layers of rough voxels the first has smooth ones beside it, and half of the last have no other.
            assert!(right as f64 > 0.7 * rough as f64, "{right} of {rough}");
            assert!(found.iter().all(|&v| grid.indices(v)[0] >= 9), "{} beside {right}", found.len());
        }
    }

    /// The side of a sheared block, 0.8 mm per subset, with noise of 5 µm. At its ends it rises by half a millimetre
    /// within three subsets, which is steeper by far than what is usual and no outlier; subsets of noise, alone or in a
    /// group, are.
    #[test]
    fn steep_ends_of_a_face_are_no_outliers() {
        use crate::voxel::{Face, MeasuredComponents, Surface};
        let surface = Some(Surface { face: Face::PlusZ, components: MeasuredComponents::InPlane });
        let grid = VoxelGrid { origin_mm: [0.0; 3], voxel_mm: [0.8, 0.8, 1.0], shape: [32, 8, 1], surface };
        let num = grid.num_voxels();
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let mut field: Vec<[f64; 3]> = (0..num)
            .map(|v| {
                let (x, y) = (grid.center_mm(v)[0], grid.center_mm(v)[1] / 6.4);
                let end = (-x / 0.8).exp() - ((x - 24.8) / 0.8).exp();
                let noise = [0.017 * uniform(), 0.017 * uniform()];
                [4.0 * y + 0.3 * end * y + noise[0], 2.0 * y * (1.0 - y) * end + noise[1], 0.0]
            })
            .collect();
        let sd = Some([0.005, 0.005, f64::INFINITY]);
        let found = |field: &[[f64; 3]], grid: &VoxelGrid, sd| outlying_voxels(grid, &vec![true; num], field, sd);
        assert_eq!((found(&field, &grid, sd), found(&field, &grid, None)), (vec![], vec![]));
        // The ends are as steep as was said: by their neighbours alone, as a volume's voxels, they would not pass.
        let judged = found(&field, &VoxelGrid { surface: None, ..grid.clone() }, None);
        assert!(judged.len() >= 8, "{judged:?}");
        let noise: Vec<usize> = (0..num)
            .filter(|&v| {
                let [i, j, _] = grid.indices(v);
                ((12..16).contains(&i) && (2..6).contains(&j)) || (i, j) == (22, 4) || (i, j) == (31, 3)
            })
            .collect();
        for &v in &noise {
            field[v] = [6.0 * uniform(), 6.0 * uniform(), 0.0];
        }
        for sd in [sd, None] {
            assert_eq!(found(&field, &grid, sd), noise);
        }
    }

    /// A sheared block with a column of noise and a group that is off by a constant: the noise is found, the group and
    /// the rest are not.
    #[test]
    fn noise_is_told_from_displacement() {
        let grid = VoxelGrid { origin_mm: [0.0; 3], voxel_mm: [1.0, 0.5, 1.0], shape: [12, 10, 9], surface: None };
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
