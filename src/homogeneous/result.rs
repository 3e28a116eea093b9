//! Fits with one to N terms, the choice among them, and what is known of the parameters.

use super::curve::{Curve, CurveMatch};
use super::curve_law::{CurveLaw, LawValue, OgdenTerms};
use super::deformation::Deformation;
use super::fit::{LawFit, fit_law, fit_terms, fitted_material, matches_of, model_stress};
use super::fit_options::{CurveFitError, CurveFitOptions};
use super::selection::{Selection, compare, independent_count};
use super::statistics::t_quantile;
use crate::material::{LawKind, Material, MaterialError, ShearTerm};
use crate::optimise::covariance;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Singular values of the scaled Jacobian below this part of the largest count as none.
const CUTOFF: f64 = 1e-6;

/// A parameter and what the data say of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CurveParameter {
    /// `mu_1` (kPa), `alpha_1`, …; of a law in the first invariant `c_1`, `mu` (kPa), `j_m`, `lambda_m`.
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

/// A fit with a number of Ogden's terms, or of a law in the first invariant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CurveFit {
    /// The law in the first invariant; none with Ogden's terms.
    pub law: Option<LawKind>,
    /// Ogden's terms, the neo-Hookean one included; zero with a law in the first invariant.
    pub num_terms: usize,
    /// Whether one term is neo-Hookean (α = 2 held).
    pub neo_hookean: bool,
    /// κ, kPa; none for the incompressible limit, where homogeneous tests say nothing of it.
    pub bulk_kpa: Option<f64>,
    /// μ₁, α₁, μ₂, … largest exponent first, or those of the law.
    pub parameters: Vec<CurveParameter>,
    /// Correlation of the parameters in this order; rows of what is held or not identifiable are zero.
    pub correlation: Vec<Vec<f64>>,
    /// ½ Σ μα, or 2 W′(0) of a law in the first invariant.
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
    /// Ogden's terms; none with a law in the first invariant.
    pub fn terms(&self) -> Vec<ShearTerm> {
        if self.law.is_some() {
            return Vec::new();
        }
        self.parameters
            .chunks_exact(2)
            .map(|p| ShearTerm { modulus_kpa: p[0].value * p[1].value, alpha: p[1].value })
            .collect()
    }

    /// The fitted law.
    pub fn fitted_law(&self) -> Box<dyn CurveLaw> {
        match self.law {
            None => Box::new(OgdenTerms::free(&self.terms())),
            Some(kind) => Box::new(kind.law(&self.parameters.iter().map(|p| p.value).collect::<Vec<_>>())),
        }
    }

    /// Its stresses in some states, kPa. `None` where a state has no response.
    pub fn stress(&self, states: &[Deformation]) -> Option<Vec<f64>> {
        model_stress(self.fitted_law().as_ref(), self.bulk_kpa, states)
    }

    /// How it meets curves. `None` where a state has no response.
    pub fn matches(&self, curves: &[Curve]) -> Option<Vec<CurveMatch>> {
        matches_of(self.fitted_law().as_ref(), self.bulk_kpa, curves)
    }

    /// What the fit is called: `2 terms`, `neo-Hookean + 1`, or the name of its law.
    pub fn name(&self) -> String {
        match (self.law, self.num_terms, self.neo_hookean) {
            (Some(kind), _, _) => kind.name().into(),
            (None, 1, true) => "neo-Hookean".into(),
            (None, n, true) => format!("neo-Hookean + {}", n - 1),
            (None, 1, false) => "1 term".into(),
            (None, n, false) => format!("{n} terms"),
        }
    }

    /// Free parameters.
    pub fn num_parameters(&self) -> usize {
        self.parameters.iter().filter(|p| !p.held).count()
    }

    /// The fit as a material ([`fitted_material`]).
    ///
    /// # Errors
    /// As [`fitted_material`].
    pub fn material(&self) -> Result<Material, MaterialError> {
        fitted_material(self.fitted_law().as_ref(), self.bulk_kpa)
    }
}

/// Fits of one family: 1 to N of Ogden's terms (with or without a neo-Hookean one), or a law in the first invariant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CurveFitSequence {
    /// The law in the first invariant; none with Ogden's terms.
    pub law: Option<LawKind>,
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

/// Fits to all curves together, and the choice among them: of 1 to `options.max_terms` of Ogden's terms, or of the law
/// in the first invariant that the options name.
///
/// A number of terms for which the data are too few, or no stable material is found, ends the sequence; the first must
/// exist.
///
/// # Errors
/// [`CurveFitError`].
pub fn fit_curves(curves: &[Curve], options: &CurveFitOptions) -> Result<CurveFitSequence, CurveFitError> {
    if let Some(kind) = options.law {
        return Ok(sequence(curves, &[fit_law(curves, kind, options)?], options));
    }
    let mut found = vec![fit_terms(curves, 1, options)?];
    for num_terms in 2..=options.max_terms {
        match fit_terms(curves, num_terms, options) {
            Ok(fit) => found.push(fit),
            Err(CurveFitError::TooFewData { .. } | CurveFitError::NoFit { .. }) => break,
            Err(other) => return Err(other),
        }
    }
    Ok(sequence(curves, &found, options))
}

