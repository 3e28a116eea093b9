//! A surrogate of what has been evaluated of one structure: Gaussian processes that pass near every value seen and say
//! how little they know elsewhere.
//!
//! Gains and margins are learnt one by one and not the objective, which has a kink wherever another gain becomes the
//! least. What the fine mesh gives is what the coarse one gives and a correction that is a process of its own (Kennedy
//! and O'Hagan, Biometrika 87 (2000) 1):
//! k(x, y) = M(|x − y| / ℓ) + (x − ½)·(y − ½) + ν δ(x, y), and τ (1 + M(|x − y| / ℓ)) more where both are fine, with
//! Matérn's M of smoothness 5/2: a smooth field on a plane, and a nugget ν for what jumps from design to design as
//! whole voxels come and go. ℓ, ν and τ are, for each process, those of the largest likelihood; its size then follows.
//! (Rasmussen and Williams, Gaussian processes for machine learning, ch. 2, 4 and 5.)

use super::fidelity::Fidelity;
use nalgebra::{DMatrix, DVector};

/// ℓ, in ranges of the variables.
const LENGTHS: [f64; 4] = [0.35, 0.7, 1.4, 2.8];
/// ν.
const NUGGETS: [f64; 4] = [1e-6, 1e-4, 1e-2, 1e-1];
/// τ.
const CORRECTIONS: [f64; 3] = [1e-5, 1e-3, 1e-1];
/// Variance of a process that has been the same everywhere.
const LEAST_VARIANCE: f64 = 1e-12;

/// A design and how finely it was solved.
#[derive(Clone, Debug)]
pub(super) struct Seen {
    pub point: Vec<f64>,
    pub fidelity: Fidelity,
}

/// ℓ, ν and τ.
#[derive(Clone, Copy)]
struct Kernel {
    length: f64,
    nugget: f64,
    correction: f64,
}

/// Processes that share a kernel.
struct Group {
    kernel: Kernel,
    /// K⁻¹.
    inverse: DMatrix<f64>,
    /// Which they are.
    processes: Vec<usize>,
    /// K⁻¹ (y − m), a column per process of the group.
    weights: DMatrix<f64>,
    /// Standard deviation of each process of the group.
    sizes: Vec<f64>,
}

/// Fitted processes.
pub(super) struct Surrogate {
    seen: Vec<Seen>,
    groups: Vec<Group>,
    /// m of each process.
    means: Vec<f64>,
}

impl Surrogate {
    /// Fits a process to each of the values, `[design][process]`; `None` without designs.
    pub(super) fn fit(seen: &[Seen], values: &[Vec<f64>]) -> Option<Surrogate> {
        let num_processes = values.first()?.len();
        let means: Vec<f64> =
            (0..num_processes).map(|c| values.iter().map(|v| v[c]).sum::<f64>() / values.len() as f64).collect();
        let centred = DMatrix::from_fn(values.len(), num_processes, |i, c| values[i][c] - means[c]);
        // Without fine designs, or without coarse ones, nothing is told of τ.
        let is_mixed = seen.iter().any(|s| s.fidelity != seen[0].fidelity);
        let corrections = if is_mixed { &CORRECTIONS[..] } else { &CORRECTIONS[1..2] };
        let mut fits: Vec<Fit> = Vec::new();
        for length in LENGTHS {
            for nugget in NUGGETS {
                let kernels = corrections.iter().map(|&correction| Kernel { length, nugget, correction });
                fits.extend(kernels.filter_map(|kernel| Fit::of(kernel, seen, &centred)));
            }
        }
        let best = |process: usize| {
            (0..fits.len()).max_by(|&a, &b| fits[a].log_likelihood[process].total_cmp(&fits[b].log_likelihood[process]))
        };
        let choice: Vec<usize> = (0..num_processes).map(best).collect::<Option<_>>()?;
        let group = |(index, fit): (usize, Fit)| {
            let processes: Vec<usize> = (0..num_processes).filter(|&p| choice[p] == index).collect();
            (!processes.is_empty()).then(|| Group {
                kernel: fit.kernel,
                inverse: fit.factor.inverse(),
                weights: DMatrix::from_fn(seen.len(), processes.len(), |i, c| fit.weights[(i, processes[c])]),
                sizes: processes.iter().map(|&p| fit.variances[p].sqrt()).collect(),
                processes,
            })
        };
        let groups = fits.into_iter().enumerate().filter_map(group).collect();
        Some(Surrogate { seen: seen.to_vec(), groups, means })
    }

