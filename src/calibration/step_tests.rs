use super::super::test_problem::ogden;
use super::*;
use crate::sensitivity::FisherInformation;

fn system(material: &Material, matrix: DMatrix<f64>, gradient: &[f64]) -> NormalSystem {
    let parameters = material.parameters();
    NormalSystem {
        values: parameters.iter().map(|p| material.value(*p)).collect(),
        scales: crate::calibration::system::scales_of(material),
        parameters,
        information: FisherInformation::none(material),
        matrix,
        gradient: DVector::from_column_slice(gradient),
        chi2: 1.0,
        loss_u: 0.0,
        loss_f: 0.0,
    }
}

fn two_terms() -> Material {
    ogden(2000.0, &[[16.0, 1.9], [0.35, 3.2]])
}

/// Without limits: the normal equations, and the distance of Newton's decrement.
#[test]
fn unlimited_steps_are_newton_steps() {
    let material = ogden(2000.0, &[[16.0, 1.9]]);
    let matrix = DMatrix::from_row_slice(3, 3, &[4.0, 1.0, 0.0, 1.0, 9e4, 1e2, 0.0, 1e2, 1e2]);
    let gradient = [0.4, 30.0, 1.0];
    let s = system(&material, matrix.clone(), &gradient);
    let constraints = Constraints::new(&material, &FitOptions::default()).unwrap();
    let step = constraints.step(&s, 0.0, true).unwrap();
    let exact = matrix.lu().solve(&s.gradient).unwrap();
    // The ridge of 10⁻¹² times the scaled condition number.
    assert!((&step.change - &exact).amax() < 1e-10);
    assert!((step.distance - s.gradient.dot(&exact).sqrt()).abs() < 1e-10);
    assert!(step.reached.is_empty());
}

/// The optimum of a separable problem in a box, in closed form.
#[test]
fn trust_limits_cut_each_parameter() {
    let material = ogden(2000.0, &[[16.0, 1.9]]);
    let s = system(&material, DMatrix::from_diagonal(&DVector::from_row_slice(&[1.0, 1e4, 1e6])), &[5.0, -2e4, 1e5]);
    let constraints = Constraints::new(&material, &FitOptions::default()).unwrap();
    let step = constraints.step(&s, 0.0, true).unwrap();
    for (found, exact) in step.change.iter().zip([MAX_LOG_CHANGE, -MAX_LOG_CHANGE, 0.1]) {
        // Interior-point tolerance over the smallest scaled curvature.
        assert!((found - exact).abs() < 1e-6, "{found} {exact}");
    }
    assert_eq!(step.reached, ["kappa: step", "mu_1: step"]);
}

/// At a limit without any room the other parameters still move.
#[test]
fn a_reached_limit_leaves_the_others_free() {
    let start = ogden(2000.0, &[[16.0, 1.9]]);
    let constraints = Constraints::new(&start, &FitOptions::default()).unwrap();
    let mut at = start.clone();
    at.bulk_kpa = constraints.bulk_range[0];
    let s = system(&at, DMatrix::from_diagonal(&DVector::from_row_slice(&[1e6, 1e4, 1e4])), &[-4e6, 1e3, -1e3]);
    let step = constraints.step(&s, 0.0, false).unwrap();
    for (found, exact) in step.change.iter().zip([0.0, 0.1, -0.1]) {
        // Rounding: the limit is an equation in the end.
        assert!((found - exact).abs() < 1e-11, "{found} {exact}");
    }
    assert_eq!(step.reached, ["kappa: smallest"]);
    // Of the free part only: √(2 (100 − 50 + 100 − 50)).
    assert!((step.distance - 200f64.sqrt()).abs() < 1e-3, "{}", step.distance);
}

/// Exponents that the data draw together stop at the gap, at the point nearest in the metric of the data.
#[test]
fn exponents_keep_their_distance() {
    let material = two_terms();
    let matrix = DMatrix::from_diagonal(&DVector::from_row_slice(&[1.0, 1e4, 1e4, 1e4, 1e4]));
    // Free optimum: α₁ 1.9 → 2.66, α₂ 3.2 → 1.92.
    let s = system(&material, matrix, &[0.0, 0.0, 4e3, 0.0, -4e3]);
    let constraints = Constraints::new(&material, &FitOptions::default()).unwrap();
    let step = constraints.step(&s, 0.0, true).unwrap();
    let moved = s.moved(&material, &step.change);
    let (a1, a2) = (moved.terms[0].alpha, moved.terms[1].alpha);
    assert!(a2 - a1 >= 1.0 - 1e-12 && a2 - a1 < 1.0 + 1e-6, "{a1} {a2}");
    assert_eq!(step.reached, ["alpha_2 - alpha_1: smallest"]);
    // Projection of (0.4, −0.4) on 3.2 s₂ − 1.9 s₁ = −0.3 with equal weights.
    let violation = (3.2 * -0.4 - 1.9 * 0.4 + 0.3) / (3.2f64.powi(2) + 1.9f64.powi(2));
    assert!((step.change[2] - (0.4 + 1.9 * violation)).abs() < 1e-6);
    assert!((step.change[4] - (-0.4 - 3.2 * violation)).abs() < 1e-6);
}

