//! What the mesh may put an evaluation wrong by, from the same evaluation on coarser meshes.

use super::covariance::PromisedSd;
use super::drives::DriveSelection;
use super::evaluation::evaluate_fixture;
use super::evaluation_options::EvaluationOptions;
use super::evaluation_result::Evaluation;
use super::fixture::Fixture;
use super::integrated::IntegratedSensitivity;
use crate::material::Material;
use crate::mesh::{CoarserMeshes, MeshedResult};
use crate::specimen::Specimen;
use rayon::prelude::*;

/// Solves the drives of `evaluation`, which was made with these options, on coarser meshes too, side by side, and fills
/// in by how much the mesh may put its forces, sensitivities and promised standard deviations wrong. What has no
/// equilibrium on a coarser mesh, or was cancelled, gets no bound from it, and neither does what is itself on a mesh
/// too coarse for coarser ones ([`CoarserMeshes::of`]).
pub fn bound_discretisation(
    evaluation: &mut Evaluation,
    specimen: &Specimen,
    material: &Material,
    options: &EvaluationOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) {
    let Some(meshes) = CoarserMeshes::of(&options.mesh, specimen) else { return };
    let drives = DriveSelection::DriveMm(evaluation.steps.iter().map(|s| s.drive_mm).collect());
    let scan = evaluation.scan;
    let on_mesh = |mesh| {
        let options = EvaluationOptions { mesh, ..options.clone() };
        let mut fixture = Fixture::new(specimen, &scan, &options).ok()?;
        let (found, _) = evaluate_fixture(&mut fixture, material, &drives, &[], &options, &is_cancelled).ok()?;
        Some(found)
    };
    let coarser: Vec<Option<Evaluation>> = meshes.options.into_par_iter().map(on_mesh).collect();
    if let [a, b] = &coarser[..] {
        bound_by(evaluation, &meshes, [a.as_ref(), b.as_ref()]);
    }
}

/// Fills in bounds from the same evaluation on coarser meshes.
fn bound_by(evaluation: &mut Evaluation, meshes: &CoarserMeshes, coarser: [Option<&Evaluation>; 2]) {
    for (index, step) in evaluation.steps.iter_mut().enumerate() {
        let steps = coarser.map(|e| e?.steps.get(index));
        let forces = steps.map(|s| Some(s?.force_n));
        step.force_discretisation_n = meshes.bound(MeshedResult::Force, step.force_n, forces);
        for (which, own) in step.integrated_sensitivity.iter_mut().enumerate() {
            let integral = |s: &IntegratedSensitivity| s.surface_integral.unwrap_or(s.volume_integral);
            let others = steps.map(|s| s?.integrated_sensitivity.get(which).map(integral));
            let kind = MeshedResult::IntegratedSensitivity;
            own.discretisation_relative = meshes.relative_bound(kind, integral(own), others);
        }
        bound_promised(&mut step.promised_sd, meshes, steps.map(|s| Some(&s?.promised_sd[..])));
    }
    bound_promised(&mut evaluation.promised_sd, meshes, coarser.map(|e| Some(&e?.promised_sd[..])));
}

fn bound_promised(promised: &mut [PromisedSd], meshes: &CoarserMeshes, coarser: [Option<&[PromisedSd]>; 2]) {
    for (which, own) in promised.iter_mut().enumerate() {
        let others = coarser.map(|list| list?.get(which)?.value);
        own.discretisation_relative =
            own.value.and_then(|sd| meshes.relative_bound(MeshedResult::PromisedSd, sd, others));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::MeshOptions;
    use crate::sensitivity::ScanSettings;

    /// The standard mesh of the solid block bounds what a mesh of 0.6 of its elements' size shows it to be wrong by.
    #[test]
    fn a_mesh_knows_what_it_leaves_open() {
        let mut specimen = Specimen::from_json(include_str!("../../geometries/solid-shear.json")).expect("shipped");
        specimen.drive_mm = vec![4.0];
        let material = Material {
            bulk_kpa: 2173.0,
            terms: vec![crate::material::OgdenTerm { mu_kpa: 17.0, alpha: 1.91 }],
            law: None,
        };
        let scan = ScanSettings {
            voxel_mm: [2.0, 0.8, 2.0],
            noise_sd_mm: [0.05; 3],
            force_sd_n: 0.02,
            ..ScanSettings::default()
        };
        let evaluated = |factor: f64| {
            let mesh = MeshOptions::scaled(&specimen, factor);
            let options = EvaluationOptions { mesh, ..EvaluationOptions::standard(&specimen) };
            let mut fixture = Fixture::new(&specimen, &scan, &options).expect("a fixture");
            let drives = DriveSelection::DriveMm(specimen.drive_mm.clone());
            let (found, _) =
                evaluate_fixture(&mut fixture, &material, &drives, &[], &options, &|| false).expect("an evaluation");
            (found, options)
        };
        let ((mut coarse, options), (fine, _)) = (evaluated(1.0), evaluated(0.6));
        assert!(coarse.steps[0].force_discretisation_n.is_none());
        bound_discretisation(&mut coarse, &specimen, &material, &options, &|| false);
        let (own, better) = (&coarse.steps[0], &fine.steps[0]);
        let bound = own.force_discretisation_n.expect("bounded");
        assert!((own.force_n - better.force_n).abs() < bound && bound < 0.1 * own.force_n, "{bound}");
        let pairs = coarse.promised_sd.iter().zip(&fine.promised_sd).filter(|(p, _)| p.is_of_shear());
        for (own, better) in pairs {
            let bound = own.discretisation_relative.expect("bounded");
            let (own, better) = (own.value.expect("determined"), better.value.expect("determined"));
            assert!(((own - better) / own).abs() < bound && bound < 0.5, "{own} {better} {bound}");
        }
        for (own, better) in own.integrated_sensitivity.iter().zip(&better.integrated_sensitivity) {
            let bound = own.discretisation_relative.expect("bounded");
            let error = (own.volume_integral / better.volume_integral - 1.0).abs();
            assert!(error < bound, "{}: {error} {bound}", own.parameter);
        }
        // Cancelled, or where even the finest mesh is coarse, nothing is known.
        for (factor, is_cancelled) in [(1.2, true), (2.4, false)] {
            let (mut unknown, options) = evaluated(factor);
            bound_discretisation(&mut unknown, &specimen, &material, &options, &|| is_cancelled);
            assert!(unknown.steps[0].force_discretisation_n.is_none());
        }
    }
}
