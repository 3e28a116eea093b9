//! Rounds: in each, all suspects are tested to first order, the leading ones are fitted in full, and the best is kept
//! where the evidence for it is strong enough.

use super::candidate::Candidate;
use super::cause::Cause;
use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::evidence::{
    EVIDENCE, OF_IMAGE_ALONE, ROUGH_TOLERANCE, counted_part, penalty, smallest_share, times_to_large_of,
};
use super::experiment::experiments;
use super::findings::Findings;
use super::found::FoundCause;
use super::further_term::further_term;
use super::inference::Inference;
use super::prior::FitSettings;
use super::ranked::Ranked;
use super::registry::Registry;
use super::score_round::{RoundScope, RoundScores, leading, score_suspects};
use super::supposed::{Supposed, scene_of};
use super::trace::Trace;
use rayon::prelude::*;
use std::sync::Arc;

/// Two fits end in the same place where their predictions differ by less than this part of the cause's effect.
const SAME_EFFECT: f64 = 0.2;
/// Causes whose fits differ by less than this in deviance cannot be told apart.
const AMBIGUITY: f64 = 15.0;

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

/// A fit with one more cause.
struct Trial<'a> {
    /// Fall of the deviance, less ln n per parameter of the cause.
    gain: f64,
    fit: CauseFit,
    /// How far it has come.
    stage: Stage,
    /// What it was made with.
    inference: Inference<'a>,
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
    fn begun(inference: Inference<'a>, current: &CauseFit, fit: CauseFit) -> Trial<'a> {
        Trial { gain: gain_of(&inference, current, &fit), fit, stage: Stage::Begun, inference }
    }

    /// What counts of its gain against others, as a part.
    fn part(&self) -> f64 {
        self.fit.causes.last().map_or(1.0, |c| counted_part(&*c.cause))
    }

    /// Its gain as it counts against others.
    fn counted(&self) -> f64 {
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
    fn description(&self) -> String {
        self.fit.causes.last().map_or_else(String::new, |c| c.cause.description())
    }
}

/// What the first half of a round found.
pub(super) struct Scored {
    /// The causes asked for.
    registry: Registry,
    /// Suspects, most explaining first.
    pub(super) candidates: Vec<Candidate>,
    /// Changes of the prediction with the parameters of the fit so far, for fits of further causes; empty where these
    /// are to work them out.
    known: Vec<Trace>,
    /// Whether a further Ogden term is asked for beside them.
    with_terms: bool,
    /// The evidence that is called for.
    evidence: f64,
}

/// How far rounds go.
#[derive(Clone, Copy)]
pub(super) struct RoundLimits {
    /// Most causes of the displacement.
    pub(super) max_causes: usize,
    /// Whether a load curve was read.
    pub(super) has_load_curve: bool,
}

/// What a round asks for.
#[derive(Clone, Copy)]
pub(super) struct Asked<'r> {
    /// The causes.
    pub(super) registry: &'r Registry,
    /// Whether a further Ogden term is asked for beside them.
    pub(super) with_terms: bool,
    /// How much each must lower the deviance, beyond ln n per parameter.
    pub(super) evidence: f64,
}

/// What the next round asks for, given what was found so far; `None` where there is to be none.
pub(super) type ToAsk<'f, 'r> = &'f dyn Fn(&Inference, &Findings) -> Option<Asked<'r>>;

/// The first half of a round: tests all suspects to first order. Where what is left is no more than a mesh's error, it
/// has no cause but in the image, for which far more evidence is called for.
///
/// # Errors
/// [`DiagnosisError`]: the work was cancelled, or the fit so far has no derivatives.
pub(super) fn score_round(
    inference: &mut Inference,
    asked: Asked,
    findings: &mut Findings,
    limits: RoundLimits,
) -> Result<Scored, DiagnosisError> {
    findings.num_rounds += 1;
    let round = findings.num_rounds;
    (inference.progress)(&format!("round {round}: testing causes"));
    let scope = RoundScope { has_load_curve: limits.has_load_curve };
    let Asked { registry, with_terms, evidence } = asked;
    let (registry, with_terms, evidence) = match inference.leaves_no_more_than_a_mesh(&findings.current) {
        true => {
            let specimen = &inference.laboratory.observed().specimen;
            (registry.clone().of_image_alone(specimen), false, OF_IMAGE_ALONE * evidence)
        }
        false => (registry.clone(), with_terms, evidence),
    };
    let RoundScores { candidates, known, maps } = score_suspects(inference, &registry, &findings.current, scope)?;
    if round == 1 {
        findings.maps.extend(maps);
    }
    findings.ranked.extend(candidates.iter().map(|c| Ranked {
        identity: c.cause.identity(),
        description: c.cause.description(),
        score: c.score,
        fitted: None,
        round,
    }));
    // The nominal model's few parameters are worked out at every step: they change most with the first cause.
    let known = if findings.current.causes.is_empty() { Vec::new() } else { known };
    Ok(Scored { registry, candidates, known, with_terms, evidence })
}

