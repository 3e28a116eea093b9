//! ℓ_u, ℓ_F and ℓ around an estimate over pairs of κ, μ₁ and α₁ (the paper's figure 8).

use super::error::CalibrationError;
use super::observed::Observed;
use super::patch::{Losses, Patch};
use super::prediction::Prediction;
use super::problem::CalibrationProblem;
use super::recording_fit::RecordingFit;
use crate::fem::{Equilibrium, SolveOptions, side_by_side};
use crate::material::{Material, Parameter};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How far to go and how fine.
#[derive(Clone, Copy, Debug)]
pub struct ContourOptions {
    /// Values per axis, at least 2; odd numbers hold the estimate itself.
    pub num_values: usize,
    /// The same where every place has to be solved.
    pub num_values_solved: usize,
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
        ContourOptions {
            num_values: 25,
            num_values_solved: 9,
            bulk_factor: 4.0,
            mu_range: 0.1,
            alpha_range: 0.3,
            beta: super::PAPER_BETA,
        }
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

/// A parameter and how far the contours go in it; places are told by a part from −1 to 1.
struct Axis {
    /// Its place in the order of [`Material::parameters`].
    index: usize,
    parameter: Parameter,
    at: f64,
    options: ContourOptions,
}

impl Axis {
    fn of(fit: &RecordingFit, index: usize, options: &ContourOptions) -> Axis {
        let parameter = fit.material.parameters()[index];
        Axis { index, parameter, at: fit.material.value(parameter), options: *options }
    }

    fn value(&self, part: f64) -> f64 {
        match self.parameter {
            Parameter::Kappa => self.at * self.options.bulk_factor.powf(part),
            p if p.is_modulus() => self.at * (1.0 + self.options.mu_range * part),
            _ => self.at * (1.0 + self.options.alpha_range * part),
        }
    }

