//! A recording made ready for comparison with a model: its voxels, its noise, and the operator that sees a model as the
//! scan saw the sample.

use super::error::CalibrationError;
use super::force_readings::{ForceOnTheWay, LoadCell, ObservedForce};
use super::noise::estimate_noise_sd_mm;
use super::noise_map::relative_noise;
use super::outliers::{lost_voxels, outlying_voxels};
use crate::fem::{VectorField, turned_by};
use crate::mesh::{BlockShape, Mesh, half_extents_mm};
use crate::recording::{Filter, Recording};
use crate::specimen::Specimen;
use crate::voxel::{HammingFilter, Sampling, VoxelGrid, VoxelMask, VoxelOperator, unbounded_where_unmeasured};

/// Least filled part of a voxel that is compared: the average over a sliver is that of a place on the wall, where the
/// made sample may differ from the drawing.
const LEAST_FRACTION: f64 = 0.3;

/// One drive of an [`Observed`] recording.
#[derive(Clone, Debug)]
pub struct ObservedStep {
    /// Commanded drive, mm.
    pub drive_mm: f64,
    /// The force, where it was recorded.
    pub force: Option<ObservedForce>,
    /// u of the compared voxels, mm, in the mask's order; NaN where missing. Components that cameras do not measure
    /// have no weight, and what stands there does not count.
    pub displacement: Vec<[f64; 3]>,
    /// The noise of each of them in multiples of [`Observed::noise_sd_mm`], in the mask's order; `None` where it is
    /// alike everywhere, as that of cameras is taken to be.
    pub relative_noise: Option<Vec<[f64; 3]>>,
    /// What was measured of the fixed and the moved face and is imposed there, beyond the nominal motion of their
    /// plates, per mm of drive. None where plates are taken to move as they were told.
    pub faces_per_mm: [Option<VectorField>; 2],
}

/// A recording made ready for comparison.
#[derive(Clone, Debug)]
pub struct Observed {
    /// The specimen as drawn.
    pub specimen: Specimen,
    /// The voxels compared.
    pub mask: VoxelMask,
    /// One per drive.
    pub steps: Vec<ObservedStep>,
    /// Forces read at other drives, where nothing was scanned.
    pub on_the_way: Vec<ForceOnTheWay>,
    /// What is unknown of the load cell.
    pub load_cell: LoadCell,
    /// Noise of a value as given or estimated, per component, mm: that of a typical voxel, where it differs from place
    /// to place. Infinite of a component that cameras do not measure.
    pub noise_sd_mm: [f64; 3],
    /// Whether the noise was estimated because the recording does not state it.
    pub is_noise_estimated: bool,
    /// The filter that the values went through.
    pub filter: Filter,
    /// Voxels that the recording marks but that the specimen as drawn (nearly) does not fill: not compared.
    pub num_outside: usize,
    /// Most voxels of a step that agree with hardly any of their neighbours: they hold no displacement and are taken as
    /// missing.
    pub num_outliers: usize,
    /// Marks of the compared voxels on the grid.
    flags: Vec<bool>,
}

