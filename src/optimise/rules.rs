//! How a descent shortens its steps, which trials it takes and when it ends.

/// The rules of one descent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// What is done about a step that was too long.
    pub shortening: Shortening,
    /// A trial is taken where its objective is lower; with a positive number also where it is higher by no more than
    /// this part, because the objective itself is known no better.
    pub tolerated_rise: f64,
    /// When the loop ends.
    pub stop: Stop,
}

/// What is done about a step that was too long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shortening {
    /// The quadratic model is damped, which turns the step towards the gradient too (Levenberg and Marquardt).
    Damped(Damping),
    /// The same step is halved until it helps or this many lengths have been tried.
    Halved {
        /// Lengths of one step: the whole, its half, …
        num_lengths: usize,
    },
}

/// How the damping δ of the model H + δ diag H changes from trial to trial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damping {
    /// δ of the first step.
    pub start: f64,
    /// A step is good where it gains at least this part of what the model promised; δ then falls to a tenth.
    pub good_part: f64,
    /// Where δ is not above this when a step was good, it becomes zero.
    pub negligible: f64,
    /// δ never falls below this.
    pub least: f64,
    /// Where a good step gained less than this in itself, δ becomes zero: the optimum is near and the plain step is
    /// best.
    pub small_gain: f64,
    /// A step is poor where it gains less than this part of what the model promised.
    pub poor_part: f64,
    /// What a poor step that is taken does to δ.
    pub after_poor: Raise,
    /// What a trial that is not taken does to δ.
    pub after_rejection: Raise,
    /// Beyond this δ no step of any length helps, and the descent is stuck.
    pub largest: f64,
}

/// How δ grows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Raise {
    /// It is multiplied by this …
    pub factor: f64,
    /// … and is at least this afterwards.
    pub at_least: f64,
}

impl Raise {
    pub(super) fn of(&self, damping: f64) -> f64 {
        (self.factor * damping).max(self.at_least)
    }
}

impl Damping {
    /// δ after a good step.
    pub(super) fn relaxed(&self, damping: f64, gain: f64) -> f64 {
        if gain < self.small_gain || damping <= self.negligible {
            return self.least;
        }
        (damping * 0.1).max(self.least)
    }
}

/// When a descent ends, besides where its problem has no further step to offer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Most trials, rejected ones included; the start's evaluation is none.
    pub max_trials: usize,
    /// Most steps taken.
    pub max_steps: usize,
    /// Converged where a step that was taken lowered the objective by less than this part of it; none: never for this
    /// reason.
    pub least_relative_gain: Option<f64>,
    /// Stuck where the last three steps that were taken together lowered the objective by less than this part of it:
    /// the accuracy of its values. None: never for this reason.
    pub rests_within: Option<f64>,
    /// An objective that is known to be within reach from elsewhere: ended where, at the pace of the last trials, those
    /// that are left would not lead below it. None: never for this reason.
    pub to_beat: Option<f64>,
}

/// Steps after which a descent that gains nothing rests.
const RESTING: usize = 3;

/// Trials whose pace counts.
const PACE: usize = 5;

impl Stop {
    /// Where the problem has no further step to offer.
    pub const NEVER: Stop = Stop {
        max_trials: usize::MAX,
        max_steps: usize::MAX,
        least_relative_gain: None,
        rests_within: None,
        to_beat: None,
    };

    /// After so many trials.
    pub const fn after_trials(max_trials: usize) -> Stop {
        Stop { max_trials, max_steps: usize::MAX, ..Stop::NEVER }
    }

    /// After so many steps taken.
    pub fn after_steps(max_steps: usize) -> Stop {
        Stop { max_steps, ..Stop::NEVER }
    }

    /// Whether a descent gains nothing any more, with the objective at the start and after every step taken.
    pub(super) fn is_at_rest(&self, history: &[f64]) -> bool {
        let Some(part) = self.rests_within.filter(|_| history.len() > RESTING) else { return false };
        let present = history[history.len() - 1];
        history[history.len() - 1 - RESTING] - present < part * present
    }

    /// Whether a descent is left behind, with the objective at the start and after every trial.
    pub(super) fn is_behind(&self, by_trial: &[f64]) -> bool {
        let num_trials = by_trial.len() - 1;
        let Some(to_beat) = self.to_beat.filter(|_| num_trials >= PACE) else { return false };
        let present = by_trial[num_trials];
        let pace = (by_trial[num_trials - PACE] - present) / PACE as f64;
        present - pace * self.max_trials.saturating_sub(num_trials) as f64 > to_beat
    }
}
