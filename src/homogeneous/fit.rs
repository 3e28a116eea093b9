//! Joint fits of Ogden terms to curves of homogeneous tests.
//!
//! Unknowns are ln|cᵢ| and αᵢ (c = μα keeps its sign; the trade of c against α is a straight valley in ln c). Starts
//! come from linear fits over a grid of exponents; each good one is refined by Levenberg–Marquardt under αᵢ ≥ αᵢ₊₁ + η
//! and the range of α. Up to two terms have c > 0 each; with more, a term may have c < 0 where the material stays
//! stable on the way to every state of the data.

use super::compressible::respond;
use super::curve::{Curve, CurveMatch};
use super::deformation::{Deformation, incompressible_derivative, incompressible_stress};
use super::fit_options::{CurveFitError, CurveFitOptions};
use super::loading_path::is_stable;
use super::starts::{Start, starts};
use crate::material::{MAX_TERMS, MaterialError, Ogden, OgdenTerm, ShearTerm, initial_shear_modulus_kpa};
use crate::optimise::{Evaluation, LeastSquaresOptions, LinearLimit, Minimum, minimise};
use nalgebra::{DMatrix, DVector};

/// The best fit with a given number of terms.
#[derive(Clone, Debug)]
pub struct TermFit {
    /// The terms, largest exponent first.
    pub terms: Vec<ShearTerm>,
    /// Which of them has its exponent held at 2.
    pub held: Option<usize>,
    /// Σ (residual / weight)².
    pub sum_of_squares: f64,
    /// Residuals (model − data) / weight, curve after curve.
    pub residual: DVector<f64>,
    /// Their derivatives with respect to (ln|c₁|, α₁, ln|c₂|, α₂, …); a held exponent has a column of zeros.
    pub jacobian: DMatrix<f64>,
    /// Whether the refinement met its tolerance.
    pub is_converged: bool,
    /// Whether two exponents stand at their least distance, or one at the end of its range.
    pub is_at_limit: bool,
}

impl TermFit {
    /// Free parameters.
    pub fn num_parameters(&self) -> usize {
        2 * self.terms.len() - usize::from(self.held.is_some())
    }
}

/// The material with these terms and κ.
pub fn material_of(terms: &[ShearTerm], bulk_kpa: f64) -> Ogden {
    let terms = terms.iter().map(|t| OgdenTerm { mu_kpa: t.mu_kpa(), alpha: t.alpha }).collect();
    Ogden { bulk_kpa, terms, law: None }
}

/// Bulk modulus over initial shear modulus of the material that stands for a fit of the incompressible limit: a
/// Poisson's ratio of 0.4995. Stresses of homogeneous tests then differ from the limit's by about a thousandth.
pub const BULK_OVER_SHEAR: f64 = 1000.0;

/// Fitted terms as a material, which needs a bulk modulus: the held one, else [`BULK_OVER_SHEAR`] times the initial
/// shear modulus.
///
/// # Errors
/// [`MaterialError`] where a parameter is beyond what a material may hold, such as an exponent near zero.
pub fn fitted_material(terms: &[ShearTerm], bulk_kpa: Option<f64>) -> Result<Ogden, MaterialError> {
    let material = material_of(terms, bulk_kpa.unwrap_or(BULK_OVER_SHEAR * initial_shear_modulus_kpa(terms)));
    material.validate().map(|()| material)
}

/// Stresses of a model at a curve's states, kPa. `None` where a state has no response.
pub fn model_stress(terms: &[ShearTerm], bulk_kpa: Option<f64>, states: &[Deformation]) -> Option<Vec<f64>> {
    match bulk_kpa {
        None => Some(states.iter().map(|s| incompressible_stress(terms, s)).collect()),
        Some(bulk) => {
            let material = material_of(terms, bulk);
            states.iter().map(|s| respond(&material, s).ok().map(|r| r.nominal_stress_kpa[0])).collect()
        }
    }
}

/// How a model meets each curve. `None` where a state has no response.
pub fn matches_of(terms: &[ShearTerm], bulk_kpa: Option<f64>, curves: &[Curve]) -> Option<Vec<CurveMatch>> {
    curves.iter().map(|c| model_stress(terms, bulk_kpa, &c.states).map(|m| CurveMatch::of(c, &m))).collect()
}

/// Residuals and Jacobian with respect to (ln|c|, α) of all terms.
fn evaluate(curves: &[Curve], terms: &[ShearTerm], held: Option<usize>, bulk_kpa: Option<f64>) -> Option<Evaluation> {
    let num_data = curves.iter().map(|c| c.states.len()).sum();
    let mut residual = DVector::zeros(num_data);
    let mut jacobian = DMatrix::zeros(num_data, 2 * terms.len());
    let material = bulk_kpa.map(|bulk| material_of(terms, bulk));
    let mut row = 0;
    for curve in curves {
        let weight = 1.0 / curve.weight_kpa();
        for (state, &data) in curve.states.iter().zip(&curve.nominal_stress_kpa) {
            let mut stress = 0.0;
            if let Some(material) = &material {
                let response = respond(material, state).ok()?;
                stress = response.nominal_stress_kpa[0];
                for (t, term) in terms.iter().enumerate() {
                    let by_mu = response.derivatives[1 + 2 * t][0];
                    let by_alpha = response.derivatives[2 + 2 * t][0];
                    // At fixed α: dμ = dc/α = μ d ln c. At fixed c: dμ = −μ/α dα.
                    jacobian[(row, 2 * t)] = weight * by_mu * term.mu_kpa();
                    jacobian[(row, 2 * t + 1)] = weight * (by_alpha - by_mu * term.mu_kpa() / term.alpha);
                }
            } else {
                for (t, term) in terms.iter().enumerate() {
                    let [by_c, by_alpha] = incompressible_derivative(term, state);
                    stress += by_c * term.modulus_kpa;
                    jacobian[(row, 2 * t)] = weight * by_c * term.modulus_kpa;
                    jacobian[(row, 2 * t + 1)] = weight * by_alpha;
                }
            }
            residual[row] = weight * (stress - data);
            row += 1;
        }
    }
    if let Some(h) = held {
        jacobian.column_mut(2 * h + 1).fill(0.0);
    }
    Some((residual, jacobian))
}

