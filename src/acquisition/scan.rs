//! The synthetic scanner.

use super::driven::DrivenSample;
use super::loading::{LoadProgram, loading_history};
use super::{AcquisitionError, Complex, KSpace, signal_images};
use crate::fem::SolveOptions;
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::recording::{RawRecording, RawStep};
use crate::specimen::Specimen;
use crate::voxel::{VoxelGrid, VoxelMask};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;
use utoipa::ToSchema;

/// Settings of a scan.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct ScanOptions {
    /// The images' grid. It should reach beyond the specimen: noise is estimated from the empty voxels.
    pub grid: VoxelGrid,
    /// Displacement per phase of each direction, mm/rad; one turn of the phase is 2π times this.
    pub mm_per_radian: [f64; 3],
    /// Signal-to-noise ratio of each direction's image: magnitude of a full voxel in a uniform field over the standard
    /// deviation of the noise's real (and imaginary) part, before any k-space window.
    pub snr: [f64; 3],
    /// Loss of the edge of k-space, applied to signal and noise.
    pub kspace: Option<KSpace>,
    /// The loading history.
    pub load: LoadProgram,
    /// Seed of all noise.
    pub seed: u64,
    /// Which kind of the specimen's samples is scanned, from 0. The force of all samples is in the recording of the
    /// first kind alone, so that it counts once where several are compared together.
    #[serde(skip_serializing_if = "is_first")]
    pub sample: usize,
}

fn is_first(sample: &usize) -> bool {
    *sample == 0
}

impl ScanOptions {
    /// The grid of [`VoxelGrid::covering`], with `margin` more voxels on every side, moved by `offset` (in voxels).
    ///
    /// # Errors
    /// [`AcquisitionError::Voxel`], [`AcquisitionError::Value`] for an offset that is not finite or above one.
    pub fn grid_around(
        specimen: &Specimen,
        voxel_mm: [f64; 3],
        margin: usize,
        offset: [f64; 3],
    ) -> Result<VoxelGrid, AcquisitionError> {
        for value in offset {
            if !(value.abs() <= 1.0) {
                let requirement = "from -1 to 1 voxels";
                return Err(AcquisitionError::Value { name: "the grid's offset", value, requirement });
            }
        }
        let inner = VoxelGrid::covering(specimen, voxel_mm)?;
        let origin = [0, 1, 2].map(|a| inner.origin_mm[a] + (offset[a] - margin as f64) * voxel_mm[a]);
        let shape = inner.shape.map(|n| n.saturating_add(2 * margin));
        Ok(VoxelGrid::new(origin, voxel_mm, shape)?)
    }

    fn check(&self) -> Result<(), AcquisitionError> {
        for value in self.snr {
            if !(value.is_finite() && value > 0.0) {
                return Err(AcquisitionError::Value { name: "snr", value, requirement: "positive and finite" });
            }
        }
        self.kspace.map_or(Ok(()), |k| k.check())
    }
}

/// A scan and what it was made from.
#[derive(Clone, Debug)]
pub struct Scan {
    /// What the scanner and the load cell give.
    pub raw: RawRecording,
    /// The mask: voxels at least half filled.
    pub mask: VoxelMask,
    /// Voxel averages of the displacement that was scanned, mm, per drive in the mask's order. Not known in an
    /// experiment.
    pub truth: Vec<Vec<[f64; 3]>>,
    /// Forces without noise, N.
    pub forces_n: Vec<f64>,
    /// Unknowns of the forward solution.
    pub num_unknowns: usize,
}

/// Solves `material` at the specimen's drives on a mesh of its own and scans the result. The recording's specimen lists
/// the sample that is scanned first.
///
/// # Errors
/// [`AcquisitionError`].
pub fn scan(
    id: &str,
    specimen: &Specimen,
    material: &Material,
    mesh: &MeshOptions,
    solve: &SolveOptions,
    options: &ScanOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Scan, AcquisitionError> {
    options.check()?;
    let driven = DrivenSample::new(specimen, options.sample, material, mesh, solve, &options.grid, is_cancelled)?;
    let DrivenSample { sample, recorded, model, path, mask, truth, forces_n, force } = driven;
    let states: Vec<&[[f64; 3]]> = path.iter().map(|state| &state.displacement[..]).collect();
    let images = signal_images(&sample, model.mesh(), &states, &options.grid, options.mm_per_radian, is_cancelled)?;
    let has_force = options.sample == 0;
    let (load, windows) = loading_history(&specimen.drive_mm, &force, &options.load, options.seed)?;
    let mut steps = Vec::with_capacity(images.len());
    for (n, signal) in images.into_iter().enumerate() {
        let (phase, magnitude) = noisy_images(signal, options, n as u64);
        steps.push(RawStep {
            drive_mm: specimen.drive_mm[n],
            force_n: load.mean_force_n(windows[n]).filter(|_| has_force),
            force_sd_n: (has_force && options.load.drift_sd_n > 0.0).then_some(options.load.drift_sd_n),
            window_s: Some(windows[n]),
            phase,
            magnitude,
            mm_per_radian: options.mm_per_radian,
        });
    }
    let factor = options.kspace.map_or(1.0, |k| k.noise_factor(options.grid.shape));
    let raw = RawRecording {
        id: id.into(),
        specimen: recorded,
        grid: options.grid.clone(),
        mask: mask.spread(&vec![true; mask.num_voxels()], false),
        steps,
        noise_sd_mm: Some([0, 1, 2].map(|a| factor * options.mm_per_radian[a] / options.snr[a])),
        load: has_force.then_some(load),
        notes: None,
    };
    Ok(Scan { raw, mask, truth, forces_n, num_unknowns: model.num_unknowns() })
}

/// Adds noise to the three images of drive `step`, applies the k-space window, and keeps what the format keeps: the
/// wrapped phase of each direction and the mean of the three magnitudes. The same seed and step give the same numbers.
pub fn noisy_images(mut signal: [Vec<Complex>; 3], options: &ScanOptions, step: u64) -> ([Vec<f64>; 3], Vec<f64>) {
    for (axis, image) in signal.iter_mut().enumerate() {
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        // Samples have noise of their own.
        rng.set_stream(3 * step + axis as u64 + ((options.sample as u64) << 32));
        let sd = 1.0 / options.snr[axis];
        for value in image.iter_mut() {
            let re: f64 = StandardNormal.sample(&mut rng);
            let im: f64 = StandardNormal.sample(&mut rng);
            *value += Complex::new(sd * re, sd * im);
        }
        if let Some(kspace) = &options.kspace {
            kspace.apply(image, options.grid.shape);
        }
    }
    let magnitude = (0..signal[0].len()).map(|v| signal.iter().map(|i| i[v].norm()).sum::<f64>() / 3.0).collect();
    (signal.map(|image| image.iter().map(|c| c.arg()).collect()), magnitude)
}