impl Observed {
    /// Prepares `recording`. Forces without a standard deviation get `force_sd_n`.
    ///
    /// # Errors
    /// [`CalibrationError::Voxel`] where the recording's mask and the specimen do not overlap.
    pub fn new(recording: &Recording, force_sd_n: f64) -> Result<Observed, CalibrationError> {
        let specimen = recording.specimen.clone();
        let mask = match recording.filter {
            Filter::None => VoxelMask::from_flags(&specimen, recording.grid.clone(), &recording.mask, LEAST_FRACTION)?,
            Filter::Hamming2 => {
                let (_, filter) = HammingFilter::for_recording(&specimen, recording.grid.clone(), &recording.mask)?;
                filter.mask().clone()
            }
        };
        let flags = mask.spread(&vec![true; mask.num_voxels()], false);
        let stated_sd_mm = recording.noise_sd_mm.map(|sd| unbounded_where_unmeasured(recording.grid.measured(), sd));
        let cleaned: Vec<Cleaned> = recording
            .steps
            .iter()
            .map(|s| Cleaned::of(&recording.grid, &flags, &s.displacement, stated_sd_mm))
            .collect();
        let num_outliers = cleaned.iter().map(|c| c.num_outliers).max().unwrap_or(0);
        let steps: Vec<ObservedStep> = recording
            .steps
            .iter()
            .zip(&cleaned)
            .map(|(step, cleaned)| ObservedStep {
                drive_mm: step.drive_mm,
                force: step
                    .force_n
                    .map(|value_n| ObservedForce { value_n, sd_n: step.force_sd_n.unwrap_or(force_sd_n) }),
                displacement: mask.voxels.iter().map(|&v| cleaned.field[v as usize]).collect(),
                relative_noise: Some(&recording.grid)
                    .filter(|grid| grid.surface.is_none())
                    .and_then(|grid| relative_noise(grid, &flags, &cleaned.field, stated_sd_mm))
                    .map(|all| mask.voxels.iter().map(|&v| all[v as usize]).collect()),
                faces_per_mm: [None, None],
            })
            .collect();
        let noise_sd_mm = match stated_sd_mm {
            Some(sd) => sd,
            None => {
                let fields: Vec<&[[f64; 3]]> = cleaned.iter().map(|c| &c.field[..]).collect();
                estimate_noise_sd_mm(&recording.grid, &flags, &fields, recording.filter)?
            }
        };
        Ok(Observed {
            num_outside: recording.num_voxels() - mask.num_voxels(),
            num_outliers,
            is_noise_estimated: recording.noise_sd_mm.is_none(),
            filter: recording.filter,
            specimen,
            mask,
            steps,
            on_the_way: Vec::new(),
            load_cell: LoadCell::default(),
            noise_sd_mm,
            flags,
        })
    }

    /// Variance of the noise of a value, per component, mm²: voxel `voxel` of the mask at step `step`.
    pub fn noise_mm2(&self, step: usize, voxel: usize) -> [f64; 3] {
        let relative = self.steps[step].relative_noise.as_ref().map_or([1.0; 3], |all| all[voxel]);
        [0, 1, 2].map(|c| (relative[c] * self.noise_sd_mm[c]).powi(2))
    }

    /// How far the noise differs over the image, per component: the multiples of the typical noise that a tenth and
    /// nine tenths of all values stay below. `None` where the two differ by less than a hundredth: a mean of scans of
    /// which one lacks a voxel is as good as even.
    pub fn noise_range(&self) -> Option<[[f64; 2]; 3]> {
        let varying: Vec<&[f64; 3]> = self.steps.iter().filter_map(|s| s.relative_noise.as_ref()).flatten().collect();
        let of_component = |c: usize| {
            let mut all: Vec<f64> = varying.iter().map(|relative| relative[c]).collect();
            all.sort_by(f64::total_cmp);
            [0.1, 0.9].map(|part| all[((all.len() - 1) as f64 * part).round() as usize])
        };
        let range = (!varying.is_empty()).then(|| [0, 1, 2].map(of_component));
        range.filter(|all| all.iter().any(|[least, most]| *most > 1.01 * least))
    }

    /// Whether the volume was scanned, as `what` needs.
    ///
    /// # Errors
    /// [`CalibrationError::NeedsVolume`] where cameras measured a face.
    pub fn check_volume(&self, what: &'static str) -> Result<(), CalibrationError> {
        match self.mask.grid.surface {
            None => Ok(()),
            Some(surface) => Err(CalibrationError::NeedsVolume { what, face: surface.face.name() }),
        }
    }

    /// The same recording with other steps.
    pub(super) fn with_steps(&self, steps: Vec<ObservedStep>) -> Observed {
        Observed { steps, ..self.clone() }
    }

