//! Local improvement: sequential quadratic programming in a trust region.
//!
//! Maximise t − ½ δᵀ B δ − ρ Σ slack over the step δ (scaled variables), with t below every linearised gain (or equal
//! to their weighted mean), the linearised geometry margins kept exactly, the response margins up to a penalised slack,
//! bounds and ‖δ‖∞ ≤ Δ. B is a damped BFGS approximation of the curvature of the Lagrangian. Every iterate keeps the
//! geometry limits: a step that breaks one is shortened. A failed evaluation shortens the step as well.

use crate::optimise::{LinearLimit, Precision, QuadraticProgramme, SolverStatus};
use nalgebra::{DMatrix, DVector};

/// Values and gradients at a point. Gradients are per unit of the scaled variables.
#[derive(Clone, Debug)]
pub struct LocalModel {
    /// Gains; the objective is their minimum (`weights` empty) or weighted mean.
    pub gains: Vec<f64>,
    /// Weights of a mean; empty for the minimum.
    pub weights: Vec<f64>,
    /// Response margins, to be ≥ 0.
    pub margins: Vec<f64>,
    /// `[gain][variable]`.
    pub gain_gradients: Vec<Vec<f64>>,
    /// `[margin][variable]`.
    pub margin_gradients: Vec<Vec<f64>>,
}

impl LocalModel {
    /// What is not finite counts as a failed evaluation: a minimum would pass over a NaN.
    fn is_finite(&self) -> bool {
        let rows = self.gain_gradients.iter().chain(&self.margin_gradients).flatten();
        self.gains.iter().chain(&self.margins).chain(rows).all(|v| v.is_finite())
    }

    fn objective(&self) -> f64 {
        if self.weights.is_empty() {
            self.gains.iter().copied().fold(f64::INFINITY, f64::min)
        } else {
            self.gains.iter().zip(&self.weights).map(|(g, w)| g * w).sum()
        }
    }

    /// Objective less the penalty on broken response margins.
    pub fn merit(&self) -> f64 {
        self.objective() - PENALTY * self.margins.iter().map(|m| (-m).max(0.0)).sum::<f64>()
    }
}

/// Weight of a broken response margin (both are logarithms of ratios).
const PENALTY: f64 = 10.0;

/// Curvature of the unknowns in which the programme is linear: enough for it to be strictly convex, too little to be
/// felt.
const LINEAR_CURVATURE: f64 = 1e-9;
/// Iterations of the interior point. What it has by then is a step that the evaluation judges.
const MAX_ITERATIONS: u32 = 80;

/// The problem that [`improve`] works on.
pub trait LocalProblem {
    /// Values and gradients at `x`; `None` where the evaluation fails.
    fn model(&self, x: &[f64]) -> Option<LocalModel>;
    /// Geometry margins at `x` (≥ 0 where they are kept): cheap, called often.
    fn geometry(&self, x: &[f64]) -> Vec<f64>;
    /// Variables that may move.
    fn is_free(&self, index: usize) -> bool;
}

/// Settings of [`improve`].
#[derive(Clone, Copy, Debug)]
pub struct LocalSettings {
    /// Evaluations.
    pub max_evaluations: usize,
    /// First trust region, in scaled variables.
    pub radius: f64,
    /// Trust region at which to stop.
    pub smallest_radius: f64,
}

impl Default for LocalSettings {
    fn default() -> Self {
        LocalSettings { max_evaluations: 12, radius: 0.15, smallest_radius: 2e-3 }
    }
}

/// Result of [`improve`].
#[derive(Clone, Debug)]
pub struct Improved {
    /// Best point.
    pub x: Vec<f64>,
    /// Its merit.
    pub merit: f64,
    /// Merit after each evaluation.
    pub history: Vec<f64>,
}

/// Improves `start`, which must keep the geometry limits. `None` where it cannot be evaluated.
pub fn improve(problem: &dyn LocalProblem, start: &[f64], settings: &LocalSettings) -> Option<Improved> {
    let n = start.len();
    let mut x = start.to_vec();
    let mut model = problem.model(&x).filter(LocalModel::is_finite)?;
    let mut merit = model.merit();
    let mut history = vec![merit];
    let mut hessian = DMatrix::<f64>::identity(n, n) * 0.1;
    let mut radius = settings.radius;
    while history.len() < settings.max_evaluations && radius > settings.smallest_radius {
        let Some((mut step, multipliers)) = subproblem(problem, &x, &model, &hessian, radius) else {
            radius *= 0.5;
            continue;
        };
        let mut candidate = moved(&x, &step);
        let mut shortenings = 0;
        while problem.geometry(&candidate).iter().any(|m| *m < 0.0) && shortenings < 12 {
            step *= 0.7;
            candidate = moved(&x, &step);
            shortenings += 1;
        }
        let length = step.amax();
        if length < settings.smallest_radius || problem.geometry(&candidate).iter().any(|m| *m < 0.0) {
            radius = (0.5 * radius).min(length);
            continue;
        }
        let Some(next) = problem.model(&candidate).filter(LocalModel::is_finite) else {
            history.push(merit);
            radius = 0.5 * length;
            continue;
        };
        let gain = next.merit() - merit;
        // The curvature along the step, whether it is taken or not.
        let change = lagrangian_gradient(&model, &multipliers) - lagrangian_gradient(&next, &multipliers);
        update_hessian(&mut hessian, &step, &change);
        if gain > 0.0 {
            radius = if gain > 1e-3 { (1.5 * radius).min(0.4) } else { radius };
            x = candidate;
            merit = next.merit();
            model = next;
        } else {
            radius = 0.4 * length;
        }
        history.push(merit);
    }
    Some(Improved { x, merit, history })
}