/// What is said of fits, the simplest first.
fn sequence<L: CurveLaw>(curves: &[Curve], found: &[LawFit<L>], options: &CurveFitOptions) -> CurveFitSequence {
    let fits: Vec<CurveFit> = found.iter().map(|f| describe(curves, f, options)).collect();
    let num_data: usize = curves.iter().map(|c| c.states.len()).sum();
    let independent = independent_of_best(curves, found.iter().map(|f| (f.residual.as_slice(), f.num_parameters())));
    let models: Vec<(String, usize, f64)> =
        fits.iter().map(|f| (f.name(), f.num_parameters(), f.sum_of_squares)).collect();
    let selection = compare(&models, num_data, independent);
    CurveFitSequence { law: options.law, neo_hookean: options.neo_hookean, fits, selection }
}

/// How many independent data the curves are worth to models with these residuals and numbers of parameters: the
/// correlation that counts is that of the residuals that the best of them cannot remove.
pub(super) fn independent_of_best<'a>(curves: &[Curve], models: impl Iterator<Item = (&'a [f64], usize)>) -> f64 {
    let num_data: usize = curves.iter().map(|c| c.states.len()).sum();
    let squares = |residual: &[f64]| residual.iter().map(|r| r * r).sum::<f64>();
    let (mut best, mut richest): (Option<&[f64]>, usize) = (None, 0);
    for (residual, num_parameters) in models {
        richest = richest.max(num_parameters);
        if best.is_none_or(|b| squares(residual) < squares(b)) {
            best = Some(residual);
        }
    }
    best.map_or(num_data as f64, |residual| independent_count(&by_curve(curves, residual), richest as f64 + 2.0))
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
fn describe<L: CurveLaw>(curves: &[Curve], fit: &LawFit<L>, options: &CurveFitOptions) -> CurveFit {
    let law = &fit.law;
    let num_data = fit.residual.len() as f64;
    let num_parameters = fit.num_parameters() as f64;
    let independent = independent_count(&by_curve(curves, fit.residual.as_slice()), num_parameters + 2.0);
    // Correlated residuals are worth fewer data: the variance of the parameters grows by as much.
    let left = (num_data - num_parameters).max(1.0);
    let is_known = curves.iter().all(|c| c.noise_sd_kpa.is_some());
    let estimated = fit.sum_of_squares / left * (num_data / independent);
    // With known noise a misfit above it still widens the intervals.
    let variance = if is_known { estimated.max(1.0) } else { estimated };
    let (covariance_of_unknowns, is_determined) = covariance(&fit.jacobian, variance, CUTOFF);
    let map = law.parameter_map();
    let physical = &map * &covariance_of_unknowns * map.transpose();
    let t95 = t_quantile(0.05, (independent - num_parameters).max(1.0));
    let values = law.parameters();
    let n = values.len();
    // A parameter needs all unknowns that it depends on, but for those that are held.
    let is_known_by_data = |i: usize| (0..n).all(|u| map[(i, u)] == 0.0 || is_determined[u] || values[u].held);
    let describe_value = |(i, p): (usize, &LawValue)| {
        let identifiable = !p.held && is_known_by_data(i);
        let sd = identifiable.then(|| physical[(i, i)].max(0.0).sqrt());
        CurveParameter {
            name: p.name.clone(),
            value: p.value,
            sd,
            interval_95: sd.map(|s| [p.value - t95 * s, p.value + t95 * s]),
            identifiable,
            held: p.held,
        }
    };
    let parameters: Vec<CurveParameter> = values.iter().enumerate().map(describe_value).collect();
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
    let modulus = law.initial_shear_modulus_kpa();
    let gradient = DMatrix::from_row_slice(1, n, &law.modulus_gradient());
    let modulus_sd = (&gradient * &covariance_of_unknowns * gradient.transpose())[(0, 0)].max(0.0).sqrt();
    let smallest = curves
        .iter()
        .flat_map(|c| c.states.iter())
        .map(|s| law.smallest_relative_stiffness(s.log_stretches()))
        .fold(f64::INFINITY, f64::min);
    let mut notes = law.notes(&fit.jacobian, fit.is_at_limit);
    if !fit.is_converged {
        notes.push("the refinement ran out of evaluations".into());
    }
    CurveFit {
        law: options.law,
        num_terms: if options.law.is_some() { 0 } else { n / 2 },
        neo_hookean: options.neo_hookean,
        bulk_kpa: options.bulk_kpa,
        parameters,
        correlation,
        initial_shear_modulus_kpa: Interval {
            value: modulus,
            interval_95: [modulus - t95 * modulus_sd, modulus + t95 * modulus_sd],
        },
        curves: matches_of(law, options.bulk_kpa, curves).unwrap_or_default(),
        sum_of_squares: fit.sum_of_squares,
        chi2_per_datum: fit.sum_of_squares / left,
        smallest_stiffness: smallest,
        notes,
    }
}
