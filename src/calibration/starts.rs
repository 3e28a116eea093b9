//! Where fits start: from a force by hand's formula, and new terms by what they promise to gain.

use super::error::CalibrationError;
use super::observed::Observed;
use super::options::{FitOptions, Held};
use super::prediction::Prediction;
use super::problem::CalibrationProblem;
use super::recording_fit::RecordingFit;
use super::system::raw_sums;
use super::target::Target;
use crate::material::{LawKind, Material, OgdenTerm};
use crate::specimen::{Specimen, TestKind};
use nalgebra::DVector;

/// Shear modulus at the start where no force tells it, kPa. Displacements do not depend on it.
const REFERENCE_SHEAR_KPA: f64 = 10.0;
/// κ over the shear modulus at the start.
const START_BULK_RATIO: f64 = 100.0;
/// Exponents of one-term starts.
const FIRST_EXPONENTS: [f64; 3] = [2.0, 6.0, -3.0];
/// Exponents that a further term is tried with.
const NEXT_EXPONENTS: [f64; 15] =
    [-16.0, -12.0, -9.0, -6.5, -4.5, -3.0, -1.5, 1.0, 2.5, 4.0, 6.0, 8.0, 10.5, 14.0, 18.0];
/// A further term starts with a part of the shear modulus in this range.
const FIRST_SHARE: [f64; 2] = [2e-3, 0.3];

/// Shear modulus (kPa) that a homogeneous test of the block's outline would need for the first force: F = G A d / t in
/// shear, 3 G A d / l in tension.
fn shear_modulus_kpa(observed: &[Observed]) -> f64 {
    for recording in observed {
        for step in &recording.steps {
            let Some(force) = step.force else { continue };
            // Newton per kilopascal: areas in mm².
            let of_sample = |specimen: &Specimen| {
                let block = &specimen.block;
                let (area, strain) = match specimen.test {
                    TestKind::DoubleLapShear => {
                        (block.length_mm * block.width_mm, step.drive_mm / block.harmonic_thickness_mm())
                    }
                    TestKind::Uniaxial => (block.thickness_mm * block.width_mm, 3.0 * step.drive_mm / block.length_mm),
                };
                1e-3 * area * strain * f64::from(specimen.samples_in_parallel)
            };
            let modulus = force.value_n / recording.specimen.samples().iter().map(of_sample).sum::<f64>();
            if modulus.is_finite() && modulus > 0.0 {
                return modulus;
            }
        }
    }
    REFERENCE_SHEAR_KPA
}

fn ogden(bulk_kpa: f64, terms: Vec<OgdenTerm>) -> Material {
    Material { bulk_kpa, terms, law: None }
}

/// Blind one-term starts, the likeliest first.
pub(super) fn first_starts(observed: &[Observed]) -> Vec<Material> {
    let shear = shear_modulus_kpa(observed);
    FIRST_EXPONENTS
        .iter()
        .map(|&alpha| ogden(START_BULK_RATIO * shear, vec![OgdenTerm { mu_kpa: 2.0 * shear / alpha, alpha }]))
        .collect()
}

/// Blind starts of a law in the first invariant.
pub(super) fn law_starts(observed: &[Observed], kind: LawKind) -> Vec<Material> {
    let shear = shear_modulus_kpa(observed);
    let start = |law| Material { bulk_kpa: START_BULK_RATIO * shear, terms: Vec::new(), law: Some(law) };
    kind.starts(shear).into_iter().map(start).collect()
}

/// What a further term would change, for every exponent that it is tried with. Does not depend on the data.
pub(super) struct Candidates {
    old: Material,
    held: Held,
    exponents: Vec<f64>,
    /// With derivatives by the moduli of further terms of these exponents.
    predictions: Vec<Prediction>,
}

