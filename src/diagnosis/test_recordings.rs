//! Small synthetic recordings for the tests of single stages: a solid block on a coarse mesh, with a few hundred
//! voxels.

use super::inference::{Inference, KNOWN_LOG_SD};
use super::laboratory::Laboratory;
use super::mesh_error::FINER;
use super::metric::Metric;
use super::options::DiagnosisOptions;
use super::prior::{BulkPrior, FitSettings};
use super::scene::Scene;
use crate::calibration::Observed;
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::recording::{Filter, RecordedStep, Recording};
use crate::specimen::Specimen;
use crate::voxel::VoxelMask;

/// Element size of the diagnosis in these tests, as a factor on the standard one.
pub(super) const MESH_FACTOR: f64 = 4.0;
/// Element size of the finer mesh by which such a diagnosis corrects itself: a recording made on it has no other error
/// of its mesh.
pub(super) const FINER_FACTOR: f64 = FINER * MESH_FACTOR;
/// Standard deviation of the displacement's noise, mm.
pub(super) const NOISE_MM: f64 = 0.01;
/// Drift of the load cell, N.
pub(super) const FORCE_SD_N: f64 = 0.01;

/// Settings for these recordings; their meshes are known, so that little is allowed for.
pub(super) fn options() -> DiagnosisOptions {
    DiagnosisOptions {
        mesh_factor: MESH_FACTOR,
        allowance_mm: Some(0.005),
        force_sd_n: FORCE_SD_N,
        ..DiagnosisOptions::default()
    }
}

/// The material of the recordings.
pub(super) fn material() -> Material {
    Material::from_json(include_str!("../../geometries/materials/ecoflex-0020.json")).unwrap()
}

/// A deterministic number that stands for noise: near Gaussian, of unit variance.
pub(super) struct Noise(pub(super) u64);

impl Noise {
    pub(super) fn next(&mut self) -> f64 {
        // The sum of twelve uniform numbers less six; a linear congruential generator is random enough for a field of
        // noise.
        let mut uniform = || {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }
}

/// A noisy recording of `scene` in `material` at 2 and 4 mm, made on a mesh of `mesh_factor`.
pub(super) fn recorded(material: &Material, scene: &Scene, mesh_factor: f64) -> Recording {
    let mut specimen = Specimen::from_json(include_str!("../../geometries/solid-shear.json")).unwrap();
    specimen.drive_mm = vec![2.0, 4.0];
    let mask = VoxelMask::covering(&specimen, [2.5, 0.8, 2.5]).unwrap();
    let empty = |drive_mm: f64| RecordedStep {
        drive_mm,
        // About what this block takes; a load train gives by it.
        force_n: Some(2.0 * drive_mm),
        force_sd_n: Some(FORCE_SD_N),
        window_s: None,
        displacement: vec![[0.0; 3]; mask.grid.num_voxels()],
    };
    let mut recording = Recording {
        id: "small".into(),
        steps: specimen.drive_mm.iter().map(|d| empty(*d)).collect(),
        specimen,
        grid: mask.grid.clone(),
        mask: mask.spread(&vec![true; mask.num_voxels()], false),
        noise_sd_mm: Some([NOISE_MM; 3]),
        filter: Filter::None,
        load: None,
        notes: None,
    };
    let observed = Observed::new(&recording, FORCE_SD_N).unwrap();
    let mesh = MeshOptions::scaled(&observed.specimen, mesh_factor);
    let prediction = Laboratory::new(&observed, &mesh).unwrap().predict(material, scene, &|| false).unwrap();
    let mut noise = Noise(1);
    for (n, step) in recording.steps.iter_mut().enumerate() {
        let field = &prediction.trace.displacement[n];
        let noisy: Vec<[f64; 3]> = field.iter().map(|u| u.map(|x| x + NOISE_MM * noise.next())).collect();
        step.displacement = observed.mask.spread(&noisy, [f64::NAN; 3]);
        step.force_n = Some(prediction.trace.force[n]);
    }
    recording
}

/// What fits of such a recording need, with a bulk modulus that is as good as known.
pub(super) fn inference_of(observed: &Observed) -> Inference<'_> {
    let allowance_mm = options().allowance_mm.unwrap();
    let bulk = BulkPrior { center_kpa: material().bulk_kpa, log_sd: KNOWN_LOG_SD };
    Inference {
        laboratory: Laboratory::new(observed, &MeshOptions::scaled(&observed.specimen, MESH_FACTOR)).unwrap(),
        metric: Metric::new(observed, allowance_mm, &|_| true),
        settings: FitSettings {
            max_iterations: 12,
            bulk,
            shear: None,
            tolerance: 0.1,
            relative_tolerance: 0.0,
            goal: None,
        },
        nominal_bulk: bulk,
        believed_bulk: bulk,
        allowance_mm,
        discrepancy_mm2: [0.0; 3],
        mesh_factor: MESH_FACTOR,
        is_cancelled: &|| false,
        progress: &|_| {},
    }
}
