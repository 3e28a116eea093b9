//! Plates that are pressed together before they are driven.

mod common;

use common::{model, off_axis, solve, specimen, two_terms};
use lambdak::calibration::{CalibrateOptions, Observed, SyntheticScan, TermCount, calibrate};
use lambdak::fem::{Departures, Equilibrium, PlateMotion, SolveError, SolveOptions};
use lambdak::mesh::MeshOptions;
use lambdak::recording::Filter;
use lambdak::sensitivity::{Protocol, ScanSettings};
use lambdak::specimen::{HoleAxis, Specimen, TestKind};

fn pressed(specimen: Specimen, precompression_mm: f64) -> Specimen {
    let pressed = Specimen { precompression_mm, ..specimen };
    assert_eq!(pressed.validate(), Ok(()));
    pressed
}

fn solved(specimen: &Specimen, drive_mm: f64) -> Equilibrium {
    solve(&mut model(specimen, 2.5), &two_terms(), drive_mm).unwrap()
}

/// Both forces are slopes of one potential: how the force along the drive changes with the precompression is minus how
/// the force across the plates changes with the drive.
#[test]
fn forces_along_and_across_are_of_one_potential() {
    let (drive, press, h) = (4.0, 0.4, 0.02);
    let at = |p: f64, d: f64| solved(&pressed(off_axis(), p), d);
    let along = (at(press + h, drive).force_n - at(press - h, drive).force_n) / (2.0 * h);
    let across = (at(press, drive + h).normal_force_n - at(press, drive - h).normal_force_n) / (2.0 * h);
    let middle = at(press, drive);
    println!("{} N along, {} N across; slopes {along} and {across} N/mm", middle.force_n, middle.normal_force_n);
    assert!(middle.normal_force_n < 0.0, "the sample pushes the plates apart");
    // The differences are of second order in h over the lengths on which forces change, some millimetres: (0.02 / 3)².
    assert!((along + across).abs() < 2e-4 * along.abs(), "{along} {across}");
}

/// A plate that is known to be pressed is the nominal plate that has gone there by a departure of its own.
#[test]
fn the_same_as_a_plate_out_of_place() {
    let (material, drive) = (two_terms(), 5.0);
    let pressed_block = solved(&pressed(off_axis(), -1.2), drive);
    let moved = PlateMotion { translation_mm: [0.0, 1.2, 0.0], ..PlateMotion::default() };
    let mut departed = model(&off_axis(), 2.5).departed(&Departures { moved_plate: moved, ..Departures::default() });
    let other = departed.solve_by_parts(&material, drive, &SolveOptions::default(), &|| false).unwrap();
    println!("{} N, {} N", pressed_block.force_n, other.force_n);
    // Both stop at a residual of 1e-10 of the reactions.
    assert!((pressed_block.force_n / other.force_n - 1.0).abs() < 1e-8);
    assert!((pressed_block.normal_force_n / other.normal_force_n - 1.0).abs() < 1e-8);
    for (u, v) in pressed_block.displacement.iter().zip(&other.displacement) {
        assert!((0..3).all(|i| (u[i] - v[i]).abs() < 1e-7), "{u:?} {v:?}");
    }
}

/// As far as is allowed, either way: a block without holes takes it, and with a hole what fails is told. A block that
/// is pulled apart pulls its plates together. Drives to either side take the same force.
#[test]
fn as_far_as_is_allowed() {
    let holed = specimen(TestKind::DoubleLapShear, [24.0, 6.0, 16.0], HoleAxis::Thickness, &[[-6.0, 0.0, 4.0]]);
    let error = solve(&mut model(&pressed(holed.clone(), 1.5), 1.5), &two_terms(), 6.0).unwrap_err();
    println!("{error}");
    let SolveError::NotPrecompressed { reached_mm, asked_mm, .. } = error else { panic!("{error}") };
    assert!(reached_mm > 0.2 && reached_mm < 1.5 && (asked_mm - 1.5).abs() < 1e-15);
    let block = Specimen { holes: vec![], ..holed };
    for (press, sign) in [(1.5, -1.0), (-1.5, 1.0)] {
        let at = |d: f64| solved(&pressed(Specimen { drive_mm: vec![d], ..block.clone() }, press), d);
        let [a, b] = [at(6.0), at(-6.0)];
        println!("{press} mm: {} N along, {} N across", a.force_n, a.normal_force_n);
        assert!(a.normal_force_n * sign > 0.0 && a.force_n > 0.0);
        // The solver's residual.
        assert!((a.force_n / b.force_n + 1.0).abs() < 1e-8 && (a.normal_force_n / b.normal_force_n - 1.0).abs() < 1e-8);
    }
}

