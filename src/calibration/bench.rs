//! The samples of a test as a fit needs them: a model of each kind, and how the scan sees those that are scanned.

use super::error::CalibrationError;
use super::prediction::{Averages, Prediction, Unseen};
use super::stress_path::StressPath;
use crate::fem::{ForwardModel, SolveOptions};
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::specimen::Specimen;
use crate::voxel::{Sampling, VoxelMask, VoxelOperator};

/// Models of the samples that share drive and load cell. Voxels stand block by block, those of the first kind first.
pub struct Bench {
    parts: Vec<(ForwardModel, Option<VoxelOperator>)>,
}

impl Bench {
    /// Of one sample.
    pub fn of_one(model: ForwardModel, operator: VoxelOperator) -> Bench {
        Bench { parts: vec![(model, Some(operator))] }
    }

    /// Of every kind of sample of `specimen`, with the voxels of `masks`, one for each kind; `None` where none is
    /// scanned.
    ///
    /// # Errors
    /// [`CalibrationError`]: a sample cannot be meshed.
    pub fn of_specimen(
        specimen: &Specimen,
        mesh: &MeshOptions,
        masks: &[Option<VoxelMask>],
    ) -> Result<Bench, CalibrationError> {
        let mut parts = Vec::new();
        for (sample, mask) in specimen.samples().iter().zip(masks) {
            let model = ForwardModel::of_specimen(sample, &mesh.carried(specimen, sample))?;
            let operator = match mask {
                Some(mask) => Some(VoxelOperator::new(sample, model.mesh(), mask, Sampling::default())?),
                None => None,
            };
            parts.push((model, operator));
        }
        Ok(Bench { parts })
    }

    /// Voxels of all scanned blocks.
    pub fn num_voxels(&self) -> usize {
        self.parts.iter().filter_map(|(_, operator)| operator.as_ref()).map(VoxelOperator::num_voxels).sum()
    }

    /// What `material` predicts at some drives, mm; `near` is what another one does at the same drives.
    ///
    /// # Errors
    /// [`CalibrationError`].
    pub(super) fn predict(
        &mut self,
        drives_mm: &[f64],
        material: &Material,
        near: Option<&Prediction>,
        solve: &SolveOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Prediction, CalibrationError> {
        let mut all: Option<Prediction> = None;
        for (index, (model, operator)) in self.parts.iter_mut().enumerate() {
            let seen: &dyn Averages = operator.as_ref().map_or(&Unseen, |operator| operator);
            let near = near.and_then(|n| n.states_of(index));
            let own = Prediction::new(model, seen, drives_mm, material, near, solve, is_cancelled)?;
            match &mut all {
                Some(all) => all.join(own),
                None => all = Some(own),
            }
        }
        let name = "the number of samples";
        all.ok_or(CalibrationError::InvalidValue { name, value: 0.0, requirement: "positive" })
    }

    /// What a scan of `material` at a drive (mm) sees without noise, and the force of all samples, N. Solved from rest.
    ///
    /// # Errors
    /// [`CalibrationError`].
    pub(super) fn scan(
        &mut self,
        material: &Material,
        drive_mm: f64,
        solve: &SolveOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<(Vec<[f64; 3]>, f64), CalibrationError> {
        let (mut voxels, mut force_n) = (Vec::new(), 0.0);
        for (model, operator) in &mut self.parts {
            let state = model.solve(material, drive_mm, None, solve, is_cancelled)?;
            force_n += state.force_n;
            if let Some(operator) = operator {
                voxels.extend(operator.average(&state.displacement)?);
            }
        }
        Ok((voxels, force_n))
    }

    /// The states that a prediction visits.
    pub(super) fn stress_path(&self, material: &Material, prediction: &Prediction) -> StressPath {
        let visited = self
            .parts
            .iter()
            .enumerate()
            .filter_map(|(index, (model, _))| Some(StressPath::new(model, material, prediction.states_of(index)?)));
        visited.fold(StressPath::default(), StressPath::join)
    }
}
