//! Whether a recording calls for one more Ogden term, or for all that a fit has.

use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::evidence::{EVIDENCE, SMALLEST_SHARE, is_large, penalty};
use super::fit::STEP;
use super::inference::Inference;
use super::prior::shear_modulus;
use super::score::ScoreTest;
use super::trace::Trace;
use crate::material::{MAX_TERMS, Material, OgdenTerm, Parameter};

/// Terms are added up to this number.
const MOST_TERMS: usize = 3;
/// Exponents tried for a further Ogden term.
const EXPONENTS: [f64; 6] = [-6.0, -2.0, 2.0, 5.0, 9.0, 14.0];
/// Most further terms that are fitted in full: first order does not tell reliably which is best.
const MAX_FITS: usize = 2;
/// Such a term is fitted where it explains, to first order, this part of what is called for: its exponent then follows.
const LEAST_PROMISE: f64 = 0.25;
/// What is left of a parameter beside a further term, at least, as a part.
const LEAST_LEFT: f64 = 0.05;
/// A term that leaves less than this part of the misfit beyond noise is as good as any.
const EXPLAINED: f64 = 0.1;
/// First order is taken to hold while no parameter changes by more than this part.
const HOLDS: f64 = 0.4;
/// Parts of the way as far as first order holds, of which the first that lowers the deviance is where a fit starts.
const STARTS: [f64; 4] = [1.0, 0.5, 0.2, 0.05];

/// A further term as first order sees it.
struct FurtherTerm {
    /// What it explains.
    explained: f64,
    /// The term.
    term: OgdenTerm,
    /// Change of the logarithm of κ, and relative changes of the other parameters of the material, beside it.
    followed: Vec<f64>,
}

impl FurtherTerm {
    /// The part of the way for which first order holds.
    fn reach(&self) -> f64 {
        self.followed.iter().fold(1.0, |part, change| f64::min(part, HOLDS / change.abs().max(1e-12)))
    }

    /// What it explains by the end of that: a quadratic whose vertex is the whole way.
    fn explained_within_reach(&self) -> f64 {
        let part = self.reach();
        part * (2.0 - part) * self.explained
    }

    /// The material with `part` of the term and of what follows beside it.
    fn beside(&self, material: &Material, part: f64) -> Material {
        let mut richer = material.clone();
        for (parameter, change) in material.parameters().into_iter().zip(&self.followed) {
            let factor = if parameter == Parameter::Kappa { (part * change).exp() } else { 1.0 + part * change };
            richer.set(parameter, factor.max(LEAST_LEFT) * material.value(parameter));
        }
        richer.terms.push(OgdenTerm { mu_kpa: part * self.term.mu_kpa, ..self.term });
        richer
    }
}

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
    let goal = current.deviance - least - penalty(&inference.metric, 2);
    for term in promising_terms(inference, current, LEAST_PROMISE * least) {
        if best.as_ref().is_some_and(|b| inference.misfit_beyond_noise(b) < EXPLAINED * beyond_noise) {
            break;
        }
        match fit_with_term(inference, measured, current, &term, goal) {
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

/// The fit with one more term, from as much of what first order says of it as explains more; it is of use below the
/// deviance `goal` alone.
fn fit_with_term(
    inference: &mut Inference,
    measured: &Trace,
    current: &CauseFit,
    term: &FurtherTerm,
    goal: f64,
) -> Result<CauseFit, DiagnosisError> {
    let parts = STARTS.map(|part| part * term.reach());
    let mut start = term.beside(&current.material, parts[parts.len() - 1]);
    for part in parts {
        let richer = term.beside(&current.material, part);
        match inference.deviance_at(measured, &richer, &current.causes) {
            Ok(deviance) if deviance < current.deviance => {
                start = richer;
                break;
            }
            Err(error) if (inference.is_cancelled)() => return Err(error),
            _ => {}
        }
    }
    let settings = inference.settings;
    inference.settings.goal = Some(goal);
    let found = inference.fit(measured, &start, &current.causes);
    inference.settings = settings;
    found
}

/// The further terms that explain more than `least` to first order, few, and first those that explain the most as far
/// as first order holds: terms of other exponents explain as much by moduli that make up for each other's.
fn promising_terms(inference: &mut Inference, current: &CauseFit, least: f64) -> Vec<FurtherTerm> {
    let num_terms = current.material.terms.len();
    // A law in the first invariant has no terms to which one could be added.
    if num_terms >= MOST_TERMS || current.material.law.is_some() {
        return Vec::new();
    }
    let probes = EXPONENTS.chunks(MAX_TERMS - num_terms);
    let mut found: Vec<FurtherTerm> = probes.flat_map(|alphas| probe(inference, current, alphas)).collect();
    found.retain(|f| f.explained > least && f.term.mu_kpa * f.term.alpha > 0.0);
    found.sort_by(|a, b| b.explained_within_reach().total_cmp(&a.explained_within_reach()));
    found.truncate(MAX_FITS);
    found
}

/// What terms of these exponents explain to first order, each alone, and the terms; none where there are no
/// derivatives.
fn probe(inference: &mut Inference, current: &CauseFit, alphas: &[f64]) -> Vec<FurtherTerm> {
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
        let term = OgdenTerm { mu_kpa: score.coefficients[0], alpha };
        FurtherTerm { explained: score.explained, term, followed: score.followed }
    };
    alphas.iter().enumerate().map(of_term).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::Observed;
    use crate::diagnosis::scene::Scene;
    use crate::diagnosis::test_recordings::{FORCE_SD_N, MESH_FACTOR, inference_of, material, recorded};

    /// A material that stiffens: a fit of one term calls for another, whose fit starts where first order says that all
    /// parameters go together and lowers the deviance from there.
    #[test]
    fn a_further_term_starts_below_the_fit_without_it() {
        let mut stiffening = material();
        stiffening.terms.push(OgdenTerm { mu_kpa: 0.5, alpha: 9.0 });
        let recording = recorded(&stiffening, &Scene::default(), MESH_FACTOR);
        let observed = Observed::new(&recording, FORCE_SD_N).unwrap();
        let mut inference = inference_of(&observed);
        let measured = inference.laboratory.measured();
        let current = inference.fit(&measured, &material(), &[]).unwrap();
        let best = promising_terms(&mut inference, &current, 0.0).remove(0);
        let at = |part: f64, inference: &mut Inference| {
            inference.deviance_at(&measured, &best.beside(&current.material, part), &[]).unwrap()
        };
        let lowered = STARTS.map(|part| current.deviance - at(part * best.reach(), &mut inference));
        assert!(lowered.iter().any(|gain| *gain > 0.2 * best.explained), "{lowered:?} of {}", best.explained);
        // A part ε of the way lowers the deviance by 2 ε less ε² of what the whole way promises, to first order.
        let short = current.deviance - at(0.01, &mut inference);
        assert!((short / (0.0199 * best.explained) - 1.0).abs() < 0.1, "{short} of {}", best.explained);
        let (richer, gain) = further_term(&mut inference, &measured, &current).unwrap().unwrap();
        assert!(richer.material.terms.len() == 2 && gain > EVIDENCE, "{gain} {:?}", richer.material);
        // Nothing is left for a third.
        assert!(further_term(&mut inference, &measured, &richer).unwrap().is_none());
    }
}
