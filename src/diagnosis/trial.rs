//! Trials: the leading suspects of a round are fitted side by side, each with one more cause than the fit so far. Fits
//! end early, and those that may be the best are gone on with.

use super::candidate::Candidate;
use super::cause::Cause;
use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::evidence::{EVIDENCE, ROUGH_TOLERANCE, counted_part, penalty, smallest_share};
use super::findings::Findings;
use super::inference::Inference;
use super::prior::FitSettings;
use super::ranked::Ranked;
use super::registry::Registry;
use super::score_round::leading;
use super::supposed::Supposed;
use super::trace::Trace;
use rayon::prelude::*;
use std::sync::Arc;

/// Causes whose fits differ by less than this in deviance cannot be told apart.
pub(super) const AMBIGUITY: f64 = 15.0;

/// A candidate is fitted where it explains, to first order, more than this part of the smallest share that is called
/// for: a full fit may explain several times what first order promises.
const LEAST_PROMISE: f64 = 0.25;

/// Trials after which fits side by side are compared, and those that cannot be the best let go.
const FIRST_TRIALS: usize = 3;

/// A fit is gone on with where it may still explain this part of what the best one does by then. Less than
/// [`AMBIGUITY`] apart are fits that differ by far less.
const MAY_LEAD: f64 = 0.9;

/// A fit that may be the best goes on to its end where it explains this part of what is called for.
const WORTH_AN_END: f64 = 0.5;

/// How often fits are gone on with as what they look like.
const MAX_LOOK_ALIKES: usize = 2;

/// Parts of what first order promises from which a fit starts, one after the other until one has an equilibrium.
const SHORTER_STARTS: [f64; 3] = [1.0, 0.4, 0.1];

/// Fits that ended early may lie so many times that apart from where they would have ended.
const NEAR_TOLERANCES: f64 = 5.0;

/// What the first half of a round found.
pub(super) struct Scored {
    /// The causes asked for.
    pub(super) registry: Registry,
    /// Suspects, most explaining first.
    pub(super) candidates: Vec<Candidate>,
    /// Changes of the prediction with the parameters of the fit so far, for fits of further causes; empty where these
    /// are to work them out.
    pub(super) known: Vec<Trace>,
    /// Whether a further Ogden term is asked for beside them.
    pub(super) with_terms: bool,
    /// The evidence that is called for.
    pub(super) evidence: f64,
}

/// A fit with one more cause.
pub(super) struct Trial<'a> {
    /// Fall of the deviance, less ln n per parameter of the cause.
    pub(super) gain: f64,
    pub(super) fit: CauseFit,
    /// How far it has come.
    stage: Stage,
    /// What it was made with.
    pub(super) inference: Inference<'a>,
}

/// How far a fit of a round has come.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// It made its first trials.
    Begun,
    /// It ended early, and leapt from there.
    Compared,
    /// It went on to its end.
    Settled,
}

