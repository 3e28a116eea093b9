//! Recovery of known materials from curves.

use super::super::deformation::HomogeneousTest;
use super::super::result::fit_curves;
use super::*;
use crate::material::ShearTerm;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

fn term(modulus_kpa: f64, alpha: f64) -> ShearTerm {
    ShearTerm { modulus_kpa, alpha }
}

/// Curves of a material with relative noise.
fn curves(terms: &[ShearTerm], bulk_kpa: Option<f64>, noise: f64, seed: u64) -> Vec<Curve> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    [(HomogeneousTest::Uniaxial, 2.6), (HomogeneousTest::Equibiaxial, 1.9), (HomogeneousTest::PureShear, 2.3)]
        .iter()
        .map(|&(test, end)| {
            let drive: Vec<f64> = (0..30).map(|i| 0.8 + (end - 0.8) * f64::from(i) / 29.0).collect();
            let states: Vec<Deformation> = drive.iter().map(|&d| test.at(d)).collect();
            let mut stress = model_stress(&OgdenTerms::free(terms), bulk_kpa, &states).unwrap();
            let scale = (stress.iter().map(|s| s * s).sum::<f64>() / 30.0).sqrt();
            for s in &mut stress {
                *s += noise * scale * rng.sample::<f64, _>(StandardNormal);
            }
            Curve::new(test.name(), test, &drive, &stress).unwrap()
        })
        .collect()
}

/// Exact data give the exact parameters: the refinement's tolerance of 1e-10 in the sum leaves 1e-5 in weak directions.
#[test]
fn exact_curves_are_recovered() {
    for truth in [
        vec![term(30.0, 1.9)],
        vec![term(4.0, 5.2), term(25.0, 1.4)],
        vec![term(0.4, 8.3), term(25.0, 1.4), term(6.0, -2.6)],
    ] {
        for bulk_kpa in [None, Some(400.0)] {
            let data = curves(&truth, bulk_kpa, 0.0, 1);
            let options = CurveFitOptions { bulk_kpa, ..CurveFitOptions::default() };
            let fit = fit_terms(&data, truth.len(), &options).unwrap();
            for (found, truth) in fit.law.terms.iter().zip(&truth) {
                assert!((found.alpha - truth.alpha).abs() < 1e-3, "{:?}", fit.law);
                assert!((found.modulus_kpa / truth.modulus_kpa - 1.0).abs() < 1e-3, "{:?}", fit.law);
            }
        }
    }
}

/// A three-term material with one negative product that is stable over the data: found, because it is allowed there.
#[test]
fn a_stable_negative_term_is_found() {
    let truth = [term(3.0, 6.0), term(30.0, 2.0), term(-4.0, -2.0)];
    let data = curves(&truth, None, 0.0, 1);
    let states: Vec<Deformation> = data.iter().flat_map(|c| c.states.clone()).collect();
    assert!(is_stable(&OgdenTerms::free(&truth), &states));
    let fit = fit_terms(&data, 3, &CurveFitOptions::default()).unwrap();
    // The positive three-term material that comes nearest leaves more than this.
    assert!(fit.sum_of_squares < 1e-8, "{} {:?}", fit.sum_of_squares, fit.law);
}

/// 500 draws of a two-term material with 1 % noise: the 95 % intervals hold the truth in 90 to 99 % of them (binomial
/// 95 % ± 3 %), and BIC takes two terms in at least 95 %.
#[test]
fn intervals_cover_and_terms_are_counted() {
    let truth = [term(4.0, 6.0), term(25.0, 1.5)];
    let values = [4.0 / 6.0, 6.0, 25.0 / 1.5, 1.5];
    let mut inside = [0; 5];
    let (mut chosen, draws) = (0, 500);
    for seed in 0..draws {
        let data = curves(&truth, None, 0.01, seed);
        let options = CurveFitOptions { num_starts: 2, ..CurveFitOptions::default() };
        let sequence = fit_curves(&data, &options).unwrap();
        chosen += usize::from(sequence.chosen().num_terms == 2);
        let fit = &sequence.fits[1];
        for (i, p) in fit.parameters.iter().enumerate() {
            let [low, high] = p.interval_95.unwrap();
            inside[i] += usize::from(low <= values[i] && values[i] <= high);
        }
        let [low, high] = fit.initial_shear_modulus_kpa.interval_95;
        inside[4] += usize::from(low <= 14.5 && 14.5 <= high);
    }
    println!("inside {inside:?} of {draws}, two terms chosen {chosen}");
    assert!(inside.iter().all(|&n| (450..=495).contains(&n)), "{inside:?}");
    assert!(chosen >= 475, "{chosen}");
}

/// The neo-Hookean family holds α = 2 and recovers the rest.
#[test]
fn the_neo_hookean_term_is_held() {
    let truth = [term(1.0, 7.0), term(25.0, 2.0)];
    let data = curves(&truth, None, 0.0, 1);
    let options = CurveFitOptions { neo_hookean: true, max_terms: 2, ..CurveFitOptions::default() };
    let sequence = fit_curves(&data, &options).unwrap();
    let fit = sequence.chosen();
    assert_eq!(fit.num_terms, 2);
    let held: Vec<&str> = fit.parameters.iter().filter(|p| p.held).map(|p| p.name.as_str()).collect();
    assert_eq!(held, ["alpha_2"]);
    assert!((fit.parameters[3].value - 2.0).abs() < 1e-12 && (fit.parameters[1].value - 7.0).abs() < 1e-4);
}

/// Noise alone, three terms asked of one-term data: the spare terms are reported, never hidden.
#[test]
fn spare_terms_are_reported() {
    let data = curves(&[term(30.0, 2.0)], None, 0.005, 3);
    let sequence = fit_curves(&data, &CurveFitOptions::default()).unwrap();
    assert_eq!(sequence.chosen().num_terms, 1);
    let spare = sequence.fits.last().unwrap();
    let wide = spare.parameters.iter().any(|p| p.sd.is_none_or(|s| s > 0.3 * p.value.abs()));
    assert!(wide || !spare.notes.is_empty(), "{spare:?}");
}

#[test]
fn bad_settings_are_refused() {
    let data = curves(&[term(30.0, 2.0)], None, 0.0, 1);
    let bad = CurveFitOptions { bulk_kpa: Some(-1.0), ..CurveFitOptions::default() };
    assert!(matches!(fit_terms(&data, 1, &bad), Err(CurveFitError::Setting { name: "bulk_kpa", .. })));
    assert!(matches!(fit_terms(&data, 9, &CurveFitOptions::default()), Err(CurveFitError::Setting { .. })));
    let short = [Curve::new("short", HomogeneousTest::Uniaxial, &[1.1, 1.2], &[1.0, 2.0]).unwrap()];
    assert!(matches!(fit_terms(&short, 1, &CurveFitOptions::default()), Err(CurveFitError::TooFewData { .. })));
}
