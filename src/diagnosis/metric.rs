//! What a misfit weighs: the covariance of the data, which is noise and an allowance for what no mesh resolves.
//!
//! The covariance of a trace is C = N + B S Bᵀ. N is the scan's noise, independent per voxel and component (inflated by
//! the filter's correlation). B S Bᵀ is the discretisation allowance: smooth displacement errors in proportion to the
//! drive, one per box for boxes of several sizes, larger at the ends where bonded edges are singular. A misfit thus
//! counts by its pattern and size: patterns below the allowance are not evidence, however many voxels show them. C⁻¹ is
//! applied by the Sherman–Morrison–Woodbury formula. (A discrepancy term in the sense of Kennedy and O'Hagan 2001.)
//!
//! The covariance of the forces holds the load cell's drift, an allowance that is common to all drives, and a smaller
//! one of each drive.

use super::trace::Trace;
use crate::calibration::Observed;
use crate::fem::dot;
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

/// Numbers of boxes along x, y, z at each level.
const LEVELS: [[usize; 3]; 3] = [[1, 1, 1], [4, 1, 3], [8, 2, 6]];
/// The ends within this distance (mm) have a larger allowance.
const END_MM: f64 = 2.0;
/// Factor on the allowance there.
const END_FACTOR: f64 = 3.0;
/// Allowance of the force that is common to all drives, as a part of the force: coarse meshes are too stiff at every
/// drive.
const FORCE_COMMON: f64 = 0.004;
/// Allowance of the force at each drive alone, as a part of the force.
const FORCE_EACH: f64 = 0.001;

/// The inner product ⟨a, b⟩ = aᵀ C⁻¹ b of traces.
#[derive(Clone)]
pub struct Metric {
    /// Per step and voxel: variance of a value per component, mm²; of noise, and of what else counts like noise.
    variance_mm2: Vec<Vec<[f64; 3]>>,
    /// Per step and voxel: square roots of what it weighs, mm⁻¹; zero where it does not count.
    roots: Vec<Vec<[f64; 3]>>,
    /// Per step and voxel: whether all of it counts.
    is_used: Vec<Vec<bool>>,
    /// Per voxel: its box at each level (indices into one list).
    boxes: Vec<[u32; LEVELS.len()]>,
    num_boxes: usize,
    /// Per box: S.
    variances: Vec<f64>,
    /// Per step: drive / largest drive.
    scale: Vec<f64>,
    /// Per step: its part of the time of a scan. The variance of the noise is as much larger.
    share: Vec<f64>,
    capacitance: Vec<Cholesky<f64, Dyn>>,
    force_precision: DMatrix<f64>,
    /// Which steps have a force.
    has_force: Vec<bool>,
}

/// A trace with what its inner products need.
pub struct Weighed {
    /// Displacements over their noise; zero where they do not count.
    white: Vec<f64>,
    force: Vec<f64>,
    moments: [DVector<f64>; 3],
    solved: [DVector<f64>; 3],
}

impl Metric {
    /// For `observed`, with an allowance of `allowance_mm` (rms, at the largest drive) and the voxels for which
    /// `is_kept`.
    pub fn new(observed: &Observed, allowance_mm: f64, is_kept: &dyn Fn(usize) -> bool) -> Metric {
        let mask = &observed.mask;
        let b = observed.specimen.block;
        let half = [0.5 * b.length_mm, 0.5 * b.thickness_mm, 0.5 * b.width_mm];
        // Sheared or pulled, the singular edges lie at the ends along x.
        let end_axis = 0;
        let mut first = [0u32; LEVELS.len()];
        let mut num_boxes = 0;
        for (level, counts) in LEVELS.iter().enumerate() {
            first[level] = num_boxes as u32;
            num_boxes += counts.iter().product::<usize>();
        }
        let mut variance = vec![0.0; num_boxes];
        let share = allowance_mm * allowance_mm / LEVELS.len() as f64;
        let boxes: Vec<[u32; LEVELS.len()]> = mask
            .voxels
            .iter()
            .map(|&v| {
                let x = mask.grid.center_mm(v as usize);
                let mut found = [0; LEVELS.len()];
                for (level, counts) in LEVELS.iter().enumerate() {
                    let place = [0, 1, 2].map(|a| {
                        let t = ((x[a] / half[a] + 1.0) * 0.5 * counts[a] as f64).floor();
                        (t.max(0.0) as usize).min(counts[a] - 1)
                    });
                    found[level] = first[level] + (place[0] + counts[0] * (place[1] + counts[1] * place[2])) as u32;
                    let is_end = half[end_axis] - x[end_axis].abs() < END_MM && level > 0;
                    let size = if is_end { share * END_FACTOR * END_FACTOR } else { share };
                    let kept = &mut variance[found[level] as usize];
                    *kept = f64::max(*kept, size);
                }
                found
            })
            .collect();
        let largest = observed.steps.iter().map(|s| s.drive_mm.abs()).fold(1e-12, f64::max);
        let scale: Vec<f64> = observed.steps.iter().map(|s| s.drive_mm.abs() / largest).collect();
        let is_used: Vec<Vec<bool>> = observed
            .steps
            .iter()
            .map(|s| {
                let finite = |u: &[f64; 3]| u.iter().all(|x| x.is_finite());
                s.displacement.iter().enumerate().map(|(v, u)| finite(u) && is_kept(v)).collect()
            })
            .collect();
        let correlation = observed.noise_correlation();
        let of_step = |step: usize| {
            (0..mask.num_voxels()).map(|v| observed.noise_mm2(step, v).map(|noise| correlation * noise)).collect()
        };
        let (force_precision, has_force) = force_precision(observed);
        Metric {
            variance_mm2: (0..observed.steps.len()).map(of_step).collect(),
            roots: Vec::new(),
            is_used,
            boxes,
            num_boxes,
            variances: variance,
            share: vec![1.0; scale.len()],
            scale,
            capacitance: Vec::new(),
            force_precision,
            has_force,
        }
        .prepared()
    }