    /// The same recording of another specimen with the voxels that `flags` (in the grid's order) mark; without steps.
    ///
    /// # Errors
    /// [`CalibrationError::Voxel`] where the specimen fills none of them.
    pub(super) fn with_mask(&self, specimen: Specimen, flags: &[bool]) -> Result<Observed, CalibrationError> {
        let mask = VoxelMask::from_flags(&specimen, self.mask.grid.clone(), flags, LEAST_FRACTION)?;
        let flags = mask.spread(&vec![true; mask.num_voxels()], false);
        Ok(Observed { specimen, mask, flags, steps: Vec::new(), ..self.clone() })
    }

    /// Takes as missing what lies within `margin_mm` of the ends x = ±length/2 of a sheared block. The bonded edges end
    /// there: strains are singular, so meshes and glue lines differ most. Returns how many voxels are left.
    pub fn leave_out_ends(&mut self, margin_mm: f64) -> usize {
        let limit = 0.5 * self.specimen.block.length_mm - margin_mm;
        let is_left: Vec<bool> =
            self.mask.voxels.iter().map(|&v| self.mask.grid.center_mm(v as usize)[0].abs() <= limit).collect();
        for step in &mut self.steps {
            for (u, _) in step.displacement.iter_mut().zip(&is_left).filter(|(_, is_left)| !**is_left) {
                *u = [f64::NAN; 3];
            }
        }
        is_left.iter().filter(|is_left| **is_left).count()
    }

    /// How many neighbouring values carry the same noise: 1 without a filter, 8 for `hamming2` (the sum of the noise's
    /// correlations with all neighbours, (½ + 1 + ½)³). For fields smoother than the filter, a sum of n values knows as
    /// much as n / this independent ones.
    pub fn noise_correlation(&self) -> f64 {
        match self.filter {
            Filter::None => 1.0,
            Filter::Hamming2 => 8.0,
        }
    }

    /// How the scan sees a field on `mesh`, a mesh of `specimen`: the nominal one or one with other holes.
    ///
    /// # Errors
    /// [`CalibrationError::Voxel`].
    pub fn view(&self, specimen: &Specimen, mesh: &Mesh) -> Result<View, CalibrationError> {
        self.placed_view(specimen, mesh, &Placing::default())
    }

    /// As [`Self::view`] of a sample that is not where, or not the block, that the image's header and the drawing say.
    /// `mesh` is that of the drawing (with its holes as made).
    ///
    /// # Errors
    /// As [`Self::view`].
    pub fn placed_view(&self, specimen: &Specimen, mesh: &Mesh, placing: &Placing) -> Result<View, CalibrationError> {
        let mut grid = self.mask.grid.clone();
        for (origin, shift) in grid.origin_mm.iter_mut().zip(placing.shift_mm) {
            *origin += shift;
        }
        // Whatever part of a compared voxel the specimen still fills is what the scan averages over.
        let least = 1e-3;
        let (acquired, filter) = match self.filter {
            Filter::None => (VoxelMask::from_flags(specimen, grid, &self.flags, least)?, None),
            Filter::Hamming2 => {
                let (acquired, filter) = HammingFilter::for_recording(specimen, grid, &self.flags)?;
                (acquired, Some(filter))
            }
        };
        let seen = filter.as_ref().map_or(&acquired, |f| f.mask());
        let places: Vec<u32> = (0..seen.num_voxels() as u32).collect();
        let place_of = seen.spread(&places, u32::MAX);
        let places = self.mask.voxels.iter().map(|&v| place_of[v as usize]).collect();
        let operator = if placing.turns_or_reshapes() {
            let place = placing.map_of(specimen);
            VoxelOperator::placed(specimen, mesh, &acquired, Sampling::default(), &place)?
        } else {
            VoxelOperator::new(specimen, mesh, &acquired, Sampling::default())?
        };
        Ok(View { operator, filter, places })
    }
}

/// A displacement field without the voxels that hold none.
struct Cleaned {
    field: Vec<[f64; 3]>,
    num_outliers: usize,
}

