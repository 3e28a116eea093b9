//! The misfit beyond noise and mesh that a fit leaves, as a discrepancy that what comes next will have too.

use super::error_left::ErrorLeft;
use crate::calibration::{BoxMeans, Observed, RecordingFit};

/// A misfit counts as found beyond this many standard deviations of what noise and mesh alone give.
const FOUND: f64 = 2.0;

/// Displacement errors that neighbouring voxels share, and relative errors of the force. Zero where none was found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Discrepancy {
    /// Variance of the displacement's mean over a box of voxels, per component, mm²: the largest of the recordings.
    pub(super) variance_mm2: [f64; 3],
    /// Volume of a box, mm³.
    pub(super) volume_mm3: f64,
    /// Variance of the force's error over the force squared.
    pub(super) force_relative_variance: f64,
}

impl Discrepancy {
    /// What `fit` leaves of `observed`, beyond what the mesh may have left. That stands beside the estimate already,
    /// and says nothing against the law.
    pub(super) fn of(observed: &[Observed], fit: &RecordingFit, mesh: &ErrorLeft) -> Discrepancy {
        let mut found = Discrepancy::default();
        let (mut squares, mut excess, mut num_forces) = (0.0, 0.0, 0.0);
        for (r, recording) in observed.iter().enumerate() {
            let rest = |s: usize| -> Vec<[f64; 3]> {
                let pairs = recording.steps[s].displacement.iter().zip(fit.predicted(r, s));
                pairs.map(|(u, model)| [0, 1, 2].map(|c| u[c] - model[c])).collect()
            };
            let residual: Vec<Vec<[f64; 3]>> = (0..recording.steps.len()).map(rest).collect();
            let means = BoxMeans::of(recording, &residual, &|_, _| true);
            let of_mesh = BoxMeans::of(recording, &mesh.displacement_mm[r], &|_, _| true);
            for c in 0..3 {
                // The square of a normal amplitude scatters by √2 times its mean.
                let mesh_mm2 = of_mesh.excess_mm2[c] + of_mesh.noise_mm2[c];
                let excess_mm2 = means.excess_mm2[c] - mesh_mm2;
                let sd_mm2 = means.excess_sd_mm2[c].hypot(f64::sqrt(2.0) * mesh_mm2);
                if excess_mm2 > FOUND * sd_mm2 {
                    found.variance_mm2[c] = found.variance_mm2[c].max(excess_mm2);
                }
            }
            let volume_mm3 = means.voxels_per_box * recording.mask.grid.voxel_volume_mm3();
            found.volume_mm3 = found.volume_mm3.max(volume_mm3);
            for ((force, state), mesh_n) in recording.forces().zip(fit.states(r)).zip(&mesh.force_n[r]) {
                let Some(force) = force else { continue };
                let misfit = force.value_n - state.force_n;
                // What gain and zero of the load cell may make of it says nothing against the law either.
                let of_cell_n2 = recording.load_cell.variance_n2(force.value_n);
                let variance = force.sd_n.powi(2) + mesh_n.powi(2) + of_cell_n2;
                squares += misfit * misfit / variance;
                excess += (misfit * misfit - variance) / (force.value_n * force.value_n);
                num_forces += 1.0;
            }
        }
        // One force fixes the modulus; only what further ones leave tells of the law.
        let freedom: f64 = num_forces - 1.0;
        if freedom > 0.0 && squares > freedom + FOUND * f64::sqrt(2.0 * freedom) {
            found.force_relative_variance = f64::max(excess / num_forces, 0.0);
        }
        found
    }

    /// The variance (mm²) that it adds to each voxel of `voxel_mm3`, independent from voxel to voxel: means over a box
    /// then scatter as they are seen to.
    pub(super) fn per_voxel_mm2(&self, voxel_mm3: f64) -> [f64; 3] {
        let num_voxels = (self.volume_mm3 / voxel_mm3).max(1.0);
        self.variance_mm2.map(|variance| variance * num_voxels)
    }

    /// Root mean square over the components, mm.
    pub(super) fn rms_mm(&self) -> f64 {
        (self.variance_mm2.iter().sum::<f64>() / 3.0).sqrt()
    }
}
