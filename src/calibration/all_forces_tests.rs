use super::super::test_problem::{block, coarse, scan, tight, truth};
use super::super::{CalibrationProblem, Objective, Observed, SyntheticScan};
use super::*;
use crate::material::Parameter;
use crate::recording::Filter;
use crate::sensitivity::Protocol;
use crate::specimen::Specimen;

const GAIN_SD: f64 = 0.02;

fn cell() -> Protocol {
    Protocol { force_gain_sd: GAIN_SD, force_zero_sd_n: 0.03, ..Protocol::default() }
}

/// Two drives of one block, read with a load cell that reads 3 % too much.
fn two_drives(cell: &Protocol) -> Observed {
    let specimen = Specimen { drive_mm: vec![1.5, 3.0], ..block() };
    let (mesh, solve) = (coarse(&specimen), tight().solve);
    let made = SyntheticScan::new(&specimen, &truth(), &scan(), &Protocol::default(), &mesh, &solve, &|| false);
    let made = made.unwrap();
    let recording = made.recording("two drives", &specimen, &made.draw(3, 0), Filter::None).unwrap();
    let observed = Observed::new(&recording, scan().force_sd_n).unwrap();
    let mut observed = observed.with_protocol(&recording, cell, scan().force_sd_n).unwrap();
    observed.forces_mut().flatten().for_each(|force| force.value_n *= 1.03);
    observed
}

/// The same drives in a recording each.
fn apart(both: &Observed) -> [Observed; 2] {
    [0, 1].map(|d| {
        let mut one = both.clone();
        one.steps = vec![both.steps[d].clone()];
        one
    })
}

/// The weights are the inverse of the covariance, across recordings too.
#[test]
fn weights_invert_the_covariance() {
    let of = |cell: &Protocol| {
        let observed = apart(&two_drives(cell));
        let problem = CalibrationProblem::new(&observed, &coarse, Objective::Weighted).unwrap();
        AllForces::of(&problem.targets().unwrap())
    };
    let forces = of(&cell());
    // Entries of the two are up to 10⁴ apart: rounding of their product.
    assert!((forces.covariance() * forces.weights() - DMatrix::identity(2, 2)).abs().max() < 1e-10);
    assert!(forces.covariance()[(0, 1)] > 0.0);
    assert_eq!(of(&Protocol::default()).weights()[(0, 1)].to_bits(), 0.0f64.to_bits());
}

/// Whether two drives are steps of one recording or recordings of their own says nothing about the load cell: the fit
/// is the same, and its modulus known no better than the cell's gain.
#[test]
fn recordings_share_the_load_cell() {
    let both = two_drives(&cell());
    let fit = |observed: &[Observed]| {
        let problem = CalibrationProblem::new(observed, &coarse, Objective::Weighted).unwrap();
        problem.fit(&truth(), None, &tight(), &|| false).unwrap()
    };
    let (one, two) = (fit(std::slice::from_ref(&both)), fit(&apart(&both)));
    for parameter in one.material.parameters() {
        let sd = one.sd(parameter).unwrap();
        // Equilibria to 10⁻¹¹, and a descent that ends within a hundredth of a standard deviation.
        assert!((one.material.value(parameter) - two.material.value(parameter)).abs() < 0.02 * sd, "{two:?}");
        assert!((two.sd(parameter).unwrap() / sd - 1.0).abs() < 1e-3, "{parameter:?}");
    }
    assert!((one.chi2 - two.chi2).abs() < 1e-3, "{} {}", one.chi2, two.chi2);
    let (mu, sd) = (two.material.value(Parameter::Mu(0)), two.sd(Parameter::Mu(0)).unwrap());
    assert!(sd > 0.99 * GAIN_SD * mu, "{sd} {mu}");
}
