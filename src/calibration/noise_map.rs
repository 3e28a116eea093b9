//! Where in its image a recording is noisier than elsewhere.
//!
//! The noise of a phase grows as the signal fades: toward the ends of the coil, and where the fringes are so close that
//! spins within a voxel cancel each other. One number per component then counts the noisy voxels for too much and the
//! quiet ones for too little. Third differences between neighbours tell the noise of a place: they take away what is
//! quadratic in the position, and a displacement is smooth along at least one axis even at a wall, a layer or a jump,
//! whereas noise is rough along all. So the mean square over the neighbourhood is taken along each axis, and the
//! smallest of the three is the noise.

use super::noise::THIRD_DIFFERENCE;
use crate::voxel::VoxelGrid;

/// Half widths of the neighbourhood, in voxels along each axis.
const HALF_WIDTHS: [usize; 3] = [2, 3, 2];
/// Fewer differences than this in a neighbourhood do not say how large the noise is there.
const FEWEST_DIFFERENCES: f64 = 20.0;
/// Noise counts as alike everywhere where the place that is noisier than nine tenths of all has less than this many
/// times the noise of the one that is noisier than a tenth. By chance the two differ by a quarter, of filtered values
/// by a third: a neighbourhood holds some hundred differences, of which about a third are independent.
const ALIKE_BELOW: f64 = 1.6;
/// Values that vary less from voxel to voxel than this part of their stated noise were smoothed: they say nothing of
/// where the noise is.
const LEAST_OF_STATED: f64 = 0.3;
/// Noise is taken to be no smaller and no larger than these multiples of the typical one: where a field is constant by
/// the way it was written, a voxel must not outweigh all others.
const RANGE: [f64; 2] = [0.25, 16.0];

/// The noise of every voxel of the grid in multiples of the typical one (the median over the voxels), per component;
/// `None` where it is alike everywhere. `field` is the displacement on the grid, mm, NaN where missing; of a voxel
/// whose neighbours say nothing the noise is taken as typical. `noise_sd_mm` is the noise, where it is stated.
pub(super) fn relative_noise(
    grid: &VoxelGrid,
    flags: &[bool],
    field: &[[f64; 3]],
    noise_sd_mm: Option<[f64; 3]>,
) -> Option<Vec<[f64; 3]>> {
    let mut relative = vec![[1.0; 3]; field.len()];
    let mut varies = false;
    for component in 0..3 {
        let value = |v: usize| if flags[v] { field[v][component] } else { f64::NAN };
        let noise = local_noise_mm(grid, &(0..field.len()).map(value).collect::<Vec<_>>());
        let mut known: Vec<f64> = noise.iter().copied().filter(|n| n.is_finite()).collect();
        if known.is_empty() {
            continue;
        }
        known.sort_by(f64::total_cmp);
        let at = |part: f64| known[((known.len() - 1) as f64 * part).round() as usize];
        let typical = at(0.5);
        let least = noise_sd_mm.map_or(0.0, |sd| LEAST_OF_STATED * sd[component]);
        if !(typical > least) || at(0.9) < ALIKE_BELOW * at(0.1) {
            continue;
        }
        varies = true;
        for (relative, noise) in relative.iter_mut().zip(&noise).filter(|(_, noise)| noise.is_finite()) {
            relative[component] = (noise / typical).clamp(RANGE[0], RANGE[1]);
        }
    }
    varies.then_some(relative)
}

/// The noise around every voxel by the axis along which `values` are smoothest, mm; NaN where too little is known.
fn local_noise_mm(grid: &VoxelGrid, values: &[f64]) -> Vec<f64> {
    let mut smallest = vec![f64::NAN; values.len()];
    for axis in 0..3 {
        let squares = squared_differences(grid, values, axis);
        for (smallest, mean) in smallest.iter_mut().zip(means_around(grid, &squares)) {
            // `f64::min` takes the number where the other is none.
            *smallest = smallest.min(mean);
        }
    }
    let is_there = |v: usize| values[v].is_finite();
    smallest.iter().enumerate().map(|(v, mean)| if is_there(v) { mean.sqrt() } else { f64::NAN }).collect()
}

/// Squares of third differences along an axis, each as the variance of the noise of which it would be the mean square,
/// at the second of their four voxels; NaN where one of them is missing.
fn squared_differences(grid: &VoxelGrid, values: &[f64], axis: usize) -> Vec<f64> {
    let stride = grid.stride(axis);
    let variance: f64 = THIRD_DIFFERENCE.iter().map(|w| w * w).sum();
    let square = |v: usize| {
        let place = grid.indices(v)[axis];
        if place == 0 || place + THIRD_DIFFERENCE.len() > grid.shape[axis] + 1 {
            return f64::NAN;
        }
        let first = v - stride;
        let difference: f64 = THIRD_DIFFERENCE.iter().enumerate().map(|(n, w)| w * values[first + n * stride]).sum();
        difference * difference / variance
    };
    (0..values.len()).map(square).collect()
}

