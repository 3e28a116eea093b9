//! The loop of every nonlinear fit: a step by the linear model, a trial, and a shorter step where the trial does not
//! help.

use super::rules::{Damping, Rules, Shortening};
use nalgebra::DVector;

/// A step from a point.
#[derive(Clone, Debug)]
pub struct Step {
    /// Change of the unknowns, in the problem's own scale.
    pub change: DVector<f64>,
    /// The decrease of the objective that the linear model promises of it.
    pub promised: f64,
}

/// A sum of squares to be lowered.
pub trait LeastSquares {
    /// Where a descent stands: parameters and what the model makes of them.
    type Point;
    /// The linear model at a point: derivatives, or the normal system that comes of them.
    type Linear;
    /// Why the work cannot go on. A trial without a value is none.
    type Error;

    /// The sum of squares, or whatever else is to be lowered.
    fn objective(&self, at: &Self::Point) -> f64;

    /// The linear model at a point whose objective is low enough to go on from; `None` where there is none, and the
    /// point is then not taken.
    ///
    /// # Errors
    /// Those of the problem.
    fn linearise(&mut self, at: &Self::Point) -> Result<Option<Self::Linear>, Self::Error>;

    /// The step of the linear model with damping δ (see [`Damping`]); `None` where it promises nothing that is worth a
    /// trial, so that the descent has converged.
    ///
    /// # Errors
    /// Those of the problem.
    fn step(&mut self, at: &Self::Point, linear: &Self::Linear, damping: f64) -> Result<Option<Step>, Self::Error>;

    /// The point after `part` of a step; `None` where the model has no value there.
    ///
    /// # Errors
    /// Those of the problem, a cancellation say.
    fn trial(
        &mut self,
        at: &Self::Point,
        linear: &Self::Linear,
        step: &Step,
        part: f64,
    ) -> Result<Option<Self::Point>, Self::Error>;

    /// Called after a good step (see [`Damping::good_part`]).
    fn on_good_step(&mut self) {}

    /// Called after a poor step: true where the problem will try the same step in another way before it is damped.
    fn has_other_way(&mut self) -> bool {
        false
    }
}

/// Why a descent ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Nothing is left that is worth a step.
    Converged,
    /// No step of any length lowers the objective: at an optimum up to rounding, or at an edge of where the model has
    /// values.
    Stuck,
    /// The trials or steps ran out.
    RanOut,
    /// It would not come below what is within reach from elsewhere ([`super::Stop::to_beat`]).
    Behind,
}

/// Where a descent ended.
#[derive(Clone, Debug)]
pub struct Descent<Point, Linear> {
    /// The last point taken.
    pub at: Point,
    /// The linear model there.
    pub linear: Linear,
    /// Why it ended.
    pub end: End,
    /// Trials made, rejected ones included.
    pub num_trials: usize,
    /// The objective at the start and after every step taken.
    pub history: Vec<f64>,
}

/// How long the next step is.
struct Length {
    damping: f64,
    part: f64,
    /// Lengths of the present step that were tried.
    num_tried: usize,
}

/// Lowers the objective of `problem` from `start`, whose linear model is `linear`.
///
/// # Errors
/// Those of the problem.
pub fn descend<P: LeastSquares>(
    problem: &mut P,
    start: P::Point,
    linear: P::Linear,
    rules: &Rules,
) -> Result<Descent<P::Point, P::Linear>, P::Error> {
    let damping = if let Shortening::Damped(d) = rules.shortening { d.start } else { 0.0 };
    let mut length = Length { damping, part: 1.0, num_tried: 0 };
    let (mut at, mut linear) = (start, linear);
    let mut history = vec![problem.objective(&at)];
    let mut by_trial = history.clone();
    let mut num_trials = 0;
    let mut known_step: Option<Step> = None;
    let end = loop {
        if num_trials >= rules.stop.max_trials || history.len() > rules.stop.max_steps {
            break End::RanOut;
        }
        if rules.stop.is_at_rest(&history) {
            break End::Stuck;
        }
        if rules.stop.is_behind(&by_trial) {
            break End::Behind;
        }
        let step = match known_step.take() {
            Some(step) => step,
            None => match problem.step(&at, &linear, length.damping)? {
                Some(step) => step,
                None => break End::Converged,
            },
        };
        num_trials += 1;
        let present = problem.objective(&at);
        let trial = problem.trial(&at, &linear, &step, length.part)?;
        let value = trial.as_ref().map(|t| problem.objective(t));
        let taken = match trial.filter(|_| value.is_some_and(|v| is_taken(v, present, rules.tolerated_rise))) {
            Some(next) => problem.linearise(&next)?.map(|model| (next, model)),
            None => None,
        };
        let has_moved = taken.is_some();
        if let Some(next) = taken {
            (at, linear) = next;
            history.push(problem.objective(&at));
        }
        by_trial.push(problem.objective(&at));
        let gain = value.map(|v| present - v);
        if has_moved && is_little(gain, present, rules.stop.least_relative_gain) {
            break End::Converged;
        }
        let before = length.damping;
        let is_stuck = match &rules.shortening {
            Shortening::Damped(damping) => adapt(damping, &mut length, problem, gain, step.promised, has_moved),
            Shortening::Halved { num_lengths } => halve(&mut length, has_moved, *num_lengths),
        };
        if is_stuck {
            break End::Stuck;
        }
        // The same point and the same damping give the same step.
        let is_same = !has_moved && length.damping.to_bits() == before.to_bits();
        known_step = is_same.then_some(step);
    };
    Ok(Descent { at, linear, end, num_trials, history })
}

