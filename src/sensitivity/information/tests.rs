//! Closed forms and a linear-Gaussian Monte Carlo.

use super::super::Criterion;
use super::*;
use crate::material::OgdenTerm;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

pub(crate) fn one_term() -> Material {
    Material { bulk_kpa: 2173.0, terms: vec![OgdenTerm { mu_kpa: 17.0, alpha: 1.91 }], law: None }
}

fn noise() -> MeasurementNoise {
    MeasurementNoise { displacement_sd_mm: [0.05, 0.04, 0.03], force_sd_n: 0.02 }
}

/// Smooth made-up sensitivities of three parameters.
fn sensitivities(num_voxels: usize) -> (Vec<Vec<[f64; 3]>>, Vec<f64>) {
    let wave = |i: usize, v: usize, c: usize| {
        0.01 * ((0.37 * (v + 1) as f64 * (i + 1) as f64) + c as f64).sin() / [300.0, 1.0, 0.2][i]
    };
    let fields = (0..3).map(|i| (0..num_voxels).map(|v| [0, 1, 2].map(|c| wave(i, v, c))).collect()).collect();
    (fields, vec![1e-5, 0.3, 2.0])
}

/// Draws data from a linear Gaussian model, fits by weighted least squares and compares the spread of the estimates
/// with the promise.
#[test]
fn promised_covariance_is_the_spread_of_estimates() {
    let (num_voxels, draws) = (40, 20_000);
    let (fields, forces) = sensitivities(num_voxels);
    let weights: Vec<f64> = (0..num_voxels).map(|v| if v % 3 == 0 { 0.25 } else { 1.0 }).collect();
    let information = FisherInformation::of_drive(&one_term(), &fields, &weights, &forces, &noise()).unwrap();
    let covariance = information.covariance();
    // Rows of the standardised design matrix: entry / noise sd of that datum.
    let mut rows: Vec<[f64; 3]> = Vec::new();
    for (v, weight) in weights.iter().enumerate() {
        for (c, noise_sd) in noise().displacement_sd_mm.into_iter().enumerate() {
            let sd = noise_sd / weight.sqrt();
            rows.push([0, 1, 2].map(|i| fields[i][v][c] / sd));
        }
    }
    rows.push([0, 1, 2].map(|i| forces[i] / noise().force_sd_n));
    let inverse = information.matrix().clone().try_inverse().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut second = [[0.0; 3]; 3];
    for _ in 0..draws {
        let mut moment = nalgebra::DVector::zeros(3);
        for row in &rows {
            let e: f64 = StandardNormal.sample(&mut rng);
            for i in 0..3 {
                moment[i] += row[i] * e;
            }
        }
        let error = &inverse * moment;
        for i in 0..3 {
            for j in 0..3 {
                second[i][j] += error[i] * error[j] / f64::from(draws);
            }
        }
    }
    for i in 0..3 {
        let sd = covariance.sd(i).unwrap();
        // A variance from n draws scatters by √(2/n) = 1 %; four of those.
        assert!((second[i][i] / (sd * sd) - 1.0).abs() < 0.04, "{i}");
        for j in 0..i {
            let expected = covariance.correlation(i, j).unwrap();
            let found = second[i][j] / (second[i][i] * second[j][j]).sqrt();
            // A correlation scatters by at most 1/√n = 0.7 %.
            assert!((found - expected).abs() < 0.03);
        }
    }
}

/// One parameter at a time: sd = σ / |s| for a force alone.
#[test]
fn single_force_closed_form() {
    let zero = vec![vec![[0.0; 3]; 2]; 3];
    let information = FisherInformation::of_drive(&one_term(), &zero, &[1.0; 2], &[0.0, 0.5, 0.0], &noise()).unwrap();
    let covariance = information.covariance();
    // Closed form; rounding only.
    assert!((covariance.sd(1).unwrap() - 0.04).abs() < 1e-15);
    assert_eq!((covariance.sd(0), covariance.sd(2)), (None, None));
    let promised = covariance.promised_sd(0.5);
    assert!(promised[1].identifiable && !promised[0].identifiable && !promised[2].identifiable);
    assert!((covariance.criterion(Criterion::WorstRelativeSd, &[1]).unwrap() - 0.04 / 17.0).abs() < 1e-16);
    assert_eq!(covariance.criterion(Criterion::WorstRelativeSd, &[1, 2]), None);
}

/// Two equal scans halve every variance; a prior adds its information; different materials are refused.
#[test]
fn information_adds() {
    let (fields, forces) = sensitivities(30);
    let one = FisherInformation::of_drive(&one_term(), &fields, &[1.0; 30], &forces, &noise()).unwrap();
    let mut two = one.clone();
    two.add(&one).unwrap();
    for i in 0..3 {
        let ratio = one.covariance().sd(i).unwrap() / two.covariance().sd(i).unwrap();
        // Rounding of an inverse whose condition number is below 10⁴ after scaling.
        assert!((ratio - 2f64.sqrt()).abs() < 1e-10);
    }
    let mut prior = FisherInformation::none(&one_term());
    prior.add_log_prior(Parameter::Kappa, 0.5).unwrap();
    assert!((prior.covariance().sd(0).unwrap() - 0.5 * 2173.0).abs() < 1e-9);
    assert!(prior.add_prior(Parameter::Mu(3), 1.0).is_err());
    assert!(prior.add_prior(Parameter::Mu(0), 0.0).is_err());
    let other = FisherInformation::none(&Material { bulk_kpa: 1.0, ..one_term() });
    assert!(matches!(two.add(&other), Err(InformationError::ParameterMismatch { .. })));
}

#[test]
fn bad_input_is_an_error() {
    let (fields, forces) = sensitivities(3);
    let material = one_term();
    let bad = MeasurementNoise { force_sd_n: f64::NAN, ..noise() };
    let with = |f: &[Vec<[f64; 3]>], w: &[f64], forces: &[f64], n: &MeasurementNoise| {
        FisherInformation::of_drive(&material, f, w, forces, n).unwrap_err()
    };
    assert!(matches!(with(&fields, &[1.0; 3], &forces, &bad), InformationError::InvalidSd { .. }));
    assert!(matches!(with(&fields, &[1.0; 2], &forces, &noise()), InformationError::LengthMismatch { .. }));
    assert!(matches!(with(&fields[..2], &[1.0; 3], &forces, &noise()), InformationError::LengthMismatch { .. }));
    assert!(matches!(with(&fields, &[1.0; 3], &[0.0, f64::NAN, 0.0], &noise()), InformationError::NotFinite { .. }));
}
