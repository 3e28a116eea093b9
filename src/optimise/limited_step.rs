//! The least of a quadratic model within linear limits whose rooms differ by decades, to rounding.

use super::limit::LinearLimit;
use super::quadratic::{Precision, QuadraticProgramme, SolverStatus};
use nalgebra::{DMatrix, DVector};

/// Tried in turn where the limited problem cannot be solved.
const LARGER_RIDGES: [f64; 3] = [1e-9, 1e-7, 1e-5];
/// A limit counts as reached where less than this is left of it.
const REACHED: f64 = 1e-6;
/// A violation of a limit below this is rounding.
const ROUNDING: f64 = 1e-12;
/// An objective this little above that of rest is none: 10⁻⁹ is 4·10⁻⁵ standard deviations.
const NO_ASCENT: f64 = 1e-9;
/// Largest violation of a limit that an interior point's solution may have before it is drawn back.
const FEASIBILITY: f64 = 1e-5;
/// Tight, because what is left of a step near the optimum is small.
const PRECISION: Precision =
    Precision { max_iterations: 200, absolute_gap: 1e-13, relative_gap: 1e-11, feasibility: 1e-11 };

/// The quadratic programme has no usable solution.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the limited quadratic step could not be found (solver status {status:?})")]
pub struct NoStep {
    /// How the interior point ended.
    pub status: SolverStatus,
}

/// The step that minimises ½ xᵀHx − gᵀx within `limits`, and the indices of the limits that it reaches.
///
/// Unknowns are expected in a scale in which H has a unit diagonal: the tolerances are absolute. Every bound must be at
/// least zero, so that rest keeps the limits.
///
/// # Errors
/// [`NoStep`].
pub fn limited_step(
    matrix: &DMatrix<f64>,
    gradient: &DVector<f64>,
    limits: &[LinearLimit],
) -> Result<(DVector<f64>, Vec<usize>), NoStep> {
    let unlimited = matrix.clone().cholesky().map(|c| c.solve(gradient));
    let x = match unlimited {
        // Where no limit is reached the normal equations give the step to more digits.
        Some(x) if limits.iter().all(|l| l.value(x.as_slice()) <= l.bound) => x,
        _ => {
            // A nearly singular matrix may be beyond the interior point's accuracy: a larger ridge then.
            let mut found = solve_limited(matrix, gradient, limits);
            for ridge in LARGER_RIDGES {
                if found.is_ok() {
                    break;
                }
                let m = gradient.len();
                let ridged = matrix + DMatrix::from_diagonal_element(m, m, ridge);
                found = solve_limited(&ridged, gradient, limits);
            }
            let mut x = found?;
            // Rest is within all limits, so drawing back towards it is too. A violation by rounding is let be: where no
            // room is left it would draw the whole step back.
            let part = limits
                .iter()
                .filter(|l| l.value(x.as_slice()) > l.bound + ROUNDING)
                .map(|l| l.bound / l.value(x.as_slice()))
                .fold(1.0, f64::min);
            x *= part;
            x
        }
    };
    let reached = reached_by(&x, limits);
    Ok((x, reached))
}

/// The limits of which next to nothing is left at `x`.
fn reached_by(x: &DVector<f64>, limits: &[LinearLimit]) -> Vec<usize> {
    (0..limits.len()).filter(|&r| limits[r].bound - limits[r].value(x.as_slice()) < REACHED).collect()
}

/// The same optimum to rounding: the limits that `x` reaches taken as equations. `None` where that is not the optimum
/// after all (another limit broken, a multiplier of the wrong sign, limits that depend on each other).
fn polished(
    matrix: &DMatrix<f64>,
    gradient: &DVector<f64>,
    limits: &[LinearLimit],
    x: &DVector<f64>,
) -> Option<DVector<f64>> {
    let active = reached_by(x, limits);
    let (m, n) = (gradient.len(), gradient.len() + active.len());
    let mut kkt = DMatrix::zeros(n, n);
    let mut right = DVector::zeros(n);
    kkt.view_mut((0, 0), (m, m)).copy_from(matrix);
    right.rows_mut(0, m).copy_from(gradient);
    for (k, &r) in active.iter().enumerate() {
        // Multipliers are measured against the gradient, rows have the height of their largest coefficient.
        let height = limits[r].height();
        for &(j, c) in &limits[r].coefficients {
            kkt[(m + k, j)] = c / height;
            kkt[(j, m + k)] = c / height;
        }
        right[m + k] = limits[r].bound / height;
    }
    let solution = kkt.lu().solve(&right).filter(|s| s.iter().all(|v| v.is_finite()))?;
    let exact = solution.rows(0, m).into_owned();
    let is_feasible = limits.iter().all(|l| l.value(exact.as_slice()) <= l.bound + ROUNDING);
    let smallest = -1e-8 * gradient.amax().max(1.0);
    let has_signs = solution.rows(m, active.len()).iter().all(|multiplier| *multiplier >= smallest);
    (is_feasible && has_signs).then_some(exact)
}

