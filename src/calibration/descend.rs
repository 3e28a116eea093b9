//! Levenberg–Marquardt descent within the limits of [`super::step`], from a start whose equilibria are known.

use super::error::CalibrationError;
use super::options::FitOptions;
use super::prediction::{Prediction, SolverWork};
use super::step::{self, Constraints};
use super::stress_path::StressPath;
use super::system::NormalSystem;
use crate::fem::SolveError;
use crate::material::Material;
use crate::optimise::{self, Damping, LeastSquares, Raise, Rules, Secant, Shortening, Stop};

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
    pub(super) work: SolverWork,
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
pub(super) type Predict<'a> = dyn FnMut(&Material, &[Prediction]) -> Result<Vec<Prediction>, CalibrationError> + 'a;

/// Where a descent begins.
#[derive(Clone, Debug)]
pub(super) struct Start {
    /// One per recording.
    pub(super) predictions: Vec<Prediction>,
    /// How steps are followed, from the states of the start.
    pub(super) path: StressPath,
}

/// Compares predictions with the data.
pub(super) type Evaluate<'a> = dyn Fn(&[Prediction]) -> Result<NormalSystem, CalibrationError> + 'a;

/// A step that gains less than this part of what it promised was poor.
const GOOD_PART: f64 = 0.25;
/// Equal up to the equilibria's accuracy counts: near the optimum nothing is gained any more.
const EQUAL: f64 = 1e-9;
/// What a step that failed or was poor does to the damping.
const RAISE: Raise = Raise { factor: 10.0, at_least: 1e-3 };
/// No damping as long as steps are good: an equilibrium costs far more than a step.
pub(super) const DAMPING: Damping = Damping {
    start: 0.0,
    good_part: GOOD_PART,
    negligible: 1e-6,
    least: 0.0,
    small_gain: 0.0,
    poor_part: GOOD_PART,
    after_poor: RAISE,
    after_rejection: RAISE,
    largest: f64::INFINITY,
};

/// How steps are taken: along the stresses or straight. Stresses fail where two terms become one: the promised stress
/// is then out of reach of any material.
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

/// A material's predictions and their normal system.
struct Point {
    predictions: Vec<Prediction>,
    system: NormalSystem,
}

/// A fit as [`optimise::descend`] sees it.
struct DescentProblem<'a, 'p> {
    constraints: &'a Constraints,
    tolerance: f64,
    path: StressPath,
    /// The objective of pure noise.
    expected: f64,
    predict: &'a mut Predict<'p>,
    evaluate: &'a Evaluate<'a>,
    way: Way,
    /// What the second derivatives of the model add to the curvature of the objective.
    secant: Secant,
    /// Where the last step that was taken led.
    last: NormalSystem,
    failure: Option<SolveError>,
    work: SolverWork,
}

impl DescentProblem<'_, '_> {
    /// `system` with the curvature that is known best.
    fn modelled(&self, system: &NormalSystem) -> NormalSystem {
        let matrix = self.secant.added_to(&system.matrix).unwrap_or_else(|| system.matrix.clone());
        NormalSystem { matrix, ..system.clone() }
    }

    /// The whole step to the optimum of the quadratic model, and how far that is in standard deviations. Where the
    /// misfit is more than noise, so are the standard deviations in which the distance counts.
    fn outlook(&self, system: &NormalSystem) -> Result<(step::Step, f64), CalibrationError> {
        let full = self.constraints.step(&self.modelled(system), 0.0, false)?;
        let distance = full.distance / (system.chi2 / self.expected.max(1.0)).max(1.0).sqrt();
        Ok((full, distance))
    }
}

impl LeastSquares for DescentProblem<'_, '_> {
    type Point = Point;
    type Linear = ();
    type Error = CalibrationError;

    fn objective(&self, at: &Point) -> f64 {
        at.system.chi2
    }

    fn linearise(&mut self, at: &Point) -> Result<Option<()>, CalibrationError> {
        let step = self.last.change_to(&at.system);
        self.secant.learn(&step, [&self.last, &at.system].map(NormalSystem::on_the_way));
        self.last = at.system.clone();
        Ok(Some(()))
    }

    fn step(&mut self, at: &Point, (): &(), damping: f64) -> Result<Option<optimise::Step>, CalibrationError> {
        // A small step alone proves nothing: damping makes steps small. The whole one tells how far the optimum is.
        if self.outlook(&at.system)?.1 < self.tolerance {
            return Ok(None);
        }
        let step = self.constraints.step(&self.modelled(&at.system), damping, true)?;
        Ok(Some(optimise::Step { change: step.change, promised: step.distance * step.distance }))
    }

    fn trial(
        &mut self,
        at: &Point,
        (): &(),
        step: &optimise::Step,
        part: f64,
    ) -> Result<Option<Point>, CalibrationError> {
        let Some(present) = at.predictions.first() else {
            let name = "the number of recordings";
            return Err(CalibrationError::InvalidValue { name, value: 0.0, requirement: "positive" });
        };
        let change = &step.change * part;
        let material = if self.way.is_followed {
            self.path.moved(self.constraints, &at.system, &present.material, &change)?
        } else {
            at.system.moved(&present.material, &change)
        };
        match (self.predict)(&material, &at.predictions) {
            Ok(predictions) => {
                self.failure = None;
                predictions.iter().for_each(|p| self.work.add(p.work));
                let system = (self.evaluate)(&predictions)?;
                Ok(Some(Point { predictions, system }))
            }
            Err(CalibrationError::Solve(cause @ SolveError::Cancelled { .. })) => Err(cause.into()),
            Err(CalibrationError::Solve(cause)) => {
                self.failure = Some(cause);
                self.secant.distrust();
                self.way.is_lost(&self.path);
                Ok(None)
            }
            Err(other) => Err(other),
        }
    }

    fn on_good_step(&mut self) {
        self.way.num_poor = 0;
    }

    fn has_other_way(&mut self) -> bool {
        self.secant.distrust();
        !self.way.is_lost(&self.path)
    }
}

/// Descends until the optimum is reached or the iterations run out. `predict` solves a material near given predictions,
/// `evaluate` compares with the data; `expected` is the objective of pure noise.
///
/// # Errors
/// Those of the calls; a trial without an equilibrium is no error.
pub(super) fn descend(
    constraints: &Constraints,
    options: &FitOptions,
    start: Start,
    expected: f64,
    predict: &mut Predict,
    evaluate: &Evaluate,
) -> Result<Descent, CalibrationError> {
    let Start { predictions, path } = start;
    let start = Point { system: evaluate(&predictions)?, predictions };
    let mut problem = DescentProblem {
        constraints,
        tolerance: options.tolerance,
        path,
        expected,
        predict,
        evaluate,
        way: Way { is_followed: true, num_poor: 0 },
        secant: Secant::unknown(start.system.values.len()),
        last: start.system.clone(),
        failure: None,
        work: SolverWork::default(),
    };
    let rules = Rules {
        shortening: Shortening::Damped(DAMPING),
        tolerated_rise: EQUAL,
        stop: Stop {
            rests_within: Some(EQUAL),
            to_beat: options.to_beat,
            ..Stop::after_trials(options.max_iterations)
        },
    };
    let found = optimise::descend(&mut problem, start, (), &rules)?;
    let Point { predictions, system } = found.at;
    let (full, distance) = problem.outlook(&system)?;
    Ok(Descent {
        predictions,
        is_converged: distance < options.tolerance,
        failure: problem.failure,
        iterations: found.num_trials,
        distance,
        reached: full.reached,
        history: found.history,
        work: problem.work,
        system,
    })
}
