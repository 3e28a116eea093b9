//! How the diagnosis fares on concealed causes.

use super::conceal::{ConcealError, Concealed, conceal};
use super::draw::{Hidden, HiddenCause, draw_cause};
use super::experiment::Experiment;
use super::options::ProofOptions;
use super::result::{Proof, Scored};
use super::summary::sum_up;
use super::truths::truths;
use crate::diagnosis::{CauseName, DiagnosisError, DiagnosisOptions, DiagnosisResult, Verdict, diagnose};
use crate::specimen::Specimen;

/// A cause counts as detectable where it changes the displacement by this many allowances (rms at the largest drive,
/// the material unchanged).
const DETECTABLE_ALLOWANCES: f64 = 3.0;
/// A cause that acts on the force counts as detectable, too, where it changes the force by this part of it.
const DETECTABLE_FORCE: f64 = 0.02;

/// Causes that are hidden from a diagnosis that is not told of them.
const UNKNOWN: [HiddenCause; 5] =
    [HiddenCause::Inclusion, HiddenCause::Debond, HiddenCause::Hole, HiddenCause::Gradient, HiddenCause::Tilt];

/// Recordings that a proof makes and diagnoses.
pub fn num_recordings(options: &ProofOptions) -> usize {
    let count = |causes: &[HiddenCause]| causes.iter().filter(|cause| is_hidden(options, **cause)).count();
    let [controls, known, unknown] = [&[HiddenCause::None][..], &HiddenCause::ALL, &UNKNOWN].map(count);
    let of = |causes: usize, each: usize| causes.saturating_mul(each);
    of(controls, options.controls)
        .saturating_add(of(known, options.per_cause))
        .saturating_add(of(unknown, options.unknown))
}

fn is_hidden(options: &ProofOptions, cause: HiddenCause) -> bool {
    options.only.is_empty() || options.only.contains(&cause)
}

/// What to conceal: cause, seed and whether the diagnosis knows of it.
fn tasks(options: &ProofOptions) -> Vec<(HiddenCause, u64, bool)> {
    let mut all = Vec::new();
    // Round by round, so that a stopped proof has seen all causes alike.
    let rounds = options.per_cause.max(options.unknown).max(1);
    for round in 0..rounds {
        let seed = |kind: u64| options.seed.wrapping_mul(1_000_003) + 1000 * round as u64 + kind;
        for n in 0..options.controls {
            if n * rounds / options.controls.max(1) == round {
                all.push((HiddenCause::None, options.seed.wrapping_mul(7_000_003) + n as u64, true));
            }
        }
        if round < options.per_cause {
            all.extend(HiddenCause::ALL.iter().enumerate().map(|(n, c)| (*c, seed(n as u64), true)));
        }
        if round < options.unknown {
            all.extend(UNKNOWN.iter().enumerate().map(|(n, c)| (*c, seed(500 + n as u64), false)));
        }
    }
    all.retain(|(cause, _, _)| is_hidden(options, *cause));
    all
}

