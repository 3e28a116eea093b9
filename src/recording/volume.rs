//! Whether components of the displacement are mistaken for others: soft solids keep their volume, and displacements of
//! which two components are exchanged, or have the wrong sign, do not.

use super::{ComponentFault, Recording, RecordingError};
use crate::kinematics::{Tensor, determinant};

/// Another reading is believed where it explains the volume better by this many standard deviations.
const EVIDENCE: f64 = 6.0;
/// It must also lower the mean square of volume changes to this part of what it is.
const FALL: f64 = 0.5;
/// Root mean squares of J − 1 below this are no matter of the components: rubbers are compressed by as much.
const NEGLIGIBLE_CHANGE: f64 = 0.015;
/// A sample may have swollen or shrunk by up to this part of its volume, everywhere alike (2 % of its length), which is
/// no matter of the components either.
const LARGEST_SWELLING: f64 = 0.06;
/// Products of volume changes count up to this size, so that a few cells of noise do not decide.
const LARGEST_PRODUCT: f64 = 1.0;
/// A cell is part of a pair along each of the axes, and pairs with a common cell are not independent.
const NUM_PAIRS_PER_CELL: f64 = 3.0;
/// Cells that are asked at most, in all steps together: enough evidence, and bounded work.
const MAX_CELLS: usize = 200_000;
/// Along an axis with fewer cells, central differences would not be had in neighbours.
const MIN_CELLS: usize = 4;
/// A cell has at most so many voxels along an axis, however thin they are.
const MAX_VOXELS_ALONG: usize = 8;
/// The displacement as stored, and each reading of it.
const NUM_READINGS: usize = 1 + ComponentFault::ALL.len();

impl Recording {
    /// Compares the volume changes that the displacements of every step mean, J − 1, with those of other readings of
    /// the components y and z.
    ///
    /// Voxels are averaged into cells about as long along every axis, so that noise along the shortest edge does not
    /// drown the rest. The measure is the mean product of J − 1 in neighbouring cells, less what is the same in all of
    /// them and may be swelling: central differences there share no voxel, so that noise does not enter it, and of a
    /// material that keeps its volume it is zero.
    ///
    /// # Errors
    /// [`RecordingError::Components`] where another reading explains the volume far better.
    pub(super) fn check_volume(&self) -> Result<(), RecordingError> {
        if self.grid.surface.is_some() {
            // A change of volume shows in the volume alone.
            return Ok(());
        }
        for (n, step) in self.steps.iter().enumerate() {
            let changes = VolumeChanges::of(self, &step.displacement, MAX_CELLS.div_ceil(self.steps.len()));
            let Some((fault, square)) = changes.better_reading() else { continue };
            let percent = |square: f64| 100.0 * square.max(0.0).sqrt();
            let (found_percent, mended_percent) = (percent(changes.mean_square(0)), percent(square));
            return Err(RecordingError::Components { step: n + 1, fault, found_percent, mended_percent });
        }
        Ok(())
    }
}

/// Sums over pairs of neighbouring cells.
struct VolumeChanges {
    num_pairs: f64,
    /// Cells beside each other over cells that begin at every voxel.
    independent_part: f64,
    /// Products of J − 1, by reading; first as stored.
    products: [f64; NUM_READINGS],
    /// By how much these are less than as stored, squared.
    falls_squared: [f64; NUM_READINGS],
}

impl VolumeChanges {
    /// Of every cell that begins at a voxel, or of `max_cells` evenly chosen ones. Nothing is stored.
    fn of(recording: &Recording, displacement: &[[f64; 3]], max_cells: usize) -> VolumeChanges {
        let grid = &recording.grid;
        let cells = Cells::new(recording, displacement);
        let first = (0..grid.num_voxels()).step_by(grid.num_voxels().div_ceil(max_cells)).map(|v| grid.indices(v));
        let swelling = mean_swelling(first.clone().filter_map(|first| cells.volume_changes(first)));
        let mut sums = VolumeChanges {
            num_pairs: 0.0,
            independent_part: 1.0 / cells.num_voxels as f64,
            products: [0.0; NUM_READINGS],
            falls_squared: [0.0; NUM_READINGS],
        };
        let beyond = |first: [usize; 3]| {
            let mut changes = cells.volume_changes(first)?;
            changes.iter_mut().zip(swelling).for_each(|(change, swelling)| *change -= swelling);
            Some(changes)
        };
        for first in first {
            let Some(here) = beyond(first) else { continue };
            for axis in 0..3 {
                let mut next = first;
                next[axis] += cells.per_cell[axis];
                if let Some(there) = beyond(next) {
                    sums.add(here, there);
                }
            }
        }
        sums
    }

