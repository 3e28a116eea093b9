//! The noise of the images: from empty voxels, or from the phases themselves.

use super::unwrap::wrapped;
use crate::recording::{RawRecording, RawStep};
use serde::Serialize;
use utoipa::ToSchema;

/// Empty voxels needed to estimate the noise from them.
const MIN_EMPTY: usize = 200;
/// An empty voxel is at least this many voxels away from the mask: nearer ones may hold a little material.
const EMPTY_DISTANCE: usize = 2;

/// Where a noise level comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum NoiseSource {
    /// The mean magnitude of empty voxels: Gaussian noise of standard deviation σ has magnitude σ√(π/2) there.
    EmptyVoxels,
    /// Second differences of the phase along lines of voxels.
    Phases,
}

/// The noise of a step's complex images.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct NoiseEstimate {
    /// Where `sd` comes from.
    pub source: NoiseSource,
    /// Standard deviation of the real (and imaginary) part, in the magnitude's unit, per direction. The phase of a
    /// voxel of magnitude M has the standard deviation sd/M.
    pub sd: [f64; 3],
    /// The same from the phases, whatever the source: a check.
    pub sd_from_phases: [f64; 3],
}

impl NoiseEstimate {
    /// Estimates the noise of a step. Without enough empty voxels, it is taken from the phases.
    pub fn of_step(raw: &RawRecording, step: &RawStep) -> NoiseEstimate {
        let sd_from_phases = [0, 1, 2].map(|axis| from_phases(raw, step, axis));
        match from_empty_voxels(raw, step) {
            Some(sd) => NoiseEstimate { source: NoiseSource::EmptyVoxels, sd: [sd; 3], sd_from_phases },
            None => NoiseEstimate { source: NoiseSource::Phases, sd: sd_from_phases, sd_from_phases },
        }
    }

    /// Standard deviation of a voxel's phase along an axis, rad; infinite without signal.
    pub fn phase_sd(&self, axis: usize, magnitude: f64) -> f64 {
        if magnitude > 0.0 { self.sd[axis] / magnitude } else { f64::INFINITY }
    }
}

fn from_empty_voxels(raw: &RawRecording, step: &RawStep) -> Option<f64> {
    let shape = raw.grid.shape;
    // Distance in voxels to the mask, the largest over the axes, up to the one needed: the mask grows by one box at a
    // time.
    let mut is_near = raw.mask.clone();
    for _ in 1..=EMPTY_DISTANCE - 1 {
        for axis in 0..3 {
            let stride = [1, shape[0], shape[0] * shape[1]][axis];
            let before = is_near.clone();
            for v in 0..is_near.len() {
                let at = v / stride % shape[axis];
                is_near[v] |= (at > 0 && before[v - stride]) || (at + 1 < shape[axis] && before[v + stride]);
            }
        }
    }
    let empty: Vec<f64> =
        is_near.iter().zip(&step.magnitude).filter(|(near, m)| !**near && m.is_finite()).map(|(_, m)| *m).collect();
    // Images that were masked hold zeros: no noise to see.
    if empty.iter().filter(|m| **m > 0.0).count() < MIN_EMPTY {
        return None;
    }
    let mean = empty.iter().sum::<f64>() / empty.len() as f64;
    (mean > 0.0).then(|| mean / (0.5 * std::f64::consts::PI).sqrt())
}

/// Median over the voxels of magnitude × |second difference of the phase|, as that of Gaussian noise.
fn from_phases(raw: &RawRecording, step: &RawStep, axis: usize) -> f64 {
    let shape = raw.grid.shape;
    let phase = &step.phase[axis];
    let is_good = |v: usize| raw.mask[v] && phase[v].is_finite() && step.magnitude[v] > 0.0;
    let mut products = Vec::new();
    for v in 0..phase.len() {
        for along in 0..3 {
            let stride = [1, shape[0], shape[0] * shape[1]][along];
            let at = v / stride % shape[along];
            if at == 0 || at + 1 == shape[along] || !(is_good(v - stride) && is_good(v) && is_good(v + stride)) {
                continue;
            }
            let second = wrapped(phase[v + stride] - phase[v]) - wrapped(phase[v] - phase[v - stride]);
            // Noise σ/M of the three phases, weights 1, −2, 1.
            let inverse = |v: usize| step.magnitude[v].powi(-2);
            let scale = (inverse(v - stride) + 4.0 * inverse(v) + inverse(v + stride)).sqrt();
            products.push(wrapped(second).abs() / scale);
        }
    }
    products.sort_by(f64::total_cmp);
    // The median of |N(0, 1)| is 0.6745.
    products.get(products.len() / 2).map_or(f64::NAN, |m| m / 0.674_489_750_196_081_7)
}
