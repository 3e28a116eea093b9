use super::super::interval::linear_ends;
use super::super::observed::Observed;
use super::super::target::Objective;
use super::super::test_problem::{block, coarse, ogden, same_mesh};
use super::super::weak_intervals::{NoiseEnds, ends_by_noise, is_weak};
use super::*;
use crate::fem::{SolveError, SolveOptions};
use crate::material::Parameter;
use crate::recording::Filter;

fn options() -> FitOptions {
    let solve = SolveOptions { tolerance: 1e-10, ..SolveOptions::default() };
    FitOptions { tolerance: 1e-3, max_iterations: 60, solve, ..FitOptions::default() }
}

/// At the estimate it is the linear model; at the ends of its intervals, at which the second term's modulus has changed
/// by factors of ten and more, it is what fits with equilibria of their own find.
#[test]
fn it_is_the_objective_of_refits_where_parameters_change_by_factors() {
    // A second term that one drive's noisy scan hardly shows.
    let truth = ogden(200.0, &[[0.1, 8.0], [17.0, 1.91]]);
    let scan = same_mesh(&truth).1;
    let recording = scan.recording("r", &block(), scan.noiseless(), Filter::None).unwrap();
    let observed = [Observed::new(&recording, 0.01).unwrap()];
    let problem = CalibrationProblem::new(&observed, &coarse, Objective::Weighted).unwrap();
    let fit = problem.fit(&truth, None, &options(), &|| false).unwrap();
    assert!(fit.is_converged && is_weak(&fit), "{:?}", fit.material);
    let response = StressResponse::new(&problem, &fit, &options(), &|| false).unwrap();
    let start = response.at(fit.material.clone());
    // χ² is as good as nothing without noise.
    assert!((start.chi2 - fit.chi2).abs() < 1e-9, "{} {}", start.chi2, fit.chi2);
    let limits = Constraints::new(&fit.material, &options()).unwrap();
    let system = ResponseFit { response: &response, limits }.system(&start);
    let of_fit = &response.system.matrix;
    for i in 0..5 {
        for j in 0..5 {
            let scale = (of_fit[(i, i)] * of_fit[(j, j)]).sqrt();
            // Of the combination of stresses, of which parts smaller than 10⁻⁹ are left out.
            assert!((system.matrix[(i, j)] - of_fit[(i, j)]).abs() < 1e-6 * scale, "{i} {j}");
        }
    }
    let found = ends_by_noise(&problem, &fit, &options(), &|| false).unwrap();
    assert!(found.are_of_profiles);
    let ends = found.ends;
    let mut num_ends = 0;
    for (index, parameter) in [(1, Parameter::Mu(0)), (2, Parameter::Alpha(0)), (4, Parameter::Alpha(1))] {
        for end in ends[index].unwrap().into_iter().flatten() {
            let mut start = fit.material.clone();
            start.set(parameter, end);
            let held = FitOptions { held: options().held.with(index), ..options() };
            let near = response.least(start, &held).unwrap();
            let refit = problem.fit(&near.material, Some(&fit), &held, &|| false).unwrap();
            // In standard deviations: what is quadratic in the stresses, which change much in so weak a scan.
            let distance = (refit.chi2 - fit.chi2).sqrt();
            assert!((distance / 1.96 - 1.0).abs() < 0.15, "{} at {end}: {distance}", parameter.name());
            num_ends += 1;
        }
    }
    // The smaller exponent has no lower end: a term whose exponent goes to zero is a logarithm.
    assert_eq!((num_ends, ends[4].unwrap()[0]), (5, None));
    let [low, high] = ends[1].unwrap().map(Option::unwrap);
    assert!(low < 0.01 && high > 1.0, "{low} {high}");
    let linear = linear_ends(Parameter::Mu(0), 0.1, fit.sd(Parameter::Mu(0)).unwrap());
    assert!(linear[1] > 5.0 * high, "{linear:?}");
}

/// Symmetric intervals are kept where terms are told apart, and where there is one only.
#[test]
fn well_known_terms_keep_the_linear_model() {
    for (terms, error) in [(vec![[17.0, 1.91]], 0.01), (vec![[2.0, 8.0], [16.0, 1.9]], 1e-4)] {
        let truth = ogden(200.0, &terms);
        let scan = same_mesh(&truth).1;
        let mut recording = scan.recording("r", &block(), scan.noiseless(), Filter::None).unwrap();
        recording.noise_sd_mm = Some([1e-4; 3]);
        let observed = [Observed::new(&recording, error).unwrap()];
        let problem = CalibrationProblem::new(&observed, &coarse, Objective::Weighted).unwrap();
        let fit = problem.fit(&truth, None, &options(), &|| false).unwrap();
        assert!(!is_weak(&fit));
        // So does a fit whose profiles have no equilibrium, and it does not call them profiles.
        let lost = CalibrationError::NotConverged { iterations: 1, distance: 2.0, limit: 0.1 };
        let without_profiles = NoiseEnds::or_linear(Err(lost), &fit).unwrap();
        for found in [ends_by_noise(&problem, &fit, &options(), &|| false).unwrap(), without_profiles] {
            assert!(!found.are_of_profiles);
            for (parameter, ends) in fit.material.parameters().into_iter().zip(found.ends) {
                let linear = linear_ends(parameter, fit.material.value(parameter), fit.sd(parameter).unwrap());
                assert_eq!(ends, Some(linear.map(Some)));
            }
        }
        let cancelled = NoiseEnds::or_linear(Err(SolveError::Cancelled { reached_mm: 0.0 }.into()), &fit);
        assert!(cancelled.is_err());
    }
}