/// Conceals and diagnoses all of `options`; `done` are results of an earlier, stopped run with the same options;
/// `report` is told of each result as it comes. A recording that cannot be made counts as one in which nothing was
/// found. It does not count as detectable, because the size of its effect is not known.
pub fn prove(
    specimen: &Specimen,
    options: &ProofOptions,
    done: &[Scored],
    report: &(dyn Fn(&Scored, usize, usize) + Sync),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Proof {
    let of_task = |&(cause, seed, is_known): &(HiddenCause, u64, bool)| {
        let same = |s: &&Scored| s.hidden.cause == cause && s.hidden.seed == seed && s.is_known == is_known;
        done.iter().find(same).cloned()
    };
    let score = |&(cause, seed, is_known): &(HiddenCause, u64, bool)| {
        let hidden = draw_cause(cause, seed);
        score_one(specimen, &hidden, is_known, options.mesh_factor, is_cancelled)
            .unwrap_or_else(|e| Scored { failure: Some(e.to_string()), ..Scored::undiagnosed(&hidden, is_known) })
    };
    sum_up(score_all(&tasks(options), &of_task, &score, report, is_cancelled), options)
}

/// The scores of all tasks, in their order, one task at a time per thread: what `done` has of an earlier run, and else
/// what `score` gives, of which `report` is told. After a cancellation only those that were finished.
pub(super) fn score_all<T: Sync, S: Send>(
    tasks: &[T],
    done: &(dyn Fn(&T) -> Option<S> + Sync),
    score: &(dyn Fn(&T) -> S + Sync),
    report: &(dyn Fn(&S, usize, usize) + Sync),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Vec<S> {
    use rayon::prelude::*;
    let scored: Vec<Option<S>> = tasks
        .par_iter()
        .enumerate()
        .with_max_len(1)
        .map(|(n, task)| {
            if let Some(found) = done(task) {
                return Some(found);
            }
            if is_cancelled() {
                return None;
            }
            let found = score(task);
            if is_cancelled() {
                return None;
            }
            report(&found, n, tasks.len());
            Some(found)
        })
        .collect();
    scored.into_iter().flatten().collect()
}

/// Conceals and diagnoses one cause.
///
/// # Errors
/// [`ConcealError`] where its recording cannot be made; a diagnosis that fails is a result.
pub fn score_one(
    specimen: &Specimen,
    hidden: &Hidden,
    is_known: bool,
    mesh_factor: f64,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Scored, ConcealError> {
    let made = conceal(specimen, &Experiment::of_one(hidden))?;
    let mut options = DiagnosisOptions { mesh_factor, ..DiagnosisOptions::default() };
    if !is_known {
        options.left_out.extend(hidden.cause.diagnosed());
    }
    let found = diagnose(&made.recording, &options, &|_| {}, is_cancelled);
    Ok(scored(specimen, hidden, is_known, &made, found.as_ref().map(|d| DiagnosisResult::new(d, "", String::new()))))
}

fn scored(
    specimen: &Specimen,
    hidden: &Hidden,
    is_known: bool,
    made: &Concealed,
    found: Result<DiagnosisResult, &DiagnosisError>,
) -> Scored {
    let largest = specimen.largest_drive_mm().abs();
    let acts_on_force = matches!(
        hidden.cause,
        HiddenCause::Relaxation | HiddenCause::Mullins | HiddenCause::Cell | HiddenCause::Compliance
    );
    let is_detectable = hidden.cause != HiddenCause::None
        && (made.effect_rms_mm > DETECTABLE_ALLOWANCES * 1e-3 * largest
            || acts_on_force && made.effect_force_relative > DETECTABLE_FORCE);
    let mut s = Scored {
        effect_rms_mm: made.effect_rms_mm,
        effect_force_relative: made.effect_force_relative,
        is_detectable,
        ..Scored::undiagnosed(hidden, is_known)
    };
    let result = match found {
        Ok(result) => result,
        Err(error) => {
            s.failure = Some(error.to_string());
            return s;
        }
    };
    s.verdict = Some(result.verdict);
    s.is_explained = result.verdict != Verdict::Unexplained;
    s.named = result.causes.iter().chain(&result.alternatives).map(|c| c.name.clone()).collect();
    s.chi2 = Some([result.chi2_per_datum.before, result.chi2_per_datum.after]);
    let named = result.causes.first().filter(|c| Some(&*c.name) == hidden.cause.diagnosed().map(CauseName::as_str));
    s.is_right = match (hidden.cause, is_known) {
        (HiddenCause::None, _) => result.verdict == Verdict::NoMismatch,
        (_, false) => result.verdict == Verdict::Unexplained,
        (_, true) => named.is_some(),
    };
    let place = match hidden.cause {
        HiddenCause::Inclusion | HiddenCause::Debond => Some((hidden.center_mm, hidden.extent_mm)),
        HiddenCause::Wrap => Some((hidden.center_mm, hidden.extent_mm)),
        HiddenCause::Hole => specimen.holes.get(hidden.which).map(|h| {
            let made = [0, 1].map(|a| h.center_mm[a] + hidden.strength * hidden.direction[1 + a]);
            let [x, z] = h.wall().half_extents_mm().map(|e| 2.0 * e);
            ([made[0], 0.0, made[1]], [x, specimen.block.thickness_mm, z])
        }),
        _ => None,
    };
    if let Some((center, extent)) = place {
        let at = if is_known { named.and_then(|c| c.location.clone()) } else { result.left_at.clone() };
        s.location_size_mm = Some(0.5 * extent.iter().map(|x| x * x).sum::<f64>().sqrt());
        s.location_error_mm = at.map(|l| (0..3).map(|a| (l.center_mm[a] - center[a]).powi(2)).sum::<f64>().sqrt());
    }
    if let Some(cause) = named.filter(|_| is_known) {
        let truths = truths(specimen, hidden);
        s.deviations = cause
            .parameters
            .iter()
            .filter_map(|p| {
                let (_, truth) = truths.iter().find(|(name, _)| *name == p.name)?;
                let [low, high] = p.interval_95?;
                Some((p.name.clone(), (0.5 * (low + high) - truth) / (0.5 * (high - low))))
            })
            .collect();
    }
    s
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recordings_are_counted_without_drawing_them() {
        for only in
            [vec![], vec![HiddenCause::None], vec![HiddenCause::Debond, HiddenCause::Cell], HiddenCause::ALL.to_vec()]
        {
            let options = ProofOptions { per_cause: 3, controls: 7, unknown: 2, only, ..ProofOptions::default() };
            assert_eq!(num_recordings(&options), tasks(&options).len(), "{:?}", options.only);
        }
    }
}
