//! What the load curve says: which effects an elastic sample leaves out of its force over time.
//!
//! Effects are added one by one, always the one that lowers the deviance most, as long as the readings call for
//! another.

use super::elastic_table::ElasticTable;
use super::evidence::EVIDENCE;
use super::load_effect::{FittedEffect, LoadEffect};
use super::load_problem::{LoadFit, LoadProblem};
use super::memory_kernel::MemoryKernel;
use crate::recording::LoadCurve;

/// A further effect must lower the deviance by this part of what the effects before it did, too: their models err by
/// some percent. A repeated effect, such as a second relaxation, is a part of one model and need not.
const SMALLEST_SHARE: f64 = 0.02;
/// An effect must change the force by this part of the largest elastic one: what a load cell adds that is less than the
/// force model errs by (its allowances are of this size) is no finding.
const LEAST_CHANGE: f64 = 0.004;
/// Most effects.
const MAX_EFFECTS: usize = 5;

/// What was found in a load curve.
#[derive(Clone, Debug)]
pub struct LoadHistoryFit {
    /// Effects in the order found.
    pub effects: Vec<FittedEffect>,
    /// Deviance without and with them.
    pub deviance: [f64; 2],
    /// Readings used.
    pub num_readings: usize,
    /// Times of the readings used, s.
    pub time_s: Vec<f64>,
    /// Force without and with the effects, N.
    pub force_n: [Vec<f64>; 2],
    /// The readings, N.
    pub measured_n: Vec<f64>,
    /// Per window: mean of the effects' part of the force, N.
    pub window_excess_n: Vec<f64>,
    /// Root mean square misfit without and with the effects, N.
    pub rms_n: [f64; 2],
}

/// An effect that may be added.
struct Trial {
    /// Place among the effects allowed.
    index: usize,
    /// Fall of the deviance, less ln n per parameter.
    gain: f64,
    fit: LoadFit,
}

