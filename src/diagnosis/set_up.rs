//! The experiment as it really was: the plates' own motions, the rig in the scanner, layers at the bonds and the block
//! as made, fitted all at once.
//!
//! Where no single cause explains a misfit, the parts of the set-up are not asked one after the other (each alone
//! explains little, and the first takes what is another's), but fitted together, each held by what a laboratory
//! believes of it. What even all of them leave is then taken as known to be left, and misfits are weighed by it
//! ([`Inference::accept_discrepancy`]): first by what the nominal model leaves, so that the beliefs lead, then by less
//! and less. Parts that are not needed are taken out again ([`super::thinning`]), and plain motions of the moved plate
//! take the place of free ones where they explain as much.

use super::candidate::Candidate;
use super::cause::Course;
use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::evidence::{EVIDENCE, counted_part, penalty};
use super::further_term::further_term;
use super::inference::Inference;
use super::leftover::leftover;
use super::registry::Registry;
use super::score_round::{has_several_drives, score_of_set_up};
use super::supposed::Supposed;
use super::thinning::{Needed, thinned};
use super::trace::Trace;

/// Most iterations of a fit whose weights are still to change.
const ROUGH_ITERATIONS: usize = 5;
/// Such a fit ends when a step would lower the deviance by less than this: a tenth of what decides about a cause.
const SMALL_GAIN: f64 = 3.0;
/// Most fits, each weighed by what the one before left.
const MAX_FITS: usize = 8;
/// The weights are settled where the misfit beyond noise changes by less than this part.
const SETTLED: f64 = 0.05;

/// Where a single cause explains more than this part of the misfit, to first order, what the set-up promises is not
/// worked out.
const SINGLE_EXPLAINS: f64 = 0.75;

/// Whether the set-up as a whole may explain more than any of `candidates`, to first order.
///
/// # Errors
/// [`DiagnosisError`]: no derivatives.
pub(super) fn is_set_up_promising(
    inference: &mut Inference,
    registry: &Registry,
    current: &CauseFit,
    candidates: &[Candidate],
) -> Result<bool, DiagnosisError> {
    if registry.set_up(inference.laboratory.observed()).is_empty() {
        return Ok(false);
    }
    let (best, all) = (candidates.first().map_or(0.0, |c| c.score), inference.misfit_of(&current.residual));
    if best > SINGLE_EXPLAINS * all {
        return Ok(true);
    }
    let set_up = score_of_set_up(inference, registry, current)?;
    (inference.progress)(&format!(
        "to first order the set-up explains {:.0} %, the best single cause {:.0} % of the misfit",
        100.0 * set_up / all,
        100.0 * best / all
    ));
    Ok(set_up > best)
}

/// The fit of `measured` with all parts of the set-up, from where `start` ended; the causes that it has stay.
///
/// # Errors
/// [`DiagnosisError`]: no equilibrium, or the work was cancelled.
pub(super) fn fit_set_up(
    inference: &mut Inference,
    registry: &Registry,
    measured: &Trace,
    start: &CauseFit,
) -> Result<CauseFit, DiagnosisError> {
    let mut causes = start.causes.clone();
    causes.extend(registry.set_up(inference.laboratory.observed()).into_iter().map(Supposed::at_start));
    inference.accept_discrepancy(&start.residual);
    let fitted = roughly(inference, |inference| inference.fit(measured, &start.material, &causes))?;
    settled(inference, measured, fitted)
}

/// What `fit` gives with looser ends: the weights are about to change, and so is the place where a fit ends.
fn roughly(
    inference: &mut Inference,
    fit: impl FnOnce(&mut Inference) -> Result<CauseFit, DiagnosisError>,
) -> Result<CauseFit, DiagnosisError> {
    let settings = inference.settings;
    inference.settings.max_iterations = ROUGH_ITERATIONS;
    inference.settings.tolerance = SMALL_GAIN;
    let found = fit(inference);
    inference.settings = settings;
    found
}

/// Fits again with weights by what the last fit left, until both hardly change.
///
/// # Errors
/// As [`fit_set_up`].
fn settled(inference: &mut Inference, measured: &Trace, mut fitted: CauseFit) -> Result<CauseFit, DiagnosisError> {
    for _ in 1..MAX_FITS {
        let before = inference.discrepancy_mm2.iter().sum::<f64>();
        inference.accept_discrepancy(&fitted.residual);
        let after = inference.discrepancy_mm2.iter().sum::<f64>();
        let left_mm = fitted.residual.rms_mm();
        (inference.progress)(&format!("fitting again, weighed by what is left ({left_mm:.3} mm rms)"));
        fitted = roughly(inference, |inference| inference.fit(measured, &fitted.material, &fitted.causes))?;
        if (after - before).abs() <= 2.0 * SETTLED * before {
            break;
        }
    }
    Ok(fitted)
}

