//! How the diagnosis fares where several causes are hidden at once.

use super::conceal::{ConcealError, conceal};
use super::detection::DetectionCurve;
use super::draw::HiddenCause;
use super::experiment::{Experiment, draw_harmless, draw_several, draw_with_unknown};
use super::own_effect::{OwnEffect, own_effects};
use super::score::score_all;
use super::several_answer::Answer;
use super::several_result::{CauseOfSeveral, CauseScore, ExperimentKind, SeveralProof, SeveralScored};
use super::truths::truths;
use crate::diagnosis::{CauseName, DiagnosisOptions, DiagnosisResult, Verdict, answers, diagnose};
use crate::recording::Recording;
use crate::specimen::Specimen;

/// A cause counts as detectable where its own effect (what neither the material nor the other causes could do in its
/// place) exceeds this part of the largest drive, rms over all drives.
const DETECTABLE_OF_DRIVE: f64 = 2e-3;
/// Its signal must also exceed noise by this: the sum of the squares of its effect over the noise's variance.
const DETECTABLE_SNR: f64 = 100.0;
/// A cause that acts on the force counts as detectable, too, where it changes the force by this part of it.
const DETECTABLE_FORCE: f64 = 0.02;

/// Settings of [`prove_several`].
#[derive(Clone, Debug)]
pub struct SeveralOptions {
    /// Recordings with two to four causes.
    pub num_recordings: usize,
    /// Recordings with a harmless mount.
    pub num_controls: usize,
    /// Recordings with a known and an unknown cause.
    pub num_unknown: usize,
    /// Seed of all draws.
    pub seed: u64,
    /// Element size of the diagnosis as a factor on the standard one.
    pub mesh_factor: f64,
}

impl Default for SeveralOptions {
    /// Three hundred recordings with several causes, a hundred controls, sixty with an unknown cause.
    fn default() -> Self {
        SeveralOptions { num_recordings: 300, num_controls: 100, num_unknown: 60, seed: 1, mesh_factor: 1.8 }
    }
}

/// All experiments of a proof, mixed so that a stopped one has seen all kinds alike.
pub fn several_experiments(options: &SeveralOptions) -> Vec<(ExperimentKind, Experiment)> {
    tasks(options).into_iter().map(|(kind, seed)| (kind, draw(kind, seed))).collect()
}

