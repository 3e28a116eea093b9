//! Score tests: how much of a misfit a cause would explain, to first order, with the material free to follow.
//!
//! A *direction* is the change of the prediction with one parameter. Directions of the parameters that are free in any
//! case (the material's and those of the causes found so far) are a *nuisance*: what they can explain is no evidence
//! for anything else.

use super::metric::{Metric, Weighed};
use super::trace::Trace;
use nalgebra::{DMatrix, DVector};

/// What a set of directions explains of a residual, beyond what nuisance directions do.
#[derive(Clone, Debug)]
pub struct Score {
    /// Fall of the deviance to first order; χ² with as many degrees of freedom as directions where nothing is there.
    pub explained: f64,
    /// Best coefficients of the directions.
    pub coefficients: Vec<f64>,
    /// How far the nuisance directions follow in their place.
    pub followed: Vec<f64>,
}

/// A residual and nuisance directions (the material's), against which directions are tested.
pub struct ScoreTest<'a> {
    metric: &'a Metric,
    residual: [Weighed; 1],
    nuisance: Vec<Weighed>,
    inverse: DMatrix<f64>,
    nuisance_residual: DVector<f64>,
}

impl<'a> ScoreTest<'a> {
    /// `prior` adds to the diagonal of the nuisance directions' information.
    pub fn new(metric: &'a Metric, residual: &Trace, nuisance: &[Trace], prior: &[f64]) -> ScoreTest<'a> {
        let residual = metric.weigh(residual);
        let nuisance = metric.weigh_all(nuisance);
        let n = nuisance.len();
        let mut matrix = metric.products(&nuisance, &nuisance);
        matrix.fill_upper_triangle_with_lower_triangle();
        for (i, prior) in prior.iter().enumerate().take(n) {
            matrix[(i, i)] += prior;
        }
        let inverse = matrix.pseudo_inverse(1e-14).unwrap_or_else(|_| DMatrix::zeros(n, n));
        let residual = [residual];
        let nuisance_residual = metric.products(&nuisance, &residual).column(0).into_owned();
        ScoreTest { metric, residual, nuisance, inverse, nuisance_residual }
    }

    /// Prepares directions: their products with the residual and with each other, the nuisance taken out.
    pub fn prepare(&self, directions: &[Trace]) -> Prepared {
        let weighed = self.metric.weigh_all(directions);
        let cross = self.metric.products(&self.nuisance, &weighed);
        let projected = &self.inverse * &cross;
        let mut gram = self.metric.products(&weighed, &weighed) - cross.tr_mul(&projected);
        gram.fill_upper_triangle_with_lower_triangle();
        let gradient =
            self.metric.products(&weighed, &self.residual).column(0) - projected.tr_mul(&self.nuisance_residual);
        Prepared { gram, gradient, projected }
    }

    /// Tests all of `directions` together.
    pub fn test(&self, directions: &[Trace]) -> Score {
        let prepared = self.prepare(directions);
        let (explained, coefficients) = prepared.solve();
        let changed = &prepared.projected * DVector::from_column_slice(&coefficients);
        let followed = &self.inverse * &self.nuisance_residual - changed;
        Score { explained, coefficients, followed: followed.iter().copied().collect() }
    }
}

impl ScoreTest<'_> {
    /// What all of `directions` together explain where something is believed of each: `precision` per direction, in
    /// its units.
    pub fn explained_believed(&self, directions: &[Trace], precision: &[f64]) -> f64 {
        let Prepared { mut gram, gradient, .. } = self.prepare(directions);
        for (i, p) in precision.iter().enumerate() {
            gram[(i, i)] += p;
        }
        gram.cholesky().map_or(0.0, |factor| gradient.dot(&factor.solve(&gradient)))
    }
}

/// The inverse of the products of directions, those that depend on others left out. They are scaled to a unit diagonal
/// first, so that directions of different units can be told from dependent ones.
fn scaled_inverse(gram: &DMatrix<f64>) -> DMatrix<f64> {
    let n = gram.nrows();
    let scale = DVector::from_fn(n, |i, _| 1.0 / gram[(i, i)].max(1e-30).sqrt());
    let scaled = DMatrix::from_fn(n, n, |i, j| gram[(i, j)] * scale[i] * scale[j]);
    let inverse = scaled.pseudo_inverse(1e-8).unwrap_or_else(|_| DMatrix::zeros(n, n));
    DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j])
}

/// Products of directions with a residual and with each other.
pub struct Prepared {
    /// ⟨dᵢ, dⱼ⟩ without the nuisance.
    pub gram: DMatrix<f64>,
    /// ⟨dᵢ, residual⟩ likewise.
    pub gradient: DVector<f64>,
    /// Per nuisance direction (row) and direction (column): how far the nuisance follows in its place.
    pub projected: DMatrix<f64>,
}

impl Prepared {
    /// Deviance explained by all directions and their coefficients.
    pub fn solve(&self) -> (f64, Vec<f64>) {
        let solution = scaled_inverse(&self.gram) * &self.gradient;
        (self.gradient.dot(&solution), solution.iter().copied().collect())
    }

    /// What some of the directions explain of another one's unit change: the fall of the deviance.
    pub fn explained_of(&self, some: &[usize], other: usize) -> f64 {
        let cross = self.part(some, &[other]);
        (cross.tr_mul(&(scaled_inverse(&self.part(some, some)) * &cross)))[(0, 0)]
    }

    /// How much two sets of directions have in common: the sum of the squared cosines of the angles between them, from
    /// 0 to the smaller of their numbers.
    pub fn overlap(&self, some: &[usize], others: &[usize]) -> f64 {
        let cross = self.part(some, others);
        let [own, theirs] = [some, others].map(|set| scaled_inverse(&self.part(set, set)));
        (own * &cross * theirs * cross.transpose()).trace()
    }

    fn part(&self, rows: &[usize], columns: &[usize]) -> DMatrix<f64> {
        DMatrix::from_fn(rows.len(), columns.len(), |i, j| self.gram[(rows[i], columns[j])])
    }

    /// Deviance explained by a sum of some directions with weights, and its coefficient.
    pub fn of_weighted(&self, members: &[(usize, f64)]) -> (f64, f64) {
        let mut g = 0.0;
        let mut h = 0.0;
        for &(i, a) in members {
            g += a * self.gradient[i];
            for &(j, b) in members {
                h += a * b * self.gram[(i, j)];
            }
        }
        if h > 0.0 { (g * g / h, g / h) } else { (0.0, 0.0) }
    }

    /// Deviance explained by the sum of some directions, and its coefficient.
    pub fn of_sum(&self, members: &[usize]) -> (f64, f64) {
        let weighted: Vec<(usize, f64)> = members.iter().map(|&i| (i, 1.0)).collect();
        self.of_weighted(&weighted)
    }
}
