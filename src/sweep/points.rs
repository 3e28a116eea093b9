//! The points of a sampled space, from the study alone.

use super::study::{Sampling, SweepStudy};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// All points, values in the order of the variables. The same study gives the same points.
pub(super) fn points(study: &SweepStudy) -> Vec<Vec<f64>> {
    match &study.sampling {
        Sampling::List { rows } => rows.clone(),
        Sampling::Grid {} => (0..study.num_points()).map(|index| grid_point(study, index)).collect(),
        Sampling::LatinHypercube { count } => latin_hypercube(study, *count),
    }
}

/// The last variable changes fastest.
fn grid_point(study: &SweepStudy, mut index: usize) -> Vec<f64> {
    let mut point = vec![0.0; study.variables.len()];
    for (slot, variable) in point.iter_mut().zip(&study.variables).rev() {
        let n = variable.grid_len();
        *slot = variable.grid_value(index % n);
        index /= n;
    }
    point
}

fn latin_hypercube(study: &SweepStudy, count: usize) -> Vec<Vec<f64>> {
    let mut points = vec![vec![0.0; study.variables.len()]; count];
    for (v, variable) in study.variables.iter().enumerate() {
        // Each variable has a stream of its own: adding one leaves the others' samples as they are.
        let mut rng = ChaCha8Rng::seed_from_u64(study.seed);
        rng.set_stream(v as u64);
        let mut strata: Vec<usize> = (0..count).collect();
        for i in (1..count).rev() {
            strata.swap(i, rng.random_range(0..=i));
        }
        let (min, max) = variable.range.map_or((0.0, 0.0), |r| (r.min, r.max));
        for (point, stratum) in points.iter_mut().zip(strata) {
            let within: f64 = rng.random();
            point[v] = min + (max - min) * (stratum as f64 + within) / count as f64;
        }
    }
    points
}