/// A step within the bounds. What an interior-point solution leaves of the way to a bound is taken: a drive of 7 mm,
/// not of 6.999999.
fn moved(x: &[f64], step: &DVector<f64>) -> Vec<f64> {
    const AT_BOUND: f64 = 1e-6;
    let snapped = |v: f64| {
        if v < AT_BOUND {
            0.0
        } else if v > 1.0 - AT_BOUND {
            1.0
        } else {
            v
        }
    };
    x.iter().zip(step.iter()).map(|(a, d)| snapped(a + d)).collect()
}

/// Gradient of Σ multiplier × value over gains and margins.
fn lagrangian_gradient(model: &LocalModel, multipliers: &[f64]) -> DVector<f64> {
    let n = model.gain_gradients.first().map_or(0, Vec::len);
    let mut sum = DVector::zeros(n);
    for (row, weight) in model.gain_gradients.iter().chain(&model.margin_gradients).zip(multipliers) {
        for (s, g) in sum.iter_mut().zip(row) {
            *s += weight * g;
        }
    }
    sum
}

/// Damped BFGS (Powell): keeps B positive definite.
fn update_hessian(hessian: &mut DMatrix<f64>, step: &DVector<f64>, change: &DVector<f64>) {
    let bs = &*hessian * step;
    let sbs = step.dot(&bs);
    if !(sbs > 1e-14) {
        return;
    }
    let sy = step.dot(change);
    let theta = if sy >= 0.2 * sbs { 1.0 } else { 0.8 * sbs / (sbs - sy) };
    let y = change * theta + &bs * (1.0 - theta);
    let ys = step.dot(&y);
    if ys > 1e-14 {
        *hessian += &y * y.transpose() / ys - &bs * bs.transpose() / sbs;
    }
}

/// The step, and the multipliers of gains and margins; `None` where Clarabel has no usable answer.
fn subproblem(
    problem: &dyn LocalProblem,
    x: &[f64],
    model: &LocalModel,
    hessian: &DMatrix<f64>,
    radius: f64,
) -> Option<(DVector<f64>, Vec<f64>)> {
    let n = x.len();
    let (num_gains, num_margins) = (model.gains.len(), model.margins.len());
    let is_minimum = model.weights.is_empty();
    // Unknowns: δ (n), t, slack per margin.
    let size = n + 1 + num_margins;
    let mut slope = vec![0.0; size];
    slope[n] = -1.0;
    slope[n + 1..].fill(PENALTY);
    let mut limits: Vec<LinearLimit> = Vec::new();
    let mut limit = |coefficients: Vec<(usize, f64)>, bound: f64| limits.push(LinearLimit { coefficients, bound });
    let gradient_row = |g: &[f64]| g.iter().enumerate().map(|(i, v)| (i, -v)).collect::<Vec<_>>();
    if is_minimum {
        for (value, g) in model.gains.iter().zip(&model.gain_gradients) {
            let mut row = gradient_row(g);
            row.push((n, 1.0));
            limit(row, *value);
        }
    } else {
        let mut mean = vec![0.0; n];
        for (g, w) in model.gain_gradients.iter().zip(&model.weights) {
            for (m, v) in mean.iter_mut().zip(g) {
                *m += w * v;
            }
        }
        let mut row = gradient_row(&mean);
        row.push((n, 1.0));
        limit(row, model.objective());
    }
    for (m, (value, g)) in model.margins.iter().zip(&model.margin_gradients).enumerate() {
        let mut row = gradient_row(g);
        row.push((n + 1 + m, -1.0));
        limit(row, *value);
        limit(vec![(n + 1 + m, -1.0)], 0.0);
    }
    for (value, g) in problem.geometry(x).iter().zip(geometry_gradient(problem, x)) {
        limit(gradient_row(&g), *value);
    }
    for (i, xi) in x.iter().enumerate() {
        let reach = if problem.is_free(i) { radius } else { 0.0 };
        limit(vec![(i, 1.0)], reach.min(1.0 - xi));
        limit(vec![(i, -1.0)], reach.min(*xi));
    }
    let programme = QuadraticProgramme {
        curvature: hessian,
        further_curvature: &vec![LINEAR_CURVATURE; size - n],
        slope: &slope,
        limits: &limits,
    };
    let solution = programme.solve(&Precision { max_iterations: MAX_ITERATIONS, ..Precision::default() })?;
    // A step of reduced accuracy is still a step: the evaluation decides. Anything else is none.
    match solution.status {
        SolverStatus::Solved
        | SolverStatus::AlmostSolved
        | SolverStatus::InsufficientProgress
        | SolverStatus::MaxIterations => {}
        _ => return None,
    }
    if solution.x.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let step = DVector::from_iterator(n, solution.x[..n].iter().map(|d| d.clamp(-radius, radius)));
    let z = &solution.multipliers;
    let mut multipliers = Vec::with_capacity(num_gains + num_margins);
    if is_minimum {
        multipliers.extend(z[..num_gains].iter().copied());
    } else {
        multipliers.extend(&model.weights);
    }
    let offset = if is_minimum { num_gains } else { 1 };
    for m in 0..num_margins {
        multipliers.push(z[offset + 2 * m]);
    }
    Some((step, multipliers))
}