    /// With what follows from the variances, the voxels that count and the shares of time.
    fn prepared(mut self) -> Metric {
        let steps = self.variance_mm2.iter().zip(&self.is_used).zip(&self.share);
        let of_step = |((variances, used), share): ((&Vec<[f64; 3]>, &Vec<bool>), &f64)| -> Vec<[f64; 3]> {
            let root = |(variance, used): (&[f64; 3], &bool)| match used {
                true => variance.map(|v| f64::sqrt(share / v)),
                false => [0.0; 3],
            };
            variances.iter().zip(used).map(root).collect()
        };
        self.roots = steps.map(of_step).collect();
        self.capacitance = self.capacitances();
        self
    }

    /// The same with `variance_mm2` added to the variance of every voxel, per component: what a model is known to
    /// leave, in patterns that nobody knows, counts like noise.
    pub(super) fn with_variance(mut self, variance_mm2: [f64; 3]) -> Metric {
        for own in self.variance_mm2.iter_mut().flatten() {
            *own = [0, 1, 2].map(|c| own[c] + variance_mm2[c]);
        }
        self.prepared()
    }

    /// The same for the voxels alone for which `is_kept`.
    pub(super) fn of_part(&self, is_kept: &dyn Fn(usize) -> bool) -> Metric {
        let mut part = self.clone();
        for used in &mut part.is_used {
            used.iter_mut().enumerate().for_each(|(v, used)| *used &= is_kept(v));
        }
        part.prepared()
    }

    /// The same where the steps get these parts of the time of a whole scan, in which the noise is what is stated: its
    /// variance is as much larger. Steps without an entry get a whole scan.
    pub(super) fn with_time_shares(mut self, shares: &[f64]) -> Metric {
        self.share.iter_mut().zip(shares).for_each(|(own, share)| *own = *share);
        self.prepared()
    }

    /// S⁻¹ + Bᵀ N⁻¹ B per component.
    fn capacitances(&self) -> Vec<Cholesky<f64, Dyn>> {
        let n = self.num_boxes;
        let of_component = |c: usize| {
            let mut matrix = DMatrix::<f64>::zeros(n, n);
            for (roots, scale) in self.roots.iter().zip(&self.scale) {
                for (boxes, root) in self.boxes.iter().zip(roots) {
                    let weight = (scale * root[c]).powi(2);
                    for &i in boxes {
                        for &j in boxes {
                            matrix[(i as usize, j as usize)] += weight;
                        }
                    }
                }
            }
            for (i, v) in self.variances.iter().enumerate() {
                // A box without voxels has no moments; any positive number serves.
                matrix[(i, i)] += 1.0 / v.max(1e-12);
            }
            // The sum of a positive diagonal and a Gram matrix is positive definite.
            Cholesky::new(matrix.clone()).unwrap_or_else(|| Cholesky::new_unchecked(matrix))
        };
        (0..3).map(of_component).collect()
    }

    /// Prepares a trace; NaN entries (voxels that a changed specimen does not fill) count as zero.
    pub fn weigh(&self, trace: &Trace) -> Weighed {
        let mut moments = [0, 1, 2].map(|_| DVector::<f64>::zeros(self.num_boxes));
        let mut white = Vec::with_capacity(3 * trace.displacement.iter().map(Vec::len).sum::<usize>());
        for (field, (roots, scale)) in trace.displacement.iter().zip(self.roots.iter().zip(&self.scale)) {
            for ((u, boxes), root) in field.iter().zip(&self.boxes).zip(roots) {
                for c in 0..3 {
                    let value = if u[c].is_finite() { root[c] * u[c] } else { 0.0 };
                    white.push(value);
                    let moment = scale * root[c] * value;
                    for &i in boxes {
                        moments[c][i as usize] += moment;
                    }
                }
            }
        }
        let solved = [0, 1, 2].map(|c| self.capacitance[c].solve(&moments[c]));
        Weighed { white, force: trace.force.clone(), moments, solved }
    }

