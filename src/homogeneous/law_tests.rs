//! Laws in the first invariant in fits to curves.

use super::super::curve_law::{CurveLaw, OgdenTerms};
use super::super::deformation::{Deformation, HomogeneousTest};
use super::super::fit::{BULK_OVER_SHEAR, fit_law, model_stress};
use super::*;
use crate::material::{ArrudaBoyce, Gent, InvariantLaw, MooneyRivlin, NeoHookean, ShearTerm, Yeoh, laws};
use nalgebra::DVector;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

const TESTS: [(HomogeneousTest, f64); 4] = [
    (HomogeneousTest::Uniaxial, 2.6),
    (HomogeneousTest::Equibiaxial, 1.7),
    (HomogeneousTest::PureShear, 2.2),
    (HomogeneousTest::SimpleShear, 1.2),
];

/// Curves of a law with relative noise.
fn curves(law: &dyn CurveLaw, bulk_kpa: Option<f64>, noise: f64, seed: u64) -> Vec<Curve> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let curve = |(test, end): (HomogeneousTest, f64)| {
        let start = if test == HomogeneousTest::SimpleShear { 0.0 } else { 0.8 };
        let drive: Vec<f64> = (0..25).map(|i| start + (end - start) * f64::from(i) / 24.0).collect();
        let states: Vec<Deformation> = drive.iter().map(|&d| test.at(d)).collect();
        let mut stress = model_stress(law, bulk_kpa, &states).unwrap();
        let scale = (stress.iter().map(|s| s * s).sum::<f64>() / stress.len() as f64).sqrt();
        for s in &mut stress {
            *s += noise * scale * rng.sample::<f64, _>(StandardNormal);
        }
        Curve::new(test.name(), test, &drive, &stress).unwrap()
    };
    TESTS.map(curve).into()
}

/// Laws that stiffen within the curves, so much that none of them looks like another, and those that cannot.
fn truths() -> [InvariantLaw; 5] {
    [
        InvariantLaw::Yeoh(Yeoh { coefficients_kpa: [8.0, -0.3, 0.05] }),
        InvariantLaw::Gent(Gent { mu_kpa: 16.0, limit: 6.0 }),
        InvariantLaw::ArrudaBoyce(ArrudaBoyce { mu_kpa: 15.0, locking_stretch: 1.4 }),
        InvariantLaw::NeoHookean(NeoHookean { mu_kpa: 16.0 }),
        InvariantLaw::MooneyRivlin(MooneyRivlin { coefficients_kpa: [6.0, 2.0] }),
    ]
}

fn options_of(law: Option<LawKind>, bulk_kpa: Option<f64>) -> CurveFitOptions {
    CurveFitOptions { law, bulk_kpa, ..CurveFitOptions::default() }
}

/// Textbook formulas: nominal stress 2 (W′ + c/λ) (λ − 1/λ²), 2 (W′ + c λ²) (λ − 1/λ⁵), 2 (W′ + c) (λ − 1/λ³) and
/// 2 (W′ + c) γ, where c (Ī₂ − 3) is a part of the law. Rounding only.
#[test]
fn stresses_are_the_closed_forms() {
    for law in laws() {
        for l in [0.7f64, 1.0, 1.3, 1.8] {
            let (shear, slope) = (l - 1.0, |x: f64| 2.0 * law.slopes_at(x)[0]);
            let c = match law {
                InvariantLaw::MooneyRivlin(law) => 2.0 * law.coefficients_kpa[1],
                _ => 0.0,
            };
            let expected = [
                (HomogeneousTest::Uniaxial, l, (slope(l * l + 2.0 / l - 3.0) + c / l) * (l - l.powi(-2))),
                (
                    HomogeneousTest::Equibiaxial,
                    l,
                    (slope(2.0 * l * l + l.powi(-4) - 3.0) + c * l * l) * (l - l.powi(-5)),
                ),
                (HomogeneousTest::PureShear, l, (slope(l * l + l.powi(-2) - 2.0) + c) * (l - l.powi(-3))),
                (HomogeneousTest::SimpleShear, shear, (slope(shear * shear) + c) * shear),
            ];
            for (test, drive, expected) in expected {
                let found = law.incompressible_stress(&test.at(drive));
                assert!(
                    (found - expected).abs() < 1e-12 * (1.0 + expected.abs()),
                    "{law:?} {test:?}: {found} {expected}"
                );
            }
        }
    }
}

/// κ → ∞ of the compressible response is the incompressible stress: the difference falls as 1/κ.
#[test]
fn the_incompressible_limit_is_the_limit() {
    for law in laws() {
        for (test, _) in TESTS {
            let state = [test.at(if test == HomogeneousTest::SimpleShear { 0.6 } else { 1.6 })];
            let limit = model_stress(&law, None, &state).unwrap()[0];
            let gap = |bulk| model_stress(&law, Some(bulk), &state).unwrap()[0] - limit;
            let (near, far) = (gap(1e4), gap(1e6));
            assert!(far.abs() < 1.1e-2 * near.abs() + 1e-7, "{law:?} {test:?} {near} {far}");
        }
    }
}