/// The optimum within `limits`. Limits enter as they are broken: an optimum within some
/// of them that breaks none of the others is that of all, and limits far away, whose rooms are larger by decades, would
/// spoil the interior point's accuracy.
fn solve_limited(
    matrix: &DMatrix<f64>,
    gradient: &DVector<f64>,
    limits: &[LinearLimit],
) -> Result<DVector<f64>, NoStep> {
    let Some(cholesky) = matrix.clone().cholesky() else {
        return solve_among(matrix, gradient, limits);
    };
    let mut x = cholesky.solve(gradient);
    let mut chosen: Vec<usize> = Vec::new();
    loop {
        let broken: Vec<usize> = (0..limits.len())
            .filter(|r| !chosen.contains(r))
            .filter(|&r| limits[r].value(x.as_slice()) > limits[r].bound + ROUNDING)
            .collect();
        if broken.is_empty() {
            return Ok(x);
        }
        chosen.extend(broken);
        chosen.sort_unstable();
        let some: Vec<LinearLimit> = chosen.iter().map(|&r| limits[r].clone()).collect();
        x = match solve_among(matrix, gradient, &some) {
            Ok(x) => x,
            Err(_) => return solve_among(matrix, gradient, limits),
        };
    }
}

/// The optimum within all of `limits` at once, by the interior point and then polished.
fn solve_among(matrix: &DMatrix<f64>, gradient: &DVector<f64>, limits: &[LinearLimit]) -> Result<DVector<f64>, NoStep> {
    // A scale of one: interior-point tolerances are partly absolute.
    let size = gradient.amax().max(1.0);
    let slope: Vec<f64> = gradient.iter().map(|g| -g / size).collect();
    // Each row to a unit largest coefficient; what has no coefficient has no entry.
    let scaled: Vec<LinearLimit> = limits
        .iter()
        .map(|l| {
            let height = l.height();
            let coefficients =
                l.coefficients.iter().filter(|(_, c)| c.abs() > 0.0).map(|&(i, c)| (i, c / height)).collect();
            LinearLimit { coefficients, bound: l.bound / (height * size) }
        })
        .collect();
    let programme = QuadraticProgramme { curvature: matrix, further_curvature: &[], slope: &slope, limits: &scaled };
    let Some(solution) = programme.solve(&PRECISION) else {
        return Err(NoStep { status: SolverStatus::Unsolved });
    };
    let status = solution.status;
    let x = DVector::from_iterator(gradient.len(), solution.x.iter().map(|x| x * size));
    let x = polished(matrix, gradient, limits, &x).unwrap_or(x);
    let is_feasible = limits.iter().all(|l| l.value(x.as_slice()) <= l.bound + FEASIBILITY);
    let model = 0.5 * x.dot(&(matrix * &x)) - gradient.dot(&x);
    let is_descent = model.is_finite() && model <= NO_ASCENT * size;
    let is_answer = match status {
        SolverStatus::Solved | SolverStatus::AlmostSolved => true,
        // Small problems may end so at full accuracy; what counts is the step itself.
        SolverStatus::InsufficientProgress
        | SolverStatus::MaxIterations
        | SolverStatus::MaxTime
        | SolverStatus::NumericalError => true,
        // Rest is feasible and the matrix is positive definite: an "infeasible" is a failure like the others.
        SolverStatus::PrimalInfeasible
        | SolverStatus::DualInfeasible
        | SolverStatus::AlmostPrimalInfeasible
        | SolverStatus::AlmostDualInfeasible
        | SolverStatus::Unsolved
        | SolverStatus::CallbackTerminated => false,
    };
    if is_answer && is_feasible && is_descent { Ok(x) } else { Err(NoStep { status }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Correlated unknowns in a box and under a line: no point of a fine grid within the limits is better, and what is
    /// reached is named. The second limit's room is larger by six decades and must not matter.
    #[test]
    fn nothing_within_the_limits_is_better() {
        let matrix = DMatrix::from_row_slice(2, 2, &[1.0, 0.9, 0.9, 1.0]);
        let gradient = DVector::from_column_slice(&[3.0, 1.0]);
        let limits = [
            LinearLimit::at_most(0, 1.5),
            LinearLimit::at_most(1, 1e6),
            LinearLimit { coefficients: vec![(0, 1.0), (1, -1.0)], bound: 1.8 },
        ];
        let (x, reached) = limited_step(&matrix, &gradient, &limits).unwrap();
        assert_eq!(reached, [0, 2]);
        // Both limits are equations: rounding only.
        assert!((x[0] - 1.5).abs() < 1e-12 && (x[1] + 0.3).abs() < 1e-12, "{x}");
        let value = |x: &DVector<f64>| 0.5 * x.dot(&(&matrix * x)) - gradient.dot(x);
        for i in 0..200 {
            for j in 0..200 {
                let other = DVector::from_column_slice(&[-3.0 + 0.03 * f64::from(i), -3.0 + 0.03 * f64::from(j)]);
                if limits.iter().all(|l| l.value(other.as_slice()) <= l.bound) {
                    assert!(value(&other) >= value(&x) - 1e-12, "{other}");
                }
            }
        }
    }

    /// Without limits: the normal equations.
    #[test]
    fn without_limits_it_is_newtons_step() {
        let matrix = DMatrix::from_row_slice(2, 2, &[1.0, 0.5, 0.5, 1.0]);
        let gradient = DVector::from_column_slice(&[1.0, -1.0]);
        let (x, reached) = limited_step(&matrix, &gradient, &[]).unwrap();
        // (2, −2) by hand; rounding only.
        assert!((x[0] - 2.0).abs() < 1e-14 && (x[1] + 2.0).abs() < 1e-14 && reached.is_empty(), "{x}");
    }
}
