//! Fits with one to N terms, the choice among them, and what is known of the parameters.

use super::curve::{Curve, CurveMatch};
use super::fit::{TermFit, fit_terms, fitted_material, matches_of};
use super::fit_options::{CurveFitError, CurveFitOptions};
use super::selection::{Selection, compare, independent_count};
use super::statistics::t_quantile;
use crate::material::{MaterialError, Ogden, ShearTerm, initial_shear_modulus_kpa, smallest_relative_stiffness};
use crate::optimise::covariance;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Singular values of the scaled Jacobian below this part of the largest count as none.
const CUTOFF: f64 = 1e-6;
/// A term that carries less than this part of the stress has faded.
const FADED: f64 = 1e-3;

/// A parameter and what the data say of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CurveParameter {
    /// `mu_1` (kPa), `alpha_1`, …
    pub name: String,
    /// Best value.
    pub value: f64,
    /// Standard deviation; none where not identifiable or held.
    pub sd: Option<f64>,
    /// 95 % interval (Student's t).
    pub interval_95: Option<[f64; 2]>,
    /// Whether the data determine it.
    pub identifiable: bool,
    /// Whether it was held.
    pub held: bool,
}

/// A value with its interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Interval {
    /// Best value.
    pub value: f64,
    /// 95 % interval (Student's t).
    pub interval_95: [f64; 2],
}

/// A fit with a number of terms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CurveFit {
    /// Terms, the neo-Hookean one included.
    pub num_terms: usize,
    /// Whether one term is neo-Hookean (α = 2 held).
    pub neo_hookean: bool,
    /// κ, kPa; none for the incompressible limit, where homogeneous tests say nothing of it.
    pub bulk_kpa: Option<f64>,
    /// μ₁, α₁, μ₂, … largest exponent first.
    pub parameters: Vec<CurveParameter>,
    /// Correlation of the parameters in this order; rows of what is held or not identifiable are zero.
    pub correlation: Vec<Vec<f64>>,
    /// ½ Σ μα.
    pub initial_shear_modulus_kpa: Interval,
    /// How each curve is met.
    pub curves: Vec<CurveMatch>,
    /// Σ (residual / weight)².
    pub sum_of_squares: f64,
    /// The same per datum left after the parameters; near 1 where the noise is known and the model complete.
    pub chi2_per_datum: f64,
    /// Smallest tangent stiffness over the states of the data, relative to the initial shear modulus (2 at rest).
    pub smallest_stiffness: f64,
    /// What the reader should know of this fit; empty where nothing.
    pub notes: Vec<String>,
}

impl CurveFit {
    /// The terms.
    pub fn terms(&self) -> Vec<ShearTerm> {
        self.parameters
            .chunks(2)
            .map(|p| ShearTerm { modulus_kpa: p[0].value * p[1].value, alpha: p[1].value })
            .collect()
    }

    /// The fit as a material ([`fitted_material`]).
    ///
    /// # Errors
    /// As [`fitted_material`].
    pub fn material(&self) -> Result<Ogden, MaterialError> {
        fitted_material(&self.terms(), self.bulk_kpa)
    }
}

/// Fits of one family (with or without a neo-Hookean term), 1 to N terms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CurveFitSequence {
    /// Whether one term is neo-Hookean.
    pub neo_hookean: bool,
    /// The fits, fewest terms first.
    pub fits: Vec<CurveFit>,
    /// Which one the data call for.
    pub selection: Selection,
}

impl CurveFitSequence {
    /// The chosen fit.
    pub fn chosen(&self) -> &CurveFit {
        &self.fits[self.selection.chosen().min(self.fits.len() - 1)]
    }
}

/// Fits with 1 to `options.max_terms` terms to all curves together, and the choice among them.
///
/// A number of terms for which the data are too few, or no stable material is found, ends the sequence; the first must
/// exist.
///
/// # Errors
/// [`CurveFitError`].
pub fn fit_curves(curves: &[Curve], options: &CurveFitOptions) -> Result<CurveFitSequence, CurveFitError> {
    let mut found: Vec<TermFit> = vec![fit_terms(curves, 1, options)?];
    for num_terms in 2..=options.max_terms {
        match fit_terms(curves, num_terms, options) {
            Ok(fit) => found.push(fit),
            Err(CurveFitError::TooFewData { .. } | CurveFitError::NoFit { .. }) => break,
            Err(other) => return Err(other),
        }
    }
    let richest = found.last().map_or(0, |f| f.num_parameters());
    let num_data: usize = curves.iter().map(|c| c.states.len()).sum();
    // The correlation that counts is that of the residuals that the best of these models cannot remove.
    let best = found.iter().min_by(|a, b| a.sum_of_squares.total_cmp(&b.sum_of_squares));
    let independent = best
        .map_or(num_data as f64, |f| independent_count(&by_curve(curves, f.residual.as_slice()), richest as f64 + 2.0));
    let models: Vec<(String, usize, f64)> = found
        .iter()
        .map(|f| (name_of(f.terms.len(), options.neo_hookean), f.num_parameters(), f.sum_of_squares))
        .collect();
    let selection = compare(&models, num_data, independent);
    let fits = found.iter().map(|f| describe(curves, f, options)).collect();
    Ok(CurveFitSequence { neo_hookean: options.neo_hookean, fits, selection })
}

fn name_of(num_terms: usize, neo_hookean: bool) -> String {
    match (num_terms, neo_hookean) {
        (1, true) => "neo-Hookean".into(),
        (n, true) => format!("neo-Hookean + {}", n - 1),
        (1, false) => "1 term".into(),
        (n, false) => format!("{n} terms"),
    }
}