/// Means of what is finite in the neighbourhood of every voxel; NaN where that is too little. Running sums along one
/// axis after the other.
fn means_around(grid: &VoxelGrid, values: &[f64]) -> Vec<f64> {
    let mut sums: Vec<[f64; 2]> = values.iter().map(|&x| if x.is_finite() { [x, 1.0] } else { [0.0, 0.0] }).collect();
    for (axis, half_width) in HALF_WIDTHS.into_iter().enumerate() {
        sums = sums_along(grid, &sums, axis, half_width);
    }
    sums.iter().map(|[sum, count]| if *count >= FEWEST_DIFFERENCES { sum / count } else { f64::NAN }).collect()
}

/// Sums over the voxels up to `half_width` away along an axis.
fn sums_along(grid: &VoxelGrid, values: &[[f64; 2]], axis: usize, half_width: usize) -> Vec<[f64; 2]> {
    let (stride, num) = (grid.stride(axis), grid.shape[axis]);
    let mut sums = vec![[0.0; 2]; values.len()];
    for start in (0..values.len()).filter(|&v| grid.indices(v)[axis] == 0) {
        for place in 0..num {
            let near = place.saturating_sub(half_width)..(place + half_width + 1).min(num);
            sums[start + place * stride] = near.fold([0.0; 2], |[sum, count], n| {
                let [x, one] = values[start + n * stride];
                [sum + x, count + one]
            });
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn grid() -> VoxelGrid {
        VoxelGrid::new([-12.5, -3.0, -9.0], [1.0, 0.1875, 0.75], [26, 33, 25]).unwrap()
    }

    /// A sheared block with a layer that does not move, bent along x and z, with noise of `sd_mm` at the place given in
    /// half lengths.
    fn noisy(grid: &VoxelGrid, sd_mm: &dyn Fn(f64) -> f64) -> Vec<[f64; 3]> {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let value = |v: usize| {
            let x = grid.center_mm(v);
            let smooth = [(x[1] + 2.2).max(0.0), 0.3 * (0.25 * x[0]).sin() * x[1], 0.02 * x[0] * x[2]];
            let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
            smooth.map(|u| u + sd_mm(x[0] / 12.5) * noise())
        };
        (0..grid.num_voxels()).map(value).collect()
    }

    /// Noise that is alike everywhere is called so, stated or not, also beside a kink and a jump of the displacement,
    /// and where there is none at all.
    #[test]
    fn noise_that_is_alike_is_called_so() {
        let grid = grid();
        let flags = vec![true; grid.num_voxels()];
        let mut field = noisy(&grid, &|_| 0.01);
        for (v, u) in field.iter_mut().enumerate() {
            u[2] += if grid.center_mm(v)[0] > 4.0 { 0.5 } else { 0.0 };
        }
        for stated in [None, Some([0.01; 3])] {
            assert_eq!(relative_noise(&grid, &flags, &field, stated), None);
        }
        assert_eq!(relative_noise(&grid, &flags, &noisy(&grid, &|_| 0.0), Some([0.01; 3])), None);
        assert_eq!(relative_noise(&grid, &flags, &vec![[0.0; 3]; flags.len()], None), None);
    }

    /// Noise five times as large at the ends as in the middle is found there, whatever was stated of it.
    #[test]
    fn noise_that_grows_is_followed() {
        let grid = grid();
        let flags = vec![true; grid.num_voxels()];
        let grown = |t: f64| 0.01 * (1.0 + 4.0 * t * t);
        let found = relative_noise(&grid, &flags, &noisy(&grid, &grown), Some([0.01, 0.02, 0.015])).unwrap();
        let mut all: Vec<f64> = (0..grid.num_voxels()).map(|v| grown(grid.center_mm(v)[0] / 12.5)).collect();
        all.sort_by(f64::total_cmp);
        let typical = all[all.len() / 2];
        for c in 0..3 {
            let ratios = found.iter().enumerate().map(|(v, f)| f[c] * typical / grown(grid.center_mm(v)[0] / 12.5));
            let (mut mean, mut spread) = (0.0, 0.0);
            for ratio in ratios {
                mean += ratio.ln() / found.len() as f64;
                spread += ratio.ln().powi(2) / found.len() as f64;
            }
            // A neighbourhood scatters by 10 %, and the smallest of three axes is some percent below the noise.
            assert!(mean.abs() < 0.1 && spread.sqrt() < 0.2, "{mean} {spread}");
        }
    }

    /// A field smoother than the noise that is stated says nothing of it: its differences show the displacement.
    #[test]
    fn smoothed_values_say_nothing() {
        let grid = grid();
        let flags = vec![true; grid.num_voxels()];
        let field = noisy(&grid, &|t| 0.001 * (1.0 + 4.0 * t * t));
        assert!(relative_noise(&grid, &flags, &field, None).is_some());
        assert_eq!(relative_noise(&grid, &flags, &field, Some([0.02; 3])), None);
    }
}
