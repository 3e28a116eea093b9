//! The limits of what is supported: incompressibility, large drives, typed failures, cancellation.

mod common;

use common::{bar, model, never, ogden, one_term, solid, solve, tight, two_holes, two_terms};
use lambdak::fem::{SolveError, SolveOptions};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Locking would stiffen the coarse mesh as κ/μ grows: coarse and finer force differ by less than 1 % for every κ/μ.
#[test]
fn nothing_locks() {
    for (s, drive, name) in [(two_holes(), 5.0, "two holes"), (solid(), 5.0, "solid"), (bar(), 15.0, "bar")] {
        let mut line = format!("{name}:");
        for ratio in [5.0, 30.0, 130.0, 1e3, 1e4] {
            let shear = 0.5 * 17.0 * 1.91;
            let material = ogden(ratio * shear, &[(17.0, 1.91)]);
            let [coarse, fine] = [1.8, 1.0].map(|factor| {
                let mut model = model(&s, factor);
                model.solve(&material, drive, None, &SolveOptions::default(), &never).unwrap().force_n
            });
            line += &format!("  κ/μ {ratio}: {fine:.4} N, coarse {:+.2} %", 100.0 * (coarse / fine - 1.0));
            assert!((coarse / fine - 1.0).abs() < 0.01, "{line}");
        }
        println!("{line}");
    }
}

#[test]
fn the_largest_nominal_deformations_are_reached() {
    for s in [solid(), two_holes(), bar()] {
        for (material, ratio) in [(one_term(), 134.0), (two_terms(), 132.0), (ogden(1.6e5, &[(17.0, 1.91)]), 1e4)] {
            let drive = s.drive_limit_mm();
            let mut model = model(&s, 1.8);
            let found = model.solve(&material, drive, None, &SolveOptions::default(), &never);
            let found = found.unwrap_or_else(|e| panic!("{} at κ/μ ≈ {ratio}: {e}", s.name));
            assert!(found.force_n > 0.0 && found.reaction_imbalance < 1e-4);
            let points = model.quadrature_fields(&material, &found);
            assert!(points.iter().all(|p| common::determinant(&p.deformation_gradient) > 0.0));
            println!("κ/μ ≈ {ratio}, drive {drive} mm: {:.3} N, {:?}", found.force_n, model.statistics());
        }
    }
}

/// At rest the residual is rounding alone, which must count as converged.
#[test]
fn no_drive_is_no_force() {
    let mut model = model(&two_holes(), 2.5);
    let rest = solve(&mut model, &one_term(), 0.0).unwrap();
    assert!(rest.force_n.abs() < 1e-12 && rest.displacement.iter().flatten().all(|u| u.abs() < 1e-12));
}

#[test]
fn bad_input_is_a_typed_error() {
    let s = two_holes();
    let mut model = model(&s, 2.5);
    let many: Vec<(f64, f64)> = (0..40).map(|i| (1.0, 1.0 + f64::from(i))).collect();
    for drive in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(matches!(solve(&mut model, &one_term(), drive), Err(SolveError::InvalidDrive { .. })));
    }
    assert!(matches!(
        solve(&mut model, &ogden(2000.0, &many), 1.0),
        Err(SolveError::TooManyTerms { num_terms: 40, .. })
    ));
    // Unstable or senseless materials, and drives that no specimen bears, fail typed or not at all; they never panic.
    for (what, material, drive) in [
        ("negative modulus", ogden(2000.0, &[(-17.0, 1.91)]), 5.0),
        ("negative bulk modulus", ogden(-2000.0, &[(17.0, 1.91)]), 5.0),
        ("no terms", ogden(2000.0, &[]), 5.0),
        ("NaN", ogden(2000.0, &[(f64::NAN, 1.91)]), 5.0),
        ("infinite κ", ogden(f64::INFINITY, &[(17.0, 1.91)]), 5.0),
        ("α = 0", ogden(2000.0, &[(17.0, 0.0)]), 5.0),
    ] {
        let result = solve(&mut model, &material, drive);
        println!("{what}: {:?}", result.as_ref().map(|e| e.force_n).map_err(ToString::to_string));
        assert!(matches!(result, Err(SolveError::Diverged { .. })), "{what}");
    }
    let options = SolveOptions { max_iterations: 8, ..SolveOptions::default() };
    for drive in [40.0, 1e4, -1e12] {
        let result = model.solve(&one_term(), drive, None, &options, &never);
        println!("drive {drive} mm: {:?}", result.as_ref().map(|e| e.force_n).map_err(ToString::to_string));
        assert!(matches!(result, Ok(_) | Err(SolveError::Diverged { .. })), "{result:?}");
    }
    // After every failure the model still solves.
    let after = solve(&mut model, &one_term(), 5.0).unwrap().force_n;
    let fresh = solve(&mut common::model(&s, 2.5), &one_term(), 5.0).unwrap().force_n;
    assert!((after / fresh - 1.0).abs() < 1e-9);
}

#[test]
fn cancellation_is_reported_at_once() {
    let mut model = model(&two_holes(), 2.0);
    let at_start = model.solve(&one_term(), 5.0, None, &tight(), &|| true);
    assert!(matches!(at_start, Err(SolveError::Cancelled { reached_mm }) if reached_mm == 0.0));
    for allowed in [1, 3, 5] {
        let calls = AtomicUsize::new(0);
        let stop = || calls.fetch_add(1, Ordering::Relaxed) >= allowed;
        let result = model.solve(&one_term(), 9.0, None, &tight(), &stop);
        assert!(matches!(result, Err(SolveError::Cancelled { reached_mm }) if reached_mm < 9.0));
        // The check is asked once per iteration; one more call distinguishes cancellation from failure.
        let calls = calls.into_inner();
        assert!(calls <= allowed + 3, "{calls} calls");
    }
}