/// Kinds and seeds of all recordings.
fn tasks(options: &SeveralOptions) -> Vec<(ExperimentKind, u64)> {
    let kinds = [
        (ExperimentKind::Several, options.num_recordings),
        (ExperimentKind::Harmless, options.num_controls),
        (ExperimentKind::Unknown, options.num_unknown),
    ];
    let mut all: Vec<(f64, ExperimentKind, u64)> = Vec::new();
    for (k, (kind, num)) in kinds.into_iter().enumerate() {
        for n in 0..num {
            let seed = options.seed.wrapping_mul(9_000_011) + 1_000_003 * k as u64 + n as u64;
            all.push(((n as f64 + 0.5) / num as f64, kind, seed));
        }
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.into_iter().map(|(_, kind, seed)| (kind, seed)).collect()
}

fn draw(kind: ExperimentKind, seed: u64) -> Experiment {
    match kind {
        ExperimentKind::Several => draw_several(seed),
        ExperimentKind::Harmless => draw_harmless(seed),
        ExperimentKind::Unknown => draw_with_unknown(seed),
    }
}

/// The specimen of an experiment: `specimen`, or the same block without its holes.
pub fn specimen_of(specimen: &Specimen, experiment: &Experiment) -> Specimen {
    let mut own = specimen.clone();
    if experiment.is_solid {
        own.holes.clear();
    }
    own
}

/// Conceals and diagnoses all of `options` in `specimen` or its block; `done` and `report` as for
/// [`prove`](super::prove).
pub fn prove_several(
    specimen: &Specimen,
    options: &SeveralOptions,
    done: &[SeveralScored],
    report: &(dyn Fn(&SeveralScored, usize, usize) + Sync),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> SeveralProof {
    let of_task = |&(kind, seed): &(ExperimentKind, u64)| {
        done.iter().find(|s| s.kind == kind && s.experiment.seed == seed).cloned()
    };
    let score = |&(kind, seed): &(ExperimentKind, u64)| {
        let experiment = draw(kind, seed);
        score_experiment(specimen, kind, &experiment, options.mesh_factor, is_cancelled)
            .unwrap_or_else(|error| unmade(kind, experiment, error.to_string()))
    };
    sum_up(score_all(&tasks(options), &of_task, &score, report, is_cancelled), options)
}

/// The score of an experiment without a diagnosis.
fn unmade(kind: ExperimentKind, experiment: Experiment, failure: String) -> SeveralScored {
    SeveralScored {
        kind,
        experiment,
        verdict: None,
        named: Vec::new(),
        alternatives: Vec::new(),
        false_names: Vec::new(),
        causes: Vec::new(),
        is_right: false,
        location_mm: None,
        chi2: None,
        failure: Some(failure),
    }
}

/// Conceals and diagnoses one experiment.
///
/// # Errors
/// [`ConcealError`] where its recording cannot be made; a diagnosis that fails is a result.
pub fn score_experiment(
    specimen: &Specimen,
    kind: ExperimentKind,
    experiment: &Experiment,
    mesh_factor: f64,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<SeveralScored, ConcealError> {
    let own_specimen = specimen_of(specimen, experiment);
    let made = conceal(&own_specimen, experiment)?;
    let mut options = DiagnosisOptions { mesh_factor, ..DiagnosisOptions::default() };
    options.left_out.extend(unknown_cause(kind, experiment));
    match diagnose(&made.recording, &options, &|_| {}, is_cancelled) {
        Ok(found) => {
            let answer = Answer::from(&DiagnosisResult::new(&found, "", String::new()));
            score_made(&own_specimen, &made.recording, kind, experiment, &answer)
        }
        Err(error) => Ok(unmade(kind, experiment.clone(), error.to_string())),
    }
}

/// The cause that a diagnosis must not be told of, by the name that it has there.
pub fn unknown_cause(kind: ExperimentKind, experiment: &Experiment) -> Option<CauseName> {
    let last = experiment.hidden.last().filter(|_| kind == ExperimentKind::Unknown)?;
    last.cause.diagnosed()
}

/// Scores what was said of one experiment.
///
/// # Errors
/// [`ConcealError`] where its recording cannot be made.
pub fn score_answer(
    specimen: &Specimen,
    kind: ExperimentKind,
    experiment: &Experiment,
    answer: &Answer,
) -> Result<SeveralScored, ConcealError> {
    let specimen = specimen_of(specimen, experiment);
    let recording = conceal(&specimen, experiment)?.recording;
    score_made(&specimen, &recording, kind, experiment, answer)
}

fn score_made(
    specimen: &Specimen,
    recording: &Recording,
    kind: ExperimentKind,
    experiment: &Experiment,
    answer: &Answer,
) -> Result<SeveralScored, ConcealError> {
    let num_data = recording.steps.len() * recording.mask.iter().filter(|m| **m).count() * 3;
    let effects = own_effects(specimen, experiment)?;
    let mut scored = unmade(kind, experiment.clone(), String::new());
    fill(&mut scored, specimen, answer);
    for (n, effect) in effects.iter().enumerate() {
        let cause = &mut scored.causes[n];
        cause.own_effect_rms_mm = effect.rms_mm;
        cause.own_force_relative = effect.force_relative;
        cause.is_detectable = is_detectable(specimen, experiment, n, effect, num_data);
    }
    judge(&mut scored);
    Ok(scored)
}

fn is_detectable(
    specimen: &Specimen,
    experiment: &Experiment,
    place: usize,
    effect: &OwnEffect,
    num_data: usize,
) -> bool {
    let largest = specimen.largest_drive_mm().abs();
    let snr = num_data as f64 * (effect.rms_mm / experiment.noise_sd_mm).powi(2);
    let hidden = &experiment.hidden[place];
    let force_relative = match hidden.cause {
        // The load curve alone shows these; what the force is at rest and how it changes with time.
        HiddenCause::Relaxation | HiddenCause::Mullins => hidden.strength,
        HiddenCause::Cell => hidden.strength.abs() / TYPICAL_FORCE_N,
        _ => 0.0,
    };
    effect.rms_mm > DETECTABLE_OF_DRIVE * largest && snr > DETECTABLE_SNR || force_relative > DETECTABLE_FORCE
}

/// The force at the largest drive of the specimens, roughly, N.
const TYPICAL_FORCE_N: f64 = 15.0;

/// What the diagnosis said.
fn fill(scored: &mut SeveralScored, specimen: &Specimen, result: &Answer) {
    scored.failure = None;
    scored.verdict = Some(result.verdict);
    scored.named = result.causes.iter().map(|c| c.name.clone()).collect();
    scored.alternatives = result.alternatives.iter().map(|c| c.name.clone()).collect();
    scored.chi2 = result.chi2_per_datum.map(|chi2| [chi2.before, chi2.after]);
    let num_known = scored.experiment.hidden.len() - usize::from(scored.kind == ExperimentKind::Unknown);
    let hidden: Vec<CauseName> =
        scored.experiment.hidden[..num_known].iter().filter_map(|h| h.cause.diagnosed()).collect();
    let is_answer = |name: &String| hidden.iter().any(|h| answers(*h, name));
    scored.false_names = scored.named.iter().filter(|name| !is_answer(name)).cloned().collect();
    scored.causes = scored
        .experiment
        .hidden
        .iter()
        .map(|h| {
            let answer = |name: &str| h.cause.diagnosed().is_some_and(|hidden| answers(hidden, name));
            let own = result.causes.iter().find(|c| c.name == h.cause.name());
            let truths = truths(specimen, h);
            let deviations = own.into_iter().flat_map(|c| &c.parameters).filter_map(|p| {
                let (_, truth) = truths.iter().find(|(name, _)| *name == p.name)?;
                let [low, high] = p.interval_95?;
                Some((p.name.clone(), (0.5 * (low + high) - truth) / (0.5 * (high - low))))
            });
            CauseScore {
                cause: h.cause,
                own_effect_rms_mm: 0.0,
                own_force_relative: 0.0,
                is_detectable: false,
                is_named: scored.named.iter().chain(&scored.alternatives).any(|n| answer(n)),
                deviations: deviations.collect(),
            }
        })
        .collect();
    if let (ExperimentKind::Unknown, Some(last), Some(at)) =
        (scored.kind, scored.experiment.hidden.last(), &result.left_at)
        && last.extent_mm.iter().any(|x| *x > 0.0)
    {
        let distance = (0..3).map(|a| (at.center_mm[a] - last.center_mm[a]).powi(2)).sum::<f64>().sqrt();
        scored.location_mm = Some([distance, 0.5 * last.extent_mm.iter().map(|x| x * x).sum::<f64>().sqrt()]);
    }
}

/// Whether it is right, once it is known what could be seen.
fn judge(scored: &mut SeveralScored) {
    scored.is_right = match scored.kind {
        ExperimentKind::Several => {
            scored.verdict.is_some() && scored.causes.iter().all(|c| c.is_named || !c.is_detectable)
        }
        ExperimentKind::Harmless => scored.verdict == Some(Verdict::NoMismatch),
        ExperimentKind::Unknown => scored.verdict == Some(Verdict::Unexplained),
    };
}

/// How far (in half diagonals of the place) what is left may lie from the unknown cause to count as located.
const LOCATED: f64 = 1.5;

/// The sums over all that was scored.
pub fn sum_up(scored: Vec<SeveralScored>, options: &SeveralOptions) -> SeveralProof {
    let of = |kind: ExperimentKind| scored.iter().filter(move |s| s.kind == kind);
    let several = || of(ExperimentKind::Several);
    let share = |part: usize, whole: usize| [part, whole];
    let can_be_seen = |s: &&SeveralScored| s.causes.iter().any(|c| c.is_detectable) || s.failure.is_some();
    let unknown = || {
        of(ExperimentKind::Unknown).filter(|s| s.causes.last().is_some_and(|c| c.is_detectable) || s.failure.is_some())
    };
    let located = || unknown().filter_map(|s| s.location_mm);
    let deviations = || several().flat_map(|s| &s.causes).flat_map(|c| &c.deviations);
    let inputs = serde_json::json!({
        "num_recordings": options.num_recordings, "num_controls": options.num_controls,
        "num_unknown": options.num_unknown, "seed": options.seed, "mesh_factor": options.mesh_factor,
    });
    let causes: Vec<CauseOfSeveral> = HiddenCause::ALL
        .into_iter()
        .chain(HiddenCause::IN_COMPANY)
        .filter_map(|cause| of_cause(cause, &several().collect::<Vec<_>>()))
        .collect();
    SeveralProof {
        schema: "proof-of-several/1".into(),
        all_named: share(
            several().filter(can_be_seen).filter(|s| s.is_right).count(),
            several().filter(can_be_seen).count(),
        ),
        false_of_named: share(several().map(|s| s.false_names.len()).sum(), several().map(|s| s.named.len()).sum()),
        quiet_controls: share(
            of(ExperimentKind::Harmless).filter(|s| s.is_right).count(),
            of(ExperimentKind::Harmless).count(),
        ),
        unexplained_of_unknown: share(unknown().filter(|s| s.is_right).count(), unknown().count()),
        located_of_unknown: share(
            located().filter(|[distance, size]| *distance < LOCATED * size).count(),
            located().count(),
        ),
        covered: share(deviations().filter(|d| d.1.abs() <= 1.0).count(), deviations().count()),
        causes,
        scored,
        version: crate::provenance::VERSION.into(),
        build: crate::provenance::build_id(),
        input_hash: crate::provenance::input_hash(&inputs),
    }
}

/// Sums over one cause; `None` where it was neither hidden nor named.
fn of_cause(cause: HiddenCause, several: &[&SeveralScored]) -> Option<CauseOfSeveral> {
    let hidden = || several.iter().flat_map(|s| &s.causes).filter(|c| c.cause == cause);
    let num_false = several.iter().flat_map(|s| &s.false_names).filter(|name| name.as_str() == cause.name()).count();
    if hidden().next().is_none() && num_false == 0 {
        return None;
    }
    let deviations = || hidden().flat_map(|c| &c.deviations);
    let sizes: Vec<(f64, bool)> = hidden().map(|c| (c.own_effect_rms_mm, c.is_named)).collect();
    Some(CauseOfSeveral {
        cause,
        num_hidden: hidden().count(),
        num_detectable: hidden().filter(|c| c.is_detectable).count(),
        num_named: hidden().filter(|c| c.is_detectable && c.is_named).count(),
        num_false,
        num_covered: [deviations().filter(|d| d.1.abs() <= 1.0).count(), deviations().count()],
        detection: DetectionCurve::fitted(&sizes),
    })
}