fn check(curves: &[Curve], options: &CurveFitOptions, num_terms: usize) -> Result<(), CurveFitError> {
    for curve in curves {
        curve.validate()?;
        if let Some(sd) = curve.noise_sd_kpa
            && !(sd > 0.0 && sd.is_finite())
        {
            let requirement = "a standard deviation must be positive";
            return Err(CurveFitError::Setting { name: "noise_sd_kpa", value: sd, requirement });
        }
    }
    let setting = |name, value: f64, is_good: bool, requirement| {
        if is_good { Ok(()) } else { Err(CurveFitError::Setting { name, value, requirement }) }
    };
    setting("terms", num_terms as f64, (1..=MAX_TERMS.min(4)).contains(&num_terms), "give 1 to 4")?;
    let gap = options.min_alpha_gap;
    setting("min_alpha_gap", gap, gap > 0.0 && gap <= 10.0, "it must be above 0 and at most 10")?;
    let [low, high] = options.alpha_range;
    setting("alpha_range", low, (-40.0..2.0).contains(&low), "its lower end lies from -40 to 2")?;
    setting("alpha_range", high, high > 2.0 && high <= 40.0, "its upper end lies from 2 to 40")?;
    if let Some(bulk) = options.bulk_kpa {
        setting("bulk_kpa", bulk, bulk > 0.0 && bulk.is_finite(), "it must be positive")?;
    }
    let num_data: usize = curves.iter().map(|c| c.states.len()).sum();
    let num_parameters = 2 * num_terms - usize::from(options.neo_hookean);
    if num_data <= num_parameters {
        return Err(CurveFitError::TooFewData { num_terms, num_data });
    }
    Ok(())
}

/// The best fit with exactly `num_terms` terms to all curves together.
///
/// # Errors
/// [`CurveFitError`].
pub fn fit_terms(curves: &[Curve], num_terms: usize, options: &CurveFitOptions) -> Result<TermFit, CurveFitError> {
    check(curves, options, num_terms)?;
    let mut states: Vec<Deformation> = curves.iter().flat_map(|c| c.states.iter().copied()).collect();
    states.extend(&options.also_stable_at);
    let mut best: Option<TermFit> = None;
    for start in starts(curves, num_terms, options) {
        let Some(found) = refine(curves, &start, options) else { continue };
        let is_better = best.as_ref().is_none_or(|b| found.sum_of_squares < b.sum_of_squares);
        let is_allowed = found.terms.iter().all(|t| t.modulus_kpa > 0.0) || is_stable(&found.terms, &states);
        if is_better && is_allowed {
            best = Some(found);
        }
    }
    best.ok_or(CurveFitError::NoFit { num_terms })
}

/// Levenberg–Marquardt from one start. `None` where the model has no value at the start.
fn refine(curves: &[Curve], start: &Start, options: &CurveFitOptions) -> Option<TermFit> {
    let held = start.held;
    let sign: Vec<f64> = start.terms.iter().map(|t| t.modulus_kpa.signum()).collect();
    let parameters: Vec<f64> = start.terms.iter().flat_map(|t| [t.modulus_kpa.abs().ln(), t.alpha]).collect();
    let terms_of = |x: &[f64]| -> Vec<ShearTerm> {
        (0..sign.len()).map(|i| ShearTerm { modulus_kpa: sign[i] * x[2 * i].exp(), alpha: x[2 * i + 1] }).collect()
    };
    let mut limits = Vec::new();
    for i in 0..sign.len() {
        limits.push(LinearLimit::at_least(2 * i + 1, options.alpha_range[0]));
        limits.push(LinearLimit::at_most(2 * i + 1, options.alpha_range[1]));
        if i > 0 {
            let coefficients = vec![(2 * i + 1, 1.0), (2 * i - 1, -1.0)];
            limits.push(LinearLimit { coefficients, bound: -options.min_alpha_gap });
        }
    }
    // A held exponent has no derivative; a step of zero keeps it from drifting by rounding.
    let steps: Vec<f64> = (0..parameters.len())
        .map(|p| {
            if p % 2 == 0 {
                2.0
            } else if held == Some(p / 2) {
                0.0
            } else {
                2.0
            }
        })
        .collect();
    let settings = LeastSquaresOptions { max_evaluations: 300, tolerance: 1e-10 };
    let m: Minimum = minimise(&parameters, &limits, &steps, &settings, &mut |x| {
        evaluate(curves, &terms_of(x), held, options.bulk_kpa)
    })?;
    let is_at_limit = m.reached.iter().any(|&l| {
        // The held exponent may stand anywhere.
        limits[l].coefficients.len() > 1 || held != Some(limits[l].coefficients[0].0 / 2)
    });
    Some(TermFit {
        terms: terms_of(&m.parameters),
        held,
        sum_of_squares: m.sum_of_squares,
        residual: m.residual,
        jacobian: m.jacobian,
        is_converged: m.is_converged,
        is_at_limit,
    })
}

#[cfg(test)]
#[path = "fit_tests.rs"]
mod tests;
