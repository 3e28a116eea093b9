//! The convex subproblem of the local search, solved by Clarabel.
//!
//! Over the step d, the epigraph variable t and slacks s ≥ 0:
//!
//! minimise ½ dᵀB d − t + ρ Σ sⱼ subject to
//! t ≤ fᵢ + ∇fᵢ·d, −sⱼ ≤ cⱼ + ∇cⱼ·d, 0 ≤ gₖ + ∇gₖ·d, l ≤ d ≤ u.
//!
//! With gₖ ≥ 0 and l ≤ 0 ≤ u the point d = 0 is admissible, so the subproblem always has a solution.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus};

/// Clarabel meets constraints to about 10⁻⁸: this keeps a hard margin on the right side.
const HARD_RESERVE: f64 = 1e-7;

/// A value and its gradient.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Linear {
    /// Value at the point.
    pub value: f64,
    /// Gradient there.
    pub gradient: Vec<f64>,
}

impl Linear {
    /// Value of the linearisation after `step`.
    pub fn at(&self, step: &[f64]) -> f64 {
        self.value + dot(&self.gradient, step)
    }

    /// Whether value and gradient are finite and the gradient has `dimension` entries.
    pub fn is_usable(&self, dimension: usize) -> bool {
        self.value.is_finite() && self.gradient.len() == dimension && self.gradient.iter().all(|g| g.is_finite())
    }
}

/// What the subproblem is made of.
pub(super) struct Subproblem<'a> {
    /// B, symmetric positive definite, row by row.
    pub hessian: &'a [Vec<f64>],
    /// f: the least is to be made large.
    pub components: &'a [Linear],
    /// c ≥ 0, soft.
    pub constraints: &'a [Linear],
    /// g ≥ 0, hard.
    pub margins: &'a [Linear],
    /// l ≤ 0.
    pub lower: &'a [f64],
    /// u ≥ 0.
    pub upper: &'a [f64],
    /// ρ.
    pub penalty: f64,
}

