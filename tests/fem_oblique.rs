//! Drives at an angle in the plane of the plates.

mod common;

use common::{model, off_axis, solve, specimen, two_terms};
use lambdak::calibration::{CalibrateOptions, Observed, SyntheticScan, TermCount, calibrate};
use lambdak::diagnosis::{DiagnosisError, DiagnosisOptions, diagnose};
use lambdak::fem::{Equilibrium, ForwardModel};
use lambdak::mesh::{Mesh, MeshOptions, mesh_specimen};
use lambdak::recording::{Filter, MistakenUnit, PlateFault, RecordingError};
use lambdak::sensitivity::{Protocol, ScanSettings};
use lambdak::specimen::{HoleAxis, Specimen, TestKind};

const SQUARE: [f64; 3] = [20.0, 6.0, 20.0];

fn square(holes: &[[f64; 3]], angle_deg: f64) -> Specimen {
    let specimen = specimen(TestKind::DoubleLapShear, SQUARE, HoleAxis::Thickness, holes);
    Specimen { drive_angle_deg: angle_deg, ..specimen }
}

fn whole(specimen: &Specimen, factor: f64) -> Mesh {
    mesh_specimen(specimen, &MeshOptions { use_mirror: false, ..MeshOptions::scaled(specimen, factor) }).unwrap()
}

/// (x, z) → (−z, x): a turn about y, from x towards z, by a right angle.
fn turned<T: std::ops::Neg<Output = T> + Copy>([x, y, z]: [T; 3]) -> [T; 3] {
    [-z, y, x]
}

/// A pattern without symmetry, turned by a right angle together with the drive, on the mesh turned as well: the same
/// force, and displacements turned.
#[test]
fn a_turned_block_and_drive_give_the_same_force() {
    let holes = [[-4.0, 2.0, 4.0], [5.0, -3.0, 3.0]];
    let drawn = square(&holes, 0.0);
    let image = square(&holes.map(|[x, z, d]| [-z, x, d]), 90.0);
    assert_eq!((drawn.validate(), image.validate()), (Ok(()), Ok(())));
    let mesh = whole(&drawn, 2.0);
    let mut of_image = mesh.clone();
    of_image.nodes.iter_mut().for_each(|p| *p = turned(*p));
    let a = solve(&mut ForwardModel::new(mesh, &drawn).unwrap(), &two_terms(), 5.0).unwrap();
    let b = solve(&mut ForwardModel::new(of_image, &image).unwrap(), &two_terms(), 5.0).unwrap();
    println!("{} N, {} N", a.force_n, b.force_n);
    // The solver stops at a residual of 1e-11 of the reactions.
    assert!(
        (a.force_n / b.force_n - 1.0).abs() < 1e-9 && (a.normal_force_n - b.normal_force_n).abs() < 1e-8 * a.force_n
    );
    for (u, v) in a.displacement.iter().zip(&b.displacement) {
        let expected = turned(*u);
        assert!((0..3).all(|i| (expected[i] - v[i]).abs() < 1e-8), "{expected:?} {v:?}");
    }
    // The mesher's own mesh is divided in another way: a discretisation's difference.
    let own = solve(&mut model(&image, 2.0), &two_terms(), 5.0).unwrap();
    println!("own mesh {} N", own.force_n);
    assert!((own.force_n / a.force_n - 1.0).abs() < 5e-3);
}

