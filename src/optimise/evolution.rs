//! Covariance matrix adaptation: an evolution strategy for functions that are known by their order alone.
//!
//! Points are drawn from a normal distribution; the better half of them moves its mean, and its covariance learns the
//! directions in which steps have paid. Neither derivatives nor continuity are asked for: objectives that count whole
//! voxels, and limits that are kept or not, are ranked like any other. (Hansen, The CMA evolution strategy: a tutorial,
//! arXiv:1604.00772; the symbols are his.)

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// The largest condition of the covariance: beyond it a direction would no longer be searched.
const LARGEST_CONDITION: f64 = 1e12;

/// The distribution from which points are drawn.
#[derive(Clone, Debug)]
pub struct Evolution {
    mean: DVector<f64>,
    /// σ.
    step: f64,
    covariance: DMatrix<f64>,
    /// Square root of the covariance, and of its inverse.
    root: DMatrix<f64>,
    inverse_root: DMatrix<f64>,
    /// p_σ and p_c.
    path_of_step: DVector<f64>,
    path: DVector<f64>,
    /// Weights of the better half, best first; they sum to one.
    weights: Vec<f64>,
    num_generations: u32,
}

impl Evolution {
    /// Around `start`, with standard deviation `step` in every direction.
    pub fn new(start: &[f64], step: f64) -> Evolution {
        let n = start.len();
        let population = population(n);
        let raw: Vec<f64> =
            (0..population / 2).map(|i| (0.5 * (population as f64 + 1.0)).ln() - (i as f64 + 1.0).ln()).collect();
        let total: f64 = raw.iter().sum();
        Evolution {
            mean: DVector::from_column_slice(start),
            step,
            covariance: DMatrix::identity(n, n),
            root: DMatrix::identity(n, n),
            inverse_root: DMatrix::identity(n, n),
            path_of_step: DVector::zeros(n),
            path: DVector::zeros(n),
            weights: raw.into_iter().map(|w| w / total).collect(),
            num_generations: 0,
        }
    }

    /// Points that a generation has.
    pub fn population(&self) -> usize {
        population(self.mean.len())
    }

    /// σ: how far from the mean points are drawn.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// A point of the next generation.
    pub fn draw(&self, rng: &mut impl Rng) -> Vec<f64> {
        let z = DVector::from_fn(self.mean.len(), |_, _| StandardNormal.sample(rng));
        (&self.mean + self.step * (&self.root * z)).as_slice().to_vec()
    }

    /// Learns from a generation, best point first. Points may have been moved after they were drawn, onto a bound for
    /// instance.
    pub fn learn(&mut self, ranked: &[Vec<f64>]) {
        let n = self.mean.len() as f64;
        if ranked.len() < self.weights.len() || self.mean.is_empty() {
            return;
        }
        self.num_generations += 1;
        let mu_eff = 1.0 / self.weights.iter().map(|w| w * w).sum::<f64>();
        let c_sigma = (mu_eff + 2.0) / (n + mu_eff + 5.0);
        let d_sigma = 1.0 + 2.0 * (((mu_eff - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0) + c_sigma;
        let c_c = (4.0 + mu_eff / n) / (n + 4.0 + 2.0 * mu_eff / n);
        let c_1 = 2.0 / ((n + 1.3).powi(2) + mu_eff);
        let c_mu = (1.0 - c_1).min(2.0 * (mu_eff - 2.0 + 1.0 / mu_eff) / ((n + 2.0).powi(2) + mu_eff));
        let steps: Vec<DVector<f64>> = ranked[..self.weights.len()]
            .iter()
            .map(|x| (DVector::from_column_slice(x) - &self.mean) / self.step)
            .collect();
        let mean_step = steps.iter().zip(&self.weights).fold(DVector::zeros(self.mean.len()), |s, (y, w)| s + y * *w);
        self.mean += self.step * &mean_step;
        self.path_of_step = (1.0 - c_sigma) * &self.path_of_step
            + (c_sigma * (2.0 - c_sigma) * mu_eff).sqrt() * (&self.inverse_root * &mean_step);
        // E‖N(0, I)‖.
        let expected = n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n));
        let length = self.path_of_step.norm();
        let settled = (1.0 - (1.0 - c_sigma).powi(2 * self.num_generations as i32)).sqrt();
        let is_stalled = length / settled >= (1.4 + 2.0 / (n + 1.0)) * expected;
        let h = if is_stalled { 0.0 } else { 1.0 };
        self.path = (1.0 - c_c) * &self.path + h * (c_c * (2.0 - c_c) * mu_eff).sqrt() * &mean_step;
        let of_steps =
            steps.iter().zip(&self.weights).fold(&self.covariance * 0.0, |s, (y, w)| s + *w * y * y.transpose());
        let lost = (1.0 - h) * c_c * (2.0 - c_c);
        self.covariance = (1.0 - c_1 - c_mu + c_1 * lost) * &self.covariance
            + c_1 * &self.path * self.path.transpose()
            + c_mu * of_steps;
        self.step *= ((c_sigma / d_sigma) * (length / expected - 1.0)).clamp(-1.0, 1.0).exp();
        self.take_roots();
    }

