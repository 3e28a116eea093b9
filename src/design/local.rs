//! Local search: sequential quadratic programming in a box-shaped trust region.
//!
//! maximise minᵢ fᵢ(x) subject to cⱼ(x) ≥ 0 (from the evaluation, approached from outside), gₖ(x) ≥ 0 (geometry, never
//! violated by an iterate) and 0 ≤ x ≤ 1. The smallest component is kept smooth by its epigraph (see [`super::qp`]);
//! curvature comes from damped BFGS updates of the Lagrangian; steps are judged by the merit
//! φ = minᵢ fᵢ − ρ Σ max(0, −cⱼ). A failed evaluation or subproblem shrinks the region.

use super::qp::{Linear, Step, Subproblem, dot, solve};

/// What one evaluation yields.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LocalPoint {
    /// fᵢ: the least is maximised.
    pub components: Vec<Linear>,
    /// cⱼ ≥ 0.
    pub constraints: Vec<Linear>,
}

/// A problem for [`maximise`].
pub trait LocalProblem {
    /// Why an evaluation fails.
    type Failure;

    /// Number of variables, each in [0, 1].
    fn dimension(&self) -> usize;

    /// Which variables may move.
    fn is_free(&self, index: usize) -> bool;

    /// gₖ with gradients; cheap.
    fn margins(&self, x: &[f64]) -> Vec<Linear>;

    /// fᵢ and cⱼ with gradients; expensive.
    ///
    /// # Errors
    /// Any failure: the step is shrunk.
    fn evaluate(&self, x: &[f64]) -> Result<LocalPoint, Self::Failure>;

    /// Asked before each evaluation.
    fn is_cancelled(&self) -> bool {
        false
    }
}

/// Settings of [`maximise`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalOptions {
    /// Evaluations after the first.
    pub max_evaluations: usize,
    /// First half-width of the trust region, in units of the variables' ranges.
    pub first_radius: f64,
    /// The search ends when the region is smaller.
    pub min_radius: f64,
    /// The search ends when less than this is to be gained by the model.
    pub min_gain: f64,
    /// A constraint counts as kept from −this on.
    pub tolerance: f64,
}

impl Default for LocalOptions {
    fn default() -> Self {
        LocalOptions { max_evaluations: 30, first_radius: 0.15, min_radius: 1e-3, min_gain: 1e-5, tolerance: 1e-4 }
    }
}

/// Why a local search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LocalEnd {
    /// The model promises no further gain.
    Converged,
    /// The trust region became too small.
    SmallRegion,
    /// The evaluations were used up.
    Budget,
    /// The start violates the geometry, or its evaluation failed.
    BadStart,
    /// Stopped from outside.
    Cancelled,
}

/// Result of [`maximise`].
#[derive(Clone, Debug)]
pub struct LocalResult {
    /// The best point found that keeps all constraints, else the one with the best merit.
    pub best: Vec<f64>,
    /// minᵢ fᵢ there; −∞ where nothing was evaluated.
    pub value: f64,
    /// Σ max(0, −cⱼ) there.
    pub violation: f64,
    /// Evaluations made, the first included.
    pub num_evaluations: usize,
    /// Evaluations that failed.
    pub num_failures: usize,
    /// Why it ended.
    pub end: LocalEnd,
}

/// Largest penalty ρ.
const MAX_PENALTY: f64 = 1e4;
/// First penalty: constraints are relative margins and components logarithms, whose exchange rate is of order one.
const FIRST_PENALTY: f64 = 10.0;

fn least(components: &[Linear]) -> f64 {
    components.iter().map(|f| f.value).fold(f64::INFINITY, f64::min)
}

fn violation(constraints: &[Linear]) -> f64 {
    constraints.iter().map(|c| (-c.value).max(0.0)).sum()
}

fn is_kept(constraints: &[Linear], tolerance: f64) -> bool {
    constraints.iter().all(|c| c.value >= -tolerance)
}

struct Best {
    x: Vec<f64>,
    value: f64,
    violation: f64,
    is_kept: bool,
}

impl Best {
    fn offer(&mut self, x: &[f64], point: &LocalPoint, tolerance: f64) {
        let (value, violation) = (least(&point.components), violation(&point.constraints));
        let is_kept = is_kept(&point.constraints, tolerance);
        let is_better = match (is_kept, self.is_kept) {
            (true, false) => true,
            (false, true) => false,
            (true, true) => value > self.value,
            (false, false) => violation < self.violation || self.value == f64::NEG_INFINITY,
        };
        if is_better {
            *self = Best { x: x.to_vec(), value, violation, is_kept };
        }
    }
}

