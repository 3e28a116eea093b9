//! Where fits of relaxations start: at given times the force is linear in the strengths, so a logarithmic grid of times
//! is searched by linear fits with strengths ≥ 0.

use nalgebra::{DMatrix, DVector};

/// Times of the grid.
const GRID: usize = 14;

/// A start: values of the free columns, then (strength × scale, τ) of each term, shortest first.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct PronyStart {
    pub(crate) free: Vec<f64>,
    pub(crate) terms: Vec<(f64, f64)>,
    pub(crate) sum_of_squares: f64,
}

/// Median sampling interval and duration, s: relaxations outside these cannot be told from none, or from equilibrium.
pub(crate) fn time_range(time_s: &[f64]) -> [f64; 2] {
    let mut steps: Vec<f64> = time_s.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 0.0).collect();
    if steps.is_empty() {
        return [1.0, 1.0];
    }
    steps.sort_by(f64::total_cmp);
    let duration = time_s[time_s.len() - 1] - time_s[0];
    [steps[steps.len() / 2], duration.max(steps[steps.len() / 2])]
}

/// The `count` best starts with `num_terms` relaxations for data = Σ free·a + Σ memory(τ)·b, b ≥ 0.
pub(crate) fn prony_starts(
    time_s: &[f64],
    num_terms: usize,
    free: &[DVector<f64>],
    memory: &dyn Fn(f64) -> DVector<f64>,
    data: &DVector<f64>,
    count: usize,
) -> Vec<PronyStart> {
    let [shortest, longest] = time_range(time_s);
    let (low, high) = (shortest.ln(), (2.0 * longest).ln());
    let times: Vec<f64> = (0..GRID).map(|i| (low + (high - low) * i as f64 / (GRID - 1) as f64).exp()).collect();
    let mut columns: Vec<DVector<f64>> = free.to_vec();
    columns.extend(times.iter().map(|&t| memory(t)));
    let norm: Vec<f64> = columns.iter().map(|c| c.norm().max(1e-300)).collect();
    for (c, n) in columns.iter_mut().zip(&norm) {
        *c /= *n;
    }
    let all = DMatrix::from_columns(&columns);
    let (gram, right, square) = (all.transpose() * &all, all.transpose() * data, data.norm_squared());
    let mut found = Vec::new();
    let mut chosen = Vec::new();
    subsets(GRID, num_terms, &mut chosen, &mut |set| {
        let mut used: Vec<usize> = (0..free.len()).chain(set.iter().map(|i| free.len() + i)).collect();
        let solution = loop {
            let m = used.len();
            let matrix = DMatrix::from_fn(m, m, |a, b| gram[(used[a], used[b])] + if a == b { 1e-10 } else { 0.0 });
            let vector = DVector::from_fn(m, |a, _| right[used[a]]);
            let Some(c) = matrix.cholesky() else { return };
            let solution = c.solve(&vector);
            let worst = (free.len()..m).min_by(|&a, &b| solution[a].total_cmp(&solution[b]));
            match worst {
                Some(a) if solution[a] < 0.0 => {
                    used.remove(a);
                }
                _ => break solution,
            }
        };
        let gain: f64 = used.iter().zip(solution.iter()).map(|(&u, s)| s * right[u]).sum();
        let value = |column: usize| used.iter().position(|&u| u == column).map_or(0.0, |a| solution[a] / norm[column]);
        found.push(PronyStart {
            free: (0..free.len()).map(value).collect(),
            terms: set.iter().map(|&i| (value(free.len() + i), times[i])).collect(),
            sum_of_squares: square - gain,
        });
    });
    found.sort_by(|a, b| a.sum_of_squares.total_cmp(&b.sum_of_squares));
    // Neighbours on the grid lead to the same minimum: keep starts that differ by more than a grid step somewhere.
    let step = (high - low) / (GRID - 1) as f64;
    let mut kept: Vec<PronyStart> = Vec::new();
    for start in found {
        let is_near =
            |k: &PronyStart| k.terms.iter().zip(&start.terms).all(|(a, b)| (a.1.ln() - b.1.ln()).abs() < 1.5 * step);
        if !kept.iter().any(is_near) {
            kept.push(start);
        }
        if kept.len() == count {
            break;
        }
    }
    kept
}

/// Calls `visit` with every rising set of `num` indices below `count`, neighbours at least two apart.
fn subsets(count: usize, num: usize, chosen: &mut Vec<usize>, visit: &mut dyn FnMut(&[usize])) {
    if chosen.len() == num {
        visit(chosen);
        return;
    }
    let first = chosen.last().map_or(0, |i| i + 2);
    for i in first..count {
        chosen.push(i);
        subsets(count, num, chosen, visit);
        chosen.pop();
    }
}
