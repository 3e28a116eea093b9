//! Levenberg–Marquardt descent within the limits of [`super::step`], from a start whose equilibria are known.

use super::error::CalibrationError;
use super::fit::FitOptions;
use super::step::Constraints;
use super::stress_path::StressPath;
use super::system::{NormalSystem, Prediction, Work};
use crate::fem::SolveError;
use crate::material::Ogden;

/// Where a descent ended.
#[derive(Debug)]
pub(super) struct Descent {
    /// One per recording, of the estimate.
    pub(super) predictions: Vec<Prediction>,
    pub(super) system: NormalSystem,
    pub(super) is_converged: bool,
    /// Why the last trial had no equilibrium, where it had none.
    pub(super) failure: Option<SolveError>,
    pub(super) iterations: usize,
    /// Distance from the optimum of the linear model, in standard deviations as the misfit has them.
    pub(super) distance: f64,
    pub(super) reached: Vec<String>,
    /// The objective at the start and after every accepted step.
    pub(super) history: Vec<f64>,
    /// What the trials took; the start's work is not in it.
    pub(super) work: Work,
}

impl Descent {
    /// The descent, if it reached the optimum.
    ///
    /// # Errors
    /// [`CalibrationError::NotConverged`], [`CalibrationError::NoEquilibrium`].
    pub(super) fn converged(self, options: &FitOptions) -> Result<Descent, CalibrationError> {
        let iterations = self.iterations;
        match self.failure {
            _ if self.is_converged => Ok(self),
            Some(source) => Err(CalibrationError::NoEquilibrium { iterations, source }),
            None => {
                let (distance, limit) = (self.distance, options.tolerance);
                Err(CalibrationError::NotConverged { iterations, distance, limit })
            }
        }
    }
}

/// Solves a material near given predictions.
pub(super) type Predict<'a> = dyn FnMut(&Ogden, &[Prediction]) -> Result<Vec<Prediction>, CalibrationError> + 'a;

/// Where a descent begins.
#[derive(Clone, Debug)]
pub(super) struct Start {
    /// One per recording.
    pub(super) predictions: Vec<Prediction>,
    /// How steps are followed, from the states of the start.
    pub(super) path: StressPath,
}

/// A step that gains less than this part of what it promised was poor.
const GOOD_PART: f64 = 0.25;

/// How steps are taken: along the stresses or straight. Stresses fail where two terms become one: the promised stress is then
/// out of reach of any material.
struct Way {
    is_followed: bool,
    num_poor: usize,
}

impl Way {
    /// After a poor step the other way is tried; true where both were poor.
    fn is_lost(&mut self, path: &StressPath) -> bool {
        if path.is_straight() {
            return true;
        }
        self.is_followed = !self.is_followed;
        self.num_poor += 1;
        self.num_poor.is_multiple_of(2)
    }
}

/// Descends until the optimum is reached or the iterations run out. `predict` solves a material near given predictions,
/// `evaluate` compares with the data; `expected` is the objective of pure noise. Where the misfit is more than noise, so are
/// the standard deviations in which the distance from the optimum counts.
///
/// # Errors
/// Those of the calls; a trial without an equilibrium is no error.
pub(super) fn descend(
    constraints: &Constraints,
    options: &FitOptions,
    start: Start,
    expected: f64,
    predict: &mut Predict,
    evaluate: &dyn Fn(&[Prediction]) -> Result<NormalSystem, CalibrationError>,
) -> Result<Descent, CalibrationError> {
    let Start { mut predictions, path } = start;
    let mut system = evaluate(&predictions)?;
    let mut history = vec![system.chi2];
    let mut work = Work::default();
    let mut damping = 0.0;
    let mut way = Way { is_followed: true, num_poor: 0 };
    let mut failure = None;
    let mut iterations = 0;
    loop {
        let full = constraints.step(&system, 0.0, false)?;
        let distance = full.distance / (system.chi2 / expected.max(1.0)).max(1.0).sqrt();
        let is_converged = distance < options.tolerance;
        if is_converged || iterations >= options.max_iterations {
            let reached = full.reached;
            return Ok(Descent {
                predictions,
                system,
                is_converged,
                failure,
                iterations,
                distance,
                reached,
                history,
                work,
            });
        }
        iterations += 1;
        let step = constraints.step(&system, damping, true)?;
        let Some(present) = predictions.first() else {
            return Err(CalibrationError::NotConverged { iterations, distance, limit: options.tolerance });
        };
        let trial = if way.is_followed {
            path.moved(constraints, &system, &present.material, &step.change)?
        } else {
            system.moved(&present.material, &step.change)
        };
        match predict(&trial, &predictions) {
            Ok(next) => {
                failure = None;
                next.iter().for_each(|p| work.add(p.work));
                let next_system = evaluate(&next)?;
                let is_good = system.chi2 - next_system.chi2 >= GOOD_PART * step.distance * step.distance;
                // Equal up to the equilibria's accuracy counts: near the optimum nothing is gained any more.
                if next_system.chi2 <= system.chi2 * (1.0 + 1e-9) {
                    predictions = next;
                    system = next_system;
                    history.push(system.chi2);
                }
                if is_good {
                    way.num_poor = 0;
                    damping = if damping > 1e-6 { damping * 0.1 } else { 0.0 };
                } else if way.is_lost(&path) {
                    damping = (damping * 10.0).max(1e-3);
                }
            }
            Err(CalibrationError::Solve(cause @ SolveError::Cancelled { .. })) => return Err(cause.into()),
            Err(CalibrationError::Solve(cause)) => {
                failure = Some(cause);
                way.is_lost(&path);
                damping = (damping * 10.0).max(1e-3);
            }
            Err(other) => return Err(other),
        }
    }
}