impl<'a> Trial<'a> {
    /// A fit that `inference` has begun.
    pub(super) fn begun(inference: Inference<'a>, current: &CauseFit, fit: CauseFit) -> Trial<'a> {
        Trial { gain: gain_of(&inference, current, &fit), fit, stage: Stage::Begun, inference }
    }

    /// What counts of its gain against others, as a part.
    fn part(&self) -> f64 {
        self.fit.causes.last().map_or(1.0, |c| counted_part(&*c.cause))
    }

    /// Its gain as it counts against others.
    pub(super) fn counted(&self) -> f64 {
        self.part() * self.gain
    }

    /// Goes on with the fit by `go_on`, to `stage`; what has no fit from there stays as it was.
    ///
    /// # Errors
    /// [`DiagnosisError`]: the work was cancelled.
    fn go_on(
        &mut self,
        current: &CauseFit,
        stage: Stage,
        go_on: impl FnOnce(&mut Inference<'a>, &CauseFit) -> Result<CauseFit, DiagnosisError>,
    ) -> Result<(), DiagnosisError> {
        match go_on(&mut self.inference, &self.fit) {
            Ok(fit) => {
                (self.gain, self.stage) = (gain_of(&self.inference, current, &fit), stage);
                self.fit = fit;
                Ok(())
            }
            Err(error) if (self.inference.is_cancelled)() => Err(error),
            Err(_) => Ok(()),
        }
    }

    /// The cause that it adds, in words.
    pub(super) fn description(&self) -> String {
        self.fit.causes.last().map_or_else(String::new, |c| c.cause.description())
    }
}

/// The gain that is called for of a cause: `evidence`, and some part of what was explained before it.
pub(super) fn called_for(findings: &Findings, evidence: f64) -> f64 {
    evidence.max(smallest_share(&findings.current.causes) * findings.explained())
}

/// Fits the leading candidates, the best first; those without a fit are left out. Fits end early, and with the
/// changes of the prediction that are known; those that may be the best are then gone on with.
///
/// # Errors
/// [`DiagnosisError`]: the work was cancelled.
pub(super) fn fit_leading<'a>(
    inference: &mut Inference<'a>,
    scored: &Scored,
    findings: &mut Findings,
    measured: &Trace,
) -> Result<Vec<Trial<'a>>, DiagnosisError> {
    let candidates = &scored.candidates;
    let mut trials: Vec<Trial> = Vec::new();
    let least = LEAST_PROMISE * smallest_share(&findings.current.causes) * findings.explained();
    let starts = leading(candidates, &findings.current).into_iter().filter(|c| c.score > least);
    let starts: Vec<Start> = starts.map(|c| (c.cause.clone(), c.values.clone())).collect();
    fit_starts(inference, findings, measured, scored, &starts, &mut trials)?;
    let (specimen, names) = (&inference.laboratory.observed().specimen, scored.registry.names());
    let mut from = 0;
    for _ in 0..MAX_LOOK_ALIKES {
        let ended = trials[from..].iter().filter_map(|t| t.fit.causes.last());
        let alike = ended.flat_map(|s| s.cause.look_alikes(&s.values, specimen));
        let starts: Vec<Start> = alike.filter(|c| names.contains(&c.name())).map(|c| (c.clone(), c.start())).collect();
        from = trials.len();
        findings.ranked.extend(starts.iter().map(|(cause, _)| Ranked {
            identity: cause.identity(),
            description: cause.description(),
            score: 0.0,
            fitted: None,
            round: findings.num_rounds,
        }));
        fit_starts(inference, findings, measured, scored, &starts, &mut trials)?;
    }
    trials.sort_by(|a, b| b.counted().total_cmp(&a.counted()));
    Ok(trials)
}

/// A cause and the values of its parameters from which its fit starts.
pub(super) type Start = (Arc<dyn Cause>, Vec<f64>);

