//! Misfit beyond noise: means over boxes of neighbouring voxels, which noise hardly moves and structure does.

use super::observed::Observed;

/// Boxes along x, y, z.
const BOXES: [usize; 3] = [12, 4, 9];

/// The box whose mean is the least likely under noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorstBox {
    /// Its centre, mm.
    pub center_mm: [f64; 3],
    /// Its edges, mm.
    pub extent_mm: [f64; 3],
    /// The component of the displacement that it is about: 0, 1, 2 for x, y, z.
    pub component: usize,
}

/// What is left of a recording after a fit, from means over boxes of voxels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxMeans {
    /// χ² of the displacement noise per datum.
    pub chi2_per_datum: f64,
    /// Variance of the boxes' means beyond noise per component, mm²; as estimated, which may be below zero.
    pub excess_mm2: [f64; 3],
    /// Standard deviation that noise alone gives `excess_mm2`, mm².
    pub excess_sd_mm2: [f64; 3],
    /// Voxels per box.
    pub voxels_per_box: f64,
    /// None where no voxel is used.
    pub worst: Option<WorstBox>,
}

impl BoxMeans {
    /// Of `residual`: measured minus model per drive and compared voxel, mm; `is_used`(drive, voxel) says which count,
    /// those that are not finite do not.
    pub fn of(observed: &Observed, residual: &[Vec<[f64; 3]>], is_used: &dyn Fn(usize, usize) -> bool) -> BoxMeans {
        let b = observed.specimen.block;
        let half = [0.5 * b.length_mm, 0.5 * b.thickness_mm, 0.5 * b.width_mm];
        let num = BOXES.iter().product::<usize>();
        let noise_of = |c: usize| observed.noise_sd_mm[c].powi(2) * observed.noise_correlation();
        let (mut chi2, mut count) = (0.0, 0.0);
        let (mut structured, mut weight) = ([0.0; 3], 0.0);
        let mut num_means = 0.0;
        let mut worst: Option<(f64, usize, usize)> = None;
        for (step, field) in residual.iter().enumerate() {
            let mut sums = vec![[0.0; 3]; num];
            let mut counts = vec![0.0; num];
            for (v, u) in field.iter().enumerate().filter(|(v, _)| is_used(step, *v)) {
                if !u.iter().all(|x| x.is_finite()) {
                    continue;
                }
                let x = observed.mask.grid.center_mm(observed.mask.voxels[v] as usize);
                let n = [0, 1, 2].map(|a| {
                    let t = (0.5 * (x[a] / half[a] + 1.0) * BOXES[a] as f64).floor().max(0.0);
                    (t as usize).min(BOXES[a] - 1)
                });
                let at = n[0] + BOXES[0] * (n[1] + BOXES[1] * n[2]);
                counts[at] += 1.0;
                for c in 0..3 {
                    chi2 += (u[c] / observed.noise_sd_mm[c]).powi(2);
                    count += 1.0;
                    sums[at][c] += u[c];
                }
            }
            for (at, (sum, n)) in sums.iter().zip(&counts).enumerate().filter(|(_, (_, n))| **n > 0.0) {
                weight += n;
                num_means += 1.0;
                for c in 0..3 {
                    let noise = noise_of(c) / n;
                    structured[c] += n * ((sum[c] / n).powi(2) - noise);
                    let significance = (sum[c] / n).powi(2) / noise;
                    if worst.is_none_or(|w| significance > w.0) {
                        worst = Some((significance, at, c));
                    }
                }
            }
        }
        let worst = worst.map(|(_, at, component)| {
            let n = [at % BOXES[0], at / BOXES[0] % BOXES[1], at / (BOXES[0] * BOXES[1])];
            let extent_mm = [0, 1, 2].map(|a| 2.0 * half[a] / BOXES[a] as f64);
            let center_mm = [0, 1, 2].map(|a| (n[a] as f64 + 0.5) * extent_mm[a] - half[a]);
            WorstBox { center_mm, extent_mm, component }
        });
        let weight = f64::max(weight, 1.0);
        BoxMeans {
            chi2_per_datum: chi2 / f64::max(count, 1.0),
            excess_mm2: structured.map(|s| s / weight),
            // Each box adds n m² with the variance 2 (σ²)², whatever its number of voxels.
            excess_sd_mm2: [0, 1, 2].map(|c| noise_of(c) * f64::sqrt(2.0 * num_means) / weight),
            voxels_per_box: weight / f64::max(num_means, 1.0),
            worst,
        }
    }
}