    fn take_roots(&mut self) {
        let symmetric = 0.5 * (&self.covariance + self.covariance.transpose());
        let SymmetricEigen { eigenvectors, eigenvalues } = symmetric.symmetric_eigen();
        let least = eigenvalues.max() / LARGEST_CONDITION;
        let values = eigenvalues.map(|v| v.max(least));
        let with =
            |f: fn(f64) -> f64| &eigenvectors * DMatrix::from_diagonal(&values.map(f)) * eigenvectors.transpose();
        self.covariance = with(|v| v);
        self.root = with(f64::sqrt);
        self.inverse_root = with(|v| 1.0 / v.sqrt());
    }
}

/// λ for `n` unknowns.
fn population(n: usize) -> usize {
    4 + (3.0 * (n.max(1) as f64).ln()).floor() as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn minimum(f: impl Fn(&[f64]) -> f64, start: &[f64], num_generations: usize, seed: u64) -> (f64, f64) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut evolution = Evolution::new(start, 0.3);
        let mut least = f64::INFINITY;
        for _ in 0..num_generations {
            let mut points: Vec<Vec<f64>> = (0..evolution.population()).map(|_| evolution.draw(&mut rng)).collect();
            points.sort_by(|a, b| f(a).total_cmp(&f(b)));
            least = least.min(f(&points[0]));
            evolution.learn(&points);
        }
        (least, evolution.step())
    }

    /// Hansen's table of the tutorial's code gives about 10² n evaluations for 10⁻¹⁰ on ill-conditioned ellipsoids and
    /// some more on Rosenbrock's valley; both bounds here are twice what ten seeds took.
    #[test]
    fn ellipsoid_and_valley_are_found() {
        let ellipsoid = |x: &[f64]| -> f64 {
            x.iter().enumerate().map(|(i, v)| 1e6f64.powf(i as f64 / 5.0) * (v - 0.3).powi(2)).sum()
        };
        let valley = |x: &[f64]| -> f64 {
            x.windows(2).map(|p| 100.0 * (p[1] - p[0] * p[0]).powi(2) + (1.0 - p[0]).powi(2)).sum()
        };
        for seed in 0..10 {
            assert!(minimum(ellipsoid, &[1.0; 6], 600, seed).0 < 1e-9, "seed {seed}");
            assert!(minimum(valley, &[0.5; 4], 500, seed).0 < 1e-9, "seed {seed}");
        }
    }

    /// The order is all that counts: any growing function of the objective gives the same points.
    #[test]
    fn only_the_order_counts() {
        let bowl = |x: &[f64]| x.iter().map(|v| (v - 1.0).powi(2)).sum::<f64>();
        let steep = |x: &[f64]| bowl(x).exp().powi(3);
        assert_eq!(minimum(bowl, &[0.0; 3], 20, 5).1.to_bits(), minimum(steep, &[0.0; 3], 20, 5).1.to_bits());
    }
}
