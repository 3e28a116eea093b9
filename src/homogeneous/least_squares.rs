//! Small nonlinear least squares with linear limits: Levenberg–Marquardt whose step is a quadratic programme, solved by a
//! primal active-set method (a dozen unknowns; no interior-point solver needed).

use nalgebra::{DMatrix, DVector};

/// Σ coefficient·x ≤ bound.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// (index, coefficient).
    pub coefficients: Vec<(usize, f64)>,
    /// Right side.
    pub bound: f64,
}

impl Limit {
    /// x[index] ≤ bound.
    pub fn at_most(index: usize, bound: f64) -> Limit {
        Limit { coefficients: vec![(index, 1.0)], bound }
    }

    /// x[index] ≥ bound.
    pub fn at_least(index: usize, bound: f64) -> Limit {
        Limit { coefficients: vec![(index, -1.0)], bound: -bound }
    }

    fn used(&self, x: &DVector<f64>) -> f64 {
        self.coefficients.iter().map(|&(i, c)| c * x[i]).sum()
    }
}

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

/// Minimises Σ r(x)² from `start`, which must keep the limits; no step changes x[i] by more than `largest_step[i]`.
/// `evaluate` returns `None` where the model has no value; such trials are shortened. `None` if the start has no value.
pub fn minimise(
    start: &[f64],
    limits: &[Limit],
    largest_step: &[f64],
    options: &LeastSquaresOptions,
    evaluate: &mut dyn FnMut(&[f64]) -> Option<Evaluation>,
) -> Option<Minimum> {
    let n = start.len();
    let mut x = DVector::from_row_slice(start);
    let usable = |e: &Evaluation| e.0.iter().all(|v| v.is_finite()) && e.1.iter().all(|v| v.is_finite());
    let mut now = evaluate(x.as_slice()).filter(usable)?;
    let mut cost = now.0.norm_squared();
    let mut damping = 1e-3;
    let (mut num_evaluations, mut is_converged) = (1, n == 0);
    while num_evaluations < options.max_evaluations && !is_converged {
        let matrix = now.1.transpose() * &now.1;
        let gradient = -(now.1.transpose() * &now.0);
        let largest = matrix.diagonal().amax().max(1e-300);
        let root: Vec<f64> = (0..n).map(|i| matrix[(i, i)].max(1e-14 * largest).sqrt()).collect();
        let scaled = DMatrix::from_fn(n, n, |a, b| matrix[(a, b)] / (root[a] * root[b]));
        let right = DVector::from_fn(n, |a, _| gradient[a] / root[a]);
        // In the scaled unknowns y = root·s: limits of the model and of the step.
        let mut rows: Vec<(DVector<f64>, f64)> = Vec::with_capacity(limits.len() + 2 * n);
        for limit in limits {
            let mut row = DVector::zeros(n);
            for &(i, c) in &limit.coefficients {
                row[i] = c / root[i];
            }
            rows.push((row, (limit.bound - limit.used(&x)).max(0.0)));
        }
        for i in 0..n {
            for sign in [1.0, -1.0] {
                let mut row = DVector::zeros(n);
                row[i] = sign / root[i];
                rows.push((row, largest_step[i]));
            }
        }
        for (row, room) in &mut rows {
            let height = row.amax().max(1e-300);
            *row /= height;
            *room /= height;
        }
        let mut is_improved = false;
        while num_evaluations < options.max_evaluations {
            let damped = &scaled + DMatrix::from_diagonal_element(n, n, damping);
            let y = quadratic_step(&damped, &right, &rows);
            let promised = 2.0 * right.dot(&y) - y.dot(&(&scaled * &y));
            if !(promised > options.tolerance * cost) && damping <= 1.0 {
                is_converged = true;
                break;
            }
            let trial = DVector::from_fn(n, |i, _| x[i] + y[i] / root[i]);
            num_evaluations += 1;
            let found = evaluate(trial.as_slice()).filter(usable);
            let lower = found.map(|e| (e.0.norm_squared(), e)).filter(|(c, _)| *c < cost);
            if let Some((found_cost, e)) = lower {
                let ratio = (cost - found_cost) / promised.max(1e-300);
                damping = if ratio > 0.75 {
                    damping * 0.1
                } else if ratio < 0.25 {
                    damping * 2.0
                } else {
                    damping
                };
                damping = damping.max(1e-12);
                // Rounding must not carry the parameters out of their limits.
                (x, now, cost) = (trial, e, found_cost);
                is_improved = true;
                break;
            }
            damping = (4.0 * damping).max(1e-6);
            if damping > 1e10 {
                // No step of any length lowers the sum: at a minimum up to rounding.
                is_converged = true;
                break;
            }
        }
        if !is_improved {
            break;
        }
    }
    let reached =
        (0..limits.len()).filter(|&l| limits[l].bound - limits[l].used(&x) < REACHED * (1.0 + limits[l].bound.abs()));
    let reached = reached.collect();
    Some(Minimum {
        parameters: x.as_slice().to_vec(),
        residual: now.0,
        jacobian: now.1,
        sum_of_squares: cost,
        num_evaluations,
        is_converged,
        reached,
    })
}