impl Candidates {
    /// Around `fit`.
    ///
    /// # Errors
    /// [`CalibrationError`].
    pub(super) fn new(
        problem: &CalibrationProblem,
        fit: &RecordingFit,
        options: &FitOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Candidates, CalibrationError> {
        let old = &fit.material;
        let gap = 1.1 * options.min_alpha_gap;
        let exponents: Vec<f64> =
            NEXT_EXPONENTS.into_iter().filter(|a| old.terms.iter().all(|t| (t.alpha - a).abs() > gap)).collect();
        let predictions = problem.with_further_terms(fit, &exponents, is_cancelled)?;
        Ok(Candidates { old: old.clone(), held: fit.held, exponents, predictions })
    }

    /// The fit's material with one term more, in the order of the decrease of the objective that the new term promises:
    /// for each exponent the new μ that the linear model likes best, all old parameters moving along. At most `count`,
    /// each with the decrease promised.
    pub(super) fn ranked(&self, targets: &[Target], count: usize) -> Vec<(f64, Material)> {
        let old = &self.old;
        let num_old = 2 * old.terms.len() + 1;
        let shear = old.initial_shear_modulus_kpa();
        let mut candidates: Vec<(f64, Material)> = Vec::new();
        let (matrix, gradient) = raw_sums(&self.predictions, targets);
        let free: Vec<usize> = (0..num_old).filter(|&i| !self.held.contains(i)).collect();
        let inner = matrix.select_rows(&free).select_columns(&free);
        // Relative parameters: a unit diagonal, and a ridge for directions without information.
        let root: Vec<f64> = free.iter().map(|&i| matrix[(i, i)].sqrt().max(f64::MIN_POSITIVE)).collect();
        let scaled = inner.map_with_location(|a, b, x| x / (root[a] * root[b]) + if a == b { 1e-9 } else { 0.0 });
        let Some(factor) = scaled.cholesky() else { return Vec::new() };
        let rest = DVector::from_iterator(free.len(), free.iter().zip(&root).map(|(&i, r)| gradient[i] / r));
        for (n, &alpha) in self.exponents.iter().enumerate() {
            let at = num_old + n;
            let coupling =
                DVector::from_iterator(free.len(), free.iter().zip(&root).map(|(&i, r)| matrix[(i, at)] / r));
            let solved = factor.solve(&coupling);
            let slope = gradient[at] - solved.dot(&rest);
            let curvature = matrix[(at, at)] - solved.dot(&coupling);
            if !(curvature > 0.0) {
                continue;
            }
            let best = slope / curvature;
            let is_stable = best * alpha > 0.0;
            let gain = if is_stable { slope * slope / curvature } else { 0.0 };
            let share = (0.5 * best * alpha / shear).abs().clamp(FIRST_SHARE[0], FIRST_SHARE[1]);
            let mut start = old.clone();
            for term in &mut start.terms {
                term.mu_kpa *= 1.0 - share;
            }
            start.terms.push(OgdenTerm { mu_kpa: 2.0 * share * shear / alpha, alpha });
            candidates.push((gain, start));
        }
        candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
        // Neighbouring exponents lead to the same optimum: spread the starts.
        let mut chosen: Vec<(f64, Material)> = Vec::new();
        for (gain, start) in candidates {
            let alpha = |m: &Material| m.terms.last().map_or(0.0, |t| t.alpha);
            if chosen.len() < count && chosen.iter().all(|(_, c)| (alpha(c) - alpha(&start)).abs() > 3.0) {
                chosen.push((gain, start));
            }
        }
        chosen
    }

    /// The decrease of the objective that a further term promises where the data are what `other`, a fit on another
    /// mesh, predicts: a term that the meshes' difference asks for.
    pub(super) fn promise_of_mesh(&self, targets: &[Target], other: &RecordingFit) -> f64 {
        let moved: Vec<Target> = targets
            .iter()
            .zip(&other.predictions)
            .map(|(t, p)| t.with_measured(&p.displacements, &p.forces_n))
            .collect();
        self.ranked(&moved, 1).first().map_or(0.0, |(gain, _)| *gain)
    }
}

/// Starts with one term more than `fit`, the most promising first, at most `count`; see [`Candidates`].
///
/// # Errors
/// [`CalibrationError`].
pub(super) fn further_starts(
    problem: &CalibrationProblem,
    fit: &RecordingFit,
    options: &FitOptions,
    count: usize,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<(f64, Material)>, CalibrationError> {
    let candidates = Candidates::new(problem, fit, options, is_cancelled)?;
    Ok(candidates.ranked(&problem.targets()?, count))
}