impl Cleaned {
    fn of(grid: &VoxelGrid, flags: &[bool], field: &[[f64; 3]], noise_sd_mm: Option<[f64; 3]>) -> Cleaned {
        let mut field = field.to_vec();
        grid.fill_unmeasured(&mut field, 0.0);
        let outliers = outlying_voxels(grid, flags, &field, noise_sd_mm);
        for &v in &outliers {
            field[v] = [f64::NAN; 3];
        }
        // No coil's signal fades over a face, and at the ends of a bonded edge its displacement is rough along both
        // axes.
        let lost = if grid.surface.is_none() { lost_voxels(grid, flags, &field, noise_sd_mm) } else { Vec::new() };
        for &v in &lost {
            field[v] = [f64::NAN; 3];
        }
        Cleaned { field, num_outliers: outliers.len() + lost.len() }
    }
}

/// Where a sample lies in the image, and which block it is: the image shows at x what the sample, as drawn and unmoved,
/// has at R x + s, with a rotation R about the origin and a shift s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Placing {
    /// s, mm.
    pub shift_mm: [f64; 3],
    /// The vector of the rotation R, rad.
    pub rotation_rad: [f64; 3],
    /// How far the block's faces lie off the drawing.
    pub shape: BlockShape,
}

impl Placing {
    fn turns_or_reshapes(&self) -> bool {
        self.rotation_rad.iter().any(|w| w.abs() > 0.0) || !self.shape.is_nominal()
    }

    /// The map from x of the shifted image to the point of the drawn block that is seen there, and its derivatives with
    /// respect to the point R x + s of the made block.
    fn map_of(&self, specimen: &Specimen) -> impl Fn([f64; 3]) -> ([f64; 3], [[f64; 3]; 3]) + Sync {
        let (shift_mm, rotation_rad) = (self.shift_mm, self.rotation_rad);
        let inverse = self.shape.inverse(half_extents_mm(specimen));
        // Columns of the rotation: it is the same for all points.
        let turned = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|e| turned_by(rotation_rad, e));
        move |x| {
            let mut at = shift_mm;
            for i in 0..3 {
                for j in 0..3 {
                    at[i] += turned[j][i] * (x[j] - shift_mm[j]);
                }
            }
            inverse.point_of(at)
        }
    }
}

/// How the scan sees a nodal field of one mesh.
#[derive(Clone, Debug)]
pub struct View {
    operator: VoxelOperator,
    filter: Option<HammingFilter>,
    /// Place of each compared voxel among those seen; `u32::MAX` where the specimen does not fill it.
    places: Vec<u32>,
}