/// Minimises ½ yᵀHy − gᵀy subject to row·y ≤ room with all rooms ≥ 0, so that rest is feasible. H positive definite.
fn quadratic_step(matrix: &DMatrix<f64>, gradient: &DVector<f64>, rows: &[(DVector<f64>, f64)]) -> DVector<f64> {
    let n = gradient.len();
    if let Some(c) = matrix.clone().cholesky() {
        let y = c.solve(gradient);
        if rows.iter().all(|(row, room)| row.dot(&y) <= *room) {
            return y;
        }
    }
    let mut y = DVector::<f64>::zeros(n);
    let mut active: Vec<usize> = Vec::new();
    // Each turn adds or drops one limit; cycling is possible only by rounding, and then the step so far serves.
    for _ in 0..10 * (rows.len() + 1) {
        let size = n + active.len();
        let mut kkt = DMatrix::zeros(size, size);
        let mut right = DVector::zeros(size);
        kkt.view_mut((0, 0), (n, n)).copy_from(matrix);
        right.rows_mut(0, n).copy_from(&(gradient - matrix * &y));
        for (k, &r) in active.iter().enumerate() {
            for i in 0..n {
                kkt[(n + k, i)] = rows[r].0[i];
                kkt[(i, n + k)] = rows[r].0[i];
            }
        }
        let Some(solution) = kkt.lu().solve(&right).filter(|s| s.iter().all(|v| v.is_finite())) else { break };
        let p = solution.rows(0, n).into_owned();
        if p.amax() <= 1e-12 * (1.0 + y.amax()) {
            let worst = (0..active.len()).min_by(|&a, &b| solution[n + a].total_cmp(&solution[n + b]));
            match worst {
                Some(k) if solution[n + k] < -1e-12 * (1.0 + gradient.amax()) => {
                    active.remove(k);
                }
                _ => break,
            }
            continue;
        }
        let mut length = 1.0;
        let mut blocking = None;
        for (r, (row, room)) in rows.iter().enumerate() {
            let slope = row.dot(&p);
            if slope > 1e-14 * p.amax() && !active.contains(&r) {
                let part = ((room - row.dot(&y)).max(0.0)) / slope;
                if part < length {
                    length = part;
                    blocking = Some(r);
                }
            }
        }
        y += length * p;
        if let Some(r) = blocking {
            active.push(r);
        }
    }
    y
}

/// Covariance of the parameters, s² (JᵀJ)⁻¹ in the directions that the data determine, and for every parameter whether
/// they do. A direction counts as undetermined where its scaled singular value is below `cutoff` of the largest.
pub fn covariance(jacobian: &DMatrix<f64>, variance: f64, cutoff: f64) -> (DMatrix<f64>, Vec<bool>) {
    let n = jacobian.ncols();
    let root: Vec<f64> = (0..n).map(|i| jacobian.column(i).norm()).collect();
    let scale = |i: usize| if root[i] > 0.0 { root[i] } else { 1.0 };
    let scaled = DMatrix::from_fn(n, n, |a, b| jacobian.column(a).dot(&jacobian.column(b)) / (scale(a) * scale(b)));
    let eigen = scaled.symmetric_eigen();
    let limit = cutoff * cutoff * eigen.eigenvalues.amax();
    let mut matrix = DMatrix::zeros(n, n);
    let mut is_determined: Vec<bool> = root.iter().map(|r| *r > 0.0).collect();
    for k in 0..n {
        let (value, vector) = (eigen.eigenvalues[k], eigen.eigenvectors.column(k));
        if value > limit {
            matrix += vector * vector.transpose() * (variance / value);
        } else {
            for i in 0..n {
                // A parameter with a tenth of the direction's length is not determined either.
                is_determined[i] &= vector[i].abs() < 0.1;
            }
        }
    }
    (DMatrix::from_fn(n, n, |a, b| matrix[(a, b)] / (scale(a) * scale(b))), is_determined)
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
        let m = minimise(&[-1.2, 1.0], &[Limit::at_most(0, 0.5)], &[1e3; 2], &options, &mut rosenbrock).unwrap();
        assert!((m.parameters[0] - 0.5).abs() < 1e-9 && (m.parameters[1] - 0.25).abs() < 1e-6, "{m:?}");
        assert_eq!(m.reached, [0]);
        let line = Limit { coefficients: vec![(0, 1.0), (1, 1.0)], bound: 0.5 };
        let m = minimise(&[-1.2, 1.0], &[line], &[1e3; 2], &options, &mut rosenbrock).unwrap();
        let best = (0..20_000)
            .map(|i| -1.0 + 1e-4 * f64::from(i))
            .map(|a| rosenbrock(&[a, 0.5 - a]).unwrap().0.norm_squared())
            .fold(f64::INFINITY, f64::min);
        // The scan's step of 1e-4 leaves up to (1e-4)² × curvature 1e3.
        assert!((m.sum_of_squares - best).abs() < 1e-5, "{} {best}", m.sum_of_squares);
    }

    /// A column that repeats another one: both are undetermined, the third is not.
    #[test]
    fn undetermined_directions_are_named() {
        let j = DMatrix::from_row_slice(3, 3, &[1.0, 2.0, 0.0, 1.0, 2.0, 1.0, 2.0, 4.0, -1.0]);
        let (c, is_determined) = covariance(&j, 1.0, 1e-7);
        assert_eq!(is_determined, [false, false, true]);
        // Normal equations without the repeated column: [[6, -1], [-1, 2]], inverse entry 6/11.
        assert!((c[(2, 2)] - 6.0 / 11.0).abs() < 1e-12);
    }
}