    fn add(&mut self, here: [f64; NUM_READINGS], there: [f64; NUM_READINGS]) {
        let product = |i: usize| (here[i] * there[i]).clamp(-LARGEST_PRODUCT, LARGEST_PRODUCT);
        let stored = product(0);
        self.num_pairs += 1.0;
        for i in 0..NUM_READINGS {
            self.products[i] += product(i);
            self.falls_squared[i] += (stored - product(i)).powi(2);
        }
    }

    fn mean_square(&self, reading: usize) -> f64 {
        self.products[reading] / self.num_pairs
    }

    /// Which reading explains the volume best, if far better than the stored one, with its mean square of J − 1.
    fn better_reading(&self) -> Option<(ComponentFault, f64)> {
        let (fault, reading) = ComponentFault::ALL
            .into_iter()
            .zip(1..)
            .min_by(|a, b| self.products[a.1].total_cmp(&self.products[b.1]))?;
        let (stored, mended) = (self.mean_square(0), self.mean_square(reading));
        let fall = stored - mended;
        let variance = self.falls_squared[reading] / self.num_pairs - fall * fall;
        let num_independent = self.num_pairs * self.independent_part / NUM_PAIRS_PER_CELL;
        let is_evident = fall > EVIDENCE * (variance / num_independent).sqrt();
        let is_large = stored > NEGLIGIBLE_CHANGE * NEGLIGIBLE_CHANGE;
        (is_evident && is_large && mended < FALL * stored).then_some((fault, mended))
    }
}

/// By reading, the mean of J − 1, as far as it may be swelling.
fn mean_swelling(changes: impl Iterator<Item = [f64; NUM_READINGS]>) -> [f64; NUM_READINGS] {
    let (mut sums, mut count) = ([0.0; NUM_READINGS], 0.0);
    for changes in changes {
        sums.iter_mut().zip(changes).for_each(|(sum, change)| *sum += change);
        count += 1.0;
    }
    sums.map(|sum| (sum / f64::max(count, 1.0)).clamp(-LARGEST_SWELLING, LARGEST_SWELLING))
}

/// Displacements averaged over cells of voxels.
struct Cells<'a> {
    recording: &'a Recording,
    displacement: &'a [[f64; 3]],
    /// Voxels along each axis.
    per_cell: [usize; 3],
    /// Voxels of a cell.
    num_voxels: usize,
}

impl<'a> Cells<'a> {
    fn new(recording: &'a Recording, displacement: &'a [[f64; 3]]) -> Self {
        let grid = &recording.grid;
        let longest_mm = grid.voxel_mm.into_iter().fold(0.0, f64::max);
        let per_cell: [usize; 3] = std::array::from_fn(|a| {
            let cubic = (longest_mm / grid.voxel_mm[a]).round() as usize;
            cubic.min(MAX_VOXELS_ALONG).min(grid.shape[a] / MIN_CELLS).max(1)
        });
        Cells { recording, displacement, per_cell, num_voxels: per_cell.iter().product() }
    }

    /// Mean over the cell that begins at this voxel; `None` where one of its voxels has no displacement.
    fn mean(&self, first: [usize; 3]) -> Option<[f64; 3]> {
        let [nx, ny, nz] = self.per_cell;
        let mut sum = [0.0; 3];
        for k in 0..nz {
            for j in 0..ny {
                for i in 0..nx {
                    let v = self.recording.grid.index([first[0] + i, first[1] + j, first[2] + k]);
                    let u = self.displacement[v];
                    if !self.recording.mask[v] || u.iter().any(|u| !u.is_finite()) {
                        return None;
                    }
                    (0..3).for_each(|c| sum[c] += u[c]);
                }
            }
        }
        Some(sum.map(|sum| sum / self.num_voxels as f64))
    }

