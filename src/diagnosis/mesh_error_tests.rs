use super::*;
use crate::calibration::Observed;
use crate::diagnosis::cause::CauseName;
use crate::diagnosis::prior::BulkPrior;
use crate::diagnosis::registry::Registry;
use crate::diagnosis::supposed::Supposed;
use crate::material::Material;
use crate::recording::{Filter, RecordedStep, Recording};
use crate::specimen::Specimen;
use crate::voxel::VoxelMask;

/// An empty recording at 5 mm.
fn observed(mut specimen: Specimen, voxel_mm: [f64; 3]) -> Observed {
    specimen.drive_mm = vec![5.0];
    let mask = VoxelMask::covering(&specimen, voxel_mm).unwrap();
    let step = RecordedStep {
        drive_mm: 5.0,
        force_n: Some(8.0),
        force_sd_n: Some(0.02),
        window_s: None,
        displacement: vec![[0.0; 3]; mask.grid.num_voxels()],
    };
    let recording = Recording {
        id: "empty".into(),
        steps: vec![step],
        grid: mask.grid.clone(),
        mask: mask.spread(&vec![true; mask.num_voxels()], false),
        specimen,
        noise_sd_mm: Some([0.02; 3]),
        filter: Filter::None,
        load: None,
        notes: None,
    };
    Observed::new(&recording, 0.02).unwrap()
}

/// Shrinkage that a mesh twice as fine shows is found on a coarse one; the coarse fit is off by the mesh, the corrected
/// one by less than half of that, and the wider interval holds the truth.
#[test]
fn a_finer_mesh_corrects_estimates() {
    let never = || false;
    let (mesh_factor, truth) = (2.2, -0.012);
    let specimen = Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).unwrap();
    let material = Material::from_json(include_str!("../../geometries/materials/ecoflex-0020.json")).unwrap();
    let observed = observed(specimen, [1.5, 0.8, 1.6]);
    let laboratory_of =
        |factor: f64| Laboratory::new(&observed, &MeshOptions::scaled(&observed.specimen, factor)).unwrap();
    let shrunk = Scene { log_growth: truth, ..Scene::default() };
    // No noise is added: what is left is the mesh.
    let measured = laboratory_of(1.1).predict(&material, &shrunk, &never).unwrap().trace;

    let mut laboratory = laboratory_of(mesh_factor);
    let metric = Metric::new(&observed, 0.005, &|_| true);
    let settings = FitSettings {
        max_iterations: 12,
        bulk: BulkPrior { center_kpa: material.bulk_kpa, log_sd: 0.1 },
        shear: None,
        tolerance: 1e-3,
        relative_tolerance: 0.0,
        goal: None,
    };
    let swelling = Registry::standard()
        .tested(&observed.specimen)
        .into_iter()
        .find(|c| c.name() == CauseName::new("swelling"))
        .unwrap();
    let supposed = [Supposed { cause: swelling, values: vec![0.0] }];
    let mut fitted = fit(&mut laboratory, &metric, &measured, &material, &supposed, &settings, &never).unwrap();
    let before = fitted.causes[0].values[0] - truth;

    let mut finer = Finer::new(&laboratory, mesh_factor).unwrap();
    let defect = finer.correct(&mut laboratory, &metric, &measured, &settings, &mut fitted, &never).unwrap();
    let after = fitted.causes[0].values[0] - truth;
    assert!(after.abs() < 0.5 * before.abs(), "{before} {after}");

    let noise = fitted.sd_of(0)[0];
    let mut coarser = Coarser::default();
    widen(&mut laboratory, (&mut coarser, mesh_factor), &metric, &settings, &mut fitted, Some(&defect), &never)
        .unwrap();
    let wider = fitted.sd_of(0)[0];
    assert!(wider > noise && after.abs() < 1.96 * wider, "{noise} {wider} {after}");
    // Not everything fits into it: shrinkage of 1.2 % is told from none by five standard deviations, on this coarse
    // mesh.
    assert!(wider < 0.2 * truth.abs(), "{wider}");
}

/// A mesh that is as fine as meshes get is not corrected.
#[test]
fn a_fine_mesh_is_left_alone() {
    let specimen = Specimen::from_json(include_str!("../../geometries/solid-shear.json")).unwrap();
    let observed = observed(specimen, [4.0, 2.0, 4.0]);
    let laboratory =
        |factor: f64| Laboratory::new(&observed, &MeshOptions::scaled(&observed.specimen, factor)).unwrap();
    assert!(Finer::new(&laboratory(FINEST), FINEST).is_none());
    assert!(Finer::new(&laboratory(4.0 * FINEST), 4.0 * FINEST).is_some());
}
