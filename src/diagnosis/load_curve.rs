//! The first stage: the load curve is read, because what time and the load cell add must be known before a model is
//! compared.

use super::cause_fit::CauseFit;
use super::elastic_table::ElasticTable;
use super::error::DiagnosisError;
use super::inference::Inference;
use super::load_effect::LoadEffect;
use super::load_history::{LoadHistoryFit, fit_load_history};
use super::memory_kernel::{KernelState, MemoryKernel};
use super::trace::Trace;
use crate::calibration::Observed;
use crate::recording::Recording;
use crate::specimen::farthest_from_zero;

/// Drives of the load curve's table.
const TABLE_POINTS: usize = 8;
/// The drive that stands for rest, as a part of the largest.
const SMALL_DRIVE: f64 = 1e-3;
/// Least standard deviation of the load cell's drift, N.
const LEAST_DRIFT_N: f64 = 1e-6;

/// The effects that the load curve of a recording shows beyond the elastic force of the nominal model; `None` where
/// there is no load curve, no step with a force, or too few readings.
///
/// # Errors
/// [`DiagnosisError`]: a drive of the curve has no equilibrium, or the work was cancelled.
pub(super) fn read_load_curve(
    inference: &mut Inference,
    recording: &Recording,
    nominal: &CauseFit,
    effects: &[&'static dyn LoadEffect],
) -> Result<Option<LoadHistoryFit>, DiagnosisError> {
    let observed = inference.laboratory.observed();
    let Some(curve) = recording.load.as_ref().filter(|_| observed.steps.iter().any(|s| s.force.is_some())) else {
        return Ok(None);
    };
    let reached_mm = curve.drive_mm.iter().fold(largest_drive_mm(observed), |s, d| s.max(d.abs()));
    let largest_mm = reached_mm.copysign(farthest_from_zero(observed.steps.iter().map(|s| s.drive_mm)));
    let (table, kernel) = elastic_table(inference, nominal, largest_mm)?;
    let drift = observed.steps.iter().filter_map(|s| s.force).map(|f| f.sd_n).fold(0.0, f64::max);
    let windows: Vec<Option<[f64; 2]>> = recording.steps.iter().map(|s| s.window_s).collect();
    Ok(fit_load_history(curve, &table, &kernel, drift.max(LEAST_DRIFT_N), &windows, effects))
}

/// The largest drive of a recording's steps, mm, whatever its sign.
pub(super) fn largest_drive_mm(observed: &Observed) -> f64 {
    observed.steps.iter().map(|s| s.drive_mm.abs()).fold(0.0, f64::max)
}

/// Takes off the recorded forces what the load curve's effects add to them over the steps' windows; whether there was
/// any.
pub(super) fn take_off_effects(recorded: &mut Trace, load: Option<&LoadHistoryFit>) -> bool {
    let Some(found) = load.filter(|l| !l.effects.is_empty()) else { return false };
    for (force, excess) in recorded.force.iter_mut().zip(&found.window_excess_n) {
        *force -= excess;
    }
    true
}

/// F∞ over drive with its derivatives with respect to scaled material parameters (but κ), and what its memory needs, on
/// the way to a drive (mm).
fn elastic_table(
    inference: &mut Inference,
    fitted: &CauseFit,
    largest_mm: f64,
) -> Result<(ElasticTable, MemoryKernel), DiagnosisError> {
    // The first one stands for rest.
    let parts = std::iter::once(SMALL_DRIVE).chain((1..=TABLE_POINTS).map(|n| n as f64 / TABLE_POINTS as f64));
    let drives: Vec<f64> = parts.map(|part| part * largest_mm).collect();
    let Inference { laboratory, is_cancelled, .. } = inference;
    let rows = laboratory.load_curve(&fitted.material, &fitted.scene(), &drives, *is_cancelled)?;
    let parameters = fitted.material.parameters();
    let from_rest = |values: Vec<f64>| -> Vec<f64> { std::iter::once(0.0).chain(values).collect() };
    // The table is of distances from rest and of forces in the direction of the drives.
    let way = largest_mm.signum();
    let forces = from_rest(rows.iter().map(|r| way * r.0).collect());
    let derivatives: Vec<Vec<f64>> = (1..parameters.len())
        .map(|i| from_rest(rows.iter().map(|r| way * r.1[i] * fitted.material.value(parameters[i])).collect()))
        .collect();
    let table = ElasticTable::new(&from_rest(drives.iter().map(|d| d.abs()).collect()), &forces, &derivatives)?;
    let states: Vec<KernelState> = rows.into_iter().map(|r| r.2).collect();
    let kernel = MemoryKernel::new(&states).ok_or(DiagnosisError::Setting {
        name: "the number of drives of the load curve's table",
        value: states.len() as f64,
        requirement: "at least one rising drive",
    })?;
    Ok((table, kernel))
}