    /// J − 1 of the cell that begins at this voxel by central differences, as stored and by every other reading; `None`
    /// next to a cell without a displacement.
    fn volume_changes(&self, first: [usize; 3]) -> Option<[f64; NUM_READINGS]> {
        let grid = &self.recording.grid;
        let is_inside = |a: usize| first[a] >= self.per_cell[a] && first[a] + 2 * self.per_cell[a] <= grid.shape[a];
        if !(0..3).all(is_inside) || !self.recording.mask[grid.index(first)] {
            return None;
        }
        let mut gradient = [nalgebra::Vector3::zeros(); 3];
        for axis in 0..3 {
            let step = self.per_cell[axis];
            let (mut before, mut after) = (first, first);
            before[axis] -= step;
            after[axis] += step;
            let (before, after) = (self.mean(before)?, self.mean(after)?);
            for c in 0..3 {
                gradient[c][axis] = (after[c] - before[c]) / (2.0 * step as f64 * grid.voxel_mm[axis]);
            }
        }
        let change = |gradient: [nalgebra::Vector3<f64>; 3]| {
            let f: Tensor =
                std::array::from_fn(|c| std::array::from_fn(|axis| gradient[c][axis] + f64::from(u8::from(c == axis))));
            determinant(&f) - 1.0
        };
        let mut changes = [change(gradient); NUM_READINGS];
        for (value, fault) in changes[1..].iter_mut().zip(ComponentFault::ALL) {
            *value = change(fault.mended(gradient));
        }
        Some(changes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{Filter, RecordedStep};
    use crate::specimen::Specimen;
    use crate::voxel::VoxelGrid;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A bar pulled by a fifth of its length that keeps its volume and thins in y more than in z, with noise, stored as
    /// `stored` does.
    fn pulled(stored: impl Fn([f64; 3]) -> [f64; 3]) -> Result<(), RecordingError> {
        swollen(1.0, stored)
    }

    /// As [`pulled`], of a bar that has swollen by a factor in volume, along y and z.
    fn swollen(volume: f64, stored: impl Fn([f64; 3]) -> [f64; 3]) -> Result<(), RecordingError> {
        let specimen = Specimen::from_json(include_str!("../../geometries/uniaxial-bar.json")).expect("a specimen");
        let grid = VoxelGrid::covering(&specimen, [1.0, 0.4, 1.0]).expect("a grid");
        let across = f64::sqrt(volume);
        let stretch: [f64; 3] = [1.2, across / (1.2 * 0.93), 0.93 * across];
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let displacement = (0..grid.num_voxels())
            .map(|v| {
                let x = grid.center_mm(v);
                stored(std::array::from_fn(|c| (stretch[c] - 1.0) * x[c] + rng.random_range(-0.1..0.1)))
            })
            .collect();
        let drive_mm = 0.2 * specimen.block.length_mm;
        let step = RecordedStep { drive_mm, force_n: None, force_sd_n: None, window_s: None, displacement };
        let recording = Recording {
            id: "pulled".into(),
            mask: vec![true; grid.num_voxels()],
            specimen,
            grid,
            steps: vec![step],
            noise_sd_mm: None,
            filter: Filter::None,
            load: None,
            notes: None,
        };
        recording.check_volume()
    }

    #[test]
    fn mistaken_components_across_the_drive_are_named() {
        pulled(|u| u).expect("as it should be");
        type Stored = fn([f64; 3]) -> [f64; 3];
        let cases: [(Stored, [bool; 3]); 4] = [
            (|[x, y, z]| [x, -y, z], [false, true, false]),
            (|[x, y, z]| [x, y, -z], [false, false, true]),
            (|[x, y, z]| [x, -y, -z], [false, true, true]),
            (|[x, y, z]| [x, z, y], [true, false, false]),
        ];
        for (stored, [is_exchanged, is_y_flipped, is_z_flipped]) in cases {
            let fault = ComponentFault { is_exchanged, is_y_flipped, is_z_flipped };
            match pulled(stored) {
                Err(RecordingError::Components { step: 1, fault: found, found_percent, mended_percent }) => {
                    assert_eq!(found, fault);
                    assert!(mended_percent < 0.5 * found_percent, "{found_percent} {mended_percent}");
                }
                other => panic!("{fault:?}: {other:?}"),
            }
        }
    }

    /// Swelling changes the volume, too; the components are as they should be.
    #[test]
    fn a_sample_that_swells_or_shrinks_is_taken() {
        for volume in [0.95, 0.98, 1.02, 1.05] {
            swollen(volume, |u| u).expect("a sample that swelled");
            assert!(swollen(volume, |[x, y, z]| [x, -y, z]).is_err(), "{volume}");
        }
    }

    #[test]
    fn every_reading_undoes_its_mistake() {
        let u = [1.0, 2.0, 3.0];
        for fault in ComponentFault::ALL {
            let stored = |[x, y, z]: [f64; 3]| {
                let (y, z) = (if fault.is_y_flipped { -y } else { y }, if fault.is_z_flipped { -z } else { z });
                if fault.is_exchanged { [x, z, y] } else { [x, y, z] }
            };
            assert_eq!(fault.mended(stored(u)), u);
        }
    }
}
