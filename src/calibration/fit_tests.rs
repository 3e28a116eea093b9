use super::super::options::Held;
use super::super::system::NormalSystem;
use super::super::test_problem::{ogden, same_mesh, scan, tight, truth};
use super::*;
use crate::fem::SolveError;
use nalgebra::DVector;

/// Without noise and on the mesh that made the data, nothing but rounding is left of the truth.
#[test]
fn truth_is_recovered_without_noise() {
    let truth = truth();
    let (mut bench, synthetic) = same_mesh(&truth);
    for start in [ogden(400.0, &[[22.1, 1.34]]), ogden(90.0, &[[11.0, 2.9]])] {
        let data = synthetic.noiseless();
        let found = fit(&mut bench, &scan(), data, &start, &tight(), &|| false).unwrap();
        for p in truth.parameters() {
            // Equilibria are good to 10⁻¹¹ of the force; the worst combination loses three digits of them.
            let error = found.material.value(p) / truth.value(p) - 1.0;
            assert!(error.abs() < 1e-6, "{} {error:e}", p.name());
        }
        assert!(found.loss_u < 1e-12 && found.loss_f < 1e-12 && found.chi2_per_datum < 1e-9);
        assert!(found.reached_limits.is_empty() && found.iterations <= 10, "{}", found.iterations);
    }
}

/// The same of the laws in the first invariant, from starts a fifth away, Yeoh's from the neo-Hookean law.
#[test]
fn laws_are_recovered_without_noise() {
    for law in crate::material::laws() {
        let truth = Material { bulk_kpa: 200.0, terms: vec![], law: Some(law) };
        let (mut bench, synthetic) = same_mesh(&truth);
        let mut start = truth.clone();
        for (n, p) in truth.parameters().into_iter().enumerate() {
            let factor = if p.has_any_sign() { 0.0 } else { [0.8, 1.2][n % 2] };
            start.set(p, factor * truth.value(p));
        }
        let found = fit(&mut bench, &scan(), synthetic.noiseless(), &start, &tight(), &|| false).unwrap();
        for p in truth.parameters() {
            // As above; the coefficients of Yeoh's law are told apart two digits less well.
            let error = (found.material.value(p) - truth.value(p)) / truth.value(p).abs();
            assert!(error.abs() < 1e-4, "{law:?} {}: {error:e}", p.name());
        }
        assert!(found.chi2_per_datum < 1e-9, "{law:?} {}", found.chi2_per_datum);
    }
}

/// χ²(s + h d) − χ²(s) + 2h g·d falls with h², for a free κ and with a prior.
#[test]
fn gradient_of_the_misfit() {
    let (mut bench, synthetic) = same_mesh(&truth());
    let data = synthetic.draw(3, 0);
    let at = ogden(260.0, &[[19.0, 1.7]]);
    for bulk in [Bulk::Free, Bulk::LogPrior { center_kpa: 150.0, log_sd: 0.1 }] {
        let mut system = |m: &Material| {
            let p = bench.predict(&data.drives_mm, m, None, &tight().solve, &|| false).unwrap();
            NormalSystem::new(&[p], &[Target::of_measurement(&data, &scan())], bulk, Held::default()).unwrap()
        };
        let base = system(&at);
        for d in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.6, -0.5, 0.7]] {
            let direction = DVector::from_column_slice(&d);
            let slope = -2.0 * base.gradient.dot(&direction);
            let mut remainder = |h: f64| {
                let moved = system(&base.moved(&at, &(&direction * h)));
                (moved.chi2 - base.chi2 - h * slope).abs()
            };
            let (a, b, c) = (remainder(8e-3), remainder(4e-3), remainder(2e-3));
            // Order 2 up to the third-order part, which is h times the second-order one.
            for rate in [(a / b).log2(), (b / c).log2()] {
                assert!((rate - 2.0).abs() < 0.1, "{d:?} {bulk:?}: {rate} ({a:e} {b:e} {c:e})");
            }
        }
    }
}

