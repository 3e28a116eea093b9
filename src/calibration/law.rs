//! The law that recordings ask for, on one mesh: what a plan rests on where there is no time for a whole calibration.

use super::calibrate_options::CalibrateOptions;
use super::error::CalibrationError;
use super::problem::CalibrationProblem;
use super::recording_fit::RecordingFit;
use super::run::Run;

/// A law that was fitted.
#[derive(Debug)]
pub struct Law {
    /// The fit of the number of terms that was taken, in the order of falling exponents.
    pub fit: RecordingFit,
    /// The best fit of every number of terms that was tried, from one upwards.
    pub by_num_terms: Vec<RecordingFit>,
    /// Remarks for the reader.
    pub notes: Vec<String>,
}

/// Fits `problem` with as many terms as `options` say. The fits of the numbers of terms that `earlier` has, fits of
/// the same models to nearly the same data, start where those ended. The options' allowance for the mesh, profiles and
/// contours are those of [`super::calibrate()`] and do nothing here. A fit that has not settled comes back as it stands
/// ([`RecordingFit::settled`]): a first guess need not.
///
/// # Errors
/// [`CalibrationError`]: nothing to compare, no equilibrium.
pub fn fit_law(
    problem: &CalibrationProblem,
    earlier: &[RecordingFit],
    options: &CalibrateOptions,
    on_stage: &dyn Fn(&str),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Law, CalibrationError> {
    let has_force = problem.has_force();
    let mut run = Run::new(options, has_force, on_stage, is_cancelled).with_earlier(earlier);
    let (selection, by_num_terms) = run.select_terms(problem)?;
    let fit = run.in_order(problem, by_num_terms[selection.chosen - 1].clone())?;
    run.note_unsettled(&fit);
    run.remark_data(problem.observed(), &fit, has_force);
    Ok(Law { fit, by_num_terms, notes: run.notes })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::test_problem::{block, coarse, same_mesh, tight, truth};
    use crate::calibration::{ForceOnTheWay, Objective, Observed, ObservedForce, TermCount};
    use crate::material::Parameter;
    use crate::recording::Filter;

    /// Fits that start where those to other noise ended come to the same law as blind ones, in fewer iterations.
    #[test]
    fn earlier_fits_save_iterations_alone() {
        let (_, scan) = same_mesh(&truth());
        let observe = |draw: u64| {
            let recording = scan.recording("draw", &block(), &scan.draw(5, draw), Filter::None).unwrap();
            [Observed::new(&recording, 0.01).unwrap()]
        };
        let [one, other] = [0, 1].map(observe);
        let options = CalibrateOptions {
            terms: TermCount::Auto { max: 2 },
            fit: tight(),
            num_starts: 2,
            ..CalibrateOptions::default()
        };
        let law = |problem: &CalibrationProblem, earlier: &[RecordingFit]| {
            fit_law(problem, earlier, &options, &|_| (), &|| false).expect("a law")
        };
        let problem = CalibrationProblem::new(&one, &coarse, Objective::Weighted).unwrap();
        let earlier = law(&problem, &[]);
        let problem = problem.with_data(&other).unwrap();
        let [blind, near] = [&[], &earlier.by_num_terms[..]].map(|earlier| law(&problem, earlier));
        assert_eq!(blind.fit.material.terms.len(), 1);
        assert_eq!(near.by_num_terms.len(), earlier.by_num_terms.len());
        let iterations = |law: &Law| law.by_num_terms[0].iterations;
        assert!(iterations(&near) < iterations(&blind), "{} {}", iterations(&near), iterations(&blind));
        // Both stopped closer to the optimum than the tolerance, in standard deviations.
        for parameter in [Parameter::Mu(0), Parameter::Alpha(0)] {
            let apart = blind.fit.material.value(parameter) - near.fit.material.value(parameter);
            assert!(apart.abs() < 2.0 * tight().tolerance * blind.fit.sd(parameter).unwrap(), "{apart}");
        }
    }

    /// An earlier fit may know less: with a force on the way that it did not have, the law is that of a blind fit.
    #[test]
    fn earlier_fits_may_lack_drives() {
        let (_, scan) = same_mesh(&truth());
        let recording = scan.recording("draw", &block(), &scan.draw(5, 0), Filter::None).unwrap();
        let without = [Observed::new(&recording, 0.01).unwrap()];
        let mut with = without.clone();
        let force = ObservedForce { value_n: 3.0, sd_n: 0.2 };
        with[0].on_the_way = vec![ForceOnTheWay { drive_mm: 1.0, force }];
        let options = CalibrateOptions { terms: TermCount::Fixed(1), fit: tight(), ..CalibrateOptions::default() };
        let law = |observed: &[Observed], earlier: &[RecordingFit]| {
            let problem = CalibrationProblem::new(observed, &coarse, Objective::Weighted).unwrap();
            fit_law(&problem, earlier, &options, &|_| (), &|| false).expect("a law")
        };
        let [blind, near] = [vec![], law(&without, &[]).by_num_terms].map(|earlier| law(&with, &earlier));
        assert_eq!((blind.fit.states(0).len(), near.fit.states(0).len()), (2, 2));
        for parameter in [Parameter::Mu(0), Parameter::Alpha(0)] {
            let apart = blind.fit.material.value(parameter) - near.fit.material.value(parameter);
            assert!(apart.abs() < 2.0 * tight().tolerance * blind.fit.sd(parameter).unwrap(), "{apart}");
        }
    }
}
