//! What a fit leaves of a recording.

use super::location::Location;
use super::metric::Metric;
use super::trace::Trace;
use crate::calibration::{BoxMeans, Observed};

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

impl Leftover {
    /// The variance (mm²) that each component of every voxel is given so that means over boxes have the standard
    /// deviation that they are seen to have, or `least_mm` where that is larger.
    pub(super) fn variance_mm2(&self, least_mm: f64) -> [f64; 3] {
        self.structured_by_component_mm.map(|mm| mm.max(least_mm).powi(2) * self.voxels_per_box)
    }
}

/// Root mean square of what the means over boxes show of a change of the displacement without noise, mm: what
/// [`Leftover::structured_rms_mm`] is expected to be where that change is left.
pub(super) fn structure_of(observed: &Observed, change: &Trace, metric: &Metric) -> f64 {
    let means = BoxMeans::of(observed, &change.displacement, &|step, voxel| metric.is_used(step, voxel));
    // The means take off what noise would add, of which there is none here.
    let squares: f64 = (0..3).map(|c| means.excess_mm2[c] + means.noise_mm2[c]).sum();
    (squares / 3.0).max(0.0).sqrt()
}

/// What is left of a recording: χ² per datum and the misfit beyond noise, from means over boxes.
pub(super) fn leftover(observed: &Observed, residual: &Trace, metric: &Metric) -> Leftover {
    let means = BoxMeans::of(observed, &residual.displacement, &|step, voxel| metric.is_used(step, voxel));
    let rms_mm = |excess_mm2: f64| f64::max(excess_mm2, 0.0).sqrt();
    Leftover {
        chi2_per_datum: means.chi2_per_datum,
        structured_rms_mm: rms_mm(means.excess_mm2.iter().sum::<f64>() / 3.0),
        structured_by_component_mm: means.excess_mm2.map(rms_mm),
        voxels_per_box: means.voxels_per_box,
        location: means.worst.map(|worst| Location {
            region: format!("largest misfit of u_{}", ["x", "y", "z"][worst.component]),
            center_mm: worst.center_mm,
            extent_mm: worst.extent_mm,
        }),
    }
}