/// What cannot work says why, in types.
#[test]
fn failures_are_typed() {
    let (mut bench, synthetic) = same_mesh(&truth());
    let data = synthetic.draw(3, 0);
    let start = ogden(400.0, &[[22.1, 1.34]]);
    let mut run = |data: &Measurement, start: &Material, options: &FitOptions, scan: &ScanSettings, stop: bool| {
        fit(&mut bench, scan, data, start, options, &|| stop).unwrap_err()
    };
    let usual = FitOptions::default();

    let hurried = FitOptions { max_iterations: 1, ..usual };
    let e = run(&data, &start, &hurried, &scan(), false);
    assert!(matches!(e, CalibrationError::NotConverged { iterations: 1, distance, .. } if distance > 0.02), "{e}");
    assert!(e.is_of_the_data());

    let e = run(&data, &start, &usual, &scan(), true);
    assert!(matches!(e, CalibrationError::Solve(SolveError::Cancelled { .. })) && !e.is_of_the_data(), "{e}");

    let mut short = data.clone();
    short.displacements[0].pop();
    let e = run(&short, &start, &usual, &scan(), false);
    assert!(matches!(e, CalibrationError::DataLength { found, expected, .. } if found + 1 == expected), "{e}");

    let mut no_force = data.clone();
    no_force.forces_n[0] = f64::NAN;
    assert!(matches!(run(&no_force, &start, &usual, &scan(), false), CalibrationError::InvalidValue { .. }));

    let mut empty = data.clone();
    empty.displacements[0].fill([f64::NAN; 3]);
    assert!(matches!(run(&empty, &start, &usual, &scan(), false), CalibrationError::InvalidValue { .. }));

    let silent = ScanSettings { force_sd_n: 0.0, ..scan() };
    assert!(matches!(run(&data, &start, &usual, &silent, false), CalibrationError::Information(_)));

    let unstable = ogden(400.0, &[[22.0, -1.3]]);
    assert!(matches!(run(&data, &unstable, &usual, &scan(), false), CalibrationError::InvalidStart(_)));

    let twins = ogden(400.0, &[[10.0, 2.0], [5.0, 1.5]]);
    assert!(matches!(run(&data, &twins, &usual, &scan(), false), CalibrationError::CloseExponents { .. }));

    let eager = FitOptions { tolerance: f64::NAN, ..usual };
    assert!(matches!(run(&data, &start, &eager, &scan(), false), CalibrationError::InvalidValue { .. }));
}

/// Voxels that the scan lost do not disturb the rest.
#[test]
fn missing_voxels_are_left_out() {
    let truth = truth();
    let (mut bench, synthetic) = same_mesh(&truth);
    let mut data = synthetic.noiseless().clone();
    for (v, u) in data.displacements[0].iter_mut().enumerate() {
        if v % 3 == 0 {
            u[v % 2] = f64::NAN;
        }
    }
    let start = ogden(300.0, &[[20.0, 1.6]]);
    let found = fit(&mut bench, &scan(), &data, &start, &tight(), &|| false).unwrap();
    let all = fit(&mut bench, &scan(), synthetic.noiseless(), &start, &tight(), &|| false).unwrap();
    for p in truth.parameters() {
        // As above.
        assert!((found.material.value(p) / truth.value(p) - 1.0).abs() < 1e-6);
        // Fewer data, wider.
        assert!(found.sd(p).unwrap() > all.sd(p).unwrap());
    }
}

/// κ where the caller wants it: held, drawn to a prior, free.
#[test]
fn bulk_is_free_drawn_or_held() {
    let (mut bench, synthetic) = same_mesh(&truth());
    let data = synthetic.noiseless();
    let start = ogden(260.0, &[[20.0, 1.6]]);
    let mut with = |bulk| {
        let options = FitOptions { bulk, ..tight() };
        fit(&mut bench, &scan(), data, &start, &options, &|| false).unwrap()
    };
    let free = with(Bulk::Free);
    let held = with(Bulk::Held);
    assert_eq!(held.material.bulk_kpa.to_bits(), 260f64.to_bits());
    assert_eq!(held.sd(Parameter::Kappa), None);
    // A known nuisance leaves less doubt about the rest.
    assert!(held.sd(Parameter::Mu(0)).unwrap() <= free.sd(Parameter::Mu(0)).unwrap());

    let log_sd = free.sd(Parameter::Kappa).unwrap() / 200.0;
    let equal = with(Bulk::LogPrior { center_kpa: 200.0 * (0.2 * log_sd).exp(), log_sd });
    // Prior and data weigh alike, so the estimate is half-way between them; the model's curvature shifts it a little.
    let part = (equal.material.bulk_kpa / 200.0).ln() / (0.2 * log_sd);
    assert!((part - 0.5).abs() < 0.02, "{part}");
    // And the variance is halved.
    let ratio = equal.sd(Parameter::Kappa).unwrap() / free.sd(Parameter::Kappa).unwrap();
    assert!((ratio - 0.5f64.sqrt()).abs() < 0.02, "{ratio}");
}

/// A prior so strong that nothing else counts pulls κ against its range, and the fit says so.
#[test]
fn limits_are_reported() {
    let (mut bench, synthetic) = same_mesh(&truth());
    let start = ogden(260.0, &[[20.0, 1.6]]);
    let bulk = Bulk::LogPrior { center_kpa: 1.0, log_sd: 1e-3 };
    let options = FitOptions { bulk, max_iterations: 60, ..FitOptions::default() };
    let found = fit(&mut bench, &scan(), synthetic.noiseless(), &start, &options, &|| false).unwrap();
    // Five times the start's shear modulus ½ · 20 · 1.6 kPa; the exponential rounds.
    assert!((found.material.bulk_kpa / 80.0 - 1.0).abs() < 1e-6, "{}", found.material.bulk_kpa);
    assert_eq!(found.reached_limits, ["kappa: smallest"]);
}
