//! The nominal model: the material alone, fitted to what was recorded.

use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::evidence::ROUGH_TOLERANCE;
use super::further_term::{further_term, without_needless_terms};
use super::inference::Inference;
use super::laboratory::Laboratory;
use super::scene::Scene;
use super::supposed::Supposed;
use super::trace::Trace;
use crate::material::{Material, OgdenTerm};

/// The material from which the first fit starts: the one believed, or a neo-Hookean one with the modulus of the
/// measured force and the κ/μ of a rubber.
///
/// # Errors
/// [`DiagnosisError`]: no equilibrium, or the work was cancelled.
pub(super) fn first_guess(
    laboratory: &mut Laboratory,
    believed: Option<&Material>,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Material, DiagnosisError> {
    if let Some(believed) = believed {
        return Ok(believed.clone());
    }
    let mut material = Material { bulk_kpa: 2000.0, terms: vec![OgdenTerm { mu_kpa: 16.0, alpha: 2.0 }], law: None };
    let predicted = laboratory.predict(&material, &Scene::default(), is_cancelled)?;
    let forces = laboratory.measured().force;
    let ratio = |n: &usize| forces[*n] / predicted.trace.force[*n];
    if let Some(r) = (0..forces.len()).filter(|n| forces[*n].abs() > 0.0).map(|n| ratio(&n)).find(|r| *r > 0.0) {
        material.terms[0].mu_kpa *= r;
        material.bulk_kpa *= r;
    }
    Ok(material)
}

/// The nominal model's fit: as many terms as the material believed (`is_believed`), or as the data call for.
///
/// # Errors
/// As [`first_guess`].
pub(super) fn fit_nominal(
    inference: &mut Inference,
    measured: &Trace,
    start: &Material,
    is_believed: bool,
) -> Result<CauseFit, DiagnosisError> {
    let settings = inference.settings;
    inference.settings.relative_tolerance = ROUGH_TOLERANCE;
    let found = if is_believed {
        inference.fit(measured, start, &[])
    } else {
        let fitted = fit_with_terms(inference, measured, start, &[]);
        // Of the terms that the start had, not all may be called for any more.
        let has_more = start.terms.len() > 1;
        fitted.and_then(|f| if has_more { without_needless_terms(inference, measured, f) } else { Ok(f) })
    };
    inference.settings = settings;
    found
}

/// The fit with `causes` and as many Ogden terms as the data call for.
///
/// # Errors
/// As [`first_guess`].
pub(super) fn fit_with_terms(
    inference: &mut Inference,
    measured: &Trace,
    start: &Material,
    causes: &[Supposed],
) -> Result<CauseFit, DiagnosisError> {
    let mut found = inference.fit(measured, start, causes)?;
    while let Some((richer, _)) = further_term(inference, measured, &found)? {
        found = richer;
    }
    Ok(found)
}