/// Derivatives along the material and the drive: what a first-order prediction leaves falls with the square of the
/// step.
#[test]
fn derivatives_with_precompression() {
    let specimen = pressed(off_axis(), -1.0);
    let (material, drive) = (two_terms(), 4.0);
    let mut model = model(&specimen, 2.5);
    let base = solve(&mut model, &material, drive).unwrap();
    let (along_drive, along_material) = {
        let mut tangent = model.tangent(&material, &base).unwrap();
        let s = tangent.material_sensitivities().unwrap();
        (tangent.path_sensitivity(&s, None, 1.0).unwrap(), s)
    };
    let order = |rests: [f64; 2]| (rests[0] / rests[1]).log2();
    let of_drive = [0.1, 0.05].map(|t| {
        (solve(&mut model, &material, drive + t).unwrap().force_n - base.force_n - t * along_drive.force_n).abs()
    });
    let of_exponent = [0.1, 0.05].map(|t| {
        let mut changed = material.clone();
        changed.terms[1].alpha += t;
        let found = solve(&mut model, &changed, drive).unwrap().force_n;
        (found - base.force_n - t * along_material[4].force_n).abs()
    });
    println!("orders {} and {}", order(of_drive), order(of_exponent));
    // Two, up to the third order.
    assert!((order(of_drive) - 2.0).abs() < 0.1 && (order(of_exponent) - 2.0).abs() < 0.1);
}

/// A recording of a precompressed block gives its material; without the precompression it is another experiment.
#[test]
fn a_precompressed_scan_gives_the_material() {
    let specimen = pressed(Specimen { drive_mm: vec![3.0, 6.0], ..off_axis() }, -0.9);
    let truth = common::ogden(400.0, &[(17.0, 1.91)]);
    let scan =
        ScanSettings { voxel_mm: [1.0; 3], noise_sd_mm: [0.01; 3], force_sd_n: 0.005, ..ScanSettings::default() };
    let (mesh, solve) = (MeshOptions::scaled(&specimen, 1.6), SolveOptions::default());
    let made = SyntheticScan::new(&specimen, &truth, &scan, &Protocol::default(), &mesh, &solve, &|| false).unwrap();
    let recording = made.recording("pressed", &specimen, &made.draw(3, 0), Filter::None).unwrap();
    recording.check_motion().unwrap();
    let options = CalibrateOptions { terms: TermCount::Fixed(1), mesh_factor: 2.0, ..CalibrateOptions::default() };
    let fitted = |recording| {
        let data = [Observed::new(recording, scan.force_sd_n).unwrap()];
        calibrate(&data, &MeshOptions::scaled, &options, &|_| (), &|| false).unwrap()
    };
    let found = fitted(&recording);
    for (e, truth) in found.estimates.iter().zip([400.0, 17.0, 1.91]) {
        let [low, high] = e.interval_95.map(|end| end.expect("determined"));
        println!("{}: {:.4}, 95 % {low:.4} to {high:.4}, truth {truth}", e.parameter.name(), e.value);
        assert!(low < truth && truth < high && (e.value / truth - 1.0).abs() < 0.1);
    }
    let mut untold = recording.clone();
    untold.specimen.precompression_mm = 0.0;
    let [with, without] = [found.fit.chi2_per_datum, fitted(&untold).fit.chi2_per_datum];
    println!("chi2 per datum {with}, {without} with the precompression left out");
    // The plate alone is 0.9 mm off where the noise is 0.01 mm.
    assert!(without > 100.0 * with);
}

/// What is refused is told at its field, and files without a precompression stay as they were.
#[test]
fn bad_precompressions_are_told_at_their_field() {
    let block = specimen(TestKind::DoubleLapShear, [24.0, 6.0, 16.0], HoleAxis::Thickness, &[]);
    let pointers = |s: &Specimen| s.field_errors().into_iter().map(|e| e.pointer).collect::<Vec<_>>();
    for bad in [f64::NAN, f64::INFINITY, 1.51, -1.6] {
        assert_eq!(pointers(&Specimen { precompression_mm: bad, ..block.clone() }), ["/precompression_mm"], "{bad}");
    }
    let pulled = Specimen { test: TestKind::Uniaxial, precompression_mm: 0.5, ..block.clone() };
    assert_eq!(pointers(&pulled), ["/precompression_mm"]);
    let json = pressed(block.clone(), 1.0).to_json();
    assert_eq!(Specimen::from_json(&json).unwrap().precompression_mm, 1.0);
    assert!(!block.to_json().contains("precompression_mm"), "files without it stay as they were");
}
