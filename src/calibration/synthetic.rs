//! Synthetic measurements: the truth solved on a mesh of its own, averaged over the scan's voxels, with noise added.

use super::error::CalibrationError;
use crate::fem::{ForwardModel, SolveOptions};
use crate::material::Ogden;
use crate::mesh::MeshOptions;
use crate::recording::{Filter, RecordedStep, Recording};
use crate::sensitivity::ScanSettings;
use crate::specimen::Specimen;
use crate::voxel::{HammingFilter, Sampling, VoxelMask, VoxelOperator};
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

impl Measurement {
    /// Weights of the voxels at one drive: zero where a component is missing (not finite).
    pub(super) fn weights_of(&self, drive_index: usize) -> Vec<f64> {
        self.displacements[drive_index]
            .iter()
            .zip(&self.weights)
            .map(|(u, w)| if u.iter().all(|x| x.is_finite()) { *w } else { 0.0 })
            .collect()
    }

    /// Checks lengths and numbers. Missing voxels are allowed, missing forces are not.
    ///
    /// # Errors
    /// [`CalibrationError::DataLength`], [`CalibrationError::InvalidValue`].
    pub fn check(&self, num_voxels: usize, num_drives: usize) -> Result<(), CalibrationError> {
        let length = |what, found: usize, expected: usize| {
            if found == expected { Ok(()) } else { Err(CalibrationError::DataLength { what, found, expected }) }
        };
        length("list of drives", self.drives_mm.len(), num_drives.max(1))?;
        length("list of displacement fields", self.displacements.len(), num_drives)?;
        length("list of forces", self.forces_n.len(), num_drives)?;
        length("list of voxel weights", self.weights.len(), num_voxels)?;
        let value = |name, value: f64, is_good: bool, requirement| {
            if is_good { Ok(()) } else { Err(CalibrationError::InvalidValue { name, value, requirement }) }
        };
        for &w in &self.weights {
            value("a voxel weight", w, w.is_finite() && w >= 0.0, "finite and not negative")?;
        }
        for (d, field) in self.displacements.iter().enumerate() {
            length("displacement field", field.len(), num_voxels)?;
            let force = self.forces_n[d];
            value("a force (N)", force, force.is_finite() && force.abs() > 0.0, "finite and not zero")?;
            let num_used = self.weights_of(d).iter().filter(|w| **w > 0.0).count() as f64;
            value("the number of voxels with a displacement", num_used, num_used > 0.0, "positive")?;
        }
        Ok(())
    }
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
    /// Solves `material` at the specimen's drives on a mesh with `mesh` settings, which should be finer than, and other
    /// than, the one used for fitting.
    ///
    /// # Errors
    /// [`CalibrationError`].
    pub fn new(
        specimen: &Specimen,
        material: &Ogden,
        scan: &ScanSettings,
        mesh: &MeshOptions,
        solve: &SolveOptions,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<SyntheticScan, CalibrationError> {
        let mut model = ForwardModel::of_specimen(specimen, mesh)?;
        let mask = VoxelMask::covering(specimen, scan.voxel_mm)?;
        let operator = VoxelOperator::new(specimen, model.mesh(), &mask, Sampling::default())?;
        let path = model.solve_path(material, &specimen.drive_mm, solve, is_cancelled)?;
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

    /// `data` of this scan as a recording of `specimen`, filtered or not. After the filter the noise stated is that of
    /// a mean of eight.
    ///
    /// # Errors
    /// [`CalibrationError::Voxel`] where the filter has nothing to average.
    pub fn recording(
        &self,
        id: &str,
        specimen: &Specimen,
        data: &Measurement,
        filter: Filter,
    ) -> Result<Recording, CalibrationError> {
        let hamming = match filter {
            Filter::None => None,
            Filter::Hamming2 => Some(HammingFilter::new(&self.mask)?),
        };
        let mask = hamming.as_ref().map_or(&self.mask, |f| f.mask());
        let mut steps = Vec::with_capacity(data.drives_mm.len());
        for (d, &drive_mm) in data.drives_mm.iter().enumerate() {
            let values = match &hamming {
                None => data.displacements[d].clone(),
                Some(filter) => filter.apply(&data.displacements[d])?,
            };
            steps.push(RecordedStep {
                drive_mm,
                force_n: Some(data.forces_n[d]),
                force_sd_n: Some(self.scan.force_sd_n),
                window_s: None,
                displacement: mask.spread(&values, [f64::NAN; 3]),
            });
        }
        let noise = self.scan.noise_sd_mm.map(|sd| if hamming.is_some() { sd / 8f64.sqrt() } else { sd });
        Ok(Recording {
            id: id.into(),
            specimen: specimen.clone(),
            grid: mask.grid.clone(),
            mask: mask.spread(&vec![true; mask.num_voxels()], false),
            steps,
            noise_sd_mm: Some(noise),
            filter,
            load: None,
            notes: None,
        })
    }

    /// A standard normal number for draw `draw`, independent of the noise of all draws.
    pub(super) fn prior_draw(seed: u64, draw: u64) -> f64 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        // Streams of the noise count up from zero, these down from the top.
        rng.set_stream(u64::MAX - draw);
        StandardNormal.sample(&mut rng)
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
                    // A voxel without weight is not measured; what stands there does not count.
                    *value += if *weight > 0.0 { normal(sd / weight.sqrt()) } else { 0.0 };
                }
            }
        }
        for force in &mut noisy.forces_n {
            *force += normal(self.scan.force_sd_n);
        }
        noisy
    }
}