/// A solution of the subproblem.
#[derive(Clone, Debug)]
pub(super) struct Step {
    /// d.
    pub step: Vec<f64>,
    /// Multipliers of the components (they sum to 1).
    pub component_weights: Vec<f64>,
    /// Multipliers of the soft constraints.
    pub constraint_weights: Vec<f64>,
    /// Multipliers of the hard margins.
    pub margin_weights: Vec<f64>,
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Solves the subproblem; `None` where Clarabel found no usable point (the caller then shrinks its trust region).
///
/// Accepted are `Solved` and `AlmostSolved`; of runs that end early (`InsufficientProgress`, `MaxIterations`,
/// `NumericalError`) the last point is taken where it is finite, as the caller judges every step by its own merit.
pub(super) fn solve(problem: &Subproblem) -> Option<Step> {
    let n = problem.lower.len();
    let (num_f, num_c, num_g) = (problem.components.len(), problem.constraints.len(), problem.margins.len());
    let width = n + 1 + num_c;
    let height = num_f + num_c + num_g + 2 * n + num_c;
    // Rows of A x + slack = b, column by column.
    let mut columns: Vec<Vec<(usize, f64)>> = vec![Vec::new(); width];
    let mut right = Vec::with_capacity(height);
    let mut row = 0;
    let push_gradient = |row: usize, gradient: &[f64], columns: &mut Vec<Vec<(usize, f64)>>| {
        for (column, g) in columns.iter_mut().zip(gradient) {
            column.push((row, -g));
        }
    };
    for f in problem.components {
        push_gradient(row, &f.gradient, &mut columns);
        columns[n].push((row, 1.0));
        right.push(f.value);
        row += 1;
    }
    for (j, c) in problem.constraints.iter().enumerate() {
        push_gradient(row, &c.gradient, &mut columns);
        columns[n + 1 + j].push((row, -1.0));
        right.push(c.value);
        row += 1;
    }
    for g in problem.margins {
        push_gradient(row, &g.gradient, &mut columns);
        right.push((g.value - HARD_RESERVE).max(0.0));
        row += 1;
    }
    for i in 0..n {
        columns[i].push((row, 1.0));
        right.push(problem.upper[i].max(0.0));
        columns[i].push((row + 1, -1.0));
        right.push((-problem.lower[i]).max(0.0));
        row += 2;
    }
    for j in 0..num_c {
        columns[n + 1 + j].push((row, -1.0));
        right.push(0.0);
        row += 1;
    }
    let a = compressed(height, &columns);
    let quadratic: Vec<Vec<(usize, f64)>> = (0..width)
        .map(|j| if j < n { (0..=j).map(|i| (i, problem.hessian[i][j])).collect() } else { Vec::new() })
        .collect();
    let p = compressed(width, &quadratic);
    let mut q = vec![0.0; width];
    q[n] = -1.0;
    q[n + 1..].fill(problem.penalty);
    let settings = DefaultSettingsBuilder::default().verbose(false).max_iter(100).build().ok()?;
    let mut solver = DefaultSolver::new(&p, &q, &a, &right, &[NonnegativeConeT(height)], settings).ok()?;
    solver.solve();
    let solution = &solver.solution;
    let is_usable = match solution.status {
        SolverStatus::Solved | SolverStatus::AlmostSolved => true,
        SolverStatus::InsufficientProgress | SolverStatus::MaxIterations | SolverStatus::NumericalError => true,
        // d = 0 is admissible and the trust region bounds d, so a certificate of infeasibility is a numerical accident.
        _ => false,
    };
    if !is_usable || solution.x.iter().chain(&solution.z).any(|v| !v.is_finite()) {
        return None;
    }
    let step = (0..n).map(|i| solution.x[i].clamp(problem.lower[i].min(0.0), problem.upper[i].max(0.0))).collect();
    let weights = |from: usize, count: usize| solution.z[from..from + count].iter().map(|z| z.max(0.0)).collect();
    Some(Step {
        step,
        component_weights: weights(0, num_f),
        constraint_weights: weights(num_f, num_c),
        margin_weights: weights(num_f + num_c, num_g),
    })
}

/// A compressed sparse column matrix from its columns' (row, value) lists, rows increasing.
fn compressed(height: usize, columns: &[Vec<(usize, f64)>]) -> CscMatrix<f64> {
    let mut pointers = vec![0];
    let (mut rows, mut values) = (Vec::new(), Vec::new());
    for column in columns {
        for &(row, value) in column {
            rows.push(row);
            values.push(value);
        }
        pointers.push(rows.len());
    }
    CscMatrix::new(height, columns.len(), pointers, rows, values)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn linear(value: f64, gradient: &[f64]) -> Linear {
        Linear { value, gradient: gradient.to_vec() }
    }

    /// max min(x, y) with x + y ≤ 1 from the origin: (½, ½), each weight ½.
    #[test]
    fn epigraph_of_two() {
        let hessian = vec![vec![1e-3, 0.0], vec![0.0, 1e-3]];
        let found = solve(&Subproblem {
            hessian: &hessian,
            components: &[linear(0.0, &[1.0, 0.0]), linear(0.0, &[0.0, 1.0])],
            constraints: &[],
            margins: &[linear(1.0, &[-1.0, -1.0])],
            lower: &[-2.0, -2.0],
            upper: &[2.0, 2.0],
            penalty: 10.0,
        })
        .unwrap();
        // Clarabel's tolerances are 1e-8.
        assert!((found.step[0] - 0.5).abs() < 1e-6 && (found.step[1] - 0.5).abs() < 1e-6);
        assert!((found.component_weights[0] - 0.5).abs() < 1e-3);
        // Multiplier: ½ from the objective less the pull of the small Hessian.
        assert!((found.margin_weights[0] - 0.5).abs() < 1e-3);
    }

    /// A soft constraint that cannot be met is violated as little as the bounds allow.
    #[test]
    fn an_unreachable_soft_constraint_is_approached() {
        let hessian = vec![vec![1e-6]];
        let found = solve(&Subproblem {
            hessian: &hessian,
            components: &[linear(0.0, &[-1.0])],
            constraints: &[linear(-3.0, &[1.0])],
            margins: &[],
            lower: &[-1.0],
            upper: &[1.0],
            penalty: 10.0,
        })
        .unwrap();
        assert!((found.step[0] - 1.0).abs() < 1e-6);
        assert!((found.constraint_weights[0] - 10.0).abs() < 1e-4);
    }
}