    /// Mean and standard deviation of what a solution as fine as `at` would give, of each process at a point.
    pub(super) fn predict(&self, point: &[f64], at: Fidelity) -> Vec<(f64, f64)> {
        let mut predicted = vec![(0.0, 0.0); self.means.len()];
        let x = Seen { point: point.to_vec(), fidelity: at };
        for group in &self.groups {
            let near = DVector::from_fn(self.seen.len(), |i, _| group.kernel.covariance(&x, &self.seen[i]));
            let known = near.dot(&(&group.inverse * &near));
            let share = (group.kernel.covariance(&x, &x) - known).max(0.0).sqrt();
            let means = group.weights.tr_mul(&near);
            for (c, &process) in group.processes.iter().enumerate() {
                predicted[process] = (self.means[process] + means[c], share * group.sizes[c]);
            }
        }
        predicted
    }

    /// The means of [`Self::predict`] alone, which cost a part of it.
    pub(super) fn means(&self, point: &[f64], at: Fidelity) -> Vec<f64> {
        let mut means = self.means.clone();
        let x = Seen { point: point.to_vec(), fidelity: at };
        for group in &self.groups {
            let near = DVector::from_fn(self.seen.len(), |i, _| group.kernel.covariance(&x, &self.seen[i]));
            for (c, &process) in group.processes.iter().enumerate() {
                means[process] += group.weights.column(c).dot(&near);
            }
        }
        means
    }

    /// Distance to the nearest design that was solved as finely as `at`.
    pub(super) fn nearest(&self, x: &[f64], at: Fidelity) -> f64 {
        let alike = self.seen.iter().filter(|s| s.fidelity == at);
        alike.map(|s| distance(&s.point, x)).fold(f64::INFINITY, f64::min)
    }
}

/// What a kernel makes of all processes.
struct Fit {
    kernel: Kernel,
    factor: nalgebra::Cholesky<f64, nalgebra::Dyn>,
    weights: DMatrix<f64>,
    variances: Vec<f64>,
    log_likelihood: Vec<f64>,
}

impl Fit {
    fn of(kernel: Kernel, seen: &[Seen], centred: &DMatrix<f64>) -> Option<Fit> {
        let matrix = DMatrix::from_fn(seen.len(), seen.len(), |i, j| {
            kernel.covariance(&seen[i], &seen[j]) + if i == j { kernel.nugget } else { 0.0 }
        });
        let factor = matrix.cholesky()?;
        let weights = factor.solve(centred);
        let num = seen.len() as f64;
        let variances: Vec<f64> = (0..centred.ncols())
            .map(|c| (centred.column(c).dot(&weights.column(c)) / num).max(LEAST_VARIANCE))
            .collect();
        let log_determinant = 2.0 * factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let log_likelihood = variances.iter().map(|v| -0.5 * (num * v.ln() + log_determinant)).collect();
        Some(Fit { kernel, factor, weights, variances, log_likelihood })
    }
}

