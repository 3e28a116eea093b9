//! Whether a recording calls for one more Ogden term, or for all that a fit has.

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
const EXPONENTS: [f64; 6] = [-6.0, -2.0, 2.0, 5.0, 9.0, 14.0];
/// Most further terms that are fitted in full: first order does not tell reliably which is best.
const MAX_FITS: usize = 2;
/// Such a term is fitted where it explains, to first order, this part of what is called for: its exponent then follows.
const LEAST_PROMISE: f64 = 0.25;
/// A term that leaves less than this part of the misfit beyond noise is as good as any.
const EXPLAINED: f64 = 0.1;
/// Parts of the first order's modulus from which a fit starts: a stiffening term may have no equilibrium at once.
const STARTS: [f64; 2] = [1.0, 0.2];

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
    let least = called_for(inference, current);
    let mut best: Option<CauseFit> = None;
    let beyond_noise = inference.misfit_beyond_noise(current);
    for term in promising_terms(inference, current, LEAST_PROMISE * least) {
        if best.as_ref().is_some_and(|b| inference.misfit_beyond_noise(b) < EXPLAINED * beyond_noise) {
            break;
        }
        match fit_with_term(inference, measured, current, term) {
            Ok(found) if best.as_ref().is_none_or(|b| found.deviance < b.deviance) => best = Some(found),
            Err(error) if (inference.is_cancelled)() => return Err(error),
            _ => {}
        }
    }
    let Some(found) = best else { return Ok(None) };
    let gain = current.deviance - found.deviance - penalty(&inference.metric, 2);
    let effect = found.prediction.trace.plus(-1.0, &current.prediction.trace);
    let is_used = gain > least && is_large(inference.laboratory.observed(), &effect, inference.allowance_mm);
    Ok(is_used.then_some((found, gain)))
}

/// How much a term must lower the deviance of a fit without it, beyond what its parameters cost.
fn called_for(inference: &Inference, without: &CauseFit) -> f64 {
    EVIDENCE.max(SMALLEST_SHARE * inference.misfit_beyond_noise(without))
}

/// The fit without the Ogden terms that are no longer called for: a fit to other data took them, to make up for our
/// mesh's error or for a cause that has been found since. The terms that make up the least of the modulus are tried.
///
/// # Errors
/// [`DiagnosisError`]: the work was cancelled.
pub(super) fn without_needless_terms(
    inference: &mut Inference,
    measured: &Trace,
    mut fitted: CauseFit,
) -> Result<CauseFit, DiagnosisError> {
    while fitted.material.terms.len() > 1 {
        let share = |n: &usize| (fitted.material.terms[*n].mu_kpa * fitted.material.terms[*n].alpha).abs();
        let mut order: Vec<usize> = (0..fitted.material.terms.len()).collect();
        order.sort_by(|a, b| share(a).total_cmp(&share(b)));
        let mut simpler: Option<CauseFit> = None;
        for &dropped in order.iter().take(MAX_FITS) {
            match fit_without_term(inference, measured, &fitted, dropped) {
                Ok(found) if simpler.as_ref().is_none_or(|s| found.deviance < s.deviance) => simpler = Some(found),
                Err(error) if (inference.is_cancelled)() => return Err(error),
                _ => {}
            }
        }
        let Some(found) = simpler else { break };
        let missed = found.deviance - fitted.deviance - penalty(&inference.metric, 2);
        if missed > called_for(inference, &found) {
            break;
        }
        (inference.progress)("an Ogden term is not needed any more");
        fitted = found;
    }
    Ok(fitted)
}

/// The fit with one term fewer, from where the others make up for its part of the modulus.
fn fit_without_term(
    inference: &mut Inference,
    measured: &Trace,
    fitted: &CauseFit,
    dropped: usize,
) -> Result<CauseFit, DiagnosisError> {
    let mut simpler = fitted.material.clone();
    simpler.terms.remove(dropped);
    let factor = shear_modulus(&fitted.material) / shear_modulus(&simpler);
    for term in &mut simpler.terms {
        term.mu_kpa *= factor;
    }
    inference.fit(measured, &simpler, &fitted.causes)
}

/// The fit with one more term, from as much of it as has an equilibrium.
fn fit_with_term(
    inference: &mut Inference,
    measured: &Trace,
    current: &CauseFit,
    term: OgdenTerm,
) -> Result<CauseFit, DiagnosisError> {
    let mut fit = |part: f64| {
        let mut richer = current.material.clone();
        richer.terms.push(OgdenTerm { mu_kpa: part * term.mu_kpa, ..term });
        inference.fit(measured, &richer, &current.causes)
    };
    let [whole, part] = STARTS;
    fit(whole).or_else(|_| fit(part))
}

/// The further terms that explain more than `least` to first order, best first and few.
fn promising_terms(inference: &mut Inference, current: &CauseFit, least: f64) -> Vec<OgdenTerm> {
    let num_terms = current.material.terms.len();
    // A law in the first invariant has no terms to which one could be added.
    if num_terms >= MOST_TERMS || current.material.law.is_some() {
        return Vec::new();
    }
    let probes = EXPONENTS.chunks(MAX_TERMS - num_terms);
    let mut found: Vec<(f64, OgdenTerm)> = probes.flat_map(|alphas| probe(inference, current, alphas)).collect();
    found.retain(|(explained, term)| *explained > least && term.mu_kpa * term.alpha > 0.0);
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.into_iter().take(MAX_FITS).map(|(_, term)| term).collect()
}

/// What terms of these exponents explain to first order, each alone, and the terms; none where there are no
/// derivatives.
fn probe(inference: &mut Inference, current: &CauseFit, alphas: &[f64]) -> Vec<(f64, OgdenTerm)> {
    let base = current.material.terms.len();
    let mut probe = current.material.clone();
    for &alpha in alphas {
        let mu_kpa = 1e-9 * shear_modulus(&current.material) / alpha;
        probe.terms.push(OgdenTerm { mu_kpa, alpha });
    }
    let scene = current.scene();
    let columns = inference.laboratory.derivatives(&probe, &scene, &current.prediction, true, &[], STEP);
    let Ok(columns) = columns else { return Vec::new() };
    let nuisance: Vec<Trace> = columns[..=2 * base]
        .iter()
        .zip(current.material.parameters())
        .map(|(t, p)| t.scaled(current.material.value(p)))
        .collect();
    let prior = [inference.settings.bulk.log_sd.powi(-2)];
    let test = ScoreTest::new(&inference.metric, &current.residual, &nuisance, &prior);
    let of_term = |(n, &alpha): (usize, &f64)| {
        // κ, then μ and α of each term.
        let score = test.test(std::slice::from_ref(&columns[1 + 2 * (base + n)]));
        (score.explained, OgdenTerm { mu_kpa: score.coefficients[0], alpha })
    };
    alphas.iter().enumerate().map(of_term).collect()
}
