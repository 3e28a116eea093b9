//! Whether components of the displacement have the wrong sign: soft solids keep their volume, and what has a wrong sign
//! does not.

use super::{FlippedComponents, Recording, RecordingError};
use crate::kinematics::{Tensor, determinant};

/// Other signs are believed where they explain the volume better by this many standard deviations.
const EVIDENCE: f64 = 6.0;
/// They must also lower the mean square of volume changes to this part of what it is.
const FALL: f64 = 0.5;
/// Products of volume changes count up to this size, so that a few voxels of noise do not decide.
const LARGEST_PRODUCT: f64 = 1.0;
/// A voxel is part of a pair along each of the axes, and pairs with a common voxel are not independent.
const NUM_PAIRS_PER_VOXEL: f64 = 3.0;

impl Recording {
    /// Compares the volume changes that the displacements of every step mean, J − 1, with those of other signs of y and
    /// z.
    ///
    /// The measure is the mean product of J − 1 in neighbouring voxels: central differences there share no voxel, so
    /// that noise does not enter it, and of a material that keeps its volume it is zero. Each J is made of the same
    /// noise with either sign, and so is what an acquisition adds to one component alone.
    ///
    /// # Errors
    /// [`RecordingError::Signs`] where other signs explain the volume far better.
    pub(super) fn check_signs(&self) -> Result<(), RecordingError> {
        for (n, step) in self.steps.iter().enumerate() {
            let changes = VolumeChanges::of(self, &step.displacement);
            let Some((flipped, square)) = changes.better_signs() else { continue };
            let percent = |square: f64| 100.0 * square.max(0.0).sqrt();
            let (found_percent, flipped_percent) = (percent(changes.mean_square()), percent(square));
            return Err(RecordingError::Signs { step: n + 1, flipped, found_percent, flipped_percent });
        }
        Ok(())
    }
}

/// Sums over pairs of neighbouring voxels.
#[derive(Default)]
struct VolumeChanges {
    num_pairs: f64,
    /// Products of J − 1 with the signs as they are.
    as_stored: f64,
    /// The same with other signs.
    flipped: [f64; 3],
    /// By how much these are less, and the squares of that.
    fall: [f64; 3],
    fall_squared: [f64; 3],
}

impl VolumeChanges {
    fn of(recording: &Recording, displacement: &[[f64; 3]]) -> VolumeChanges {
        let grid = &recording.grid;
        let strides = [1, grid.shape[0], grid.shape[0] * grid.shape[1]];
        let mut sums = VolumeChanges::default();
        for v in (0..grid.num_voxels()).filter(|v| recording.mask[*v]) {
            let Some(here) = volume_changes(recording, displacement, v) else { continue };
            let place = grid.indices(v);
            for axis in (0..3).filter(|a| place[*a] + 1 < grid.shape[*a]) {
                if let Some(there) = volume_changes(recording, displacement, v + strides[axis]) {
                    sums.add(here, there);
                }
            }
        }
        sums
    }

    fn add(&mut self, here: [f64; 4], there: [f64; 4]) {
        let [stored, flipped @ ..]: [f64; 4] =
            std::array::from_fn(|i| (here[i] * there[i]).clamp(-LARGEST_PRODUCT, LARGEST_PRODUCT));
        self.num_pairs += 1.0;
        self.as_stored += stored;
        for (i, product) in flipped.into_iter().enumerate() {
            self.flipped[i] += product;
            self.fall[i] += stored - product;
            self.fall_squared[i] += (stored - product).powi(2);
        }
    }

    fn mean_square(&self) -> f64 {
        self.as_stored / self.num_pairs
    }

    /// Which signs explain the volume best, if far better than those that are there, with their mean square of J − 1.
    fn better_signs(&self) -> Option<(FlippedComponents, f64)> {
        let means = FlippedComponents::ALL.into_iter().enumerate().map(|(i, flipped)| {
            let fall = self.fall[i] / self.num_pairs;
            let variance = self.fall_squared[i] / self.num_pairs - fall * fall;
            let sd = (variance * NUM_PAIRS_PER_VOXEL / self.num_pairs).sqrt();
            (flipped, self.flipped[i] / self.num_pairs, fall > EVIDENCE * sd)
        });
        let (flipped, square, is_evident) = means.min_by(|a, b| a.1.total_cmp(&b.1))?;
        (is_evident && square < FALL * self.mean_square()).then_some((flipped, square))
    }
}

/// J − 1 at a voxel by central differences, with the signs as they are and with the other ones; `None` next to a voxel
/// without a displacement.
fn volume_changes(recording: &Recording, displacement: &[[f64; 3]], voxel: usize) -> Option<[f64; 4]> {
    let grid = &recording.grid;
    let place = grid.indices(voxel);
    let strides = [1, grid.shape[0], grid.shape[0] * grid.shape[1]];
    let measured = |v: usize| {
        let u = displacement[v];
        (recording.mask[v] && u.iter().all(|u| u.is_finite())).then_some(u)
    };
    let mut gradient = [[0.0; 3]; 3];
    for axis in 0..3 {
        if place[axis] == 0 || place[axis] + 1 == grid.shape[axis] {
            return None;
        }
        let (before, after) = (measured(voxel - strides[axis])?, measured(voxel + strides[axis])?);
        for c in 0..3 {
            gradient[c][axis] = (after[c] - before[c]) / (2.0 * grid.voxel_mm[axis]);
        }
    }
    let change = |signs: [f64; 3]| {
        let f: Tensor = std::array::from_fn(|c| {
            std::array::from_fn(|axis| signs[c] * gradient[c][axis] + f64::from(u8::from(c == axis)))
        });
        determinant(&f) - 1.0
    };
    let [y, z, both] = FlippedComponents::ALL.map(|flipped| change(flipped.signs()));
    Some([change([1.0; 3]), y, z, both])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{Filter, RecordedStep};
    use crate::specimen::Specimen;
    use crate::voxel::VoxelGrid;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A bar pulled by a fifth of its length that keeps its volume, with noise of which J − 1 is as large as what a
    /// wrong sign makes of it, times `signs`.
    fn pulled(signs: [f64; 3]) -> Result<(), RecordingError> {
        let specimen = Specimen::from_json(include_str!("../../geometries/uniaxial-bar.json")).expect("a specimen");
        let grid = VoxelGrid::covering(&specimen, [1.0; 3]).expect("a grid");
        let thinner = 1.2f64.powf(-0.5) - 1.0;
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let displacement = (0..grid.num_voxels())
            .map(|v| {
                let x = grid.center_mm(v);
                std::array::from_fn(|c| signs[c] * ([0.2, thinner, thinner][c] * x[c] + rng.random_range(-0.15..0.15)))
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
        recording.check_signs()
    }

    #[test]
    fn flipped_signs_across_the_drive_are_named() {
        pulled([1.0; 3]).expect("as it should be");
        for flipped in FlippedComponents::ALL {
            match pulled(flipped.signs()) {
                Err(RecordingError::Signs { step: 1, flipped: found, found_percent, flipped_percent }) => {
                    assert_eq!(found, flipped);
                    assert!(found_percent > 15.0 && flipped_percent < 3.0, "{found_percent} {flipped_percent}");
                }
                other => panic!("{flipped:?}: {other:?}"),
            }
        }
    }
}
