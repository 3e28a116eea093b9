//! What terms that are not there yet would change.

use super::error::CalibrationError;
use super::options::FitOptions;
use super::prediction::Prediction;
use super::problem::CalibrationProblem;
use super::recording_fit::RecordingFit;
use crate::material::{MAX_TERMS, OgdenTerm};

/// A term of this part of the shear modulus is not there yet; its derivatives exist.
const NO_MODULUS: f64 = 1e-9;

/// Exponents that were solved together, and the predictions of the fit's material with further terms of these, whose
/// moduli are nothing: their derivatives by these moduli are what the terms would change.
pub(super) type Group = (Vec<f64>, Vec<Prediction>);

/// The material of `fit` with further terms of `exponents`, as many at once as a material may have. Does not depend on
/// the data.
///
/// # Errors
/// [`CalibrationError`].
pub(super) fn with_further_terms(
    problem: &mut CalibrationProblem,
    fit: &RecordingFit,
    exponents: &[f64],
    options: &FitOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Group>, CalibrationError> {
    let old = &fit.material;
    let mu_kpa = NO_MODULUS * old.initial_shear_modulus_kpa();
    let num_at_once = MAX_TERMS.saturating_sub(old.terms.len());
    if num_at_once == 0 {
        return Ok(Vec::new());
    }
    let mut groups = Vec::new();
    for chunk in exponents.chunks(num_at_once) {
        let mut wide = old.clone();
        wide.terms.extend(chunk.iter().map(|&alpha| OgdenTerm { mu_kpa, alpha }));
        let predictions = problem.predict(&wide, Some(&fit.predictions), &options.solve, is_cancelled)?;
        groups.push((chunk.to_vec(), predictions));
    }
    Ok(groups)
}
