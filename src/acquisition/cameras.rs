//! Synthetic cameras: displacements of a face as digital image correlation gives them.
//!
//! Of every subset the mean displacement over its square on the reference surface is seen, in the components that are
//! measured, with independent Gaussian noise. How pictures are correlated is not modelled: subsets that overlap share
//! noise, and these do not overlap.

use super::driven::DrivenSample;
use super::{AcquisitionError, LoadProgram, loading_history};
use crate::fem::SolveOptions;
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::recording::{Filter, RecordedStep, Recording};
use crate::specimen::Specimen;
use crate::voxel::{VoxelGrid, VoxelMask, unbounded_where_unmeasured};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;
use utoipa::ToSchema;

/// Settings of cameras.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct CameraOptions {
    /// The subsets: a grid of a surface ([`VoxelGrid::planned`]).
    pub grid: VoxelGrid,
    /// Noise of a subset's displacement along x, y, z, mm; that of a component that is not measured is not used.
    pub noise_sd_mm: [f64; 3],
    /// The loading history.
    pub load: LoadProgram,
    /// Seed of all noise.
    pub seed: u64,
    /// Which kind of the specimen's samples is seen, from 0. The force of all samples is in the recording of the first
    /// kind alone, so that it counts once where several are compared together.
    #[serde(skip_serializing_if = "is_first")]
    pub sample: usize,
}

fn is_first(sample: &usize) -> bool {
    *sample == 0
}

impl CameraOptions {
    fn check(&self) -> Result<(), AcquisitionError> {
        for (value, is_measured) in self.noise_sd_mm.into_iter().zip(self.grid.measured()) {
            if is_measured && !(value.is_finite() && value > 0.0) {
                let requirement = "positive and finite";
                return Err(AcquisitionError::Value { name: "noise_sd_mm", value, requirement });
            }
        }
        Ok(())
    }
}

/// What cameras gave and what it was made from.
#[derive(Clone, Debug)]
pub struct Filmed {
    /// The recording.
    pub recording: Recording,
    /// The subsets at least half filled.
    pub mask: VoxelMask,
    /// Means of the displacement that was seen, mm, per drive in the mask's order. Not known in an experiment.
    pub truth: Vec<Vec<[f64; 3]>>,
    /// Forces without noise, N.
    pub forces_n: Vec<f64>,
    /// Unknowns of the forward solution.
    pub num_unknowns: usize,
}

