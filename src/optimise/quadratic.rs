//! Convex quadratic programmes with linear limits, by Clarabel's interior point.

use super::limit::LinearLimit;
use clarabel::algebra::CscMatrix;
pub use clarabel::solver::SolverStatus;
use clarabel::solver::{DefaultSettings, DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT};
use nalgebra::DMatrix;

/// Minimise ½ xᵀPx + qᵀx where every limit is kept. The unknowns are those of a dense curvature, then some whose
/// curvature is their own alone.
#[derive(Clone, Debug)]
pub struct QuadraticProgramme<'a> {
    /// P of the first unknowns: symmetric (only its upper triangle is read), not indefinite.
    pub curvature: &'a DMatrix<f64>,
    /// P's diagonal of the further unknowns.
    pub further_curvature: &'a [f64],
    /// q, of all unknowns.
    pub slope: &'a [f64],
    /// The limits.
    pub limits: &'a [LinearLimit],
}

/// How exactly a programme is solved. Gaps and feasibility are measured as Clarabel measures them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Precision {
    /// Most iterations of the interior point.
    pub max_iterations: u32,
    /// Largest difference of the primal and the dual objective.
    pub absolute_gap: f64,
    /// The same relative to the objective.
    pub relative_gap: f64,
    /// Largest residual of the limits and of the stationarity.
    pub feasibility: f64,
}

impl Default for Precision {
    /// Clarabel's own.
    fn default() -> Precision {
        let its_own = DefaultSettings::<f64>::default();
        Precision {
            max_iterations: its_own.max_iter,
            absolute_gap: its_own.tol_gap_abs,
            relative_gap: its_own.tol_gap_rel,
            feasibility: its_own.tol_feas,
        }
    }
}

/// What the interior point ended with. Whether that is of use is for the caller to say: see `status`.
#[derive(Clone, Debug)]
pub struct QuadraticSolution {
    /// The unknowns.
    pub x: Vec<f64>,
    /// One multiplier per limit.
    pub multipliers: Vec<f64>,
    /// How it ended.
    pub status: SolverStatus,
}

impl QuadraticProgramme<'_> {
    /// Solves it; `None` where the programme is not one (lists of different lengths, a precision out of range).
    pub fn solve(&self, precision: &Precision) -> Option<QuadraticSolution> {
        let num_dense = self.curvature.ncols();
        let num_unknowns = num_dense + self.further_curvature.len();
        let mut curvature = ColumnEntries::new(num_unknowns, num_unknowns);
        for j in 0..num_dense {
            for i in 0..=j {
                curvature.push(i, j, self.curvature[(i, j)]);
            }
        }
        for (k, &value) in self.further_curvature.iter().enumerate() {
            curvature.push(num_dense + k, num_dense + k, value);
        }
        let mut rows = ColumnEntries::new(self.limits.len(), num_unknowns);
        for (r, limit) in self.limits.iter().enumerate() {
            for &(column, coefficient) in &limit.coefficients {
                rows.push(r, column, coefficient);
            }
        }
        let bounds: Vec<f64> = self.limits.iter().map(|l| l.bound).collect();
        let settings = DefaultSettingsBuilder::default()
            .verbose(false)
            .max_iter(precision.max_iterations)
            .tol_gap_abs(precision.absolute_gap)
            .tol_gap_rel(precision.relative_gap)
            .tol_feas(precision.feasibility)
            .build()
            .ok()?;
        let cones = [NonnegativeConeT(self.limits.len())];
        let (p, a) = (curvature.finish(), rows.finish());
        let mut solver = DefaultSolver::new(&p, self.slope, &a, &bounds, &cones, settings).ok()?;
        solver.solve();
        let solution = solver.solution;
        Some(QuadraticSolution { x: solution.x, multipliers: solution.z, status: solution.status })
    }
}

/// Entries of a sparse matrix, collected by column.
struct ColumnEntries {
    num_rows: usize,
    columns: Vec<Vec<(usize, f64)>>,
}

impl ColumnEntries {
    fn new(num_rows: usize, num_columns: usize) -> Self {
        ColumnEntries { num_rows, columns: vec![Vec::new(); num_columns] }
    }

    fn push(&mut self, row: usize, column: usize, value: f64) {
        self.columns[column].push((row, value));
    }

    fn finish(mut self) -> CscMatrix<f64> {
        let (mut pointers, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
        for column in &mut self.columns {
            column.sort_by_key(|e| e.0);
            for &(r, v) in column.iter() {
                indices.push(r);
                values.push(v);
            }
            pointers.push(indices.len());
        }
        CscMatrix::new(self.num_rows, self.columns.len(), pointers, indices, values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ½(x₀² + 4x₁²) − x₀ − 8x₁ + 3s with x₀ + x₁ ≤ 2 + s and s ≥ 0: the free optimum (1, 2) breaks the limit by one;
    /// its multiplier 1 − x₀ = 8 − 4x₁ with x₀ + x₁ = 2 is 0.8, below the price 3 of the slack, so that s = 0: (0.2,
    /// 1.8).
    #[test]
    fn a_limit_and_a_slack() {
        let curvature = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 4.0]);
        let limits = [
            LinearLimit { coefficients: vec![(2, -1.0), (0, 1.0), (1, 1.0)], bound: 2.0 },
            LinearLimit::at_least(2, 0.0),
        ];
        let programme = QuadraticProgramme {
            curvature: &curvature,
            further_curvature: &[1e-9],
            slope: &[-1.0, -8.0, 3.0],
            limits: &limits,
        };
        let found = programme.solve(&Precision::default()).unwrap();
        assert_eq!(found.status, SolverStatus::Solved);
        for (value, exact) in found.x.iter().zip([0.2, 1.8, 0.0]) {
            // The interior point's own tolerance.
            assert!((value - exact).abs() < 1e-6, "{:?}", found.x);
        }
        assert!((found.multipliers[0] - 0.8).abs() < 1e-6, "{:?}", found.multipliers);
    }
}
