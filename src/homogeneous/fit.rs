//! Joint fits of laws to curves of homogeneous tests.
//!
//! Unknowns are those of [`CurveLaw`]. Starts of Ogden's terms come from linear fits over a grid of exponents; each
//! good one is refined by Levenberg–Marquardt under αᵢ ≥ αᵢ₊₁ + η and the range of α. Up to two terms have c > 0 each;
//! with more, a term may have c < 0 where the material stays stable on the way to every state of the data, and so may
//! coefficients of a law in the first invariant.

use super::compressible::respond;
use super::curve::{Curve, CurveMatch};
use super::curve_law::{CurveLaw, OgdenTerms};
use super::deformation::Deformation;
use super::fit_options::{CurveFitError, CurveFitOptions};
use super::loading_path::is_stable;
use super::starts::{law_starts, starts};
use crate::material::{InvariantLaw, LawKind, MAX_TERMS, Material, MaterialError};
use crate::optimise::{Evaluation, LeastSquaresOptions, Minimum, minimise};
use nalgebra::{DMatrix, DVector};

/// The best fit of a law.
#[derive(Clone, Debug)]
pub struct LawFit<L> {
    /// The law.
    pub law: L,
    /// Σ (residual / weight)².
    pub sum_of_squares: f64,
    /// Residuals (model − data) / weight, curve after curve.
    pub residual: DVector<f64>,
    /// Their derivatives with respect to the unknowns of the law; a held one has a column of zeros.
    pub jacobian: DMatrix<f64>,
    /// Whether the refinement met its tolerance.
    pub is_converged: bool,
    /// Whether two exponents stand at their least distance, or a parameter at the end of its range.
    pub is_at_limit: bool,
}

impl<L: CurveLaw> LawFit<L> {
    /// Free parameters.
    pub fn num_parameters(&self) -> usize {
        self.law.parameters().iter().filter(|p| !p.held).count()
    }
}

/// Bulk modulus over initial shear modulus of the material that stands for a fit of the incompressible limit: a
/// Poisson's ratio of 0.4995. Stresses of homogeneous tests then differ from the limit's by about a thousandth.
pub const BULK_OVER_SHEAR: f64 = 1000.0;

/// A fitted law as a material, which needs a bulk modulus: the held one, else [`BULK_OVER_SHEAR`] times the initial
/// shear modulus.
///
/// # Errors
/// [`MaterialError`] where a parameter is beyond what a material may hold, such as an exponent near zero.
pub fn fitted_material(law: &dyn CurveLaw, bulk_kpa: Option<f64>) -> Result<Material, MaterialError> {
    let material = law.material(bulk_kpa.unwrap_or(BULK_OVER_SHEAR * law.initial_shear_modulus_kpa()));
    material.validate().map(|()| material)
}

/// Stresses of a law at a curve's states, kPa, with κ or in the incompressible limit. `None` where a state has no
/// response.
pub fn model_stress(law: &dyn CurveLaw, bulk_kpa: Option<f64>, states: &[Deformation]) -> Option<Vec<f64>> {
    match bulk_kpa {
        None => states.iter().map(|s| Some(law.incompressible_stress(s)).filter(|stress| stress.is_finite())).collect(),
        Some(bulk) => {
            let material = law.material(bulk);
            states.iter().map(|s| respond(&material, s).ok().map(|r| r.nominal_stress_kpa[0])).collect()
        }
    }
}

/// How a law meets each curve. `None` where a state has no response.
pub fn matches_of(law: &dyn CurveLaw, bulk_kpa: Option<f64>, curves: &[Curve]) -> Option<Vec<CurveMatch>> {
    curves.iter().map(|c| model_stress(law, bulk_kpa, &c.states).map(|m| CurveMatch::of(c, &m))).collect()
}

/// Residuals and Jacobian with respect to the unknowns.
fn evaluate<L: CurveLaw>(curves: &[Curve], law: &L, bulk_kpa: Option<f64>) -> Option<Evaluation> {
    let num_data = curves.iter().map(|c| c.states.len()).sum();
    let mut row = vec![0.0; law.unknowns().len()];
    let mut residual = DVector::zeros(num_data);
    let mut jacobian = DMatrix::zeros(num_data, row.len());
    let material = bulk_kpa.map(|bulk| law.material(bulk));
    let mut index = 0;
    for curve in curves {
        let weight = 1.0 / curve.weight_kpa();
        for (state, &data) in curve.states.iter().zip(&curve.nominal_stress_kpa) {
            let stress = law.stress_and_row(material.as_ref(), state, weight, &mut row)?;
            residual[index] = weight * (stress - data);
            row.iter().enumerate().for_each(|(column, value)| jacobian[(index, column)] = *value);
            index += 1;
        }
    }
    Some((residual, jacobian))
}

