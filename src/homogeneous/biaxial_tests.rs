//! Biaxial tests: closed forms of both stresses, and fits to them.

use super::super::deformation::HomogeneousTest;
use super::super::result::fit_curves;
use super::*;
use crate::material::{ShearTerm, laws};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

const TERMS: [ShearTerm; 2] = [ShearTerm { modulus_kpa: 4.0, alpha: 5.5 }, ShearTerm { modulus_kpa: 26.0, alpha: 1.6 }];

/// Both nominal stresses of the stretches, kPa.
fn both(law: &dyn CurveLaw, bulk_kpa: Option<f64>, [a, b]: [f64; 2]) -> [f64; 2] {
    let states = [[a, b], [b, a]].map(|stretches| Deformation::Biaxial { stretches });
    model_stress(law, bulk_kpa, &states).unwrap().try_into().unwrap()
}

/// Σ μ (λ₁^(α−1) − (λ₁λ₂)^(−α)/λ₁) along either axis; rounding only.
#[test]
fn stresses_are_the_closed_forms() {
    for stretches in [[1.3, 1.3], [1.5, 1.0], [1.7, 1.2], [1.4, 0.9], [0.8, 0.9]] {
        let found = both(&OgdenTerms::free(&TERMS), None, stretches);
        for (axis, found) in found.into_iter().enumerate() {
            let (own, other): (f64, f64) = (stretches[axis], stretches[1 - axis]);
            let of = |t: &ShearTerm| t.mu_kpa() * (own.powf(t.alpha) - (own * other).powf(-t.alpha)) / own;
            let expected: f64 = TERMS.iter().map(of).sum();
            assert!((found - expected).abs() < 1e-12 * (1.0 + expected.abs()), "{stretches:?}: {found} {expected}");
        }
    }
}

/// Equal stretches are the equibiaxial test, a second stretch of 1 is pure shear, and the second stretch at which a
/// uniaxial test is free leaves no second stress; with κ and without, of every law. Newton's tolerance is 1e-13 of κ.
#[test]
fn special_stretches_are_the_other_tests() {
    fn check(law: &dyn CurveLaw, bulk_kpa: Option<f64>) {
        let one = |test: HomogeneousTest, l: f64| model_stress(law, bulk_kpa, &[test.at(l)]).unwrap()[0];
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b} {bulk_kpa:?}");
        for l in [0.8, 1.2, 1.6] {
            let [first, second] = both(law, bulk_kpa, [l, l]);
            near(first, one(HomogeneousTest::Equibiaxial, l));
            near(second, first);
            near(both(law, bulk_kpa, [l, 1.0])[0], one(HomogeneousTest::PureShear, l));
            let free = match bulk_kpa {
                None => l.powf(-0.5),
                Some(bulk) => {
                    let uniaxial = HomogeneousTest::Uniaxial.at(l);
                    respond(&law.material(bulk), &uniaxial).unwrap().principal_stretches[1]
                }
            };
            let [first, second] = both(law, bulk_kpa, [l, free]);
            near(first, one(HomogeneousTest::Uniaxial, l));
            near(second, 0.0);
        }
    }
    for bulk_kpa in [None, Some(60.0), Some(2000.0)] {
        check(&OgdenTerms::free(&TERMS), bulk_kpa);
        laws().iter().for_each(|law| check(law, bulk_kpa));
    }
}

/// Three ratios of the strains, both stresses with the noise of one kind of load cell.
fn tests(bulk_kpa: Option<f64>, noise_kpa: f64, seed: u64) -> Vec<Curve> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut of_ratio = |ratio: f64| {
        let strains = (1..=30).map(|i| 0.7 * f64::from(i) / 30.0);
        let stretches: Vec<[f64; 2]> = strains.map(|e| [1.0 + e, 1.0 + ratio * e]).collect();
        let mut stresses = [Vec::new(), Vec::new()];
        for s in &stretches {
            for (list, stress) in stresses.iter_mut().zip(both(&OgdenTerms::free(&TERMS), bulk_kpa, *s)) {
                list.push(stress + noise_kpa * rng.sample::<f64, _>(StandardNormal));
            }
        }
        Curve::biaxial("biaxial", &stretches, stresses.each_ref().map(|s| Some(s.as_slice()))).unwrap()
    };
    [1.0, 0.75, 0.5].into_iter().flat_map(&mut of_ratio).collect()
}

/// Exact data give the exact parameters, with κ and without, from both stresses and from the second alone.
#[test]
fn exact_tests_are_recovered() {
    for bulk_kpa in [None, Some(400.0)] {
        let all = tests(bulk_kpa, 0.0, 1);
        let second: Vec<Curve> = all.iter().filter(|c| c.biaxial.is_some_and(|b| b.axis == 1)).cloned().collect();
        for curves in [all, second] {
            let options = CurveFitOptions { bulk_kpa, ..CurveFitOptions::default() };
            let fit = fit_terms(&curves, 2, &options).unwrap();
            for (found, truth) in fit.law.terms.iter().zip(&TERMS) {
                assert!((found.alpha - truth.alpha).abs() < 1e-3, "{:?}", fit.law);
                assert!((found.modulus_kpa / truth.modulus_kpa - 1.0).abs() < 1e-3, "{:?}", fit.law);
            }
        }
    }
}

/// 60 draws with noise of 0.2 kPa: the standard deviations that are promised are found again (60 draws know one to a
/// tenth; three of those), and the 95 % intervals hold the truth (57 expected, standard deviation 1.7).
#[test]
fn promised_standard_deviations_are_found_again() {
    let truth: Vec<f64> = TERMS.iter().flat_map(|t| [t.mu_kpa(), t.alpha]).collect();
    let draws = 60;
    let (mut squares, mut promised, mut inside) = ([0.0; 4], [0.0; 4], [0; 4]);
    for seed in 0..draws {
        let sequence = fit_curves(&tests(None, 0.2, seed), &CurveFitOptions { max_terms: 2, ..Default::default() });
        let fit = &sequence.unwrap().fits[1];
        for (i, p) in fit.parameters.iter().enumerate() {
            squares[i] += (p.value - truth[i]).powi(2) / draws as f64;
            promised[i] += p.sd.unwrap().powi(2) / draws as f64;
            let [low, high] = p.interval_95.unwrap();
            inside[i] += usize::from(low <= truth[i] && truth[i] <= high);
        }
    }
    let ratios: Vec<f64> = squares.iter().zip(promised).map(|(s, p)| f64::sqrt(s / p)).collect();
    println!("found over promised {ratios:?}, inside {inside:?} of {draws}");
    assert!(ratios.iter().all(|r| (0.7..1.3).contains(r)), "{ratios:?}");
    assert!(inside.iter().all(|n| *n >= 52), "{inside:?}");
}