/// A second term that stands at the smallest distance of exponents and fades: other limits are farther away by seven
/// decades.
#[test]
fn limits_far_away_do_not_spoil_the_step() {
    let start = ogden(2173.0, &[[1.2, 8.0], [17.0, 1.9]]);
    let constraints = Constraints::new(&start, &FitOptions::default()).unwrap();
    let at = ogden(2110.0, &[[0.0012, 2.9], [17.16, 1.9]]);
    // Correlations of 0.99 between parameters that are known to 26, 0.011, 0.022, 783 and 1107.
    let roots = [0.038, 0.0114, 0.022, 783.0, 1107.0].map(|r: f64| 1.0 / r);
    let correlation = [
        [1.0, 0.087, 0.099, 0.076, 0.083],
        [0.087, 1.0, 0.94, 0.965, 0.988],
        [0.099, 0.94, 1.0, 0.82, 0.9765],
        [0.076, 0.965, 0.82, 1.0, 0.916],
        [0.083, 0.988, 0.9765, 0.916, 1.0],
    ];
    let root = |i: usize| 1.0 / roots[i];
    let matrix = DMatrix::from_fn(5, 5, |i, j| correlation[i][j] * root(i) * root(j));
    let gradient: Vec<f64> =
        [-0.00098, -0.0565, -0.185, -0.011, -0.0113].iter().enumerate().map(|(i, g)| g * root(i)).collect();
    let s = system(&at, matrix.clone(), &gradient);
    let step = constraints.step(&s, 0.0, true).unwrap();
    // No step within the limits does better: steps drawn around the found one, cut to the limits on the way from rest.
    let value = |x: &DVector<f64>| 0.5 * x.dot(&(&matrix * x)) - s.gradient.dot(x);
    let limits = constraints.limits(&s, true);
    let used = |l: &NamedLimit, x: &DVector<f64>| l.limit.value(x.as_slice());
    assert!(limits.iter().all(|l| used(l, &step.change) <= l.limit.bound + 1e-9), "{:?}", step.reached);
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    for n in 0..20_000 {
        let size = 10f64.powi(-(n % 6));
        let mut x = DVector::from_fn(5, |i, _| step.change[i] + size * random() / root(i));
        let part = limits
            .iter()
            .filter(|l| used(l, &x) > l.limit.bound)
            .map(|l| (l.limit.bound / used(l, &x)).max(0.0))
            .fold(1.0, f64::min);
        x *= part;
        assert!(value(&x) >= value(&step.change) - 1e-9, "{x} is better than {}", step.change);
    }
}

/// Directions without any information stay; no panic, no huge step.
#[test]
fn singular_systems_have_a_step() {
    let material = two_terms();
    // Only μ₁ + μ₂ is seen, κ not at all.
    let mut matrix = DMatrix::zeros(5, 5);
    for (i, j) in [(1, 1), (1, 3), (3, 1), (3, 3)] {
        matrix[(i, j)] = 1e4;
    }
    let s = system(&material, matrix, &[0.0, 1e3, 0.0, 1e3, 0.0]);
    let constraints = Constraints::new(&material, &FitOptions::default()).unwrap();
    let step = constraints.step(&s, 0.0, true).unwrap();
    // The ridge's share: 10⁻¹² of the scaled system.
    assert!((step.change[1] + step.change[3] - 0.1).abs() < 1e-9);
    assert!(step.change[0].abs() < 1e-9 && step.change[2].abs() < 1e-9);
}

/// A term that fades stops at 10⁻⁹ of its start.
#[test]
fn fading_terms_stop() {
    let start = two_terms();
    let constraints = Constraints::new(&start, &FitOptions::default()).unwrap();
    let mut faded = start.clone();
    faded.terms[1].mu_kpa = 0.35e-9 * 1.01;
    let s = system(&faded, DMatrix::identity(5, 5), &[0.0, 0.0, 0.0, -0.4, 0.0]);
    let step = constraints.step(&s, 0.0, true).unwrap();
    let moved = s.moved(&faded, &step.change);
    assert!(moved.terms[1].mu_kpa >= 0.35e-9 * (1.0 - 1e-9) && moved.terms[1].mu_kpa < 0.35e-9 * 1.0001);
    assert_eq!(step.reached, ["mu_2: smallest size"]);
}

/// A matrix that is not finite is an error, not a step.
#[test]
fn nonsense_is_refused() {
    let material = ogden(2000.0, &[[16.0, 1.9]]);
    let s = system(&material, DMatrix::from_element(3, 3, f64::NAN), &[1.0, 1.0, 1.0]);
    let constraints = Constraints::new(&material, &FitOptions::default()).unwrap();
    assert!(matches!(constraints.step(&s, 0.0, true), Err(CalibrationError::Subproblem { .. })));
}