/// The second half of a round: fits the leading candidates and names the best, unless a further Ogden term of the
/// material explains more; whether there was either.
///
/// # Errors
/// As [`score_round`].
pub(super) fn fit_round(
    inference: &mut Inference,
    findings: &mut Findings,
    measured: &Trace,
    scored: &Scored,
) -> Result<bool, DiagnosisError> {
    let trials = fit_leading(inference, scored, findings, measured)?;
    if scored.with_terms {
        let best = trials.first().map_or(0.0, Trial::counted);
        if let Some((richer, gain)) = further_term(inference, measured, &findings.current)?
            && gain > best
        {
            (inference.progress)("a further Ogden term explains more than any cause");
            findings.current = richer;
            return Ok(true);
        }
    }
    let is_named = take_best(inference, findings, trials, scored.evidence)?;
    if is_named {
        take_out_artefacts(inference, &scored.registry, findings, measured)?;
    }
    Ok(is_named)
}

/// Finds the artefacts of the image in what the fit so far leaves, if none is in it yet, and fits their sizes.
///
/// # Errors
/// As [`score_round`].
pub(super) fn take_out_artefacts(
    inference: &mut Inference,
    registry: &Registry,
    findings: &mut Findings,
    measured: &Trace,
) -> Result<(), DiagnosisError> {
    let current = &findings.current;
    if current.causes.iter().all(|c| !c.cause.is_artefact()) {
        let found = registry.artefacts(inference.laboratory.observed(), &current.residual, inference.progress);
        if !found.is_empty() {
            let causes = current.causes.iter().cloned().chain(found).collect::<Vec<_>>();
            findings.current = inference.fit(measured, &current.material, &causes)?;
        }
    }
    Ok(())
}

/// Looks for the artefacts of the image again, in what the fit leaves without them, and fits anew where they are others
/// now: what looked like one before all causes were found may have been a cause's. Whether they are others.
///
/// # Errors
/// As [`score_round`].
pub(super) fn look_for_artefacts_again(
    inference: &mut Inference,
    registry: &Registry,
    findings: &mut Findings,
    measured: &Trace,
) -> Result<bool, DiagnosisError> {
    let (known, others): (Vec<Supposed>, Vec<Supposed>) =
        findings.current.causes.iter().cloned().partition(|s| s.cause.is_artefact());
    if known.is_empty() {
        return Ok(false);
    }
    let mut without = findings.current.residual.clone();
    for jump in scene_of(&known).image.jumps {
        for &voxel in jump.voxels.iter() {
            without.displacement[jump.step][voxel as usize][jump.component] += jump.size_mm;
        }
    }
    let found = registry.artefacts(inference.laboratory.observed(), &without, &|_| {});
    let identities = |all: &[Supposed]| all.iter().map(|s| s.cause.identity()).collect::<Vec<_>>();
    let are_others = identities(&found) != identities(&known);
    if are_others {
        (inference.progress)(&format!("of {} artefacts of the image {} are left", known.len(), found.len()));
        let causes = [others, found].concat();
        findings.current = inference.fit(measured, &findings.current.material, &causes)?;
    }
    Ok(are_others)
}

/// Adds causes round by round, each of those that the next round is `to_ask` for, until no further one is called for,
/// the limits are reached, or nothing is to be asked any more.
///
/// # Errors
/// As [`score_round`].
pub(super) fn add_causes<'r>(
    inference: &mut Inference,
    findings: &mut Findings,
    measured: &Trace,
    limits: RoundLimits,
    to_ask: ToAsk<'_, 'r>,
) -> Result<(), DiagnosisError> {
    while findings.num_of_fit() < limits.max_causes {
        let Some(asked) = to_ask(inference, findings) else { break };
        let scored = score_round(inference, asked, findings, limits)?;
        if !fit_round(inference, findings, measured, &scored)? {
            break;
        }
    }
    Ok(())
}

