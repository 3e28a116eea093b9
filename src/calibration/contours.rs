//! ℓ_u, ℓ_F and ℓ around an estimate over pairs of κ, μ₁ and α₁ (the paper's figure 8).

use super::error::CalibrationError;
use super::problem::CalibrationProblem;
use super::recording_fit::RecordingFit;
use crate::fem::{Equilibrium, SolveOptions};
use crate::material::{Material, Parameter};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How far to go and how fine.
#[derive(Clone, Copy, Debug)]
pub struct ContourOptions {
    /// Values per axis, at least 2; odd numbers hold the estimate itself.
    pub num_values: usize,
    /// κ runs from the estimate over this to the estimate times this, in equal ratios.
    pub bulk_factor: f64,
    /// μ₁ runs by this fraction to both sides.
    pub mu_range: f64,
    /// α₁ likewise.
    pub alpha_range: f64,
    /// β of the total.
    pub beta: f64,
}

impl Default for ContourOptions {
    fn default() -> Self {
        ContourOptions { num_values: 9, bulk_factor: 4.0, mu_range: 0.1, alpha_range: 0.3, beta: super::PAPER_BETA }
    }
}

/// The three losses over two parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Contour {
    /// Names of the horizontal and the vertical parameter.
    pub parameters: [String; 2],
    /// Values along each.
    pub values: [Vec<f64>; 2],
    /// ℓ_u, the first parameter fastest; null where there is no equilibrium.
    pub loss_u: Vec<Option<f64>>,
    /// ℓ_F likewise.
    pub loss_f: Vec<Option<f64>>,
    /// ℓ_u + βℓ_F.
    pub total: Vec<Option<f64>>,
}

/// Computes the three pairs (κ, μ₁), (κ, α₁), (μ₁, α₁) (of a law its first two parameters), other parameters staying at
/// the estimate.
///
/// # Errors
/// [`CalibrationError`].
pub fn contours(
    problem: &mut CalibrationProblem,
    fit: &RecordingFit,
    options: &ContourOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Contour>, CalibrationError> {
    problem.refuse_unlike_samples("contours of the losses")?;
    let n = options.num_values.max(2);
    let part = |i: usize| 2.0 * i as f64 / (n - 1) as f64 - 1.0;
    let values = |parameter: Parameter| -> Vec<f64> {
        let at = fit.material.value(parameter);
        (0..n)
            .map(|i| match parameter {
                Parameter::Kappa => at * options.bulk_factor.powf(part(i)),
                _ if parameter.is_modulus() => at * (1.0 + options.mu_range * part(i)),
                _ => at * (1.0 + options.alpha_range * part(i)),
            })
            .collect()
    };
    // κ, and the first two of the others.
    let parameters = fit.material.parameters();
    let (first, second) = (parameters[1], parameters[2]);
    let pairs = [[Parameter::Kappa, first], [Parameter::Kappa, second], [first, second]];
    let mut all = Vec::new();
    for pair in pairs {
        let axes = pair.map(values);
        let mut losses = vec![None; n * n];
        let mut near: Vec<Vec<Equilibrium>> = fit.predictions.iter().map(|p| p.states.clone()).collect();
        for j in 0..n {
            for step in 0..n {
                // There and back again, so that neighbours are solved one after the other.
                let i = if j % 2 == 0 { step } else { n - 1 - step };
                let mut material = fit.material.clone();
                material.set(pair[0], axes[0][i]);
                material.set(pair[1], axes[1][j]);
                losses[i + n * j] = match losses_at(problem, &material, &mut near, is_cancelled) {
                    Ok(found) => Some(found),
                    Err(e) if e.is_of_the_data() => None,
                    Err(e) => return Err(e),
                };
            }
        }
        all.push(Contour {
            parameters: pair.map(Parameter::name),
            values: axes,
            loss_u: losses.iter().map(|l| l.map(|l| l[0])).collect(),
            loss_f: losses.iter().map(|l| l.map(|l| l[1])).collect(),
            total: losses.iter().map(|l| l.map(|l| l[0] + options.beta * l[1])).collect(),
        });
    }
    Ok(all)
}

/// ℓ_u and ℓ_F of a material; `near` is replaced by its equilibria.
pub(super) fn losses_at(
    problem: &mut CalibrationProblem,
    material: &Material,
    near: &mut [Vec<Equilibrium>],
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<[f64; 2], CalibrationError> {
    let (observed, models, views) = problem.parts();
    let (mut loss_u, mut loss_f) = ([0.0, 0.0], [0.0, 0.0]);
    for (((recording, model), view), states) in observed.iter().zip(models).zip(views).zip(near) {
        for (step, state) in recording.steps.iter().zip(states) {
            *state =
                model.own_mut().solve(material, step.drive_mm, Some(state), &SolveOptions::trial(), is_cancelled)?;
            let (mut sum, mut largest, mut count) = (0.0, 0.0f64, 0.0);
            for (u, m) in view.average(&state.displacement)?.iter().zip(&step.displacement) {
                if m.iter().all(|x| x.is_finite()) {
                    sum += (0..3).map(|c| (m[c] - u[c]).powi(2)).sum::<f64>();
                    largest = largest.max(m.iter().map(|x| x * x).sum());
                    count += 1.0;
                }
            }
            loss_u = [loss_u[0] + sum / (count * largest), loss_u[1] + 1.0];
            if let Some(force) = step.force {
                loss_f = [loss_f[0] + (1.0 - state.force_n / force.value_n).powi(2), loss_f[1] + 1.0];
            }
        }
    }
    Ok([loss_u, loss_f].map(|[sum, count]| if count > 0.0 { sum / count } else { 0.0 }))
}
