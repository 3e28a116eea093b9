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
    let ranges: Vec<[f64; 2]> =
        study.variables.iter().map(|v| v.range.map_or([0.0, 0.0], |r| [r.min, r.max])).collect();
    latin_hypercube_points(&ranges, count, study.seed)
}

/// `count` points of a Latin hypercube over `ranges` (least and greatest value of each variable): along every variable
/// one point lies in each of `count` equal parts. The same arguments give the same points.
pub fn latin_hypercube_points(ranges: &[[f64; 2]], count: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut points = vec![vec![0.0; ranges.len()]; count];
    for (v, &[min, max]) in ranges.iter().enumerate() {
        // Each variable has a stream of its own: adding one leaves the others' samples as they are.
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(v as u64);
        let mut strata: Vec<usize> = (0..count).collect();
        for i in (1..count).rev() {
            strata.swap(i, rng.random_range(0..=i));
        }
        for (point, stratum) in points.iter_mut().zip(strata) {
            let within: f64 = rng.random();
            point[v] = min + (max - min) * (stratum as f64 + within) / count as f64;
        }
    }
    points
}
