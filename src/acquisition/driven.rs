//! The sample that is recorded, driven to its steps: what scanner, cameras and load cell see without noise.

use super::AcquisitionError;
use crate::fem::{Equilibrium, ForwardModel, SolveOptions};
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::specimen::Specimen;
use crate::voxel::{Sampling, VoxelGrid, VoxelMask, VoxelOperator};

/// One kind of a specimen's samples at all drives, and the force of all samples.
pub(super) struct DrivenSample {
    /// The sample alone.
    pub sample: Specimen,
    /// The specimen with this sample listed first.
    pub recorded: Specimen,
    pub model: ForwardModel,
    /// One per drive.
    pub path: Vec<Equilibrium>,
    /// Voxels at least half filled.
    pub mask: VoxelMask,
    /// Voxel averages of the displacement, mm, per drive in the mask's order.
    pub truth: Vec<Vec<[f64; 3]>>,
    /// N, per drive.
    pub forces_n: Vec<f64>,
}

impl DrivenSample {
    /// Solves `material` at the drives of `specimen`, of which the kind of sample with number `index`, from 0, is
    /// recorded on `grid`.
    ///
    /// # Errors
    /// [`AcquisitionError`].
    pub fn new(
        specimen: &Specimen,
        index: usize,
        material: &Material,
        mesh: &MeshOptions,
        solve: &SolveOptions,
        grid: &VoxelGrid,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<DrivenSample, AcquisitionError> {
        let samples = specimen.samples();
        let (Some(sample), Some(recorded)) = (samples.get(index), specimen.with_first(index)) else {
            let requirement = "the number of a kind of the specimen's samples, from 0";
            return Err(AcquisitionError::Value { name: "the sample", value: index as f64, requirement });
        };
        let mask = VoxelMask::of_specimen(sample, grid.clone())?;
        let mut model = ForwardModel::of_specimen(sample, &mesh.carried(specimen, sample))?;
        let path = model.solve_path(material, &sample.drive_mm, solve, &|| is_cancelled())?;
        let operator = VoxelOperator::new(sample, model.mesh(), &mask, Sampling::default())?;
        let truth = path.iter().map(|state| operator.average(&state.displacement)).collect::<Result<Vec<_>, _>>()?;
        let mut forces_n: Vec<f64> = path.iter().map(|state| state.force_n).collect();
        for (_, other) in samples.iter().enumerate().filter(|(n, _)| *n != index) {
            let mut model = ForwardModel::of_specimen(other, &mesh.carried(specimen, other))?;
            let path = model.solve_path(material, &other.drive_mm, solve, &|| is_cancelled())?;
            forces_n.iter_mut().zip(path).for_each(|(sum, state)| *sum += state.force_n);
        }
        Ok(DrivenSample { sample: sample.clone(), recorded, model, path, mask, truth, forces_n })
    }
}