impl Kernel {
    fn covariance(&self, a: &Seen, b: &Seen) -> f64 {
        let r = 5f64.sqrt() * distance(&a.point, &b.point) / self.length;
        let field = (1.0 + r + r * r / 3.0) * (-r).exp();
        let plane: f64 = a.point.iter().zip(&b.point).map(|(a, b)| (a - 0.5) * (b - 0.5)).sum();
        let are_fine = a.fidelity == Fidelity::Fine && b.fidelity == Fidelity::Fine;
        field + plane + if are_fine { self.correction * (1.0 + field) } else { 0.0 }
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Vec<Vec<f64>> {
        (0..6).flat_map(|i| (0..6).map(move |j| vec![f64::from(i) / 5.0, f64::from(j) / 5.0])).collect()
    }

    fn fine(points: &[Vec<f64>]) -> Vec<Seen> {
        points.iter().map(|p| Seen { point: p.clone(), fidelity: Fidelity::Fine }).collect()
    }

    /// Between the points of a grid of a fifth, smooth functions are met to a hundredth of their range, and the stated
    /// deviation is of that size; far away it is larger.
    #[test]
    fn smooth_functions_are_met() {
        let functions = |x: &[f64]| vec![(2.0 * x[0] + x[1]).sin(), 3.0 * x[0] - x[1], (x[0] - 0.3).powi(2)];
        let points = grid();
        let values: Vec<Vec<f64>> = points.iter().map(|p| functions(p)).collect();
        let surrogate = Surrogate::fit(&fine(&points), &values).expect("there are points");
        for x in [[0.11, 0.53], [0.5, 0.5], [0.93, 0.27]] {
            for ((mean, sd), truth) in surrogate.predict(&x, Fidelity::Fine).into_iter().zip(functions(&x)) {
                assert!((mean - truth).abs() < 0.01 && sd < 0.05, "{x:?} {mean} {sd} {truth}");
            }
        }
        let (here, far) =
            (surrogate.predict(&[0.5, 0.5], Fidelity::Fine)[0].1, surrogate.predict(&[3.0, 3.0], Fidelity::Fine)[0].1);
        assert!(far > 10.0 * here, "{here} {far}");
    }

    /// Jumps of alternating sign are taken for what they are: the mean passes between them.
    #[test]
    fn jumps_are_smoothed() {
        let points = grid();
        let jump = |i: usize| if (i / 6 + i).is_multiple_of(2) { 0.05 } else { -0.05 };
        let values: Vec<Vec<f64>> = points.iter().enumerate().map(|(i, p)| vec![p[0] + jump(i)]).collect();
        let surrogate = Surrogate::fit(&fine(&points), &values).expect("there are points");
        let off = points.iter().map(|p| (surrogate.predict(p, Fidelity::Fine)[0].0 - p[0]).abs()).sum::<f64>() / 36.0;
        assert!(off < 0.03, "{off}");
    }

    /// A field seen coarsely on the grid, a tenth too low, and finely at three points: the fine field is met elsewhere
    /// too. A second field, which both meshes give alike, does not suffer.
    #[test]
    fn a_few_fine_designs_correct_many_coarse_ones() {
        let field = |x: &[f64]| (2.0 * x[0] + x[1]).sin();
        let points = grid();
        let mut seen: Vec<Seen> =
            points.iter().map(|p| Seen { point: p.clone(), fidelity: Fidelity::Coarse }).collect();
        let mut values: Vec<Vec<f64>> = points.iter().map(|p| vec![field(p) - 0.1, p[0]]).collect();
        for p in [vec![0.1, 0.9], vec![0.5, 0.3], vec![0.9, 0.6]] {
            values.push(vec![field(&p), p[0]]);
            seen.extend(fine(&[p]));
        }
        let surrogate = Surrogate::fit(&seen, &values).expect("there are points");
        for x in [[0.11, 0.53], [0.5, 0.5], [0.83, 0.27]] {
            let predicted = surrogate.predict(&x, Fidelity::Fine);
            // A fifth of what the coarse field is off by; the other as without corrections.
            assert!((predicted[0].0 - field(&x)).abs() < 0.02, "{x:?} {predicted:?} {}", field(&x));
            assert!((predicted[1].0 - x[0]).abs() < 1e-3, "{x:?} {predicted:?}");
        }
    }
}