/// Maximises from `start`, which must keep the geometry margins.
pub fn maximise<P: LocalProblem>(problem: &P, start: &[f64], options: &LocalOptions) -> LocalResult {
    let n = problem.dimension();
    let mut x = start.to_vec();
    let mut best = Best { x: x.clone(), value: f64::NEG_INFINITY, violation: f64::INFINITY, is_kept: false };
    let (mut evaluations, mut failures) = (0, 0);
    let finish = |best: Best, evaluations, failures, end| LocalResult {
        best: best.x,
        value: best.value,
        violation: best.violation,
        num_evaluations: evaluations,
        num_failures: failures,
        end,
    };
    let mut margins = problem.margins(&x);
    let is_inside = x.len() == n && x.iter().all(|v| (0.0..=1.0).contains(v));
    if !is_inside || margins.iter().any(|g| !(g.value >= -1e-9 && g.is_usable(n))) {
        return finish(best, 0, 0, LocalEnd::BadStart);
    }
    if problem.is_cancelled() {
        return finish(best, 0, 0, LocalEnd::Cancelled);
    }
    evaluations += 1;
    let Some(mut point) = usable(problem.evaluate(&x), n) else {
        return finish(best, evaluations, 1, LocalEnd::BadStart);
    };
    best.offer(&x, &point, options.tolerance);
    let mut hessian: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| if i == j { 0.05 } else { 0.0 }).collect()).collect();
    let (mut radius, mut penalty) = (options.first_radius, FIRST_PENALTY);
    let mut is_first_update = true;
    let end = loop {
        if evaluations > options.max_evaluations {
            break LocalEnd::Budget;
        }
        if radius < options.min_radius {
            break LocalEnd::SmallRegion;
        }
        let bound = |sign: f64| -> Vec<f64> {
            (0..n)
                .map(|i| match (problem.is_free(i), sign > 0.0) {
                    (false, _) => 0.0,
                    (true, true) => radius.min(1.0 - x[i]),
                    (true, false) => -radius.min(x[i]),
                })
                .collect()
        };
        let (lower, upper) = (bound(-1.0), bound(1.0));
        let subproblem = Subproblem {
            hessian: &hessian,
            components: &point.components,
            constraints: &point.constraints,
            margins: &margins,
            lower: &lower,
            upper: &upper,
            penalty,
        };
        let Some(solution) = solve(&subproblem) else {
            radius *= 0.4;
            continue;
        };
        if penalty < MAX_PENALTY && is_penalty_weak(&subproblem, &solution.step, options.tolerance) {
            penalty *= 3.0;
            continue;
        }
        let Some(step) = keep_geometry(problem, &x, solution.step.clone()) else {
            radius *= 0.4;
            continue;
        };
        let merit = |least: f64, violation: f64| least - penalty * violation;
        let now = merit(least(&point.components), violation(&point.constraints));
        let model = {
            let f = point.components.iter().map(|f| f.at(&step)).fold(f64::INFINITY, f64::min);
            let c: f64 = point.constraints.iter().map(|c| (-c.at(&step)).max(0.0)).sum();
            merit(f, c) - 0.5 * dot(&step, &times(&hessian, &step))
        };
        let promised = model - now;
        let length = step.iter().fold(0.0f64, |m, s| m.max(s.abs()));
        if promised < options.min_gain {
            break LocalEnd::Converged;
        }
        if problem.is_cancelled() {
            break LocalEnd::Cancelled;
        }
        let trial: Vec<f64> = x.iter().zip(&step).map(|(x, s)| (x + s).clamp(0.0, 1.0)).collect();
        evaluations += 1;
        let Some(next) = usable(problem.evaluate(&trial), n).filter(|p| has_shape_of(p, &point)) else {
            if problem.is_cancelled() {
                break LocalEnd::Cancelled;
            }
            failures += 1;
            radius = 0.3 * length.min(radius);
            continue;
        };
        best.offer(&trial, &next, options.tolerance);
        let gained = merit(least(&next.components), violation(&next.constraints)) - now;
        let ratio = gained / promised;
        let next_margins = problem.margins(&trial);
        let change = gradient_change(&solution, (&point, &margins), (&next, &next_margins));
        update(&mut hessian, &step, &change, &mut is_first_update);
        if ratio > 0.7 && length > 0.9 * radius {
            radius = (2.0 * radius).min(0.5);
        } else if ratio < 0.25 {
            radius = 0.4 * length.min(radius);
        }
        if ratio > 0.02 {
            x = trial;
            point = next;
            margins = next_margins;
        }
    };
    finish(best, evaluations, failures, end)
}

