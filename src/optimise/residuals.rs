//! Fits whose residuals and Jacobian are at hand: Levenberg–Marquardt with linear limits on the parameters.

use super::active_set::{Row, least_within};
use super::descend::{End, LeastSquares, Step, descend};
use super::limit::LinearLimit;
use super::rules::{Damping, Raise, Rules, Shortening, Stop};
use nalgebra::{DMatrix, DVector};
use std::convert::Infallible;

/// Settings of [`minimise`].
#[derive(Clone, Copy, Debug)]
pub struct LeastSquaresOptions {
    /// Most evaluations of the residual.
    pub max_evaluations: usize,
    /// Converged when a step promises to lower the sum of squares by less than this part of it.
    pub tolerance: f64,
}

impl Default for LeastSquaresOptions {
    fn default() -> Self {
        LeastSquaresOptions { max_evaluations: 200, tolerance: 1e-9 }
    }
}

/// Residuals (length m) and their Jacobian (m × n).
pub type Evaluation = (DVector<f64>, DMatrix<f64>);

/// Where a fit ended.
#[derive(Clone, Debug)]
pub struct Minimum {
    /// The parameters.
    pub parameters: Vec<f64>,
    /// Residuals there.
    pub residual: DVector<f64>,
    /// Their Jacobian.
    pub jacobian: DMatrix<f64>,
    /// Σ residual².
    pub sum_of_squares: f64,
    /// Evaluations made.
    pub num_evaluations: usize,
    /// Whether the tolerance was met.
    pub is_converged: bool,
    /// Indices of the limits that are reached.
    pub reached: Vec<usize>,
}

/// What a limit may be missed by and still count as reached.
const REACHED: f64 = 1e-9;
/// A promise counts only up to this damping: heavy damping makes every step, and with it every promise, small.
const LARGEST_DAMPING_OF_PROMISES: f64 = 1.0;
/// The damping of these fits: residuals are cheap, so that it begins with a little and is never given up altogether.
const DAMPING: Damping = Damping {
    start: 1e-3,
    good_part: 0.75,
    negligible: 0.0,
    least: 1e-12,
    small_gain: 0.0,
    poor_part: 0.25,
    after_poor: Raise { factor: 2.0, at_least: 1e-12 },
    after_rejection: Raise { factor: 4.0, at_least: 1e-6 },
    largest: 1e10,
};

/// Parameters with residuals.
struct Point {
    x: DVector<f64>,
    residual: DVector<f64>,
    jacobian: DMatrix<f64>,
    sum_of_squares: f64,
}

/// Normal equations in the unknowns y = root·s, which have a unit diagonal, with the limits on a step.
struct ScaledSystem {
    matrix: DMatrix<f64>,
    gradient: DVector<f64>,
    root: Vec<f64>,
    rows: Vec<Row>,
}

/// What [`minimise`] descends on.
struct Residuals<'a> {
    limits: &'a [LinearLimit],
    largest_step: &'a [f64],
    tolerance: f64,
    evaluate: &'a mut dyn FnMut(&[f64]) -> Option<Evaluation>,
}

impl Residuals<'_> {
    fn point(&mut self, x: DVector<f64>) -> Option<Point> {
        let (residual, jacobian) = (self.evaluate)(x.as_slice())?;
        let is_usable = residual.iter().all(|v| v.is_finite()) && jacobian.iter().all(|v| v.is_finite());
        let sum_of_squares = residual.norm_squared();
        is_usable.then_some(Point { x, residual, jacobian, sum_of_squares })
    }

    fn system(&self, at: &Point) -> ScaledSystem {
        let n = at.x.len();
        let matrix = at.jacobian.transpose() * &at.jacobian;
        let gradient = -(at.jacobian.transpose() * &at.residual);
        let largest = matrix.diagonal().amax().max(1e-300);
        let root: Vec<f64> = (0..n).map(|i| matrix[(i, i)].max(1e-14 * largest).sqrt()).collect();
        let mut rows: Vec<Row> = Vec::with_capacity(self.limits.len() + 2 * n);
        for limit in self.limits {
            let mut normal = DVector::zeros(n);
            for &(i, c) in &limit.coefficients {
                normal[i] = c / root[i];
            }
            rows.push(Row { normal, room: (limit.bound - limit.value(at.x.as_slice())).max(0.0) });
        }
        for i in 0..n {
            for sign in [1.0, -1.0] {
                let mut normal = DVector::zeros(n);
                normal[i] = sign / root[i];
                rows.push(Row { normal, room: self.largest_step[i] });
            }
        }
        for row in &mut rows {
            let height = row.normal.amax().max(1e-300);
            row.normal /= height;
            row.room /= height;
        }
        ScaledSystem {
            matrix: DMatrix::from_fn(n, n, |a, b| matrix[(a, b)] / (root[a] * root[b])),
            gradient: DVector::from_fn(n, |a, _| gradient[a] / root[a]),
            root,
            rows,
        }
    }
}

