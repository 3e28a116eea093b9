//! The load model against closed forms and differences.

use super::*;
use crate::homogeneous::incompressible_stress;

fn curve(test: HomogeneousTest) -> LoadCurve {
    let end = if test == HomogeneousTest::SimpleShear { 1.2 } else { 2.2 };
    let rest = test.rest();
    let time: Vec<f64> = (1..=80).map(|i| 0.5 * f64::from(i)).collect();
    let drive: Vec<f64> = time
        .iter()
        .map(|t| {
            // Up, a little below rest, up again.
            let p = if *t < 12.0 {
                t / 12.0
            } else if *t < 28.0 {
                1.0 - (t - 12.0) / 14.0
            } else {
                (t - 28.0) / 12.0 - 1.0 / 7.0
            };
            rest + (end - rest) * p
        })
        .collect();
    LoadCurve::new("c", test, &time, &drive, &vec![0.0; 80]).unwrap()
}

fn full() -> Layout {
    let physics = Physics {
        num_relaxations: 2,
        is_nominal: false,
        has_softening: true,
        has_barrelling: true,
        has_friction: true,
        has_offset: true,
        has_gain: true,
    };
    Layout { signs: vec![1.0, 1.0], physics, num_curves: 2 }
}

const X: [f64; 15] = [3.4, 1.9, 1.2, -2.5, 0.4, 0.7, 0.2, 2.5, 0.3, 1.1, 0.1, 0.15, 0.7, -0.4, 1.08];

/// Without physics the elastic stress; with every strength at its nominal value too.
#[test]
fn nominal_values_are_the_elastic_material() {
    for test in [HomogeneousTest::Uniaxial, HomogeneousTest::PureShear, HomogeneousTest::SimpleShear] {
        let c = curve(test);
        let prepared = Prepared::new(1, &c);
        let plain = Layout { signs: vec![1.0, 1.0], physics: Physics::default(), num_curves: 2 };
        let elastic = model(&plain, &X[..4], &prepared).stress_kpa;
        let mut nominal = X;
        for i in [4, 6, 8, 11, 12, 13] {
            nominal[i] = 0.0;
        }
        nominal[14] = 1.0;
        let found = model(&full(), &nominal, &prepared).stress_kpa;
        for (i, d) in c.drive.iter().enumerate() {
            let exact = incompressible_stress(&plain.terms(&X), &test.at(*d));
            assert!((elastic[i] - exact).abs() < 1e-11 && (found[i] - exact).abs() < 1e-11);
        }
    }
}

/// Every derivative of the full model: second-order Taylor remainder, in all tests.
#[test]
fn derivatives_pass_the_taylor_test() {
    for test in [HomogeneousTest::Uniaxial, HomogeneousTest::Equibiaxial, HomogeneousTest::SimpleShear] {
        let prepared = Prepared::new(1, &curve(test));
        let mut layout = full();
        layout.physics.is_nominal = test == HomogeneousTest::Equibiaxial;
        assert_eq!(layout.num_unknowns(), X.len());
        let base = model(&layout, &X, &prepared);
        for u in 0..X.len() {
            let one_side = |h: f64| {
                let mut moved = X;
                moved[u] += h;
                let found = model(&layout, &moved, &prepared).stress_kpa;
                (0..found.len())
                    .map(|i| (found[i] - base.stress_kpa[i] - h * base.by_unknown[u][i]).abs())
                    .fold(0.0, f64::max)
            };
            let remainder = |h: f64| one_side(h) + one_side(-h);
            let (coarse, fine) = (remainder(1e-3), remainder(1e-4));
            // Rounding of stresses of order 100.
            assert!(fine < 0.02 * coarse + 1e-10, "{test:?} unknown {u}: {coarse} {fine}");
        }
    }
}

/// A jump to λ and a hold: all of (1 + Σ g) at once, equilibrium in the end. Exact in Simo's model, because the
/// reference stress is constant after the jump.
#[test]
fn relaxation_goes_from_instantaneous_to_equilibrium() {
    let layout =
        Layout { signs: vec![1.0], physics: Physics { num_relaxations: 1, ..Physics::default() }, num_curves: 1 };
    let x = [3.0, 2.0, 0.5, 4f64.ln()];
    let c = LoadCurve::new("j", HomogeneousTest::Uniaxial, &[0.0, 4.0, 400.0], &[1.8; 3], &[0.0; 3]).unwrap();
    let found = model(&layout, &x, &Prepared::new(0, &c)).stress_kpa;
    let elastic = incompressible_stress(&layout.terms(&x), &HomogeneousTest::Uniaxial.at(1.8));
    for (value, factor) in found.iter().zip([1.5, 1.0 + 0.5 * (-1f64).exp(), 1.0]) {
        assert!((value - factor * elastic).abs() < 1e-10, "{value} {factor} {elastic}");
    }
}

/// Softening: the first loading is the primary curve, unloading lies below it, reloading follows the unloading.
#[test]
fn softening_needs_a_past() {
    let layout =
        Layout { signs: vec![1.0], physics: Physics { has_softening: true, ..Physics::default() }, num_curves: 1 };
    let x = [3.0, 2.0, 0.4, 1.0, 0.05];
    let drive = [1.2, 1.6, 2.0, 1.6, 1.2, 1.6, 2.0, 2.3];
    let c = LoadCurve::new("m", HomogeneousTest::Uniaxial, &[], &drive, &[0.0; 8]).unwrap();
    let found = model(&layout, &x, &Prepared::new(0, &c)).stress_kpa;
    let primary = |d: f64| incompressible_stress(&layout.terms(&x), &HomogeneousTest::Uniaxial.at(d));
    for i in [0, 1, 2, 6, 7] {
        assert!((found[i] - primary(drive[i])).abs() < 1e-11);
    }
    assert!(found[3] < 0.97 * found[1] && (found[3] - found[5]).abs() < 1e-11);
}