    /// How the value changes with the part.
    fn slope(&self, part: f64) -> f64 {
        match self.parameter {
            Parameter::Kappa => self.value(part) * self.options.bulk_factor.ln(),
            p if p.is_modulus() => self.at * self.options.mu_range,
            _ => self.at * self.options.alpha_range,
        }
    }
}

/// The parts of so many places along an axis.
fn parts(num_values: usize) -> Vec<f64> {
    let n = num_values.max(2);
    (0..n).map(|i| 2.0 * i as f64 / (n - 1) as f64 - 1.0).collect()
}

/// `material` at a place over two axes.
fn moved(material: &Material, axes: [&Axis; 2], parts: [f64; 2]) -> Material {
    let mut moved = material.clone();
    for (axis, part) in axes.into_iter().zip(parts) {
        moved.set(axis.parameter, axis.value(part));
    }
    moved
}

/// The parts at both ends of an axis.
const SIDES: [f64; 2] = [-1.0, 1.0];
/// The pairs of axes.
const PAIRS: [[usize; 2]; 3] = [[0, 1], [0, 2], [1, 2]];

/// What a material predicts; none where it has no equilibrium.
type Solved = Option<Vec<Prediction>>;

/// Computes the three pairs (κ, μ₁), (κ, α₁), (μ₁, α₁) (of a law its first two parameters), other parameters staying at
/// the estimate.
///
/// What a material predicts is smooth in its parameters: it is solved, with its derivatives, at the estimate and at the
/// ends and the corners of each pair, and is a polynomial in between (`calibration::patch`). A pair that has an end or
/// a corner without an equilibrium, or that polynomials do not follow, is solved place by place.
///
/// # Errors
/// [`CalibrationError`].
pub fn contours(
    problem: &CalibrationProblem,
    fit: &RecordingFit,
    options: &ContourOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Contour>, CalibrationError> {
    problem.refuse_unlike_samples("contours of the losses")?;
    // κ, and the first two of the others.
    let axes = [0, 1, 2].map(|index| Axis::of(fit, index, options));
    let solved = |(material, near): (Material, &[Prediction])| -> Result<Solved, CalibrationError> {
        match problem.predict(&material, Some(near), &SolveOptions::trial(), is_cancelled) {
            Ok(found) => Ok(Some(found)),
            Err(e) if e.is_of_the_data() => Ok(None),
            Err(e) => Err(e),
        }
    };
    let ends = axes.iter().flat_map(|axis| SIDES.map(|part| moved(&fit.material, [axis, axis], [part; 2])));
    let ends = side_by_side(ends.map(|material| (material, &fit.predictions[..])).collect(), solved);
    let ends = ends.into_iter().collect::<Result<Vec<Solved>, _>>()?;
    let corners = PAIRS.iter().flat_map(|&pair| [0, 1, 2, 3].map(|corner| (pair, [corner / 2, corner % 2])));
    let corners = side_by_side(corners.collect(), |([first, second], [i, j]): ([usize; 2], [usize; 2])| {
        let Some(near) = &ends[2 * first + i] else { return Ok(None) };
        solved((moved(&fit.material, [&axes[first], &axes[second]], [SIDES[i], SIDES[j]]), near))
    });
    let corners = corners.into_iter().collect::<Result<Vec<Solved>, _>>()?;
    let mut all = Vec::new();
    for ([first, second], corners) in PAIRS.into_iter().zip(corners.chunks(4)) {
        let pair = [&axes[first], &axes[second]];
        let mut places: Vec<([f64; 2], &Solved)> = Vec::new();
        for (i, x) in SIDES.into_iter().enumerate() {
            places.push(([x, 0.0], &ends[2 * first + i]));
            places.push(([0.0, x], &ends[2 * second + i]));
            places.extend(SIDES.into_iter().enumerate().map(|(j, y)| ([x, y], &corners[2 * i + j])));
        }
        let (parts, losses) = match polynomials(problem.observed(), fit, pair, &places) {
            Some(losses) => {
                let parts = parts(options.num_values);
                let places = parts.iter().flat_map(|&y| parts.iter().map(move |&x| [x, y]));
                let losses: Vec<Option<[f64; 2]>> = places.map(|place| Some(losses.at(place))).collect();
                (parts, losses)
            }
            None => {
                let parts = parts(options.num_values_solved);
                let losses = place_by_place(problem, fit, pair, &parts, is_cancelled)?;
                (parts, losses)
            }
        };
        let total = |[u, f]: [f64; 2]| u + options.beta * f;
        all.push(Contour {
            parameters: pair.map(|axis| axis.parameter.name()),
            values: pair.map(|axis| parts.iter().map(|&part| axis.value(part)).collect()),
            loss_u: losses.iter().map(|l| l.map(|l| l[0])).collect(),
            loss_f: losses.iter().map(|l| l.map(|l| l[1])).collect(),
            total: losses.iter().map(|l| l.map(total)).collect(),
        });
    }
    Ok(all)
}

/// The losses over two axes from what was solved at places around the estimate; none where a place has no equilibrium
/// or polynomials do not follow.
fn polynomials(
    observed: &[Observed],
    fit: &RecordingFit,
    axes: [&Axis; 2],
    places: &[([f64; 2], &Solved)],
) -> Option<Losses> {
    let mut patch = Patch::new(observed, &fit.predictions);
    let slopes = |parts: [f64; 2]| [0, 1].map(|a| (axes[a].index, axes[a].slope(parts[a])));
    patch.add([0.0; 2], &fit.predictions, slopes([0.0; 2]));
    for (parts, solved) in places {
        patch.add(*parts, solved.as_ref()?, slopes(*parts));
    }
    patch.losses()
}

/// The losses at `parts` of two axes, the first fastest, each place solved from its neighbour.
fn place_by_place(
    problem: &CalibrationProblem,
    fit: &RecordingFit,
    axes: [&Axis; 2],
    parts: &[f64],
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Option<[f64; 2]>>, CalibrationError> {
    let n = parts.len();
    let mut losses = vec![None; n * n];
    let mut near: Vec<Vec<Equilibrium>> = fit.predictions.iter().map(|p| p.states.clone()).collect();
    for (j, &second) in parts.iter().enumerate() {
        for step in 0..n {
            // There and back again, so that neighbours are solved one after the other.
            let i = if j % 2 == 0 { step } else { n - 1 - step };
            let material = moved(&fit.material, axes, [parts[i], second]);
            losses[i + n * j] = match losses_at(problem, &material, &mut near, is_cancelled) {
                Ok(found) => Some(found),
                Err(e) if e.is_of_the_data() => None,
                Err(e) => return Err(e),
            };
        }
    }
    Ok(losses)
}

/// ℓ_u and ℓ_F of a material; `near` is replaced by its equilibria.
fn losses_at(
    problem: &CalibrationProblem,
    material: &Material,
    near: &mut [Vec<Equilibrium>],
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<[f64; 2], CalibrationError> {
    let (observed, models, views) = problem.parts();
    let (mut loss_u, mut loss_f) = ([0.0, 0.0], [0.0, 0.0]);
    for (((recording, model), view), states) in observed.iter().zip(models).zip(views).zip(near) {
        for (step, state) in recording.steps.iter().zip(states) {
            let near = Some(&*state);
            *state =
                model.with(|model| model.solve(material, step.drive_mm, near, &SolveOptions::trial(), is_cancelled))?;
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

#[cfg(test)]
#[path = "contours_tests.rs"]
mod tests;