impl LeastSquares for Residuals<'_> {
    type Point = Point;
    type Linear = ScaledSystem;
    type Error = Infallible;

    fn objective(&self, at: &Point) -> f64 {
        at.sum_of_squares
    }

    fn linearise(&mut self, at: &Point) -> Result<Option<ScaledSystem>, Infallible> {
        Ok(Some(self.system(at)))
    }

    fn step(&mut self, at: &Point, linear: &ScaledSystem, damping: f64) -> Result<Option<Step>, Infallible> {
        let n = at.x.len();
        if n == 0 {
            return Ok(None);
        }
        let damped = &linear.matrix + DMatrix::from_diagonal_element(n, n, damping);
        let y = least_within(&damped, &linear.gradient, &linear.rows);
        let promised = 2.0 * linear.gradient.dot(&y) - y.dot(&(&linear.matrix * &y));
        if !(promised > self.tolerance * at.sum_of_squares) && damping <= LARGEST_DAMPING_OF_PROMISES {
            return Ok(None);
        }
        let change = DVector::from_fn(n, |i, _| y[i] / linear.root[i]);
        Ok(Some(Step { change, promised }))
    }

    fn trial(&mut self, at: &Point, _: &ScaledSystem, step: &Step, part: f64) -> Result<Option<Point>, Infallible> {
        let x = DVector::from_fn(at.x.len(), |i, _| at.x[i] + part * step.change[i]);
        Ok(self.point(x))
    }
}

/// Minimises Σ r(x)² from `start`, which must keep the limits; no step changes `x[i]` by more than `largest_step[i]`.
/// `evaluate` returns `None` where the model has no value; such trials are shortened. `None` if the start has no value.
pub fn minimise(
    start: &[f64],
    limits: &[LinearLimit],
    largest_step: &[f64],
    options: &LeastSquaresOptions,
    evaluate: &mut dyn FnMut(&[f64]) -> Option<Evaluation>,
) -> Option<Minimum> {
    let mut problem = Residuals { limits, largest_step, tolerance: options.tolerance, evaluate };
    let start = problem.point(DVector::from_row_slice(start))?;
    let linear = problem.system(&start);
    let rules = Rules {
        shortening: Shortening::Damped(DAMPING),
        tolerated_rise: 0.0,
        // The start was the first evaluation.
        stop: Stop::after_trials(options.max_evaluations.saturating_sub(1)),
    };
    let Ok(found) = descend(&mut problem, start, linear, &rules);
    let Point { x, residual, jacobian, sum_of_squares } = found.at;
    let is_reached =
        |limit: &LinearLimit| limit.bound - limit.value(x.as_slice()) < REACHED * (1.0 + limit.bound.abs());
    let reached = (0..limits.len()).filter(|&l| is_reached(&limits[l])).collect();
    Some(Minimum {
        parameters: x.as_slice().to_vec(),
        residual,
        jacobian,
        sum_of_squares,
        num_evaluations: found.num_trials + 1,
        // Where no step helps, that is a minimum up to rounding.
        is_converged: matches!(found.end, End::Converged | End::Stuck),
        reached,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rosenbrock(x: &[f64]) -> Option<Evaluation> {
        let r = DVector::from_vec(vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]]);
        let j = DMatrix::from_row_slice(2, 2, &[-20.0 * x[0], 10.0, -1.0, 0.0]);
        Some((r, j))
    }

    /// Free minimum at (1, 1); quadratic convergence leaves rounding.
    #[test]
    fn finds_a_curved_valleys_floor() {
        let m = minimise(&[-1.2, 1.0], &[], &[1e3; 2], &LeastSquaresOptions::default(), &mut rosenbrock).unwrap();
        assert!(m.is_converged && (m.parameters[0] - 1.0).abs() < 1e-6 && (m.parameters[1] - 1.0).abs() < 1e-6);
    }

    /// With x₀ ≤ ½ the valley gives x₁ = ¼ and Σ r² = ¼. With x₀ + x₁ ≤ ½ also: x₁ = x₀² on the line has the stationary
    /// point of the constrained problem, checked against a fine scan along the line.
    #[test]
    fn keeps_limits() {
        let options = LeastSquaresOptions { tolerance: 1e-14, ..LeastSquaresOptions::default() };
        let m = minimise(&[-1.2, 1.0], &[LinearLimit::at_most(0, 0.5)], &[1e3; 2], &options, &mut rosenbrock).unwrap();
        assert!((m.parameters[0] - 0.5).abs() < 1e-9 && (m.parameters[1] - 0.25).abs() < 1e-6, "{m:?}");
        assert_eq!(m.reached, [0]);
        let line = LinearLimit { coefficients: vec![(0, 1.0), (1, 1.0)], bound: 0.5 };
        let m = minimise(&[-1.2, 1.0], &[line], &[1e3; 2], &options, &mut rosenbrock).unwrap();
        let best = (0..20_000)
            .map(|i| -1.0 + 1e-4 * f64::from(i))
            .map(|a| rosenbrock(&[a, 0.5 - a]).unwrap().0.norm_squared())
            .fold(f64::INFINITY, f64::min);
        // The scan's step of 1e-4 leaves up to (1e-4)² × curvature 1e3.
        assert!((m.sum_of_squares - best).abs() < 1e-5, "{} {best}", m.sum_of_squares);
    }
}