/// Looks for `allowed` effects in a load curve whose elastic force is `table` and whose memory is `kernel`;
/// `drift_sd_n` is the standard deviation of the load cell's slow drift, `windows_s` are the steps' windows. `None`
/// where the curve has too few readings.
pub(super) fn fit_load_history(
    curve: &LoadCurve,
    table: &ElasticTable,
    kernel: &MemoryKernel,
    drift_sd_n: f64,
    windows_s: &[Option<[f64; 2]>],
    allowed: &[&'static dyn LoadEffect],
) -> Option<LoadHistoryFit> {
    let problem = LoadProblem::new(curve, table, kernel, drift_sd_n)?;
    let nominal = problem.fit(&[], &vec![0.0; problem.num_material()])?;
    let (nominal_deviance, nominal_force) = (nominal.deviance, problem.force(&[], &nominal.parameters).0);
    let mut taken: Vec<usize> = Vec::new();
    let mut gained: Vec<f64> = Vec::new();
    let mut best = nominal;
    while let Some(trial) = best_trial(&problem, allowed, &taken, &best) {
        let is_repeated = taken.contains(&trial.index);
        let share = if is_repeated { 0.0 } else { SMALLEST_SHARE };
        if trial.gain < EVIDENCE.max(share * (nominal_deviance - best.deviance)) || taken.len() >= MAX_EFFECTS {
            break;
        }
        taken.push(trial.index);
        gained.push(best.deviance - trial.fit.deviance);
        best = trial.fit;
    }
    let effects: Vec<&'static dyn LoadEffect> = taken.iter().map(|&i| allowed[i]).collect();
    let (force, elastic) = problem.force(&effects, &best.parameters);
    let excess: Vec<f64> = force.iter().zip(&elastic).map(|(f, e)| f - e).collect();
    let fitted = fitted_effects(&problem, allowed, &taken, &gained, &best);
    let readings = problem.readings;
    let rms = |model: &[f64]| {
        let sum: f64 = model.iter().zip(&readings.measured_n).map(|(a, b)| (a - b).powi(2)).sum();
        (sum / readings.measured_n.len() as f64).sqrt()
    };
    Some(LoadHistoryFit {
        effects: fitted,
        deviance: [nominal_deviance, best.deviance],
        num_readings: readings.measured_n.len(),
        window_excess_n: windows_s.iter().map(|w| w.map_or(0.0, |w| mean_in(w, &readings.time_s, &excess))).collect(),
        rms_n: [rms(&nominal_force), rms(&force)],
        force_n: [nominal_force, force],
        time_s: readings.time_s,
        measured_n: readings.measured_n,
    })
}

/// Of all effects that may still be added to those taken, the one that lowers the deviance most beyond what its
/// parameters cost.
fn best_trial(
    problem: &LoadProblem,
    allowed: &[&'static dyn LoadEffect],
    taken: &[usize],
    current: &LoadFit,
) -> Option<Trial> {
    let cost = (problem.readings.measured_n.len() as f64).ln();
    let mut best: Option<Trial> = None;
    for (index, effect) in allowed.iter().enumerate() {
        if taken.iter().filter(|t| **t == index).count() >= effect.max_count() {
            continue;
        }
        let effects: Vec<&'static dyn LoadEffect> = taken.iter().chain([&index]).map(|&i| allowed[i]).collect();
        for start in effect.starts() {
            let num_parameters = start.len() as f64;
            let whole: Vec<f64> = current.parameters.iter().copied().chain(start).collect();
            let Some(fit) = problem.fit(&effects, &whole) else { continue };
            let gain = current.deviance - fit.deviance - num_parameters * cost;
            if best.as_ref().is_none_or(|b| gain > b.gain) && changes_enough(problem, &effects, &fit) {
                best = Some(Trial { index, gain, fit });
            }
        }
    }
    best
}

/// Whether the last of `effects` changes any reading by more than [`LEAST_CHANGE`] of the largest elastic force.
fn changes_enough(problem: &LoadProblem, effects: &[&'static dyn LoadEffect], fit: &LoadFit) -> bool {
    let Some((last, before)) = effects.split_last() else { return false };
    let num_before = fit.parameters.len() - problem.parameters_of(*last).len();
    let (with, elastic) = problem.force(effects, &fit.parameters);
    let (without, _) = problem.force(before, &fit.parameters[..num_before]);
    let change = with.iter().zip(&without).fold(0.0f64, |largest, (a, b)| largest.max((a - b).abs()));
    change > LEAST_CHANGE * elastic.iter().fold(0.0f64, |largest, f| largest.max(f.abs()))
}

/// The effects with their parameters in the units of their names.
fn fitted_effects(
    problem: &LoadProblem,
    allowed: &[&'static dyn LoadEffect],
    taken: &[usize],
    gained: &[f64],
    fit: &LoadFit,
) -> Vec<FittedEffect> {
    let mut at = problem.num_material();
    let mut all = Vec::new();
    for (n, (&index, &gained)) in taken.iter().zip(gained).enumerate() {
        let effect = allowed[index];
        let parameters = problem.parameters_of(effect);
        let range = at..at + parameters.len();
        at = range.end;
        let (mut values, mut sd) = (fit.parameters[range.clone()].to_vec(), fit.sd[range].to_vec());
        for ((value, sd), parameter) in values.iter_mut().zip(&mut sd).zip(&parameters) {
            if parameter.is_logarithm {
                *value = value.exp();
                *sd *= *value;
            }
        }
        let ordinal = taken[..n].iter().filter(|t| **t == index).count();
        let names = parameters.iter().map(|p| p.name).collect();
        all.push(FittedEffect { effect, ordinal, names, values, sd, gained });
    }
    all
}

/// Mean of values over a window; zero where the window holds no reading.
fn mean_in([start, end]: [f64; 2], time_s: &[f64], values: &[f64]) -> f64 {
    let inside: Vec<f64> =
        time_s.iter().zip(values).filter(|(t, _)| **t >= start && **t <= end).map(|(_, x)| *x).collect();
    if inside.is_empty() { 0.0 } else { inside.iter().sum::<f64>() / inside.len() as f64 }
}