/// What has to be right whatever is fitted.
fn check(curves: &[Curve], options: &CurveFitOptions) -> Result<(), CurveFitError> {
    for curve in curves {
        curve.validate()?;
        if let Some(sd) = curve.noise_sd_kpa
            && !(sd > 0.0 && sd.is_finite())
        {
            let requirement = "a standard deviation must be positive";
            return Err(CurveFitError::Setting { name: "noise_sd_kpa", value: sd, requirement });
        }
    }
    if let Some(bulk) = options.bulk_kpa {
        setting("bulk_kpa", bulk, bulk > 0.0 && bulk.is_finite(), "it must be positive")?;
    }
    Ok(())
}

fn setting(name: &'static str, value: f64, is_good: bool, requirement: &'static str) -> Result<(), CurveFitError> {
    if is_good { Ok(()) } else { Err(CurveFitError::Setting { name, value, requirement }) }
}

fn check_terms(curves: &[Curve], options: &CurveFitOptions, num_terms: usize) -> Result<(), CurveFitError> {
    check(curves, options)?;
    setting("terms", num_terms as f64, (1..=MAX_TERMS.min(4)).contains(&num_terms), "give 1 to 4")?;
    let gap = options.min_alpha_gap;
    setting("min_alpha_gap", gap, gap > 0.0 && gap <= 10.0, "it must be above 0 and at most 10")?;
    let [low, high] = options.alpha_range;
    setting("alpha_range", low, (-40.0..2.0).contains(&low), "its lower end lies from -40 to 2")?;
    setting("alpha_range", high, high > 2.0 && high <= 40.0, "its upper end lies from 2 to 40")?;
    let num_data: usize = curves.iter().map(|c| c.states.len()).sum();
    let num_parameters = 2 * num_terms - usize::from(options.neo_hookean);
    if num_data <= num_parameters {
        return Err(CurveFitError::TooFewData { num_terms, num_data });
    }
    Ok(())
}

/// The best stable fit from `starts`.
fn best_of<L: CurveLaw>(curves: &[Curve], starts: &[L], options: &CurveFitOptions) -> Option<LawFit<L>> {
    let mut states: Vec<Deformation> = curves.iter().flat_map(|c| c.states.iter().copied()).collect();
    states.extend(&options.also_stable_at);
    let mut best: Option<LawFit<L>> = None;
    for start in starts {
        let Some(found) = refine(curves, start, options) else { continue };
        let is_better = best.as_ref().is_none_or(|b| found.sum_of_squares < b.sum_of_squares);
        if is_better && (found.law.is_always_stable() || is_stable(&found.law, &states)) {
            best = Some(found);
        }
    }
    best
}

/// The best fit with exactly `num_terms` of Ogden's terms to all curves together.
///
/// # Errors
/// [`CurveFitError`].
pub fn fit_terms(
    curves: &[Curve],
    num_terms: usize,
    options: &CurveFitOptions,
) -> Result<LawFit<OgdenTerms>, CurveFitError> {
    check_terms(curves, options, num_terms)?;
    best_of(curves, &starts(curves, num_terms, options), options).ok_or(CurveFitError::NoFit { num_terms })
}

/// The best fit of a law in the first invariant to all curves together.
///
/// # Errors
/// [`CurveFitError`].
pub fn fit_law(
    curves: &[Curve],
    kind: LawKind,
    options: &CurveFitOptions,
) -> Result<LawFit<InvariantLaw>, CurveFitError> {
    check(curves, options)?;
    let starts = law_starts(curves, kind);
    let num_data: usize = curves.iter().map(|c| c.states.len()).sum();
    let num_parameters = starts.first().map_or(0, |law| law.parameters().len());
    if num_data <= num_parameters {
        return Err(CurveFitError::TooFewForLaw { law: kind.name(), num_parameters, num_data });
    }
    best_of(curves, &starts, options).ok_or(CurveFitError::NoLawFit { law: kind.name() })
}

/// Levenberg–Marquardt from one start. `None` where the model has no value at the start.
fn refine<L: CurveLaw>(curves: &[Curve], start: &L, options: &CurveFitOptions) -> Option<LawFit<L>> {
    let limits = start.limits(options);
    let settings = LeastSquaresOptions { max_evaluations: 300, tolerance: 1e-10 };
    let m: Minimum = minimise(&start.unknowns(), &limits, &start.largest_steps(), &settings, &mut |x| {
        evaluate(curves, &start.with_unknowns(x), options.bulk_kpa)
    })?;
    Some(LawFit {
        law: start.with_unknowns(&m.parameters),
        sum_of_squares: m.sum_of_squares,
        residual: m.residual,
        jacobian: m.jacobian,
        is_converged: m.is_converged,
        is_at_limit: m.reached.iter().any(|&l| start.is_told_by(&limits[l])),
    })
}

#[cfg(test)]
#[path = "fit_tests.rs"]
mod tests;

#[cfg(test)]
#[path = "biaxial_tests.rs"]
mod biaxial_tests;
