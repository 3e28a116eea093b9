use super::*;
use crate::diagnosis::cause::CauseName;
use crate::diagnosis::scene::Scene;
use crate::diagnosis::test_recordings::{FINER_FACTOR, MESH_FACTOR, NOISE_MM, material, options, recorded};
use crate::fem::LawCorrection;
use crate::rate::Verdict;
use crate::recording::LoadCurve;
use crate::voxel::VoxelMask;

fn never() -> bool {
    false
}

fn begun<'a>(observed: &'a Observed, registry: &'a Registry, options: &'a DiagnosisOptions) -> Run<'a> {
    Run::begin(observed, registry, options, &|_| {}, &never).unwrap()
}

fn observed(recording: &Recording) -> Observed {
    Observed::new(recording, options().force_sd_n).unwrap()
}

/// A recording whose load cell reads `offset_n` too much, with a load curve of quiet readings, and its true forces.
fn with_offset(offset_n: f64, drift_n: f64) -> (Recording, Vec<f64>) {
    let mut recording = recorded(&material(), &Scene::default(), MESH_FACTOR);
    let true_forces: Vec<f64> = recording.steps.iter().map(|s| s.force_n.unwrap()).collect();
    let mut curve = LoadCurve::default();
    for n in 0..120 {
        // Rest, a ramp to the first drive within 2 s, and a hold there: near rest a ramp's force is a straight line.
        let t = 0.5 * f64::from(n);
        let drive = (t - 10.0).clamp(0.0, 2.0);
        curve.time_s.push(t);
        curve.drive_mm.push(drive);
        let noise = if n % 2 == 0 { drift_n } else { -drift_n };
        curve.force_n.push(0.5 * drive * true_forces[0] + offset_n + noise);
    }
    recording.load = Some(curve);
    for (step, force) in recording.steps.iter_mut().zip(&true_forces) {
        step.force_n = Some(force + offset_n);
        step.force_sd_n = Some(drift_n);
        step.window_s = Some([20.0, 50.0]);
    }
    (recording, true_forces)
}

/// A load cell that reads 0.4 N too much: the stage names it and takes it off the steps' forces.
#[test]
fn the_load_curve_is_read_and_taken_off() {
    let offset = 0.4;
    let (recording, true_forces) = with_offset(offset, 0.01);
    let (observed, registry, options) = (observed(&recording), Registry::standard(), options());
    let mut run = begun(&observed, &registry, &options);
    run.read_load_curve(&recording).unwrap();
    let cause = &run.findings.causes[0];
    assert_eq!(cause.name, CauseName::new("cell"));
    assert!((cause.parameters[0].1 - offset).abs() < 0.02, "{:?}", cause.parameters);
    for (left, force) in run.recorded.force.iter().zip(&true_forces) {
        assert!((left - force).abs() < 0.02, "{left} {force}");
    }
}

/// An offset of 1 % of the force is named where readings are quiet enough; one of 0.2 % is not, however quiet they are:
/// it is less than the model of the force errs by.
#[test]
fn what_the_force_model_errs_by_is_no_finding() {
    let force_n = with_offset(0.0, 1e-4).1[0];
    for (part, is_named) in [(0.01, true), (0.002, false)] {
        let (recording, _) = with_offset(part * force_n, 1e-4);
        let (observed, registry, options) = (observed(&recording), Registry::standard(), options());
        let mut run = begun(&observed, &registry, &options);
        run.read_load_curve(&recording).unwrap();
        assert_eq!(!run.findings.causes.is_empty(), is_named, "{part}");
    }
}

/// A recording that comes from the finer mesh: what that mesh predicts beyond ours is taken off, and the nominal model,
/// fitted anew, leaves less.
#[test]
fn the_mesh_is_corrected_before_a_misfit_is_looked_for() {
    let recording = recorded(&material(), &Scene::default(), FINER_FACTOR);
    let (observed, registry, options) = (observed(&recording), Registry::standard(), options());
    let mut run = begun(&observed, &registry, &options);
    assert!(run.mesh_defect.is_none() && run.measured().force == run.recorded.force);
    let before = run.findings.nominal.deviance;
    run.correct_mesh().unwrap();
    let defect = run.mesh_defect.as_ref().unwrap();
    // A coarse mesh of a block with singular edges errs by more than nothing and by less than a tenth of the drive.
    assert!(defect.trace.rms_mm() > 1e-4 && defect.trace.rms_mm() < 0.4, "{}", defect.trace.rms_mm());
    assert_eq!(run.measured().force, defect.taken_off(&run.recorded).force);
    assert!(run.findings.nominal.deviance < before, "{} {before}", run.findings.nominal.deviance);
    // The search for causes starts from the corrected fit.
    assert_eq!(run.findings.current.material, run.findings.nominal.material);
}