/// Fits the leading candidates, the best first; those without a fit are left out. Fits end early, and with the
/// changes of the prediction that are known; those that may be the best are then gone on with.
///
/// # Errors
/// [`DiagnosisError`]: the work was cancelled.
fn fit_leading<'a>(
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
type Start = (Arc<dyn Cause>, Vec<f64>);

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
fn begin(
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

/// The gain that is called for of a cause: `evidence`, and some part of what was explained before it.
fn called_for(findings: &Findings, evidence: f64) -> f64 {
    evidence.max(smallest_share(&findings.current.causes) * findings.explained())
}

/// Names the best trial as a cause where the evidence for it is strong enough, with what cannot be told apart from it;
/// whether it did.
///
/// Where the leading one does too little to be a cause, one that explains more than it is taken: a smooth field, whose
/// gain counts in part.
fn take_best<'a>(
    inference: &mut Inference<'a>,
    findings: &mut Findings,
    mut trials: Vec<Trial<'a>>,
    evidence: f64,
) -> Result<bool, DiagnosisError> {
    let Some(leading) = trials.first() else { return Ok(false) };
    let least = called_for(findings, evidence);
    (inference.progress)(&format!(
        "round {}: '{}' lowers the deviance by {:.0}, of which {:.0} count; {least:.0} are called for",
        findings.num_rounds,
        leading.description(),
        leading.gain,
        leading.counted()
    ));
    let gain_of_leading = leading.gain;
    let effect_of = |trial: &Trial| trial.fit.prediction.trace.plus(-1.0, &findings.current.prediction.trace);
    let may_be_named = |trial: &Trial| {
        let observed = inference.laboratory.observed();
        let is_large = trial.fit.causes.last().is_some_and(|found| {
            times_to_large_of(&*found.cause, observed, &effect_of(trial), inference.allowance_mm) < 1.0
        });
        trial.gain >= gain_of_leading && trial.counted() >= least && is_large
    };
    let Some(place) = trials.iter().position(may_be_named) else { return Ok(false) };
    let effect = effect_of(&trials[place]);
    let others = trials.split_off(place + 1);
    let Some(mut best) = trials.pop() else { return Ok(false) };
    if place > 0 {
        (inference.progress)(&format!("it does too little; '{}' explains more", best.description()));
    }
    for other in others {
        if best.counted() - other.counted() < AMBIGUITY && !is_same(&best.fit, &other.fit, &effect) {
            let alternative = alternative(inference, &findings.current, &best.fit, &other)?;
            findings.alternatives.push(alternative);
        }
    }
    findings.causes.push(last_cause(inference, &best, &effect));
    findings.current = best.fit;
    // Its laboratory has the models and the equilibria from which the next round starts.
    best.inference.laboratory.num_solves += inference.laboratory.num_solves;
    inference.laboratory = best.inference.laboratory;
    Ok(true)
}

/// Whether two fits are two starts of one cause that ended in one place; `effect` is that of the first.
fn is_same(best: &CauseFit, other: &CauseFit, effect: &Trace) -> bool {
    let name_of = |fit: &CauseFit| fit.causes.last().map(|c| c.cause.name());
    let apart = other.prediction.trace.plus(-1.0, &best.prediction.trace);
    name_of(other) == name_of(best) && apart.rms_mm() < SAME_EFFECT * effect.rms_mm()
}

/// What the data cannot tell apart from the best, with the experiments that would.
fn alternative(
    inference: &mut Inference,
    current: &CauseFit,
    best: &CauseFit,
    other: &Trial,
) -> Result<FoundCause, DiagnosisError> {
    let effect = other.fit.prediction.trace.plus(-1.0, &current.prediction.trace);
    let mut found = last_cause(inference, other, &effect);
    (inference.progress)(&format!("looking for the experiment that would tell '{}' apart", found.description));
    found.experiments = experiments(inference, [best, &other.fit])?;
    Ok(found)
}

