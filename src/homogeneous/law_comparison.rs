//! Which law describes curves with the fewest parameters: fits of Ogden's terms and of every law in the first invariant
//! side by side.
//!
//! The laws are not nested in each other, so that there is no F-test between them; the Bayesian information criterion
//! compares them all the same.

use super::curve::Curve;
use super::fit_options::{CurveFitError, CurveFitOptions};
use super::result::{CurveFit, CurveFitSequence, Interval, fit_curves, independent_of_best};
use super::selection::bic;
use crate::material::LawKind;
use serde::{Deserialize, Serialize};

/// A difference of BIC below this is none: the odds are less than three to one (Kass and Raftery 1995).
pub const MIN_BIC_DIFFERENCE: f64 = 2.0;

/// A law's fit beside the others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LawEvidence {
    /// `Ogden, 2 terms`, or the name of the law.
    pub name: String,
    /// The law in the first invariant; none with Ogden's terms.
    pub law: Option<LawKind>,
    /// Ogden's terms; zero with a law in the first invariant.
    pub num_terms: usize,
    /// Free parameters.
    pub num_parameters: usize,
    /// Σ (residual / weight)².
    pub sum_of_squares: f64,
    /// n ln(Σ/n) + k ln n with n the number of independent data, the same for all laws; smaller is better.
    pub bic: f64,
    /// Its BIC less the smallest one. Below 2 there is nothing to choose between the two.
    pub bic_above_best: f64,
    /// The initial shear modulus, kPa.
    pub initial_shear_modulus_kpa: Interval,
}

/// A law that has no fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LawLeftOut {
    /// `Ogden`, or the name of the law.
    pub name: String,
    /// Why.
    pub reason: String,
}

/// All laws side by side.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LawComparison {
    /// The fits, best first by BIC.
    pub laws: Vec<LawEvidence>,
    /// Laws without a fit.
    pub left_out: Vec<LawLeftOut>,
    /// Data points.
    pub num_data: usize,
    /// How many independent ones they are worth, given the correlation of the residuals of the fit with the smallest
    /// misfit.
    pub num_independent: f64,
}

/// Fits all laws to the curves of `known`, which is one of them, and compares them. Ogden's terms are fitted with 1 to
/// `options.max_terms` terms.
///
/// # Errors
/// [`CurveFitError`] where curves or settings are bad; a law without a fit is left out.
pub fn compare_laws(
    curves: &[Curve],
    known: &CurveFitSequence,
    options: &CurveFitOptions,
) -> Result<LawComparison, CurveFitError> {
    let mut fits: Vec<CurveFit> = Vec::new();
    let mut left_out = Vec::new();
    for law in std::iter::once(None).chain(LawKind::ALL.map(Some)) {
        if law == known.law {
            fits.extend(known.fits.iter().cloned());
            continue;
        }
        match fit_curves(curves, &CurveFitOptions { law, ..options.clone() }) {
            Ok(sequence) => fits.extend(sequence.fits),
            Err(error @ (CurveFitError::Curve(_) | CurveFitError::Setting { .. })) => return Err(error),
            Err(error) => {
                let name = law.map_or("Ogden", LawKind::name).to_string();
                left_out.push(LawLeftOut { name, reason: error.to_string() });
            }
        }
    }
    let residuals: Vec<Vec<f64>> = fits.iter().map(|f| residuals(curves, f)).collect();
    let models = residuals.iter().zip(&fits).map(|(r, f)| (r.as_slice(), f.num_parameters()));
    let n = independent_of_best(curves, models);
    let of = |f: &CurveFit| bic(f.sum_of_squares, f.num_parameters(), n);
    let best = fits.iter().map(of).fold(f64::INFINITY, f64::min);
    let evidence = |f: &CurveFit| LawEvidence {
        name: if f.law.is_none() { format!("Ogden, {}", f.name()) } else { f.name() },
        law: f.law,
        num_terms: f.num_terms,
        num_parameters: f.num_parameters(),
        sum_of_squares: f.sum_of_squares,
        bic: of(f),
        bic_above_best: of(f) - best,
        initial_shear_modulus_kpa: f.initial_shear_modulus_kpa,
    };
    let mut laws: Vec<LawEvidence> = fits.iter().map(evidence).collect();
    laws.sort_by(|a, b| a.bic.total_cmp(&b.bic));
    let num_data = curves.iter().map(|c| c.states.len()).sum();
    Ok(LawComparison { laws, left_out, num_data, num_independent: n })
}

/// (model − data)/weight, curve after curve.
fn residuals(curves: &[Curve], fit: &CurveFit) -> Vec<f64> {
    let of_curve = |curve: &Curve| {
        let stress = fit.stress(&curve.states).unwrap_or_default();
        let weight = 1.0 / curve.weight_kpa();
        let of = |(model, data): (f64, &f64)| weight * (model - data);
        stress.into_iter().zip(&curve.nominal_stress_kpa).map(of).collect::<Vec<_>>()
    };
    curves.iter().flat_map(of_curve).collect()
}

impl LawComparison {
    /// The evidence of a fit that is among those compared.
    pub fn of(&self, fit: &CurveFit) -> Option<&LawEvidence> {
        self.laws.iter().find(|e| e.law == fit.law && e.num_terms == fit.num_terms)
    }

    /// The best law, where it is another one than that of `used` and the difference counts.
    pub fn better_than(&self, used: &LawEvidence) -> Option<&LawEvidence> {
        self.laws.first().filter(|_| used.bic_above_best >= MIN_BIC_DIFFERENCE)
    }
}

#[cfg(test)]
#[path = "law_tests.rs"]
mod tests;