/// Solves `material` at the specimen's drives on a mesh of its own and films the face of `options`. The recording's
/// specimen lists the sample that is seen first.
///
/// # Errors
/// [`AcquisitionError`].
pub fn film(
    id: &str,
    specimen: &Specimen,
    material: &Material,
    mesh: &MeshOptions,
    solve: &SolveOptions,
    options: &CameraOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Filmed, AcquisitionError> {
    options.check()?;
    let driven = DrivenSample::new(specimen, options.sample, material, mesh, solve, &options.grid, is_cancelled)?;
    let (mask, truth) = (driven.mask, driven.truth);
    let has_force = options.sample == 0;
    let (load, windows) = loading_history(&specimen.drive_mm, &driven.force, &options.load, options.seed)?;
    let steps = truth.iter().zip(&specimen.drive_mm).zip(&windows).enumerate();
    let steps = steps.map(|(n, ((seen, &drive_mm), &window))| RecordedStep {
        drive_mm,
        force_n: load.mean_force_n(window).filter(|_| has_force),
        force_sd_n: (has_force && options.load.drift_sd_n > 0.0).then_some(options.load.drift_sd_n),
        window_s: Some(window),
        displacement: noisy(&mask, seen, options, n as u64),
    });
    let recording = Recording {
        id: id.into(),
        specimen: driven.recorded,
        grid: options.grid.clone(),
        mask: mask.spread(&vec![true; mask.num_voxels()], false),
        steps: steps.collect(),
        noise_sd_mm: Some(unbounded_where_unmeasured(options.grid.measured(), options.noise_sd_mm)),
        filter: Filter::None,
        load: has_force.then_some(load),
        notes: None,
    };
    Ok(Filmed { recording, mask, truth, forces_n: driven.forces_n, num_unknowns: driven.model.num_unknowns() })
}

/// What is measured of `seen` at drive `step`, with noise, on the grid. The same seed and step give the same numbers.
fn noisy(mask: &VoxelMask, seen: &[[f64; 3]], options: &CameraOptions, step: u64) -> Vec<[f64; 3]> {
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    // Samples have noise of their own.
    rng.set_stream(step + ((options.sample as u64) << 32));
    let with_noise = |u: &[f64; 3]| {
        let normal = [0; 3].map(|_| -> f64 { StandardNormal.sample(&mut rng) });
        [0, 1, 2].map(|c| u[c] + options.noise_sd_mm[c] * normal[c])
    };
    let measured: Vec<[f64; 3]> = seen.iter().map(with_noise).collect();
    let mut displacement = mask.spread(&measured, [f64::NAN; 3]);
    mask.grid.fill_unmeasured(&mut displacement, f64::NAN);
    displacement
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::voxel::{Face, MeasuredComponents, Surface};

    /// The same seed gives the same recording; its noise is the one that was told, and nothing is seen along the
    /// normal.
    #[test]
    fn cameras_see_a_face_with_noise() {
        let text = include_str!("../../geometries/solid-shear.json");
        let specimen = Specimen { drive_mm: vec![2.0], ..Specimen::from_json(text).expect("a specimen") };
        let material =
            Material::from_json(include_str!("../../geometries/materials/ecoflex-0020.json")).expect("a material");
        let surface = Some(Surface { face: Face::PlusZ, components: MeasuredComponents::InPlane });
        let options = CameraOptions {
            grid: VoxelGrid::planned(&specimen, [0.5; 3], surface).expect("a grid"),
            noise_sd_mm: [0.004, 0.002, 1.0],
            load: LoadProgram::default(),
            seed: 4,
            sample: 0,
        };
        let mesh = MeshOptions::scaled(&specimen, 3.0);
        let run = |options: &CameraOptions| {
            let solve = SolveOptions::default();
            film("filmed", &specimen, &material, &mesh, &solve, options, &|| false).expect("a recording")
        };
        let (one, other) = (run(&options), run(&CameraOptions { seed: 5, ..options.clone() }));
        let values = |f: &Filmed| f.recording.steps[0].displacement.iter().map(|u| [u[0], u[1]]).collect::<Vec<_>>();
        assert_eq!(values(&one), values(&run(&options)));
        assert_ne!(values(&one), values(&other));
        one.recording.check_motion().expect("the motion of the plates");
        assert_eq!(one.recording.noise_sd_mm, Some([0.004, 0.002, f64::INFINITY]));
        assert!(one.recording.steps[0].displacement.iter().all(|u| one.recording.is_complete(u) && u[2].is_nan()));
        let places = one.mask.voxels.iter().map(|&v| one.recording.steps[0].displacement[v as usize]);
        for (c, sd) in [(0, 0.004), (1, 0.002)] {
            let errors = places.clone().zip(&one.truth[0]).map(|(u, t)| (u[c] - t[c]).powi(2));
            let found = (errors.sum::<f64>() / one.mask.num_voxels() as f64).sqrt();
            // 51 × 13 subsets: √(1/(2 n)) = 2.7 %, of which three.
            assert!((found / sd - 1.0).abs() < 0.09, "{c}: {found}");
        }
        let bad = CameraOptions { noise_sd_mm: [0.0, 0.002, 1.0], ..options };
        let solve = SolveOptions::default();
        let error = film("filmed", &specimen, &material, &mesh, &solve, &bad, &|| false).expect_err("no noise");
        assert!(matches!(error, AcquisitionError::Value { .. }), "{error}");
    }
}