/// A longer block is stiffer along its length than across it; at 45° the force lies between. At small strains it is the
/// mean of both exactly, because stiffness is a tensor.
#[test]
fn an_oblique_drive_lies_between() {
    let force = |angle_deg: f64, drive: f64| {
        let block = specimen(TestKind::DoubleLapShear, [24.0, 6.0, 10.0], HoleAxis::Thickness, &[]);
        let block = Specimen { drive_angle_deg: angle_deg, ..block };
        assert_eq!(block.validate(), Ok(()));
        let mut model = ForwardModel::new(whole(&block, 2.0), &block).unwrap();
        solve(&mut model, &two_terms(), drive).unwrap().force_n
    };
    let [along, oblique, across] = [0.0, 45.0, 90.0].map(|angle| force(angle, 4.0));
    println!("4 mm: {along} N, {oblique} N, {across} N");
    assert!(across < oblique && oblique < along);
    let [along, oblique, across] = [0.0, 45.0, 90.0].map(|angle| force(angle, 0.006));
    println!("0.006 mm: {along} N, {oblique} N, {across} N");
    // The second order of a shear strain of 1e-3 is 1e-6 of the force.
    assert!((oblique / (0.5 * (along + across)) - 1.0).abs() < 1e-5);
    // A mirror image in z goes to the other side.
    assert!((force(-45.0, 4.0) / force(45.0, 4.0) - 1.0).abs() < 1e-8);
}

/// z is a mirror along x alone.
#[test]
fn an_oblique_drive_is_meshed_whole() {
    let mirrors = [0.0, 30.0, -90.0].map(|angle| model(&square(&[], angle), 2.5).mesh().mirror.z);
    assert_eq!(mirrors, [true, false, false]);
}

/// Derivatives along material and drive: the rest of a first-order prediction falls with the square of the step.
#[test]
fn derivatives_along_an_oblique_drive() {
    let specimen = Specimen { drive_angle_deg: 35.0, ..off_axis() };
    let (material, drive) = (two_terms(), 4.0);
    let mut model = model(&specimen, 2.5);
    let base = solve(&mut model, &material, drive).unwrap();
    let (along_drive, along_material, adjoint) = {
        let mut tangent = model.tangent(&material, &base).unwrap();
        let s = tangent.material_sensitivities().unwrap();
        // J = F: its gradient by the adjoint is the force's by the direct way.
        let still = vec![[0.0; 3]; base.displacement.len()];
        let adjoint = tangent.adjoint_gradient(&still, 1.0).unwrap();
        (tangent.path_sensitivity(&s, None, 1.0).unwrap(), s, adjoint)
    };
    for (direct, adjoint) in along_material.iter().zip(&adjoint) {
        // Both linear solves stop at 1e-10.
        assert!(
            (direct.force_n - adjoint).abs() < 1e-7 * (direct.force_n.abs() + 1e-3),
            "{} {adjoint}",
            direct.force_n
        );
    }
    let rests = |move_by: &mut dyn FnMut(f64) -> Equilibrium, slope: f64| {
        [0.1, 0.05].map(|t| (move_by(t).force_n - base.force_n - t * slope).abs())
    };
    let found = rests(&mut |t| solve(&mut model, &material, drive + t).unwrap(), along_drive.force_n);
    println!("drive: {found:?}, rate {}", (found[0] / found[1]).log2());
    // Two, up to the third order.
    assert!(((found[0] / found[1]).log2() - 2.0).abs() < 0.1);
    let found = rests(
        &mut |t| {
            let mut changed = material.clone();
            changed.terms[1].alpha += t;
            solve(&mut model, &changed, drive).unwrap()
        },
        along_material[4].force_n,
    );
    println!("α₂: {found:?}, rate {}", (found[0] / found[1]).log2());
    assert!(((found[0] / found[1]).log2() - 2.0).abs() < 0.1);
    // How ∂F/∂ξ changes along the drive is how ∂F/∂d changes along ξ: central differences of the solved ones.
    let step = 1e-3;
    let forces = [drive + step, drive - step].map(|d| {
        let at = solve(&mut model, &material, d).unwrap();
        model.tangent(&material, &at).unwrap().material_sensitivities().unwrap()[1].force_n
    });
    let expected = (forces[0] - forces[1]) / (2.0 * step);
    println!("d/dd of ∂F/∂μ₁: {} and {expected}", along_drive.parameters[1].force_n);
    // The differences' second order, (1e-3 / 6.4)², and solves to 1e-10 over 2e-3.
    assert!((along_drive.parameters[1].force_n / expected - 1.0).abs() < 1e-5);
}