    /// Prepares traces.
    pub fn weigh_all(&self, traces: &[Trace]) -> Vec<Weighed> {
        traces.par_iter().map(|t| self.weigh(t)).collect()
    }

    /// ⟨a, b⟩.
    pub fn inner(&self, a: &Weighed, b: &Weighed) -> f64 {
        self.products(std::slice::from_ref(a), std::slice::from_ref(b))[(0, 0)]
    }

    /// ⟨a, b⟩ of each of `a` (rows) with each of `b` (columns).
    pub fn products(&self, a: &[Weighed], b: &[Weighed]) -> DMatrix<f64> {
        let mut sum = products_of(a, &|w| &w.white, b, &|w| &w.white);
        for c in 0..3 {
            sum -= products_of(a, &|w| w.moments[c].as_slice(), b, &|w| w.solved[c].as_slice());
        }
        for (i, a) in a.iter().enumerate() {
            for (j, b) in b.iter().enumerate() {
                let forces = (0..a.force.len()).flat_map(|k| (0..b.force.len()).map(move |l| (k, l)));
                let own: f64 = forces.map(|(k, l)| a.force[k] * self.force_precision[(k, l)] * b.force[l]).sum();
                sum[(i, j)] += own;
            }
        }
        sum
    }

    /// Numbers that count: displacement components and forces.
    pub fn num_data(&self) -> usize {
        3 * self.is_used.iter().flatten().filter(|u| **u).count() + self.has_force.iter().filter(|f| **f).count()
    }

    /// Whether a voxel counts at a step.
    pub fn is_used(&self, step: usize, voxel: usize) -> bool {
        self.is_used[step][voxel]
    }
}

/// Products of a vector of each of `a` (rows) with one of each of `b` (columns), all of one length.
fn products_of(
    a: &[Weighed],
    of_a: &(dyn Fn(&Weighed) -> &[f64] + Sync),
    b: &[Weighed],
    of_b: &(dyn Fn(&Weighed) -> &[f64] + Sync),
) -> DMatrix<f64> {
    let mut found = DMatrix::zeros(a.len(), b.len());
    if a.is_empty() || b.is_empty() {
        return found;
    }
    if a.len() == 1 || b.len() == 1 {
        for (i, a) in a.iter().enumerate() {
            for (j, b) in b.iter().enumerate() {
                found[(i, j)] = dot(of_a(a), of_b(b));
            }
        }
        return found;
    }
    let num = of_a(&a[0]).len();
    let left = a.iter().map(of_a).collect::<Vec<_>>().concat();
    let left = MatRef::from_column_major_slice(&left, num, a.len());
    let size = b.len().div_ceil(rayon::current_num_threads());
    found.as_mut_slice().par_chunks_mut(size * a.len()).zip(b.par_chunks(size)).for_each(|(found, b)| {
        let right = b.iter().map(of_b).collect::<Vec<_>>().concat();
        let right = MatRef::from_column_major_slice(&right, num, b.len());
        let found = MatMut::from_column_major_slice_mut(found, a.len(), b.len());
        matmul(found, Accum::Replace, left.transpose(), right, 1.0, Par::Seq);
    });
    found
}

fn force_precision(observed: &Observed) -> (DMatrix<f64>, Vec<bool>) {
    let n = observed.steps.len();
    let has_force: Vec<bool> = observed.steps.iter().map(|s| s.force.is_some()).collect();
    let places: Vec<usize> = (0..n).filter(|i| has_force[*i]).collect();
    let m = places.len();
    let value = |k: usize| observed.steps[places[k]].force.map_or(0.0, |f| f.value_n);
    let sd = |k: usize| observed.steps[places[k]].force.map_or(1.0, |f| f.sd_n);
    let covariance = DMatrix::from_fn(m, m, |i, j| {
        let common = FORCE_COMMON * FORCE_COMMON * value(i) * value(j);
        let each = if i == j { sd(i).powi(2) + (FORCE_EACH * value(i)).powi(2) } else { 0.0 };
        common + each
    });
    let mut precision = DMatrix::zeros(n, n);
    if let Some(inverse) = covariance.try_inverse() {
        for i in 0..m {
            for j in 0..m {
                precision[(places[i], places[j])] = inverse[(i, j)];
            }
        }
    }
    (precision, has_force)
}

#[cfg(test)]
#[path = "metric_tests.rs"]
mod tests;