/// Central differences of the closed-form margins.
fn geometry_gradient(problem: &dyn LocalProblem, x: &[f64]) -> Vec<Vec<f64>> {
    let h = 1e-6;
    let count = problem.geometry(x).len();
    let mut rows = vec![vec![0.0; x.len()]; count];
    for i in 0..x.len() {
        let (mut a, mut b) = (x.to_vec(), x.to_vec());
        a[i] += h;
        b[i] -= h;
        let (ga, gb) = (problem.geometry(&a), problem.geometry(&b));
        for ((row, pa), pb) in rows.iter_mut().zip(&ga).zip(&gb) {
            row[i] = (pa - pb) / (2.0 * h);
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    /// max min(1 − (x − 0.7)², 1.2 − y − x/2) on the unit square with x + y ≤ 1.1: at the kink and off the bounds.
    struct Kink;

    impl LocalProblem for Kink {
        fn model(&self, v: &[f64]) -> Option<LocalModel> {
            let (x, y) = (v[0], v[1]);
            Some(LocalModel {
                gains: vec![1.0 - (x - 0.7).powi(2) - (y - 0.9).powi(2), 1.2 - y],
                weights: Vec::new(),
                margins: vec![0.6 - x],
                gain_gradients: vec![vec![-2.0 * (x - 0.7), -2.0 * (y - 0.9)], vec![0.0, -1.0]],
                margin_gradients: vec![vec![-1.0, 0.0]],
            })
        }
        fn geometry(&self, v: &[f64]) -> Vec<f64> {
            vec![1.1 - v[0] - v[1]]
        }
        fn is_free(&self, _: usize) -> bool {
            true
        }
    }

    /// The optimum: gains equal, x at the margin or the geometry limit. With x = 0.6, 1 − 0.01 − (y − 0.9)² = 1.2 − y
    /// has the root y = (2.8 − √(2.8² − 4·1.02))/2 = 0.4302; x + y = 1.03 keeps the geometry, so it is the optimum.
    #[test]
    fn finds_the_kink_on_the_margin() {
        let settings = LocalSettings { max_evaluations: 60, radius: 0.2, smallest_radius: 1e-6 };
        let found = improve(&Kink, &[0.1, 0.8], &settings).expect("evaluates everywhere");
        let y = 0.5 * (2.8 - (2.8f64 * 2.8 - 4.0 * 1.02).sqrt());
        assert!((found.x[0] - 0.6).abs() < 2e-3 && (found.x[1] - y).abs() < 2e-3, "{:?} {y}", found.x);
        assert!(found.history.windows(2).all(|w| w[1] >= w[0]));
    }

    struct Mean;

    impl LocalProblem for Mean {
        fn model(&self, v: &[f64]) -> Option<LocalModel> {
            // Fails in a corner: such steps are shortened.
            (v[0] < 0.8).then(|| LocalModel {
                gains: vec![-(v[0] - 0.75).powi(2), -3.0 * (v[1] - 0.25).powi(2)],
                weights: vec![0.5, 0.5],
                margins: vec![],
                gain_gradients: vec![vec![-2.0 * (v[0] - 0.75), 0.0], vec![0.0, -6.0 * (v[1] - 0.25)]],
                margin_gradients: vec![],
            })
        }
        fn geometry(&self, _: &[f64]) -> Vec<f64> {
            Vec::new()
        }
        fn is_free(&self, _: usize) -> bool {
            true
        }
    }

    #[test]
    fn finds_a_smooth_optimum_beside_failures() {
        let settings = LocalSettings { max_evaluations: 60, radius: 0.3, smallest_radius: 1e-6 };
        let found = improve(&Mean, &[0.2, 0.9], &settings).expect("the start evaluates");
        // Merit is flat at the optimum: 1e-4 of it is 1e-2 in the variables.
        assert!((found.x[0] - 0.75).abs() < 1e-2 && (found.x[1] - 0.25).abs() < 1e-2, "{:?}", found.x);
    }
}

#[cfg(test)]
#[path = "local_tests.rs"]
mod known_optima;
