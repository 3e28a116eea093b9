//! Levenberg–Marquardt descent within the limits of [`super::step`], from a start whose equilibria are known.

use super::error::CalibrationError;
use super::fit::FitOptions;
use super::step::Constraints;
use super::system::{NormalSystem, Prediction, Work};
use crate::fem::SolveError;
use crate::material::Ogden;

/// Where a descent ended.
#[derive(Debug)]
pub(super) struct Descent {
    /// One per recording, of the estimate.
    pub(super) predictions: Vec<Prediction>,
    pub(super) system: NormalSystem,
    pub(super) iterations: usize,
    /// Distance from the optimum of the linear model, in standard deviations.
    pub(super) distance: f64,
    pub(super) reached: Vec<String>,
    /// The objective at the start and after every accepted step.
    pub(super) history: Vec<f64>,
    /// What the trials took; the start's work is not in it.
    pub(super) work: Work,
}

/// Descends to the optimum. `predict` solves a material near given predictions, `evaluate` compares with the data.
///
/// # Errors
/// [`CalibrationError::NotConverged`], [`CalibrationError::NoEquilibrium`], and those of the calls.
pub(super) fn descend(
    constraints: &Constraints,
    options: &FitOptions,
    start: Vec<Prediction>,
    predict: &mut dyn FnMut(&Ogden, &[Prediction]) -> Result<Vec<Prediction>, CalibrationError>,
    evaluate: &dyn Fn(&[Prediction]) -> Result<NormalSystem, CalibrationError>,
) -> Result<Descent, CalibrationError> {
    let mut predictions = start;
    let mut system = evaluate(&predictions)?;
    let mut history = vec![system.chi2];
    let mut work = Work::default();
    let mut damping = 0.0;
    let mut failure = None;
    let mut iterations = 0;
    loop {
        let full = constraints.step(&system, 0.0, false)?;
        if full.distance < options.tolerance {
            let (distance, reached) = (full.distance, full.reached);
            return Ok(Descent { predictions, system, iterations, distance, reached, history, work });
        }
        if iterations >= options.max_iterations {
            return Err(match failure {
                Some(source) => CalibrationError::NoEquilibrium { iterations, source },
                None => {
                    CalibrationError::NotConverged { iterations, distance: full.distance, limit: options.tolerance }
                }
            });
        }
        iterations += 1;
        let step = constraints.step(&system, damping, true)?;
        let Some(present) = predictions.first() else {
            return Err(CalibrationError::NotConverged { iterations, distance: full.distance, limit: options.tolerance });
        };
        let trial = system.moved(&present.material, &step.change);
        match predict(&trial, &predictions) {
            Ok(next) => {
                failure = None;
                next.iter().for_each(|p| work.add(p.work));
                let next_system = evaluate(&next)?;
                // Equal up to the equilibria's accuracy counts: near the optimum nothing is gained any more.
                if next_system.chi2 <= system.chi2 * (1.0 + 1e-9) {
                    predictions = next;
                    system = next_system;
                    history.push(system.chi2);
                    damping = if damping > 1e-6 { damping * 0.1 } else { 0.0 };
                } else {
                    damping = (damping * 10.0).max(1e-3);
                }
            }
            Err(CalibrationError::Solve(cause @ SolveError::Cancelled { .. })) => return Err(cause.into()),
            Err(CalibrationError::Solve(cause)) => {
                failure = Some(cause);
                damping = (damping * 10.0).max(1e-3);
            }
            Err(other) => return Err(other),
        }
    }
}
