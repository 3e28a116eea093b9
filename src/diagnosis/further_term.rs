//! Whether a recording calls for one more Ogden term.

use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::evidence::{EVIDENCE, SMALLEST_SHARE, is_large, penalty};
use super::fit::STEP;
use super::inference::Inference;
use super::prior::shear_modulus;
use super::score::ScoreTest;
use super::trace::Trace;
use crate::material::{MAX_TERMS, OgdenTerm};

/// Terms are added up to this number.
const MOST_TERMS: usize = 3;
/// Exponents tried for a further Ogden term.
const EXPONENTS: [f64; 5] = [-6.0, -2.0, 5.0, 9.0, 14.0];

/// The fit with one more Ogden term beside the causes of `current`, and its evidence, where the data call for it: by as
/// much as for a cause, and by some part of what is left to be explained. Of a misfit that is not the material's, every
/// term takes a little.
///
/// # Errors
/// [`DiagnosisError`]: the work was cancelled.
pub(super) fn further_term(
    inference: &mut Inference,
    measured: &Trace,
    current: &CauseFit,
) -> Result<Option<(CauseFit, f64)>, DiagnosisError> {
    let least = EVIDENCE.max(SMALLEST_SHARE * inference.misfit_beyond_noise(current));
    let Some(term) = best_term(inference, current, least) else { return Ok(None) };
    let mut richer = current.material.clone();
    richer.terms.push(term);
    match inference.fit(measured, &richer, &current.causes) {
        Ok(found) => {
            let gain = current.deviance - found.deviance - penalty(&inference.metric, 2);
            let effect = found.prediction.trace.plus(-1.0, &current.prediction.trace);
            let is_used = gain > least && is_large(inference.laboratory.observed(), &effect, inference.allowance_mm);
            Ok(is_used.then_some((found, gain)))
        }
        Err(error) if (inference.is_cancelled)() => Err(error),
        Err(_) => Ok(None),
    }
}

/// The further term that explains most to first order, all exponents tried at once; `None` where none explains `least`.
fn best_term(inference: &mut Inference, current: &CauseFit, least: f64) -> Option<OgdenTerm> {
    if current.material.terms.len() >= MOST_TERMS {
        return None;
    }
    let mut probe = current.material.clone();
    let base = current.material.terms.len();
    let exponents = || EXPONENTS.into_iter().take(MAX_TERMS - base);
    for alpha in exponents() {
        let mu_kpa = 1e-9 * shear_modulus(&current.material) / alpha;
        probe.terms.push(OgdenTerm { mu_kpa, alpha });
    }
    let scene = current.scene();
    let columns = inference.laboratory.derivatives(&probe, &scene, &current.prediction, true, &[], STEP).ok()?;
    let nuisance: Vec<Trace> = columns[..=2 * base]
        .iter()
        .zip(current.material.parameters())
        .map(|(t, p)| t.scaled(current.material.value(p)))
        .collect();
    let prior = [inference.settings.bulk.log_sd.powi(-2)];
    let test = ScoreTest::new(&inference.metric, &current.residual, &nuisance, &prior);
    let mut best: Option<(f64, OgdenTerm)> = None;
    for (n, alpha) in exponents().enumerate() {
        // κ, then μ and α of each term.
        let direction = &columns[1 + 2 * (base + n)];
        let score = test.test(std::slice::from_ref(direction));
        let mu_kpa = score.coefficients[0];
        if mu_kpa * alpha > 0.0 && best.as_ref().is_none_or(|b| score.explained > b.0) {
            best = Some((score.explained, OgdenTerm { mu_kpa, alpha }));
        }
    }
    best.filter(|b| b.0 > least).map(|b| b.1)
}