impl View {
    /// Voxel averages (filtered as the data were) of a nodal field, in the order of the compared voxels; NaN where the
    /// mesh's specimen has no material.
    ///
    /// # Errors
    /// [`CalibrationError::Voxel`] where `field` is not of the mesh.
    pub fn average(&self, field: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, CalibrationError> {
        let values = self.operator.average(field)?;
        let values = match &self.filter {
            Some(filter) => filter.apply(&values)?,
            None => values,
        };
        Ok(self.places.iter().map(|&p| values.get(p as usize).copied().unwrap_or([f64::NAN; 3])).collect())
    }

    /// The transpose of [`Self::average`]: from weights of the compared voxels to every node. For adjoint loads.
    ///
    /// # Errors
    /// [`CalibrationError::Voxel`] where `weights` are not of the compared voxels.
    pub fn average_transposed(&self, weights: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, CalibrationError> {
        Ok(self.operator.average_transposed(&self.on_acquired(weights)?)?)
    }

    /// Weights of the compared voxels carried back through the filter to the acquired voxels.
    ///
    /// # Errors
    /// [`CalibrationError::DataLength`].
    pub fn on_acquired(&self, weights: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, CalibrationError> {
        if weights.len() != self.places.len() {
            let (found, expected) = (weights.len(), self.places.len());
            return Err(CalibrationError::DataLength { what: "list of voxel weights", found, expected });
        }
        let num_seen = self.filter.as_ref().map_or(self.operator.num_voxels(), |f| f.mask().num_voxels());
        let mut seen = vec![[0.0; 3]; num_seen];
        for (weight, &place) in weights.iter().zip(&self.places) {
            if let Some(seen) = seen.get_mut(place as usize) {
                *seen = *weight;
            }
        }
        match &self.filter {
            Some(filter) => Ok(filter.apply_transposed(&seen)?),
            None => Ok(seen),
        }
    }

    /// How many acquired voxels each compared value is the mean of; one without a filter.
    pub fn num_averaged(&self) -> Vec<usize> {
        match &self.filter {
            Some(filter) => {
                let counts = filter.num_averaged();
                self.places.iter().map(|&p| counts.get(p as usize).copied().unwrap_or(1)).collect()
            }
            None => vec![1; self.places.len()],
        }
    }

    /// Whether the data went through a filter.
    pub fn is_filtered(&self) -> bool {
        self.filter.is_some()
    }

    /// Number of nodes of the mesh.
    pub fn num_nodes(&self) -> usize {
        self.operator.num_nodes()
    }

    /// Voxel averages of ∂u_i/∂X_j (row i), likewise.
    ///
    /// # Errors
    /// As [`Self::average`].
    pub fn gradients(&self, field: &[[f64; 3]]) -> Result<Vec<[[f64; 3]; 3]>, CalibrationError> {
        let mut f = self.operator.average_gradient(field)?;
        if let Some(filter) = &self.filter {
            let flat: Vec<[f64; 9]> = f.iter().map(|g| std::array::from_fn(|n| g[n / 3][n % 3])).collect();
            f = filter.apply(&flat)?.iter().map(|g| [0, 1, 2].map(|i| [0, 1, 2].map(|j| g[3 * i + j]))).collect();
        }
        Ok(self.places.iter().map(|&p| f.get(p as usize).copied().unwrap_or([[f64::NAN; 3]; 3])).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_problem::{block, coarse, same_mesh, truth};
    use super::*;

    /// A linear field: whole voxels see its slope times the shift, voxels that leave the sample see what is left of
    /// them.
    #[test]
    fn shifted_voxels_see_what_lies_there() {
        let specimen = block();
        let (_, synthetic) = same_mesh(&truth());
        let recording = synthetic.recording("shift", &specimen, synthetic.noiseless(), Filter::None).unwrap();
        let observed = Observed::new(&recording, 0.01).unwrap();
        let mesh = crate::mesh::mesh_specimen(&specimen, &coarse(&specimen)).unwrap();
        let field: Vec<[f64; 3]> =
            mesh.nodes.iter().map(|x| [0.3 * x[0] + 0.1 * x[1], 0.2 * x[1], -0.4 * x[2]]).collect();
        let shift = [0.21, -0.13, 0.17];
        let plain = observed.view(&specimen, &mesh).unwrap().average(&field).unwrap();
        let moved = observed
            .placed_view(&specimen, &mesh, &Placing { shift_mm: shift, ..Placing::default() })
            .unwrap()
            .average(&field)
            .unwrap();
        let expected = [0.3 * shift[0] + 0.1 * shift[1], 0.2 * shift[1], -0.4 * shift[2]];
        let half = [0.5 * specimen.block.length_mm, 0.5 * specimen.block.thickness_mm, 0.5 * specimen.block.width_mm];
        let mut num_inside = 0;
        for ((a, b), &voxel) in moved.iter().zip(&plain).zip(&observed.mask.voxels) {
            let x = observed.mask.grid.center_mm(voxel as usize);
            // Half a voxel (1 × 0.5 × 1 mm) and the shift away from every face; the drawn half of a mirrored sample.
            if (0..3).all(|i| x[i].abs() < half[i] - 0.8) && (0..3).all(|i| a[i].is_finite()) {
                num_inside += 1;
                for i in 0..3 {
                    // Rounding: averages of linear fields are exact.
                    assert!((a[i] - b[i] - expected[i]).abs() < 1e-9, "{x:?} {a:?} {b:?}");
                }
            }
        }
        assert!(num_inside > 100, "{num_inside}");
    }
}