/// The cause that a trial added, with its effect on the prediction.
fn last_cause(inference: &Inference, trial: &Trial, effect: &Trace) -> FoundCause {
    let last = trial.fit.causes.len() - 1;
    FoundCause::of_fit(&trial.fit, last, inference.laboratory.observed()).with_evidence(trial.gain, effect.rms_mm())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::Observed;
    use crate::diagnosis::scene::{Jump, Scene};
    use crate::diagnosis::test_recordings::{FORCE_SD_N, MESH_FACTOR, inference_of, material, recorded};

    /// A fit of `measured` with the cause of this name beside those of `current`, and what it changes, mm rms.
    fn trial_of<'a>(
        inference: &Inference<'a>,
        registry: &Registry,
        measured: &Trace,
        current: &CauseFit,
        name: &str,
    ) -> (Trial<'a>, f64) {
        let specimen = &inference.laboratory.observed().specimen;
        let cause = registry.tested(specimen).into_iter().find(|c| c.name().as_str() == name).unwrap();
        let start = (cause.clone(), cause.start());
        let mut inference = inference.twin();
        let fit = begin(&mut inference, current, 1, measured, &[], &start).unwrap();
        let effect = fit.prediction.trace.plus(-1.0, &current.prediction.trace);
        (Trial::begun(inference, current, fit), effect.rms_mm())
    }

    /// A group of voxels that is a turn off, and another that looked so before: the first stays, with its size, the
    /// other goes.
    #[test]
    fn artefacts_that_are_not_found_again_go() {
        let plain = recorded(&material(), &Scene::default(), MESH_FACTOR);
        let plain = Observed::new(&plain, FORCE_SD_N).unwrap();
        let around = |x_mm: f64| -> Vec<u32> {
            let center = |v: &u32| plain.mask.grid.center_mm(plain.mask.voxels[*v as usize] as usize);
            let is_near = |x: [f64; 3]| (x[0] - x_mm).abs() < 4.0 && x[2].abs() < 5.0;
            (0..plain.mask.num_voxels() as u32).filter(|v| is_near(center(v))).collect()
        };
        let mut scene = Scene::default();
        scene.image.jumps.push(Jump { step: 1, component: 2, voxels: Arc::new(around(-5.0)), size_mm: 0.4 });
        let recording = recorded(&material(), &scene, MESH_FACTOR);
        let observed = Observed::new(&recording, FORCE_SD_N).unwrap();
        let (registry, mut inference) = (Registry::standard(), inference_of(&observed));
        let measured = inference.laboratory.measured();
        let nominal = inference.fit(&measured, &material(), &[]).unwrap();
        let mut findings = Findings::of_nominal(nominal.clone());
        take_out_artefacts(&mut inference, &registry, &mut findings, &measured).unwrap();
        let right = findings.current.causes.clone();
        assert_eq!(right.len(), 1);
        // Other voxels by the same cause: those of a residual that jumps elsewhere.
        let mut elsewhere = nominal.residual.scaled(0.0);
        around(5.0).into_iter().for_each(|v| elsewhere.displacement[1][v as usize][0] = 0.5);
        let wrong = registry.artefacts(&observed, &elsewhere, &|_| {});
        assert_eq!(wrong.len(), 1);
        let both = [&right[..], &wrong].concat();
        findings.current = inference.fit(&measured, &material(), &both).unwrap();
        assert!(look_for_artefacts_again(&mut inference, &registry, &mut findings, &measured).unwrap());
        assert!(!look_for_artefacts_again(&mut inference, &registry, &mut findings, &measured).unwrap());
        let [left] = &findings.current.causes[..] else { panic!("{}", findings.current.causes.len()) };
        assert_eq!(left.cause.identity(), right[0].cause.identity());
        // The mean of more than fifty voxels of 0.01 mm of noise each: seven standard deviations.
        assert!((left.values[0] - 0.4).abs() < 0.01, "{}", left.values[0]);
    }

    /// A background of 0.03 mm that a displaced plate takes up in part. Where that plate does less than a mesh could
    /// and leads all the same, because the gain of a smooth field counts in part, the field is named, not nothing; and
    /// nothing where the plate is all there is.
    #[test]
    fn a_leading_cause_that_does_too_little_gives_way_to_what_explains_more() {
        let mut scene = Scene::default();
        scene.image.background_mm[1] = [0.01, 0.0, 0.01, 0.0, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0];
        let recording = recorded(&material(), &scene, MESH_FACTOR);
        let observed = Observed::new(&recording, FORCE_SD_N).unwrap();
        let (registry, mut inference) = (Registry::standard(), inference_of(&observed));
        let measured = inference.laboratory.measured();
        let current = inference.fit(&measured, &material(), &[]).unwrap();
        let mut findings = Findings::of_nominal(current.clone());
        let trial = |name| trial_of(&inference, &registry, &measured, &current, name);
        let ((plate, plate_mm), (field, field_mm)) = (trial("mount"), trial("background"));
        let (alone, _) = trial("mount");
        assert!(
            field.gain > plate.gain && field_mm > 2.0 * plate_mm,
            "{} {} {field_mm} {plate_mm}",
            field.gain,
            plate.gain
        );
        inference.allowance_mm = (plate_mm * field_mm).sqrt();
        assert!(!take_best(&mut inference, &mut findings, vec![alone], EVIDENCE).unwrap());
        assert!(take_best(&mut inference, &mut findings, vec![plate, field], EVIDENCE).unwrap());
        assert_eq!(findings.causes.last().unwrap().name.as_str(), "background");
    }
}
