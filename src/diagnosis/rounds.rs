//! Rounds: in each, all suspects are tested to first order, the leading ones are fitted in full, and the best is kept
//! where the evidence for it is strong enough.

use super::artefacts::take_out_artefacts;
use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::evidence::{OF_IMAGE_ALONE, times_to_large_of};
use super::experiment::experiments;
use super::findings::Findings;
use super::found::FoundCause;
use super::further_term::further_term;
use super::inference::Inference;
use super::ranked::Ranked;
use super::registry::Registry;
use super::score_round::{RoundScope, RoundScores, score_suspects};
use super::trace::Trace;
use super::trial::{AMBIGUITY, Scored, Trial, called_for, fit_leading};

/// Two fits end in the same place where their predictions differ by less than this part of the cause's effect.
const SAME_EFFECT: f64 = 0.2;

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
    use crate::diagnosis::evidence::EVIDENCE;
    use crate::diagnosis::scene::Scene;
    use crate::diagnosis::test_recordings::{FORCE_SD_N, MESH_FACTOR, inference_of, material, recorded};
    use crate::diagnosis::trial::begin;

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