/// Adds the fits from `starts`, which end early, and goes on with those of all trials that may be the best. Fits are
/// made side by side, each with a laboratory of its own, so that none depends on what another found.
///
/// # Errors
/// [`DiagnosisError`]: the work was cancelled.
fn fit_starts<'a>(
    inference: &mut Inference<'a>,
    findings: &mut Findings,
    measured: &Trace,
    scored: &Scored,
    starts: &[Start],
    trials: &mut Vec<Trial<'a>>,
) -> Result<(), DiagnosisError> {
    if starts.is_empty() {
        return Ok(());
    }
    let settings = inference.settings;
    let tolerance = settings.tolerance.max(ROUGH_TOLERANCE * inference.misfit_beyond_noise(&findings.current));
    let round = findings.num_rounds;
    let twins: Vec<(Inference, &Start)> = starts.iter().map(|start| (inference.twin(), start)).collect();
    let (current, least) = (&findings.current, called_for(findings, scored.evidence));
    let begun: Vec<Option<Trial>> = twins
        .into_par_iter()
        .map(|(mut twin, start)| {
            twin.settings.relative_tolerance = ROUGH_TOLERANCE;
            twin.settings.max_iterations = FIRST_TRIALS;
            let fit = begin(&mut twin, current, round, measured, &scored.known, start)?;
            Some(Trial::begun(twin, current, fit))
        })
        .collect();
    let begun_trials = || begun.iter().flatten();
    let best = trials.iter().chain(begun_trials()).map(Trial::counted).fold(f64::NEG_INFINITY, f64::max);
    // What a fit must come to, beyond what its parameters cost, to be named or told from what is.
    let needed = |trial: &Trial| (least / trial.part()).max(MAY_LEAD * best);
    let compare = |mut trial: Trial<'a>| {
        let num = trial.fit.causes.last().map_or(0, |c| c.values.len());
        let goal = current.deviance - penalty(&trial.inference.metric, num) - needed(&trial);
        let rough = FitSettings { relative_tolerance: ROUGH_TOLERANCE, goal: Some(goal), ..settings };
        trial.inference.settings = rough;
        trial.go_on(current, Stage::Compared, |twin, fit| {
            let is_at_its_end = fit.iterations < FIRST_TRIALS;
            let ended = match is_at_its_end {
                true => fit.clone(),
                false => twin.fit_beyond(measured, &fit.material, &fit.causes, &scored.known)?,
            };
            twin.with_leaps(measured, ended, &scored.known)
        })?;
        trial.inference.settings = settings;
        Ok(trial)
    };
    let found = begun
        .into_par_iter()
        .map(|trial| trial.map(compare).transpose())
        .collect::<Result<Vec<Option<Trial>>, DiagnosisError>>()?;
    for ((cause, _), trial) in starts.iter().zip(&found) {
        // Suspects without an identity of their own, as two balls, share the last entry.
        let identity = cause.identity();
        if let (Some(trial), Some(ranked)) = (trial, findings.ranked.iter_mut().rev().find(|r| r.identity == identity))
        {
            ranked.fitted = Some(trial.gain);
        }
    }
    trials.extend(found.into_iter().flatten());
    let best = trials.iter().map(Trial::counted).fold(f64::NEG_INFINITY, f64::max);
    let near = (best - 2.0 * AMBIGUITY).max(EVIDENCE) - NEAR_TOLERANCES * tolerance;
    let current = &findings.current;
    let may_be_named = |t: &&mut Trial| t.counted() > near && t.counted() > WORTH_AN_END * least;
    trials.par_iter_mut().filter(|t| t.stage != Stage::Settled).filter(may_be_named).try_for_each(|trial| {
        trial.go_on(current, Stage::Settled, |twin, fit| twin.fit(measured, &fit.material, &fit.causes))
    })?;
    for trial in trials {
        inference.laboratory.num_solves += std::mem::take(&mut trial.inference.laboratory.num_solves);
    }
    Ok(())
}

/// The first trials of a fit with one more cause; `None` where it has none or the work is cancelled.
pub(super) fn begin(
    inference: &mut Inference,
    current: &CauseFit,
    round: usize,
    measured: &Trace,
    known: &[Trace],
    (cause, values): &Start,
) -> Option<CauseFit> {
    if (inference.is_cancelled)() {
        return None;
    }
    (inference.progress)(&format!("round {round}: fitting '{}'", cause.description()));
    let mut fit_from = |values: Vec<f64>| {
        let mut supposed = current.causes.clone();
        supposed.push(Supposed { cause: cause.clone(), values });
        inference.fit_beyond(measured, &current.material, &supposed, known).ok()
    };
    SHORTER_STARTS.into_iter().find_map(|part| fit_from(between(&cause.start(), values, part)))
}

/// A start `part` of the way from one to the other.
fn between(from: &[f64], to: &[f64], part: f64) -> Vec<f64> {
    from.iter().zip(to).map(|(a, b)| a + part * (b - a)).collect()
}

/// By how much the deviance of `current` falls with the last cause of `fit`, less what its parameters cost.
fn gain_of(inference: &Inference, current: &CauseFit, fit: &CauseFit) -> f64 {
    let num = fit.causes.last().map_or(0, |c| c.values.len());
    current.deviance - fit.deviance - penalty(&inference.metric, num)
}
