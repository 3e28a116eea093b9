//! Synthetic measurements: the truth solved on a mesh of its own, averaged over the scan's voxels, with noise added.

use super::fit::CalibrationError;
use crate::fem::{ForwardModel, SolveOptions};
use crate::material::Ogden;
use crate::mesh::MeshOptions;
use crate::sensitivity::ScanSettings;
use crate::specimen::Specimen;
use crate::voxel::{Sampling, VoxelMask, VoxelOperator};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// What a scan gives: displacements of the mask's voxels and a force, at each drive.
#[derive(Clone, Debug)]
pub struct Measurement {
    /// Drives, mm.
    pub drives_mm: Vec<f64>,
    /// Voxel displacements per drive, mm, in the mask's order.
    pub displacements: Vec<Vec<[f64; 3]>>,
    /// Forces, N.
    pub forces_n: Vec<f64>,
    /// Weight of each voxel (see [`crate::sensitivity::PartialVoxels`]); its noise variance is σ²/weight.
    pub weights: Vec<f64>,
}

/// The noiseless scan of a true material, from which noisy measurements are drawn.
#[derive(Clone, Debug)]
pub struct SyntheticScan {
    /// Voxels measured.
    pub mask: VoxelMask,
    /// Grid and noise.
    pub scan: ScanSettings,
    truth: Measurement,
}

impl SyntheticScan {
    /// Solves `material` on a mesh with `mesh` settings, which should be finer than, and other than, the one used for
    /// fitting.
    ///
    /// # Errors
    /// [`CalibrationError`].
    pub fn new(
        specimen: &Specimen,
        material: &Ogden,
        scan: &ScanSettings,
        mesh: &MeshOptions,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<SyntheticScan, CalibrationError> {
        let mut model = ForwardModel::of_specimen(specimen, mesh)?;
        let mask = VoxelMask::covering(specimen, scan.voxel_mm)?;
        let operator = VoxelOperator::new(specimen, model.mesh(), &mask, Sampling::default())?;
        let path = model.solve_path(material, &specimen.drive_mm, &SolveOptions::default(), is_cancelled)?;
        let displacements =
            path.iter().map(|state| operator.average(&state.displacement)).collect::<Result<Vec<_>, _>>()?;
        let truth = Measurement {
            drives_mm: specimen.drive_mm.clone(),
            displacements,
            forces_n: path.iter().map(|state| state.force_n).collect(),
            weights: scan.partial_voxels.weights(&mask),
        };
        Ok(SyntheticScan { mask, scan: *scan, truth })
    }

    /// The measurement without noise.
    pub fn noiseless(&self) -> &Measurement {
        &self.truth
    }

    /// The measurement with noise; the same `seed` and `draw` give the same numbers.
    pub fn draw(&self, seed: u64, draw: u64) -> Measurement {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(draw);
        let mut normal = |sd: f64| {
            let x: f64 = StandardNormal.sample(&mut rng);
            sd * x
        };
        let mut noisy = self.truth.clone();
        for displacements in &mut noisy.displacements {
            for (u, weight) in displacements.iter_mut().zip(&self.truth.weights) {
                for (value, sd) in u.iter_mut().zip(self.scan.noise_sd_mm) {
                    *value += normal(sd / weight.sqrt());
                }
            }
        }
        for force in &mut noisy.forces_n {
            *force += normal(self.scan.force_sd_n);
        }
        noisy
    }
}