/// Derivatives by the unknowns, of Ogden's terms and of every law, with κ and without: the remainder of the first-order
/// model falls with the square of the step.
#[test]
fn rows_pass_the_taylor_test() {
    fn check<L: CurveLaw>(law: &L, bulk_kpa: Option<f64>) {
        let material = |law: &L| bulk_kpa.map(|bulk| law.material(bulk));
        let x = law.unknowns();
        // Both rows of a biaxial test: the stress along either axis.
        let biaxial = [[1.6, 1.2], [1.2, 1.6]].map(|stretches| Deformation::Biaxial { stretches });
        for state in TESTS.map(|(test, end)| test.at(0.8 * end)).into_iter().chain(biaxial) {
            let mut row = vec![0.0; x.len()];
            let stress = law.stress_and_row(material(law).as_ref(), &state, 1.0, &mut row).unwrap();
            for u in 0..x.len() {
                let one_side = |h: f64| {
                    let mut moved = x.clone();
                    moved[u] += h;
                    let moved = law.with_unknowns(&moved);
                    let mut ignored = row.clone();
                    let there = moved.stress_and_row(material(&moved).as_ref(), &state, 1.0, &mut ignored).unwrap();
                    (there - stress - h * row[u]).abs()
                };
                // Both sides: on one of them the second and third orders may cancel.
                let remainder = |h: f64| one_side(h) + one_side(-h);
                let (coarse, fine) = (remainder(1e-2), remainder(1e-3));
                // Newton's tolerance is 1e-13 of κ; a remainder near it has no rate.
                assert!(fine < 0.02 * coarse + 1e-9, "{state:?} {u}: {coarse} {fine}");
            }
        }
    }
    let term = |modulus_kpa, alpha| ShearTerm { modulus_kpa, alpha };
    for bulk_kpa in [None, Some(400.0)] {
        check(&OgdenTerms::free(&[term(4.0, 5.0), term(25.0, 1.4)]), bulk_kpa);
        for law in truths() {
            check(&law, bulk_kpa);
        }
    }
}

/// Parameters and shear modulus move with the unknowns as the map and the gradient say; Taylor as above.
#[test]
fn maps_pass_the_taylor_test() {
    for law in truths() {
        let (x, map, gradient) = (law.unknowns(), law.parameter_map(), law.modulus_gradient());
        let direction = DVector::from_fn(x.len(), |i, _| 1.0 + i as f64);
        let remainder = |h: f64| {
            let moved = law.with_unknowns(&x.iter().zip(&direction).map(|(x, d)| x + h * d).collect::<Vec<_>>());
            let rise = &map * &direction * h;
            let values = CurveLaw::parameters(&law).into_iter().zip(CurveLaw::parameters(&moved));
            let of_parameters: f64 = values.zip(rise.iter()).map(|((a, b), r)| (b.value - a.value - r).abs()).sum();
            let by_gradient: f64 = gradient.iter().zip(&direction).map(|(g, d)| g * d * h).sum();
            let modulus = |law: &InvariantLaw| CurveLaw::initial_shear_modulus_kpa(law);
            of_parameters + (modulus(&moved) - modulus(&law) - by_gradient).abs()
        };
        let (coarse, fine) = (remainder(1e-2), remainder(1e-3));
        assert!(fine < 0.02 * coarse + 1e-12, "{law:?} {coarse} {fine}");
    }
}

/// Exact curves give the exact law, with κ and without: the refinement's tolerance of 1e-10 in the sum leaves 1e-5 in
/// weak directions.
#[test]
fn exact_curves_are_recovered() {
    for truth in truths() {
        for bulk_kpa in [None, Some(400.0)] {
            let data = curves(&truth, bulk_kpa, 0.0, 1);
            let kind = truth.kind();
            let fit = fit_law(&data, kind, &options_of(Some(kind), bulk_kpa)).unwrap();
            for (found, truth) in CurveLaw::parameters(&fit.law).iter().zip(CurveLaw::parameters(&truth)) {
                assert!((found.value - truth.value).abs() < 1e-3 * truth.value.abs(), "{found:?} {truth:?}");
            }
            assert!(fit.is_converged && !fit.is_at_limit);
        }
    }
}

