//! A surrogate of what has been evaluated of one structure: Gaussian processes that pass near every value seen and say
//! how little they know elsewhere.
//!
//! Gains and margins are learnt one by one and not the objective, which has a kink wherever another gain becomes the
//! least. All share one covariance, k(x, y) = M(|x − y| / ℓ) + (x − ½)·(y − ½) + ν δ(x, y) with Matérn's M of
//! smoothness 5/2: a smooth field on a plane, and a nugget ν for what jumps from design to design as whole voxels come
//! and go. ℓ and ν are those of the largest likelihood, the size of each process then follows. (Rasmussen and Williams,
//! Gaussian processes for machine learning, ch. 2, 4 and 5.)

use nalgebra::{DMatrix, DVector};

/// ℓ, in ranges of the variables.
const LENGTHS: [f64; 4] = [0.35, 0.7, 1.4, 2.8];
/// ν.
const NUGGETS: [f64; 3] = [1e-6, 1e-4, 1e-2];
/// Variance of a process that has been the same everywhere.
const LEAST_VARIANCE: f64 = 1e-12;

/// Fitted processes.
pub(super) struct Surrogate {
    points: Vec<Vec<f64>>,
    length: f64,
    /// K⁻¹.
    inverse: DMatrix<f64>,
    /// K⁻¹ (y − m), a column per process.
    weights: DMatrix<f64>,
    /// m.
    means: Vec<f64>,
    /// Standard deviation of each process.
    sizes: Vec<f64>,
}

impl Surrogate {
    /// Fits a process to each of the values, `[point][process]`; `None` without points.
    pub(super) fn fit(points: &[Vec<f64>], values: &[Vec<f64>]) -> Option<Surrogate> {
        let num_processes = values.first()?.len();
        let means: Vec<f64> =
            (0..num_processes).map(|c| values.iter().map(|v| v[c]).sum::<f64>() / values.len() as f64).collect();
        let centred = DMatrix::from_fn(values.len(), num_processes, |i, c| values[i][c] - means[c]);
        let pairs = LENGTHS.iter().flat_map(|&length| NUGGETS.iter().map(move |&nugget| (length, nugget)));
        let fitted = pairs.filter_map(|(length, nugget)| {
            let matrix = DMatrix::from_fn(points.len(), points.len(), |i, j| {
                covariance(length, &points[i], &points[j]) + if i == j { nugget } else { 0.0 }
            });
            let factor = matrix.cholesky()?;
            let weights = factor.solve(&centred);
            let num = points.len() as f64;
            let variances: Vec<f64> = (0..num_processes)
                .map(|c| (centred.column(c).dot(&weights.column(c)) / num).max(LEAST_VARIANCE))
                .collect();
            let log_determinant = 2.0 * factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
            let of_process = |v: &f64| -0.5 * (num * v.ln() + log_determinant);
            let log_likelihood: f64 = variances.iter().map(of_process).sum();
            let sizes = variances.into_iter().map(f64::sqrt).collect();
            let inverse = factor.inverse();
            let fit = Surrogate { points: points.to_vec(), length, inverse, weights, means: means.clone(), sizes };
            Some((log_likelihood, fit))
        });
        fitted.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, fit)| fit)
    }

    /// Mean and standard deviation of each process at a point.
    pub(super) fn predict(&self, x: &[f64]) -> Vec<(f64, f64)> {
        let near = DVector::from_fn(self.points.len(), |i, _| covariance(self.length, x, &self.points[i]));
        let known = near.dot(&(&self.inverse * &near));
        let share = (covariance(self.length, x, x) - known).max(0.0).sqrt();
        let means = self.weights.tr_mul(&near);
        (0..self.means.len()).map(|c| (self.means[c] + means[c], share * self.sizes[c])).collect()
    }

    /// Distance to the nearest point seen.
    pub(super) fn nearest(&self, x: &[f64]) -> f64 {
        self.points.iter().map(|p| distance(p, x)).fold(f64::INFINITY, f64::min)
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

fn covariance(length: f64, a: &[f64], b: &[f64]) -> f64 {
    let r = 5f64.sqrt() * distance(a, b) / length;
    let plane: f64 = a.iter().zip(b).map(|(a, b)| (a - 0.5) * (b - 0.5)).sum();
    (1.0 + r + r * r / 3.0) * (-r).exp() + plane
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Vec<Vec<f64>> {
        (0..6).flat_map(|i| (0..6).map(move |j| vec![f64::from(i) / 5.0, f64::from(j) / 5.0])).collect()
    }

    /// Between the points of a grid of a fifth, smooth functions are met to a hundredth of their range, and the stated
    /// deviation is of that size; far away it is larger.
    #[test]
    fn smooth_functions_are_met() {
        let functions = |x: &[f64]| vec![(2.0 * x[0] + x[1]).sin(), 3.0 * x[0] - x[1], (x[0] - 0.3).powi(2)];
        let points = grid();
        let values: Vec<Vec<f64>> = points.iter().map(|p| functions(p)).collect();
        let surrogate = Surrogate::fit(&points, &values).expect("there are points");
        for x in [[0.11, 0.53], [0.5, 0.5], [0.93, 0.27]] {
            for ((mean, sd), truth) in surrogate.predict(&x).into_iter().zip(functions(&x)) {
                assert!((mean - truth).abs() < 0.01 && sd < 0.05, "{x:?} {mean} {sd} {truth}");
            }
        }
        let (here, far) = (surrogate.predict(&[0.5, 0.5])[0].1, surrogate.predict(&[3.0, 3.0])[0].1);
        assert!(far > 10.0 * here, "{here} {far}");
    }

    /// Jumps of alternating sign are taken for what they are: the mean passes between them.
    #[test]
    fn jumps_are_smoothed() {
        let points = grid();
        let jump = |i: usize| if (i / 6 + i).is_multiple_of(2) { 0.05 } else { -0.05 };
        let values: Vec<Vec<f64>> = points.iter().enumerate().map(|(i, p)| vec![p[0] + jump(i)]).collect();
        let surrogate = Surrogate::fit(&points, &values).expect("there are points");
        let off = points.iter().map(|p| (surrogate.predict(p)[0].0 - p[0]).abs()).sum::<f64>() / 36.0;
        assert!(off < 0.03, "{off}");
    }
}