/// Whether a trial is low enough.
fn is_taken(value: f64, present: f64, tolerated_rise: f64) -> bool {
    if tolerated_rise > 0.0 { value <= present * (1.0 + tolerated_rise) } else { value < present }
}

/// Whether a step that was taken gained too little to go on.
fn is_little(gain: Option<f64>, before: f64, least_relative_gain: Option<f64>) -> bool {
    gain.zip(least_relative_gain).is_some_and(|(gain, least)| gain < least * before)
}

/// Adapts the damping to a trial; true where nothing helps any more. `gain` is none where the trial has no value.
fn adapt<P: LeastSquares>(
    rules: &Damping,
    length: &mut Length,
    problem: &mut P,
    gain: Option<f64>,
    promised: f64,
    has_moved: bool,
) -> bool {
    if let Some(gain) = gain.filter(|_| has_moved) {
        if gain >= rules.good_part * promised {
            problem.on_good_step();
            length.damping = rules.relaxed(length.damping, gain);
        } else if gain < rules.poor_part * promised && !problem.has_other_way() {
            length.damping = rules.after_poor.of(length.damping);
        }
        return false;
    }
    // Without a value there is nothing to try again in another way.
    if gain.is_none() || !problem.has_other_way() {
        length.damping = rules.after_rejection.of(length.damping);
    }
    length.damping > rules.largest
}

/// Halves a step that was not taken; true where all its lengths were tried.
fn halve(length: &mut Length, has_moved: bool, num_lengths: usize) -> bool {
    if has_moved {
        (length.part, length.num_tried) = (1.0, 0);
        return false;
    }
    length.part *= 0.5;
    length.num_tried += 1;
    length.num_tried >= num_lengths
}

#[cfg(test)]
mod tests {
    use super::super::rules::{Raise, Stop};
    use super::*;

    /// r = e^x − 1, without a value at or below `wall`.
    struct Exponential {
        wall: f64,
        trials: Vec<f64>,
    }

    impl LeastSquares for Exponential {
        type Point = f64;
        type Linear = (f64, f64);
        type Error = std::convert::Infallible;

        fn objective(&self, x: &f64) -> f64 {
            (x.exp() - 1.0).powi(2)
        }

        fn linearise(&mut self, x: &f64) -> Result<Option<(f64, f64)>, Self::Error> {
            Ok(Some((x.exp() * x.exp(), -x.exp() * (x.exp() - 1.0))))
        }

        fn step(
            &mut self,
            x: &f64,
            &(matrix, gradient): &(f64, f64),
            damping: f64,
        ) -> Result<Option<Step>, Self::Error> {
            let change = gradient / (matrix * (1.0 + damping));
            let promised = 2.0 * gradient * change - matrix * change * change;
            let is_worth_it = promised > 1e-12 * self.objective(x).max(1e-12);
            Ok(is_worth_it.then(|| Step { change: DVector::from_element(1, change), promised }))
        }

        fn trial(&mut self, x: &f64, _: &(f64, f64), step: &Step, part: f64) -> Result<Option<f64>, Self::Error> {
            let next = x + part * step.change[0];
            self.trials.push(next);
            Ok((next > self.wall).then_some(next))
        }
    }

    fn damped() -> Shortening {
        let raise = Raise { factor: 10.0, at_least: 1e-2 };
        Shortening::Damped(Damping {
            start: 0.0,
            good_part: 0.25,
            negligible: 1e-3,
            least: 0.0,
            small_gain: 0.0,
            poor_part: 0.25,
            after_poor: raise,
            after_rejection: raise,
            largest: 1e6,
        })
    }

