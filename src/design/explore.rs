//! Sampling of makeable designs: stratified in every variable (Latin hypercube), shrunk until the geometry limits hold.

use super::space::{Subspace, Variable};
use crate::specimen::{ManufacturingLimits, Outline, Specimen};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Attempts at one sample before it is given up.
const ATTEMPTS: usize = 60;

/// Geometry margins of a specimen, mm (voxels for the voxel limit): ≥ 0 where the limits are kept. Their number depends
/// on the number of holes and the kind of outline alone.
pub fn geometry_margins(specimen: &Specimen, limits: &ManufacturingLimits, voxel_mm: [f64; 3]) -> Vec<f64> {
    let mut margins = Vec::new();
    for sample in specimen.samples() {
        for ligament in sample.ligaments() {
            margins.push(ligament.length_mm - limits.min_ligament_mm(ligament.kind));
            if let Some(fewest) = limits.min_voxels_across_ligament {
                let across =
                    ManufacturingLimits::voxels_across(&sample, ligament.length_mm, ligament.direction, voxel_mm);
                margins.push(across - fewest);
            }
        }
        if let Outline::Dumbbell(gauge) = &sample.outline {
            margins.extend(gauge.slacks_mm([sample.block.length_mm, sample.block.width_mm]));
        }
    }
    margins
}

/// Whether every geometry limit is kept.
pub fn is_makeable(specimen: &Specimen, limits: &ManufacturingLimits, voxel_mm: [f64; 3]) -> bool {
    specimen.validate().is_ok() && limits.check_geometry(specimen, voxel_mm).iter().all(|m| m.is_satisfied)
}

/// Up to `count` makeable vectors of a subspace, of which every other one takes what is `known` of its variables. The
/// random numbers depend on `seed` and `stream` alone.
pub fn sample(
    subspace: &Subspace,
    (limits, voxel_mm): (&ManufacturingLimits, [f64; 3]),
    count: usize,
    (seed, stream): (u64, u64),
    known: &[(Variable, f64)],
) -> Vec<Vec<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    let n = subspace.variables.len();
    let mut strata: Vec<Vec<usize>> = (0..n).map(|_| permutation(count, &mut rng)).collect();
    let mut samples = Vec::with_capacity(count);
    for index in 0..count {
        for attempt in 0..ATTEMPTS {
            let mut vector: Vec<f64> = (0..n)
                .map(|v| {
                    let within: f64 = rng.random();
                    // After a failure the strata are given up: anything makeable will do.
                    if attempt == 0 { (strata[v][index] as f64 + within) / count as f64 } else { within }
                })
                .collect();
            for (v, variable) in subspace.variables.iter().enumerate() {
                // The largest drive is nearly always best: three of four samples take it.
                if *variable == Variable::Drive && index % 4 != 3 {
                    vector[v] = 1.0;
                }
                if let Some((_, value)) = known.iter().find(|(k, _)| k == variable && index % 2 == 0) {
                    vector[v] = *value;
                }
            }
            if let Some(vector) = shrink(subspace, vector, limits, voxel_mm) {
                samples.push(vector);
                break;
            }
        }
    }
    strata.clear();
    samples
}

/// Smaller holes until the specimen can be made.
fn shrink(
    subspace: &Subspace,
    mut vector: Vec<f64>,
    limits: &ManufacturingLimits,
    voxel_mm: [f64; 3],
) -> Option<Vec<f64>> {
    for _ in 0..8 {
        if is_makeable(&subspace.specimen(&vector), limits, voxel_mm) {
            return Some(vector);
        }
        let mut is_shrunk = false;
        for (v, variable) in subspace.variables.iter().enumerate() {
            if matches!(variable, Variable::Diameter(_) | Variable::Elongation(_)) && vector[v] > 1e-3 {
                vector[v] *= 0.6;
                is_shrunk = true;
            }
        }
        if !is_shrunk {
            return None;
        }
    }
    None
}

fn permutation(count: usize, rng: &mut impl Rng) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    for i in (1..count).rev() {
        order.swap(i, rng.random_range(0..=i));
    }
    order
}
