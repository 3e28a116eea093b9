//! Compares the candidates and says which comes next.

use super::candidate::{Candidate, bodies, candidates};
use super::error::NextError;
use super::options::{NextOptions, Plan};
use super::posterior::{Point, Posterior};
use super::result::{CandidateResult, LeftOut, MisfitResult, NextParameter, NextResult, Stop, StopVerdict};
use super::trial::{Bench, Trial};
use super::worth::{Knowledge, MOST_SCANS, Worth};
use crate::calibration::{Observed, TWO_SIDED_95};
use crate::material::{Parameter, symbol_of_parameter};
use crate::specimen::{Specimen, farthest_from_zero, leads_on};
use rayon::prelude::*;
use std::cmp::Ordering;

/// What `observed` leave unknown, and what should be scanned next. `names` are those of the recordings.
///
/// # Errors
/// [`NextError`].
pub fn advise(
    (observed, names): (&[Observed], &[String]),
    plan: &Plan,
    options: &NextOptions,
    input_hash: String,
    on_stage: &dyn Fn(&str),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<NextResult, NextError> {
    let posterior = Posterior::new(observed, plan, options, on_stage, is_cancelled)?;
    let parameters = named(&posterior, options)?;
    let points = posterior.points()?;
    on_stage("candidates");
    let bodies = bodies(observed, plan);
    let all = candidates(observed, &bodies, plan, options);
    let trials = trials(&bodies, &all, &points, plan, (&posterior, options), is_cancelled);
    let so_far = Knowledge::so_far(&posterior)?;
    let (mut judged, mut left_out) = (Vec::new(), Vec::new());
    let view = Comparison { posterior: &posterior, points: &points, so_far: &so_far, names: &parameters, options };
    for candidate in &all {
        let body = &bodies[candidate.body];
        let name = words(candidate, body);
        let trials = match &trials[candidate.body] {
            Ok(trials) => trials,
            Err(error) => {
                left_out.push(LeftOut { name, reason: error.clone() });
                continue;
            }
        };
        match reason_against(candidate, &trials[0]) {
            Some(reason) => left_out.push(LeftOut { name, reason }),
            None => judged.push(view.judge(candidate, trials, body, name)?),
        }
    }
    if judged.is_empty() {
        let reasons: Vec<String> = left_out.iter().map(|l| format!("{}: {}", l.name, l.reason)).collect();
        return Err(NextError::NoCandidate { tried: all.len(), reasons: reasons.join("; ") });
    }
    judged.sort_by(Judged::compare);
    let stop = view.stop(&judged[0]);
    let values = posterior.material.parameters().into_iter().zip(&posterior.mesh_sd);
    let values = values.filter(|(p, _)| *p != Parameter::Kappa);
    let (worst, _) = so_far.worst(&parameters, &options.precision);
    let sentence = sentence(&parameters[worst], so_far.relative_sd[worst], worst, &judged[0].result, stop.as_ref());
    Ok(NextResult {
        schema: "next/1".into(),
        sentence,
        recordings: names.to_vec(),
        material: posterior.material.clone(),
        parameters: values
            .zip(&parameters)
            .zip(&so_far.relative_sd)
            .map(|(((parameter, mesh_sd), name), &relative_sd)| {
                let value = posterior.material.value(parameter);
                let half = TWO_SIDED_95 * mesh_sd.hypot(relative_sd * value);
                let precision = Some(options.precision.of(name)).filter(|p| p.is_finite());
                NextParameter {
                    name: name.clone(),
                    value,
                    relative_sd,
                    discretisation_relative_sd: mesh_sd / value.abs(),
                    interval_95: [value - half, value + half],
                    precision,
                }
            })
            .collect(),
        least_known: parameters[worst].clone(),
        misfit: MisfitResult {
            structured_by_component_mm: posterior.discrepancy.variance_mm2.map(f64::sqrt),
            force_relative: posterior.discrepancy.force_relative_variance.sqrt(),
            chi2_per_datum: posterior.chi2_per_datum,
        },
        candidates: judged.into_iter().map(|j| j.result).collect(),
        stop,
        left_out,
        num_materials: points.len(),
        notes: notes(&posterior, observed, plan),
        version: env!("CARGO_PKG_VERSION").into(),
        input_hash,
    })
}

/// Every specimen with every material, at all drives of its candidates; why not, where it cannot be tried.
fn trials(
    bodies: &[Specimen],
    all: &[Candidate],
    points: &[Point],
    plan: &Plan,
    (posterior, options): (&Posterior, &NextOptions),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Vec<Result<Vec<Trial>, String>> {
    let pairs: Vec<(usize, &Specimen, &Point)> =
        bodies.iter().enumerate().flat_map(|(index, body)| points.iter().map(move |p| (index, body, p))).collect();
    let mut tried: Vec<Result<Trial, String>> = pairs
        .into_par_iter()
        .map(|(index, body, point)| {
            let bench = Bench::new(body, plan, options.mesh_factor);
            let own = all.iter().filter(|c| c.body == index);
            let mut drives: Vec<f64> = own.flat_map(|c| c.drives_mm.iter().copied()).collect();
            drives.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
            drives.dedup();
            let trial = |mut bench: Bench| bench.trial(&drives, &point.material, plan, posterior, is_cancelled);
            bench.and_then(trial).map_err(|error| error.to_string())
        })
        .collect();
    let num = points.len();
    bodies.iter().map(|_| tried.drain(..num).collect()).collect()
}

/// Names of all μ and α.
fn named(posterior: &Posterior, options: &NextOptions) -> Result<Vec<String>, NextError> {
    let names: Vec<String> = posterior.material.shear_parameters().map(|p| p.name()).collect();
    match options.precision.by_parameter.keys().find(|name| !names.contains(name)) {
        Some(name) => Err(NextError::UnknownParameter { name: name.clone(), known: names.join(", ") }),
        None => Ok(names),
    }
}

/// A candidate in words.
fn words(candidate: &Candidate, body: &Specimen) -> String {
    let drives: Vec<String> = candidate.drives_mm.iter().map(|d| format!("{}", (100.0 * d).round() / 100.0)).collect();
    let again = if candidate.is_repeat() { ", again" } else { "" };
    format!("{} at {} mm{again}", body.name, drives.join(", "))
}

/// Why a candidate may not be scanned.
fn reason_against(candidate: &Candidate, trial: &Trial) -> Option<String> {
    for drive in &candidate.drives_mm {
        let Some(step) = trial.steps.iter().find(|s| s.drive_mm == *drive) else {
            let failure = trial.failure.as_ref().map_or(String::new(), |(at, why)| format!(" (at {at} mm: {why})"));
            return Some(format!("no equilibrium was found{failure}"));
        };
        if let Some(limit) = step.limits.iter().find(|l| !l.is_satisfied) {
            return Some(format!("{} would be {:.3}, the limit is {}", limit.name, limit.value, limit.limit));
        }
    }
    None
}

/// A candidate with its worth.
struct Judged {
    result: CandidateResult,
    minutes_to_precision: Option<f64>,
    /// After as many scans as may be: the parameter in the way and its relative standard deviation.
    at_last: (usize, f64),
}

impl Judged {
    /// The better first: the least minutes to the precision; where none is reached (or asked) or they are equal, the
    /// largest gain per minute.
    fn compare(&self, other: &Judged) -> Ordering {
        let minutes = |j: &Judged| j.minutes_to_precision.unwrap_or(f64::INFINITY);
        let gain = |j: &Judged| j.result.gain_per_minute;
        minutes(self).total_cmp(&minutes(other)).then(gain(other).total_cmp(&gain(self)))
    }
}

/// What candidates are compared with.
struct Comparison<'a> {
    posterior: &'a Posterior,
    points: &'a [Point],
    so_far: &'a Knowledge,
    names: &'a [String],
    options: &'a NextOptions,
}

impl Comparison<'_> {
    fn judge(
        &self,
        candidate: &Candidate,
        trials: &[Trial],
        body: &Specimen,
        name: String,
    ) -> Result<Judged, NextError> {
        let Comparison { posterior, points, so_far, names, options } = *self;
        let precision = &options.precision;
        let worth = Worth { posterior, points, trials, candidate };
        let after = worth.after(1.0)?;
        let gain = (so_far.worst(names, precision).1 / after.worst(names, precision).1).ln();
        let minutes = candidate.minutes(1.0, options);
        let (mut num_scans, mut at_last) = (None, (0, f64::NAN));
        if !precision.is_empty() {
            num_scans = worth.num_scans_to(names, precision)?;
            let last = worth.after(MOST_SCANS as f64)?;
            let index = last.worst(names, precision).0;
            at_last = (index, last.relative_sd[index]);
        }
        let is_read = |drive: &f64| {
            candidate.drives_mm.last().is_some_and(|last| leads_on(*drive, *last))
                && !candidate.drives_mm.contains(drive)
        };
        let steps = || trials[0].steps.iter().filter(|s| candidate.drives_mm.contains(&s.drive_mm));
        let beyond = steps().map(|s| s.scanned.part_beyond());
        let result = CandidateResult {
            name,
            specimen: body.name.clone(),
            drive_mm: candidate.drives_mm.clone(),
            force_drive_mm: trials[0].readings.iter().map(|r| r.0).filter(is_read).collect(),
            is_repeat: candidate.is_repeat(),
            minutes,
            force_n: farthest_from_zero(steps().map(|s| s.force_n)),
            part_beyond: beyond.fold(0.0, f64::max),
            promised_relative_sd: after.relative_sd.clone(),
            gain,
            gain_per_minute: gain / minutes,
            gain_of_all: so_far.half_log_det - after.half_log_det,
            num_scans_to_precision: num_scans,
        };
        let minutes_to_precision = num_scans.map(|num| candidate.minutes(num as f64, options));
        Ok(Judged { result, minutes_to_precision, at_last })
    }

    /// Whether it is enough.
    fn stop(&self, best: &Judged) -> Option<Stop> {
        let precision = &self.options.precision;
        if precision.is_empty() {
            return None;
        }
        let of = |verdict, num_scans| Stop { verdict, num_scans, held_back_by: None, reachable_relative_sd: None };
        Some(match best.result.num_scans_to_precision {
            _ if self.so_far.worst(self.names, precision).1 <= 1.0 => of(StopVerdict::Reached, Some(0)),
            Some(num) => of(StopVerdict::MoreScans, Some(num)),
            None => Stop {
                held_back_by: Some(self.names[best.at_last.0].clone()),
                reachable_relative_sd: Some(best.at_last.1),
                ..of(StopVerdict::OutOfReach, None)
            },
        })
    }
}