    fn run(x: f64, wall: f64, shortening: Shortening, stop: Stop) -> (Descent<f64, (f64, f64)>, Vec<f64>) {
        let mut problem = Exponential { wall, trials: Vec::new() };
        let Ok(Some(linear)) = problem.linearise(&x) else { panic!("it has a slope everywhere") };
        let Ok(found) = descend(&mut problem, x, linear, &Rules { shortening, tolerated_rise: 0.0, stop });
        (found, problem.trials)
    }

    /// Newton's steps overshoot from the flat side, x = −3 → 16: damped or halved, the minimum x = 0 is found.
    #[test]
    fn long_steps_are_shortened() {
        for shortening in [damped(), Shortening::Halved { num_lengths: 8 }] {
            let (found, trials) = run(-3.0, f64::NEG_INFINITY, shortening, Stop::after_trials(200));
            assert_eq!(found.end, End::Converged);
            assert!(found.at.abs() < 1e-6, "{}", found.at);
            assert!(trials[0] > 10.0 && found.num_trials == trials.len() && found.history.len() < found.num_trials);
            assert!(found.history.windows(2).all(|w| w[1] < w[0]));
        }
    }

    /// Where the optimum lies beyond the wall both rules end at it as stuck; and both keep to their number of trials or
    /// steps.
    #[test]
    fn ends_are_told_apart() {
        for shortening in [damped(), Shortening::Halved { num_lengths: 6 }] {
            let (found, _) = run(3.0, 1.0, shortening, Stop::after_trials(2000));
            assert_eq!(found.end, End::Stuck);
            assert!(found.at > 1.0 && found.at < 1.1, "{}", found.at);
            let (found, trials) = run(3.0, f64::NEG_INFINITY, shortening, Stop::after_trials(2));
            assert_eq!((found.end, trials.len()), (End::RanOut, 2));
            let (found, _) = run(3.0, f64::NEG_INFINITY, shortening, Stop::after_steps(1));
            assert_eq!((found.end, found.history.len()), (End::RanOut, 2));
            let stop = Stop { least_relative_gain: Some(0.999), ..Stop::after_steps(50) };
            let (found, _) = run(3.0, f64::NEG_INFINITY, shortening, stop);
            assert_eq!((found.end, found.history.len()), (End::Converged, 2));
        }
    }

    /// A descent that crawls is given up where it would not come below what is known from elsewhere; one that may is
    /// not.
    #[test]
    fn what_is_left_behind_is_given_up() {
        let stop = |to_beat| Stop { to_beat: Some(to_beat), ..Stop::after_trials(30) };
        // From −5 the first steps are all too long: only the damping makes them short, by and by.
        let (free, _) = run(-5.0, f64::NEG_INFINITY, damped(), Stop::after_trials(30));
        assert_eq!(free.end, End::Converged);
        let (found, _) = run(-5.0, f64::NEG_INFINITY, damped(), stop(-1.0));
        assert!(found.end == End::Behind && found.num_trials < free.num_trials, "{:?} {}", found.end, found.num_trials);
        let (found, _) = run(-5.0, f64::NEG_INFINITY, damped(), stop(10.0));
        assert_eq!((found.end, found.num_trials), (End::Converged, free.num_trials));
    }

    /// r² = x² + 10⁶, of which a step halves x where it promises to take all of it: what is left of x is soon below the
    /// accuracy of the objective.
    struct Crawling;

    impl LeastSquares for Crawling {
        type Point = f64;
        type Linear = ();
        type Error = std::convert::Infallible;

        fn objective(&self, x: &f64) -> f64 {
            x * x + 1e6
        }

        fn linearise(&mut self, _: &f64) -> Result<Option<()>, Self::Error> {
            Ok(Some(()))
        }

        fn step(&mut self, x: &f64, (): &(), _: f64) -> Result<Option<Step>, Self::Error> {
            Ok(Some(Step { change: DVector::from_element(1, -x), promised: x * x }))
        }

        fn trial(&mut self, x: &f64, (): &(), step: &Step, _: f64) -> Result<Option<f64>, Self::Error> {
            Ok(Some(x + 0.5 * step.change[0]))
        }
    }

    /// A descent whose steps gain nothing that the objective's accuracy would show is stuck; else it goes on.
    #[test]
    fn a_descent_without_gain_rests() {
        let run = |stop| {
            let rules = Rules { shortening: damped(), tolerated_rise: 0.0, stop };
            let Ok(found) = descend(&mut Crawling, 1.0, (), &rules);
            (found.end, found.at)
        };
        let stop = Stop::after_trials(20);
        assert_eq!(run(stop).0, End::RanOut);
        let (end, at) = run(Stop { rests_within: Some(1e-9), ..stop });
        // Three steps gain 63/64 of what x² was before them: less than 10⁶ · 10⁻⁹ from x = 2⁻⁵ on.
        assert_eq!((end, at), (End::Stuck, 2.0f64.powi(-8)));
    }
}
