//! Profile likelihood: what the objective loses when one parameter is held off its optimum and all others follow.

use super::error::CalibrationError;
use super::interval::TWO_SIDED_95;
use super::options::FitOptions;
use super::problem::CalibrationProblem;
use super::recording_fit::RecordingFit;
use crate::fem::side_by_side;
use crate::material::{Material, Parameter};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Distances from the optimum, in standard deviations.
const PLACES: [f64; 6] = [-3.0, -2.0, -1.0, 1.0, 2.0, 3.0];
/// How near the other parameters come to their optimum, in standard deviations: the increase is wrong by its square.
const TOLERANCE: f64 = 0.05;
/// 95 % point: one-sided bounds.
pub const ONE_SIDED_95: f64 = 1.644_854;
/// Most halvings of κ on the way to its bound.
const MAX_HALVINGS: usize = 8;

/// The profile of one parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// `kappa`, `mu_1`, …
    pub parameter: String,
    /// Values at which it was held; the optimum is in the middle.
    pub values: Vec<f64>,
    /// Increase of χ² at each, over the misfit per datum where that is more than noise.
    pub chi2_increase: Vec<f64>,
    /// Where the increase passes 1.96²; null on a side that was not reached.
    pub interval_95: [Option<f64>; 2],
}

/// Refits from `start` with one parameter (`index` in κ, μ₁, α₁, …) held where it is.
fn held(
    problem: &CalibrationProblem,
    fit: &RecordingFit,
    index: usize,
    start: &Material,
    options: &FitOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<RecordingFit, CalibrationError> {
    problem.fit(start, Some(fit), &FitOptions { held: options.held.with(index), ..*options }, is_cancelled)
}

/// The material of `fit` with one parameter at `value`.
fn with_value(fit: &RecordingFit, index: usize, value: f64) -> Material {
    let mut moved = fit.material.clone();
    moved.set(moved.parameters()[index], value);
    moved
}

/// The same with the other parameters where the linear model has them then.
fn along_linear_model(fit: &RecordingFit, index: usize, value: f64) -> Material {
    let mut moved = with_value(fit, index, value);
    let parameters = moved.parameters();
    let change = value - fit.material.value(parameters[index]);
    let covariance = fit.information.covariance();
    let Some(variance) = covariance.covariance(index, index) else { return moved };
    for (other, &parameter) in parameters.iter().enumerate() {
        let Some(shared) = covariance.covariance(other, index) else { continue };
        if other == index || fit.held.contains(other) {
            continue;
        }
        let (at, shift) = (fit.material.value(parameter), change * shared / variance);
        // What keeps its sign moves in its logarithm.
        let keeps_its_sign = parameter.is_modulus() && !parameter.has_any_sign();
        moved.set(parameter, if keeps_its_sign { at * (shift / at).exp() } else { at + shift });
    }
    moved
}

/// The increase of the objective in units in which one sandwich standard deviation is one.
fn increase(fit: &RecordingFit, held: &RecordingFit, index: usize) -> f64 {
    let last = |f: &RecordingFit| f.history.last().copied().unwrap_or(f64::NAN);
    (last(held) - last(fit)).max(0.0) / fit.objective_per_variance(index)
}

/// Profiles every parameter that was fitted and that the data determine.
///
/// # Errors
/// [`CalibrationError`]; places without an equilibrium are left out.
pub fn profile(
    problem: &CalibrationProblem,
    fit: &RecordingFit,
    options: &FitOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Profile>, CalibrationError> {
    let profiled: Vec<(usize, Parameter, f64)> = fit
        .material
        .parameters()
        .into_iter()
        .enumerate()
        .filter_map(|(index, parameter)| Some((index, parameter, fit.sd(parameter)?)))
        // Beyond half of its value a parameter is not told by a parabola; κ has its own bound.
        .filter(|&(_, parameter, sd)| sd <= 0.5 * fit.material.value(parameter).abs())
        .collect();
    let places: Vec<(usize, f64)> = profiled
        .iter()
        .flat_map(|&(index, parameter, sd)| PLACES.map(|place| (index, fit.material.value(parameter) + place * sd)))
        .collect();
    let options = FitOptions { tolerance: options.tolerance.max(TOLERANCE), ..*options };
    let mut found = side_by_side(places, |(index, value)| {
        // Along a curved valley the linear model may lead nowhere.
        let near = held(problem, fit, index, &along_linear_model(fit, index, value), &options, is_cancelled);
        match near.or_else(|_| held(problem, fit, index, &with_value(fit, index, value), &options, is_cancelled)) {
            Ok(held) => Ok(held.is_converged.then(|| (value, increase(fit, &held, index)))),
            Err(e) if e.is_of_the_data() => Ok(None),
            Err(e) => Err(e),
        }
    })
    .into_iter();
    let mut profiles = Vec::new();
    for (_, parameter, _) in profiled {
        let optimum = fit.material.value(parameter);
        let solved = found.by_ref().take(PLACES.len()).collect::<Result<Vec<_>, _>>()?;
        let mut points = vec![(optimum, 0.0)];
        points.extend(solved.into_iter().flatten());
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        // The signed root is nearly straight: interpolate it.
        let roots: Vec<(f64, f64)> = points.iter().map(|(v, d)| (*v, d.sqrt() * (v - optimum).signum())).collect();
        let crossing = |level: f64| {
            roots.windows(2).find_map(|w| {
                let ((a, ra), (b, rb)) = (w[0], w[1]);
                ((ra - level) * (rb - level) <= 0.0 && rb > ra).then(|| a + (b - a) * (level - ra) / (rb - ra))
            })
        };
        profiles.push(Profile {
            parameter: parameter.name(),
            values: points.iter().map(|p| p.0).collect(),
            chi2_increase: points.iter().map(|p| p.1).collect(),
            interval_95: [crossing(-TWO_SIDED_95), crossing(TWO_SIDED_95)],
        });
    }
    Ok(profiles)
}

/// The κ (kPa) below which the data exclude it at 95 %; none where no κ that the elements bear is excluded.
///
/// # Errors
/// [`CalibrationError`].
pub fn bulk_lower_bound_kpa(
    problem: &CalibrationProblem,
    fit: &RecordingFit,
    options: &FitOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Option<f64>, CalibrationError> {
    let level = ONE_SIDED_95 * ONE_SIDED_95;
    let root = |held: &RecordingFit| {
        let last = |f: &RecordingFit| f.history.last().copied().unwrap_or(f64::NAN);
        ((last(held) - last(fit)).max(0.0) / fit.misfit_factor / level).sqrt()
    };
    let optimum = fit.material.value(Parameter::Kappa);
    let (mut high, mut root_high) = (optimum.ln(), 0.0);
    let mut near = fit.clone();
    for _ in 0..MAX_HALVINGS {
        let low = high - std::f64::consts::LN_2;
        let held = match held(problem, &near, 0, &with_value(&near, 0, low.exp()), options, is_cancelled) {
            Ok(held) if held.is_converged => held,
            Ok(_) => return Ok(None),
            Err(e) if e.is_of_the_data() => return Ok(None),
            Err(e) => return Err(e),
        };
        let root_low = root(&held);
        if root_low >= 1.0 {
            // The misfit goes as 1/κ − 1/κ₀: straight in 1/κ.
            let (a, b) = ((-high).exp(), (-low).exp());
            return Ok(Some(1.0 / (a + (b - a) * (1.0 - root_high) / (root_low - root_high))));
        }
        (high, root_high, near) = (low, root_low, held);
    }
    Ok(None)
}
