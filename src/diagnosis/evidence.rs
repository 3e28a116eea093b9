//! How much evidence a cause needs: the limits that all stages of a diagnosis share.

use super::cause::Cause;
use super::metric::Metric;
use super::supposed::Supposed;
use super::trace::Trace;
use crate::calibration::{Observed, ObservedForce};

/// A cause must lower the deviance by this much beyond ln n per parameter. For a single cause this would be many times
/// what counts as very strong evidence; it takes that much because many causes are tried.
pub(super) const EVIDENCE: f64 = 30.0;
/// A cause that changes the image alone looks like no mesh's error where it is plain. Where it does no more than a mesh
/// could, it needs so many times the usual evidence.
pub(super) const OF_IMAGE_ALONE: f64 = 10.0;
/// Fits that only compare end where a step would lower the deviance by less than this part of the misfit beyond noise.
pub(super) const ROUGH_TOLERANCE: f64 = 1e-3;
/// A cause is fitted where it explains more than this part of what the leading one does, to first order.
pub(super) const WORTH_A_FIT: f64 = 0.1;
/// A further cause must explain this part of what the ones before it did, where the model of one of these idealises its
/// shape ([`is_idealised`](super::cause::Cause::is_idealised)): such a model errs by some percent of its effect, and
/// that error is no cause of its own.
pub(super) const SMALLEST_SHARE: f64 = 0.02;
/// The same part where all models are exact but for the mesh.
const SMALLEST_SHARE_OF_EXACT: f64 = 0.004;
/// The gain of a smooth field without a mechanism counts for this part: it takes up what several causes leave, and
/// each of them first explains a part of that. What later causes make needless is taken out at the end.
const SPONGE_COUNTS: f64 = 1.0 / 3.0;
/// The allowance where none is stated, as a part of the largest drive.
pub(super) const ALLOWANCE_OF_DRIVE: f64 = 1e-3;
/// Structured misfit that is left counts as unexplained above this multiple of the allowance (rms).
pub(super) const UNEXPLAINED: f64 = 2.0;

/// The part of what `causes` explain that a further cause must explain.
pub(super) fn smallest_share(causes: &[Supposed]) -> f64 {
    if causes.iter().any(|c| c.cause.is_idealised()) { SMALLEST_SHARE } else { SMALLEST_SHARE_OF_EXACT }
}

/// The part of what a cause explains that counts against other causes, and against what is called for.
pub(super) fn counted_part(cause: &dyn Cause) -> f64 {
    if cause.is_sponge() { SPONGE_COUNTS } else { 1.0 }
}

/// What parameters cost in deviance: ln n for each, n being the number of data.
pub(super) fn penalty(metric: &Metric, num_parameters: usize) -> f64 {
    num_parameters as f64 * (metric.num_data() as f64).ln()
}

/// Whether a change of the forces, or what is left of them, is more than noise and a mesh's error.
pub(super) fn is_large_force(observed: &Observed, change: &Trace) -> bool {
    times_to_large_force(observed, change) < 1.0
}

/// The multiple of a change of the forces beyond which it is more than noise and a mesh's error; infinite where it
/// changes none.
pub(super) fn times_to_large_force(observed: &Observed, change: &Trace) -> f64 {
    let forces = observed.steps.iter().zip(&change.force);
    let times = |f: &ObservedForce, change: f64| (4.0 * f.sd_n + 0.01 * f.value_n.abs()) / change.abs();
    forces.filter_map(|(s, change)| s.force.map(|f| times(&f, *change))).fold(f64::INFINITY, f64::min)
}

/// Whether a change of the prediction is large enough to be more than a mesh's.
pub(super) fn is_large(observed: &Observed, effect: &Trace, allowance_mm: f64) -> bool {
    times_to_large(observed, effect, allowance_mm) < 1.0
}

/// The multiple of a change of the prediction beyond which it is more than a mesh's: its displacement (rms at the last
/// drive) more than the allowance, or a force more than that of forces; infinite where nothing changes.
fn times_to_large(observed: &Observed, effect: &Trace, allowance_mm: f64) -> f64 {
    times_to_large_force(observed, effect).min(allowance_mm / rms_at_last_mm(effect))
}

/// The multiple of what a cause changes beyond which it is more than a mesh's.
///
/// Every free face of a block is a little off. A cause with so many parameters that it follows what another code's mesh
/// gets wrong must change the displacement by as much as would be called unexplained.
pub(super) fn times_to_large_of(cause: &dyn Cause, observed: &Observed, effect: &Trace, allowance_mm: f64) -> f64 {
    match cause.follows_mesh_errors() {
        true => UNEXPLAINED * allowance_mm / rms_at_last_mm(effect),
        false => times_to_large(observed, effect, allowance_mm),
    }
}

/// Root mean square of a change of the displacement at the last drive, mm.
fn rms_at_last_mm(effect: &Trace) -> f64 {
    Trace { displacement: effect.displacement.last().cloned().into_iter().collect(), force: vec![] }.rms_mm()
}