fn by_curve<'a>(curves: &[Curve], values: &'a [f64]) -> Vec<&'a [f64]> {
    let mut rest = values;
    curves
        .iter()
        .map(|c| {
            let (own, after) = rest.split_at(c.states.len());
            rest = after;
            own
        })
        .collect()
}

/// Parameters with intervals, matches and notes.
fn describe(curves: &[Curve], fit: &TermFit, options: &CurveFitOptions) -> CurveFit {
    let num_data = fit.residual.len() as f64;
    let num_parameters = fit.num_parameters() as f64;
    let independent = independent_count(&by_curve(curves, fit.residual.as_slice()), num_parameters + 2.0);
    // Correlated residuals are worth fewer data: the variance of the parameters grows by as much.
    let left = (num_data - num_parameters).max(1.0);
    let is_known = curves.iter().all(|c| c.noise_sd_kpa.is_some());
    let estimated = fit.sum_of_squares / left * (num_data / independent);
    // With known noise a misfit above it still widens the intervals.
    let variance = if is_known { estimated.max(1.0) } else { estimated };
    let (log_covariance, is_determined) = covariance(&fit.jacobian, variance, CUTOFF);
    // (ln c, α) → (μ, α): dμ = μ d ln c − μ/α dα.
    let n = 2 * fit.terms.len();
    let mut map = DMatrix::identity(n, n);
    for (t, term) in fit.terms.iter().enumerate() {
        map[(2 * t, 2 * t)] = term.mu_kpa();
        map[(2 * t, 2 * t + 1)] = -term.mu_kpa() / term.alpha;
    }
    let physical = &map * &log_covariance * map.transpose();
    let t95 = t_quantile(0.05, (independent - num_parameters).max(1.0));
    let mut parameters = Vec::with_capacity(n);
    for i in 0..n {
        let (t, is_alpha) = (i / 2, i % 2 == 1);
        let held = is_alpha && fit.held == Some(t);
        let value = if is_alpha { fit.terms[t].alpha } else { fit.terms[t].mu_kpa() };
        // μ needs both of its term's unknowns.
        let identifiable = is_determined[i] && (is_alpha || fit.held == Some(t) || is_determined[i + 1]) && !held;
        let sd = identifiable.then(|| physical[(i, i)].max(0.0).sqrt());
        parameters.push(CurveParameter {
            name: format!("{}_{}", if is_alpha { "alpha" } else { "mu" }, t + 1),
            value,
            sd,
            interval_95: sd.map(|s| [value - t95 * s, value + t95 * s]),
            identifiable,
            held,
        });
    }
    let correlation = (0..n)
        .map(|a| {
            (0..n)
                .map(|b| match (parameters[a].sd, parameters[b].sd) {
                    (Some(x), Some(y)) if x > 0.0 && y > 0.0 => physical[(a, b)] / (x * y),
                    _ => 0.0,
                })
                .collect()
        })
        .collect();
    // ½ Σ c: its gradient in ln c is ½ c.
    let modulus = initial_shear_modulus_kpa(&fit.terms);
    let gradient = DMatrix::from_fn(1, n, |_, i| if i % 2 == 0 { 0.5 * fit.terms[i / 2].modulus_kpa } else { 0.0 });
    let modulus_sd = (&gradient * &log_covariance * gradient.transpose())[(0, 0)].max(0.0).sqrt();
    let matches = matches_of(&fit.terms, options.bulk_kpa, curves).unwrap_or_default();
    let smallest = curves
        .iter()
        .flat_map(|c| c.states.iter())
        .map(|s| smallest_relative_stiffness(&fit.terms, s.log_stretches()))
        .fold(f64::INFINITY, f64::min);
    CurveFit {
        num_terms: fit.terms.len(),
        neo_hookean: options.neo_hookean,
        bulk_kpa: options.bulk_kpa,
        parameters,
        correlation,
        initial_shear_modulus_kpa: Interval {
            value: modulus,
            interval_95: [modulus - t95 * modulus_sd, modulus + t95 * modulus_sd],
        },
        curves: matches,
        sum_of_squares: fit.sum_of_squares,
        chi2_per_datum: fit.sum_of_squares / left,
        smallest_stiffness: smallest,
        notes: notes(fit),
    }
}

/// What is degenerate about a fit.
fn notes(fit: &TermFit) -> Vec<String> {
    let mut notes = Vec::new();
    // ∂r/∂ln c is the term's own stress in units of the weight.
    let share: Vec<f64> = (0..fit.terms.len()).map(|t| fit.jacobian.column(2 * t).norm()).collect();
    let largest = share.iter().fold(0.0f64, |a, b| a.max(*b));
    for (t, s) in share.iter().enumerate() {
        if *s < FADED * largest {
            notes.push(format!("term {} has faded: it carries less than {FADED} of the stress", t + 1));
        }
        let alpha = fit.terms[t].alpha;
        if alpha.abs() < 0.05 {
            notes.push(format!(
                "alpha_{0} is near 0, where mu_{0} grows without limit; mu alpha is the meaningful product",
                t + 1
            ));
        }
    }
    if fit.is_at_limit {
        notes.push("an exponent stands at the end of its range or at the least distance from its neighbour".into());
    }
    if !fit.is_converged {
        notes.push("the refinement ran out of evaluations".into());
    }
    notes
}