/// A part as a percentage of two digits.
fn percent(part: f64) -> String {
    let value = 100.0 * part;
    let decimals = if value >= 9.95 {
        0
    } else if value >= 0.995 {
        1
    } else {
        2
    };
    format!("{value:.decimals$} %")
}

/// What to do, in a sentence; `before` is the standard deviation of the parameter `name`, of place `index`.
fn sentence(name: &str, before: f64, index: usize, best: &CandidateResult, stop: Option<&Stop>) -> String {
    let (name, after) = (symbol_of_parameter(name), best.promised_relative_sd[index]);
    let advice = format!(
        "Scan next: {}. It takes the sd of {name} from {} to {} for {} minutes.",
        best.name,
        percent(before),
        percent(after),
        best.minutes
    );
    match stop {
        Some(Stop { verdict: StopVerdict::Reached, .. }) => {
            format!(
                "Enough: every parameter has its precision; the farthest from it, {name}, has an sd of {}.",
                percent(before)
            )
        }
        Some(Stop { verdict: StopVerdict::MoreScans, num_scans: Some(num), .. }) => {
            let scans = if *num == 1 { "One such scan suffices".into() } else { format!("{num} such scans suffice") };
            format!("{advice} {scans} for the precision asked.")
        }
        Some(Stop { held_back_by: Some(held), reachable_relative_sd: Some(sd), .. }) => format!(
            "{advice} No candidate reaches the precision asked, however often it is scanned: {} stays at {}.",
            symbol_of_parameter(held),
            percent(*sd)
        ),
        _ => advice,
    }
}

/// Remarks for the reader.
fn notes(posterior: &Posterior, observed: &[Observed], plan: &Plan) -> Vec<String> {
    let mut notes = posterior.notes.clone();
    let misfit = posterior.discrepancy.rms_mm();
    if misfit > 0.0 {
        notes.push(format!(
            "the law leaves {misfit:.4} mm (rms of box means) beyond noise: it counts as noise that neighbouring voxels and \
             repeats share, and grows beyond the states visited so far. `lambdak diagnose` says where it comes from"
        ));
    }
    for recording in observed {
        let ratio = |c: usize| recording.noise_sd_mm[c] / plan.study.scan.noise_sd_mm[c];
        if (0..3).any(|c| !(0.67..1.5).contains(&ratio(c))) {
            notes.push(format!(
                "the noise of a recording, {:.4?} mm, is not that of the study's scans, {:?} mm: promises hold for the study's",
                recording.noise_sd_mm, plan.study.scan.noise_sd_mm
            ));
            break;
        }
    }
    notes
}
