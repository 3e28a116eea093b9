//! A small problem for the tests of this room: a solid block, sheared to 1, on a coarse mesh.

use super::bench::Bench;
use super::options::FitOptions;
use super::synthetic::SyntheticScan;
use crate::fem::{ForwardModel, SolveOptions};
use crate::material::{Material, OgdenTerm};
use crate::mesh::MeshOptions;
use crate::sensitivity::{Protocol, ScanSettings};
use crate::specimen::{Block, Outline, Specimen, TestKind};
use crate::voxel::{Sampling, VoxelOperator};

pub(super) fn block() -> Specimen {
    Specimen {
        name: "small block".into(),
        test: TestKind::DoubleLapShear,
        block: Block::new(12.0, 4.0, 9.0),
        outline: Outline::Block,
        holes: vec![],
        drive_mm: vec![4.0],
        drive_angle_deg: 0.0,
        precompression_mm: 0.0,
        samples_in_parallel: 2,
        other_samples: Vec::new(),
    }
}

pub(super) fn ogden(bulk_kpa: f64, terms: &[[f64; 2]]) -> Material {
    Material { bulk_kpa, terms: terms.iter().map(|&[mu_kpa, alpha]| OgdenTerm { mu_kpa, alpha }).collect(), law: None }
}

/// Compressible enough for κ to be seen.
pub(super) fn truth() -> Material {
    ogden(200.0, &[[17.0, 1.91]])
}

pub(super) fn scan() -> ScanSettings {
    ScanSettings {
        voxel_mm: [1.0, 0.5, 1.0],
        noise_sd_mm: [0.02, 0.03, 0.04],
        force_sd_n: 0.01,
        ..ScanSettings::default()
    }
}

pub(super) fn coarse(specimen: &Specimen) -> MeshOptions {
    MeshOptions::scaled(specimen, 2.5)
}

/// Equilibria as good as rounding allows.
pub(super) fn tight() -> FitOptions {
    let solve = SolveOptions { tolerance: 1e-11, ..SolveOptions::default() };
    FitOptions { tolerance: 1e-6, solve, ..FitOptions::default() }
}

/// A model with its voxels, and the scan of `material` made on the same mesh.
pub(super) fn same_mesh(material: &Material) -> (Bench, SyntheticScan) {
    let specimen = block();
    let mesh = coarse(&specimen);
    let model = ForwardModel::of_specimen(&specimen, &mesh).unwrap();
    let plain = Protocol::default();
    let synthetic = SyntheticScan::new(&specimen, material, &scan(), &plain, &mesh, &tight().solve, &|| false).unwrap();
    let operator = VoxelOperator::new(&specimen, model.mesh(), &synthetic.mask, Sampling::default()).unwrap();
    (Bench::of_one(model, operator), synthetic)
}

/// Bounds of s²/σ² over `n` draws at two-sided 99.9 % (Wilson and Hilferty's cube-root approximation of χ²).
pub(super) fn variance_bounds(n: usize) -> [f64; 2] {
    let f = (n - 1) as f64;
    let a = 2.0 / (9.0 * f);
    [-3.29, 3.29].map(|z: f64| (1.0 - a + z * a.sqrt()).powi(3))
}