/// A block of voxels off by 0.3 mm at the second step: found, fitted, named, and no cause that counts.
#[test]
fn artefacts_are_taken_out_and_named() {
    let mut recording = recorded(&material(), &Scene::default(), MESH_FACTOR);
    let mask = VoxelMask::covering(&recording.specimen, [2.5, 0.8, 2.5]).unwrap();
    let mut num_moved = 0;
    for &voxel in &mask.voxels {
        let x = mask.grid.center_mm(voxel as usize);
        if x[0].abs() < 5.0 && x[2].abs() < 5.0 {
            recording.steps[1].displacement[voxel as usize][2] += 0.3;
            num_moved += 1;
        }
    }
    let (observed, registry, options) = (observed(&recording), Registry::standard(), options());
    let mut run = begun(&observed, &registry, &options);
    run.take_out_artefacts().unwrap();
    let causes = &run.findings.current.causes;
    assert_eq!(causes.len(), 1);
    assert!(causes[0].cause.is_artefact());
    assert_eq!(causes[0].cause.variant(), [1, 2, num_moved]);
    // The mean of a hundred voxels and more.
    assert!((causes[0].values[0] - 0.3).abs() < NOISE_MM, "{}", causes[0].values[0]);
    run.name_artefacts();
    assert_eq!(run.findings.causes[0].name, CauseName::new("wrap"));
    assert!(run.findings.causes[0].evidence > 1000.0);
}

/// A sample with a tenth of a rubber's κ/G: named before other causes are looked for, and kept where there are none.
#[test]
fn the_material_is_questioned() {
    let mut soft = material();
    soft.bulk_kpa = 10.0 * shear_modulus(&soft);
    let recording = recorded(&soft, &Scene::default(), MESH_FACTOR);
    let (observed, registry, options) = (observed(&recording), Registry::standard(), options());
    let mut run = begun(&observed, &registry, &options);
    run.question_material().unwrap();
    run.question_material_again().unwrap();
    let causes = &run.findings.causes;
    assert_eq!(causes.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["compressibility"]);
    // Volume changes move some hundred voxels at the free ends by some hundredths of a millimetre, with 0.01 mm of
    // noise.
    assert!((causes[0].parameters[0].1 / 10.0 - 1.0).abs() < 0.3, "{:?}", causes[0].parameters);
    assert!(run.findings.nominal.deviance > run.findings.current.deviance + causes[0].evidence);
}

/// Stages after a cancelled one do not run.
#[test]
fn a_cancelled_diagnosis_is_an_error() {
    let recording = recorded(&material(), &Scene::default(), MESH_FACTOR);
    assert!(diagnose(&recording, &options(), &|_| {}, &|| true).is_err());
    let coarse = DiagnosisOptions { mesh_factor: 9.0, ..options() };
    assert!(matches!(diagnose(&recording, &coarse, &|_| {}, &never), Err(DiagnosisError::Setting { .. })));
}

/// A law that softens with stretch and stiffens with the distance from pure shear is no sum of Ogden terms: its
/// correction is named, though its own form has another reach.
#[test]
fn a_law_that_is_no_sum_of_terms_is_named() {
    let law = LawCorrection { reach: 2.0, coefficients_kpa: [-40.0, 20.0, 0.0, 60.0] };
    let recording = recorded(&material(), &Scene { law: Some(law), ..Scene::default() }, FINER_FACTOR);
    let found = diagnose(&recording, &options(), &|_| {}, &never).unwrap();
    let names: Vec<&str> = found.causes.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(
        (names, found.verdict),
        (vec!["law"], Verdict::Explained),
        "{:?}",
        found.left.map(|l| l.structured_rms_mm)
    );
}