fn usable<F>(result: Result<LocalPoint, F>, n: usize) -> Option<LocalPoint> {
    let point = result.ok()?;
    let all_usable = point.components.iter().chain(&point.constraints).all(|l| l.is_usable(n));
    (all_usable && !point.components.is_empty()).then_some(point)
}

fn has_shape_of(a: &LocalPoint, b: &LocalPoint) -> bool {
    a.components.len() == b.components.len() && a.constraints.len() == b.constraints.len()
}

/// Shortens a step until the geometry is kept; `None` where even a thousandth of it breaks it.
fn keep_geometry<P: LocalProblem>(problem: &P, x: &[f64], mut step: Vec<f64>) -> Option<Vec<f64>> {
    for _ in 0..10 {
        let trial: Vec<f64> = x.iter().zip(&step).map(|(x, s)| (x + s).clamp(0.0, 1.0)).collect();
        if problem.margins(&trial).iter().all(|g| g.value >= 0.0) {
            return Some(step);
        }
        step.iter_mut().for_each(|s| *s *= 0.5);
        // The first try is the full step; rounding of an active linear margin is mended by a hair.
        if step.iter().all(|s| s.abs() < 1e-9) {
            return None;
        }
    }
    None
}

/// Whether a much larger penalty would mend violations markedly better: it is exact only above the multipliers.
fn is_penalty_weak(subproblem: &Subproblem, step: &[f64], tolerance: f64) -> bool {
    let left_by = |step: &[f64]| subproblem.constraints.iter().map(|c| (-c.at(step)).max(0.0)).sum::<f64>();
    let (left, now) = (left_by(step), violation(subproblem.constraints));
    if left <= tolerance {
        return false;
    }
    let strict = Subproblem { penalty: MAX_PENALTY, ..*subproblem };
    solve(&strict).is_some_and(|s| {
        let least = left_by(&s.step);
        left - least > 0.1 * (now - least).max(tolerance)
    })
}

fn times(matrix: &[Vec<f64>], vector: &[f64]) -> Vec<f64> {
    matrix.iter().map(|row| dot(row, vector)).collect()
}

/// Change of the Lagrangian's gradient with the multipliers of `solution`.
fn gradient_change(solution: &Step, old: (&LocalPoint, &[Linear]), new: (&LocalPoint, &[Linear])) -> Vec<f64> {
    let mut change = vec![0.0; solution.step.len()];
    let mut add = |weights: &[f64], old: &[Linear], new: &[Linear]| {
        if old.len() != new.len() {
            return;
        }
        for ((w, a), b) in weights.iter().zip(old).zip(new) {
            for (c, (a, b)) in change.iter_mut().zip(a.gradient.iter().zip(&b.gradient)) {
                *c -= w * (b - a);
            }
        }
    };
    add(&solution.component_weights, &old.0.components, &new.0.components);
    add(&solution.constraint_weights, &old.0.constraints, &new.0.constraints);
    add(&solution.margin_weights, old.1, new.1);
    change
}

/// Powell's damped BFGS update: B stays positive definite whatever the curvature. Before the first one B is scaled to the
/// curvature seen.
fn update(hessian: &mut [Vec<f64>], step: &[f64], change: &[f64], is_first: &mut bool) {
    let (ss, sy, yy) = (dot(step, step), dot(step, change), dot(change, change));
    if ss < 1e-20 || !yy.is_finite() {
        return;
    }
    if std::mem::replace(is_first, false) && sy > 1e-12 {
        let scale = (yy / sy).clamp(1e-2, 1e3);
        for (i, row) in hessian.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                *entry = if i == j { scale } else { 0.0 };
            }
        }
    }
    let bs = times(hessian, step);
    let sbs = dot(step, &bs);
    let theta = if sy >= 0.2 * sbs { 1.0 } else { 0.8 * sbs / (sbs - sy) };
    let y: Vec<f64> = change.iter().zip(&bs).map(|(y, b)| theta * y + (1.0 - theta) * b).collect();
    let curvature = dot(step, &y);
    if curvature < 1e-16 {
        return;
    }
    for (i, row) in hessian.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            *entry += y[i] * y[j] / curvature - bs[i] * bs[j] / sbs;
        }
    }
    // Without exact curvature a floor keeps the subproblem well posed.
    for (i, row) in hessian.iter_mut().enumerate() {
        row[i] += 1e-6;
    }
}

#[cfg(test)]
#[path = "local_tests.rs"]
mod tests;
