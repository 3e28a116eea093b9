//! What a fit leaves of a recording.

use super::location::Location;
use super::metric::Metric;
use super::trace::Trace;
use crate::calibration::Observed;

/// What was left of a recording after a fit.
#[derive(Clone, Debug)]
pub struct Leftover {
    /// χ² of the displacement noise per datum.
    pub chi2_per_datum: f64,
    /// Misfit beyond noise, mm rms, from means over boxes.
    pub structured_rms_mm: f64,
    /// The same per component, mm rms.
    pub structured_by_component_mm: [f64; 3],
    /// Voxels per box of those means.
    pub voxels_per_box: f64,
    /// Where it is largest.
    pub location: Option<Location>,
}

/// What is left of a recording: χ² per datum and the misfit beyond noise, from means over boxes.
pub(super) fn leftover(observed: &Observed, residual: &Trace, metric: &Metric) -> Leftover {
    const BOXES: [usize; 3] = [12, 4, 9];
    let b = observed.specimen.block;
    let half = [0.5 * b.length_mm, 0.5 * b.thickness_mm, 0.5 * b.width_mm];
    let num = BOXES.iter().product::<usize>();
    let (mut chi2, mut count) = (0.0, 0.0);
    let (mut structured, mut weight) = ([0.0; 3], 0.0);
    let mut num_means = 0.0;
    let mut worst: Option<(f64, usize, usize)> = None;
    for (step, field) in residual.displacement.iter().enumerate() {
        let mut sums = vec![[0.0; 3]; num];
        let mut counts = vec![0.0; num];
        for (v, u) in field.iter().enumerate().filter(|(v, _)| metric.is_used(step, *v)) {
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
                let noise = observed.noise_sd_mm[c].powi(2) * observed.noise_correlation() / n;
                let excess = (sum[c] / n).powi(2) - noise;
                structured[c] += n * excess;
                let significance = (sum[c] / n).powi(2) / noise;
                if worst.is_none_or(|w| significance > w.0) {
                    worst = Some((significance, at, c));
                }
            }
        }
    }
    let location = worst.map(|(_, at, c)| {
        let n = [at % BOXES[0], at / BOXES[0] % BOXES[1], at / (BOXES[0] * BOXES[1])];
        let size = [0, 1, 2].map(|a| 2.0 * half[a] / BOXES[a] as f64);
        Location {
            region: format!("largest misfit of u_{}", ["x", "y", "z"][c]),
            center_mm: [0, 1, 2].map(|a| (n[a] as f64 + 0.5) * size[a] - half[a]),
            extent_mm: size,
        }
    });
    Leftover {
        chi2_per_datum: chi2 / f64::max(count, 1.0),
        structured_rms_mm: f64::max(structured.iter().sum::<f64>() / f64::max(3.0 * weight, 1.0), 0.0).sqrt(),
        structured_by_component_mm: structured.map(|s| f64::max(s / f64::max(weight, 1.0), 0.0).sqrt()),
        voxels_per_box: weight / f64::max(num_means, 1.0),
        location,
    }
}
