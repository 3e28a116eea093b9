//! What meshes do to estimates: the shift that a coarser mesh makes, added to the standard deviations.
//!
//! Noise alone gives intervals that are far too narrow: 20,000 voxels average it out, and what is left is the error of the mesh,
//! ours and that of whoever made synthetic data. The prediction of a coarser mesh differs from ours by a multiple of our error;
//! fitted as if it were a misfit, to first order, it says how far our error moves each parameter.

use super::error::DiagnosisError;
use super::fit::{FitSettings, Fitted, derivatives, normal_matrix, scales};
use super::laboratory::Laboratory;
use super::metric::Metric;
use crate::calibration::Observed;
use crate::mesh::MeshOptions;
use nalgebra::DVector;

/// Element size of the coarser mesh as a factor on ours.
const COARSER: f64 = 1.4;
/// Standard deviation of an error over the shift between the two meshes: 1/(1.4^1.4 − 1) at the order 1.4 that singular edges
/// leave is our own error; data that come from a mesh have another of the kind, hence √2 times that.
const SD_OVER_SHIFT: f64 = 2.35;

/// Adds the meshes' share to the standard deviations of `fitted`, found by `laboratory` on a mesh of `mesh_factor`.
///
/// # Errors
/// [`DiagnosisError`]: the coarser model has no equilibrium, or the work was cancelled.
pub fn widen(
    laboratory: &mut Laboratory,
    observed: &Observed,
    mesh_factor: f64,
    metric: &Metric,
    settings: &FitSettings,
    fitted: &mut Fitted,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<(), DiagnosisError> {
    let mesh = MeshOptions::scaled(&observed.specimen, COARSER * mesh_factor);
    let mut coarser = Laboratory::new(observed, &mesh)?;
    let theirs = coarser.predict(&fitted.material, &fitted.scene(), is_cancelled)?;
    let change = metric.weigh(&fitted.prediction.trace.plus(-1.0, &theirs.trace));
    let columns = derivatives(laboratory, &fitted.material, &fitted.causes, &fitted.prediction)?;
    let weighed: Vec<_> = columns.iter().map(|c| metric.weigh(c)).collect();
    let matrix = normal_matrix(metric, &weighed, &fitted.material, &fitted.causes, settings);
    let gradient = DVector::from_iterator(weighed.len(), weighed.iter().map(|c| metric.inner(c, &change)));
    let Some(factor) = matrix.cholesky() else { return Ok(()) };
    let shift = factor.solve(&gradient);
    let scales = scales(&fitted.material, &fitted.causes);
    for ((sd, shift), scale) in fitted.sd.iter_mut().zip(shift.iter()).zip(scales) {
        *sd = sd.hypot(SD_OVER_SHIFT * scale * shift);
    }
    Ok(())
}