/// A recording of an oblique drive gives its material; with another angle told it is refused by its plates.
#[test]
fn an_oblique_scan_gives_the_material() {
    let specimen = Specimen { drive_angle_deg: 60.0, drive_mm: vec![-3.0, -6.0], ..off_axis() };
    let truth = common::ogden(400.0, &[(17.0, 1.91)]);
    let scan =
        ScanSettings { voxel_mm: [1.0; 3], noise_sd_mm: [0.01; 3], force_sd_n: 0.005, ..ScanSettings::default() };
    let (mesh, solve) = (MeshOptions::scaled(&specimen, 1.6), lambdak::fem::SolveOptions::default());
    let made = SyntheticScan::new(&specimen, &truth, &scan, &Protocol::default(), &mesh, &solve, &|| false).unwrap();
    let recording = made.recording("oblique", &specimen, &made.draw(3, 0), Filter::None).unwrap();
    recording.check_motion().unwrap();
    for told in [-60.0, 10.0] {
        let mut wrong = recording.clone();
        wrong.specimen.drive_angle_deg = told;
        let error = wrong.check_motion().unwrap_err().to_string();
        println!("{told}°: {error}");
        assert!(error.contains("drive_angle_deg"));
    }
    let scaled = |factor: f64| {
        let mut wrong = recording.clone();
        wrong.steps.iter_mut().flat_map(|s| &mut s.displacement).flatten().for_each(|u| *u *= factor);
        let Err(RecordingError::PlateMotion { fault, .. }) = wrong.check_motion() else { panic!("taken: {factor}") };
        fault
    };
    assert_eq!(scaled(1e-3), PlateFault::Unit(MistakenUnit::Metres));
    assert!(matches!(scaled(3.0), PlateFault::TooFar { component: 'z', .. }));
    let refused = diagnose(&recording, &DiagnosisOptions::default(), &|_| (), &|| false);
    assert!(matches!(refused, Err(DiagnosisError::DriveAngle { value_deg: 60.0 })));
    let data = [Observed::new(&recording, scan.force_sd_n).unwrap()];
    let options = CalibrateOptions { terms: TermCount::Fixed(1), mesh_factor: 2.0, ..CalibrateOptions::default() };
    let found = calibrate(&data, &MeshOptions::scaled, &options, &|_| (), &|| false).unwrap();
    for (e, truth) in found.estimates.iter().zip([400.0, 17.0, 1.91]) {
        let [low, high] = e.interval_95.map(|end| end.expect("determined"));
        println!("{}: {:.4}, 95 % {low:.4} to {high:.4}, truth {truth}", e.parameter.name(), e.value);
        assert!(low < truth && truth < high && (e.value / truth - 1.0).abs() < 0.1);
    }
}

/// What is refused of an angle is told at its field, and files without one stay as they were.
#[test]
fn bad_angles_are_told_at_their_field() {
    let pointers = |s: &Specimen| s.field_errors().into_iter().map(|e| e.pointer).collect::<Vec<_>>();
    for bad in [f64::NAN, f64::INFINITY, 91.0, -90.5] {
        assert_eq!(pointers(&square(&[], bad)), ["/drive_angle_deg"], "{bad}");
    }
    let pulled = Specimen { test: TestKind::Uniaxial, ..square(&[], 10.0) };
    assert_eq!(pointers(&pulled), ["/drive_angle_deg"]);
    let json = square(&[[0.0, 0.0, 4.0]], -30.0).to_json();
    assert_eq!(Specimen::from_json(&json).unwrap().drive_angle_deg, -30.0);
    assert!(!square(&[], 0.0).to_json().contains("drive_angle_deg"), "files without an angle stay as they were");
}