/// The fit with plain motions of the moved plate (alike at all drives, in proportion to them, or to the force) in place
/// of motions with values of their own at every drive, where they explain as much for their number; else as it is.
///
/// # Errors
/// As [`fit_set_up`].
pub(super) fn with_plain_motions(
    inference: &mut Inference,
    registry: &Registry,
    measured: &Trace,
    fitted: CauseFit,
) -> Result<CauseFit, DiagnosisError> {
    let special_cases = registry.special_cases(&fitted.causes);
    if special_cases.is_empty() {
        return Ok(fitted);
    }
    let observed = inference.laboratory.observed();
    let has_several_drives = has_several_drives(observed);
    let plain = registry
        .tested(&observed.specimen)
        .into_iter()
        .filter(|c| special_cases.contains(&c.name()) && (has_several_drives || !c.needs_several_drives()))
        .filter(|c| !fitted.causes.iter().any(|s| s.cause.identity() == c.identity()))
        .map(Supposed::at_start);
    let is_kept = |c: &&Supposed| registry.special_cases(std::slice::from_ref(*c)).is_empty();
    let mut causes: Vec<Supposed> = fitted.causes.iter().filter(is_kept).cloned().collect();
    causes.extend(plain);
    let Ok(other) = inference.fit(measured, &fitted.material, &causes) else { return Ok(fitted) };
    let other = thinned(inference, measured, other, Needed::BeyondAMesh)?;
    Ok(if inference.cost_of(&other) < inference.cost_of(&fitted) { other } else { fitted })
}

/// The fit with a smooth field that is alike at all drives in place of motions of the plates that are alike at all
/// drives, too, or free at each: where it explains more, its gain over theirs counting in part, as that of any such
/// field does. Each of the two has the Ogden terms that it calls for (`with_terms`), so that a missing one does not
/// decide.
///
/// # Errors
/// As [`fit_set_up`].
fn with_sponge_for_motions(
    inference: &mut Inference,
    registry: &Registry,
    measured: &Trace,
    fitted: CauseFit,
    with_terms: bool,
) -> Result<CauseFit, DiagnosisError> {
    let observed = inference.laboratory.observed();
    let may_be_alike = |s: &Supposed| s.cause.moves_only_plates() && s.cause.course() != Course::InProportion;
    if !has_several_drives(observed) || !fitted.causes.iter().any(may_be_alike) {
        return Ok(fitted);
    }
    let sponges = registry.sponges(&observed.specimen);
    let causes: Vec<Supposed> = fitted.causes.iter().filter(|s| !may_be_alike(s)).cloned().chain(sponges).collect();
    let with_motions = inference.discrepancy_mm2;
    let left_mm =
        |inference: &Inference, fit: &CauseFit| leftover(observed, &fit.residual, &inference.metric).structured_rms_mm;
    // What the motions left must not be what the other fit is weighed by.
    let other = roughly(inference, |inference| inference.fit(measured, &fitted.material, &causes))
        .and_then(|other| settled(inference, measured, other))
        .and_then(|other| if with_terms { with_further_terms(inference, measured, other) } else { Ok(other) });
    let other = match other {
        Ok(other) if left_mm(inference, &other) < left_mm(inference, &fitted) => other,
        Err(error) if (inference.is_cancelled)() => return Err(error),
        _ => {
            inference.weigh_by(with_motions);
            return Ok(fitted);
        }
    };
    // The motions are asked for as many terms.
    let with_sponge = inference.discrepancy_mm2;
    inference.weigh_by(with_motions);
    let fitted = if with_terms { with_further_terms(inference, measured, fitted)? } else { fitted };
    let with_motions = inference.discrepancy_mm2;
    inference.weigh_by(with_sponge);
    let cost = |fit: &CauseFit| inference.misfit_of(&fit.residual) + penalty(&inference.metric, fit.num_parameters());
    let counted = |s: &Supposed| counted_part(&*s.cause);
    let counts = other.causes.iter().map(counted).fold(1.0, f64::min);
    let gain = counts * (cost(&fitted) - cost(&other));
    (inference.progress)(&format!("a smooth field in place of motions gains {gain:.0}; {EVIDENCE:.0} are called for"));
    if gain > EVIDENCE {
        return Ok(other);
    }
    inference.weigh_by(with_motions);
    Ok(fitted)
}

/// The fit with the further Ogden terms that it calls for, each weighed by what the one before left.
///
/// # Errors
/// As [`fit_set_up`].
fn with_further_terms(
    inference: &mut Inference,
    measured: &Trace,
    mut fitted: CauseFit,
) -> Result<CauseFit, DiagnosisError> {
    while let Some((richer, _)) = further_term(inference, measured, &fitted)? {
        fitted = settled(inference, measured, richer)?;
    }
    Ok(fitted)
}

/// As far as the set-up is in a fit: the fit without what it does not need.
///
/// # Errors
/// As [`fit_set_up`].
pub(super) fn simplest_set_up(
    inference: &mut Inference,
    registry: &Registry,
    measured: &Trace,
    fitted: CauseFit,
    with_terms: bool,
) -> Result<CauseFit, DiagnosisError> {
    let fitted = thinned(inference, measured, fitted, Needed::BeyondAMesh)?;
    let fitted = with_plain_motions(inference, registry, measured, fitted)?;
    let fitted = with_sponge_for_motions(inference, registry, measured, fitted, with_terms)?;
    let fitted = settled(inference, measured, fitted)?;
    inference.fit(measured, &fitted.material, &fitted.causes)
}