/// 300 draws of each law with 1 % noise: the 95 % intervals of parameters and shear modulus hold the truth in 91 to
/// 98.5 % of them (binomial 95 % ± 3 standard deviations of 1.26 %), and in at least 95 % no other law is said to be
/// better than the one that made the data. Laws that come near it share its misfit but for noise; a richer one has to
/// fall below it by more than the price of its parameters, ln 100 each.
#[test]
fn intervals_cover_and_the_law_is_found() {
    let draws = 300;
    for truth in truths() {
        let kind = truth.kind();
        let values: Vec<f64> = CurveLaw::parameters(&truth).iter().map(|p| p.value).collect();
        let modulus = CurveLaw::initial_shear_modulus_kpa(&truth);
        let (mut inside, mut taken) = (vec![0; values.len() + 1], 0);
        for seed in 0..draws {
            let data = curves(&truth, None, 0.01, seed);
            let options = CurveFitOptions { max_terms: 2, num_starts: 2, ..options_of(Some(kind), None) };
            let sequence = fit_curves(&data, &options).unwrap();
            let fit = sequence.chosen();
            for (i, p) in fit.parameters.iter().enumerate() {
                let [low, high] = p.interval_95.unwrap();
                inside[i] += usize::from(low <= values[i] && values[i] <= high);
            }
            let [low, high] = fit.initial_shear_modulus_kpa.interval_95;
            inside[values.len()] += usize::from(low <= modulus && modulus <= high);
            let comparison = compare_laws(&data, &sequence, &options).unwrap();
            taken += usize::from(comparison.better_than(comparison.of(fit).unwrap()).is_none());
        }
        println!("{}: inside {inside:?} of {draws}, taken {taken}", kind.name());
        assert!(inside.iter().all(|&n| (273..=296).contains(&n)), "{inside:?}");
        assert!(taken >= 285, "{taken}");
    }
}

/// A Gent fit of a material that does not stiffen says so, and stays within what a material may hold.
#[test]
fn what_the_data_do_not_call_for_is_said() {
    let data = curves(&OgdenTerms::free(&[ShearTerm { modulus_kpa: 30.0, alpha: 2.0 }]), None, 0.0, 1);
    for kind in [LawKind::Gent, LawKind::ArrudaBoyce] {
        let sequence = fit_curves(&data, &options_of(Some(kind), None)).unwrap();
        let fit = sequence.chosen();
        assert!((fit.initial_shear_modulus_kpa.value - 15.0).abs() < 0.01, "{fit:?}");
        // Within 1e-5 of the neo-Hookean stresses.
        assert!(fit.curves.iter().all(|m| m.relative_rms_error < 1e-3), "{fit:?}");
        assert!(fit.material().is_ok());
    }
}

/// A fit is a material in its own schema; without κ it stands for the incompressible limit.
#[test]
fn a_fit_is_a_material_of_its_law() {
    for truth in truths() {
        let kind = truth.kind();
        let data = curves(&truth, None, 0.0, 1);
        let sequence = fit_curves(&data, &options_of(Some(kind), None)).unwrap();
        let material = sequence.chosen().material().unwrap();
        assert_eq!(material.law.map(|law| law.kind()), Some(kind));
        let ratio = material.bulk_kpa / material.initial_shear_modulus_kpa();
        assert!((ratio / BULK_OVER_SHEAR - 1.0).abs() < 1e-12);
        assert_eq!(sequence.chosen().name(), kind.name());
    }
}

/// A softening Yeoh material that turns unstable within the data is not taken for one, and the comparison says why.
#[test]
fn unstable_laws_are_left_out() {
    let law = InvariantLaw::Yeoh(Yeoh { coefficients_kpa: [8.0, -1.2, 0.0] });
    let drive: Vec<f64> = (0..30).map(|i| 1.0 + 0.05 * f64::from(i)).collect();
    let states: Vec<Deformation> = drive.iter().map(|&d| HomogeneousTest::Uniaxial.at(d)).collect();
    let stress = model_stress(&law, None, &states).unwrap();
    let data = [Curve::new("soft", HomogeneousTest::Uniaxial, &drive, &stress).unwrap()];
    let found = fit_law(&data, LawKind::Yeoh, &options_of(Some(LawKind::Yeoh), None));
    assert!(matches!(found, Err(CurveFitError::NoLawFit { law: "Yeoh" })), "{found:?}");
    let options = options_of(None, None);
    let comparison = compare_laws(&data, &fit_curves(&data, &options).unwrap(), &options).unwrap();
    assert_eq!(comparison.left_out.iter().map(|l| l.name.as_str()).collect::<Vec<_>>(), ["Yeoh"]);
}

#[test]
fn too_few_data_are_refused() {
    let data = [Curve::new("short", HomogeneousTest::Uniaxial, &[1.1, 1.2, 1.3], &[1.0, 2.0, 3.0]).unwrap()];
    let found = fit_law(&data, LawKind::Yeoh, &options_of(Some(LawKind::Yeoh), None));
    assert!(matches!(found, Err(CurveFitError::TooFewForLaw { num_parameters: 3, num_data: 3, .. })), "{found:?}");
    let bad = options_of(Some(LawKind::Gent), Some(-1.0));
    assert!(matches!(fit_law(&data, LawKind::Gent, &bad), Err(CurveFitError::Setting { name: "bulk_kpa", .. })));
}
