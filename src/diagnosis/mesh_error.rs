//! What meshes and soft edges do to estimates: the shifts that coarser meshes and wider edges of a cause make, added to the
//! standard deviations.
//!
//! Noise alone gives intervals that are far too narrow: 20,000 voxels average it out, and what is left is the error of the mesh,
//! ours and that of whoever made synthetic data. The prediction of a coarser mesh differs from ours by a multiple of our error;
//! fitted as if it were a misfit, to first order, it says how far our error moves each parameter.

use super::error::DiagnosisError;
use super::fit::{FitSettings, Fitted, derivatives, normal_matrix, scales};
use super::laboratory::Laboratory;
use super::metric::Metric;
use super::scene::Scene;
use crate::calibration::Observed;
use crate::mesh::MeshOptions;
use nalgebra::DVector;

/// Element sizes of the coarser meshes as factors on ours. One alone may shift a parameter by little where it happens to err as
/// ours does; the mean square of two counts.
const COARSER: [f64; 2] = [1.25, 1.6];
/// The order of convergence that singular edges leave.
const ORDER: f64 = 1.4;

/// Standard deviation of an error over the shift between our mesh and one `coarser` times as coarse: 1/(coarser^order − 1) is our
/// own error; data that come from a mesh have another of the kind, hence √2 times that.
fn sd_over_shift(coarser: f64) -> f64 {
    std::f64::consts::SQRT_2 / (coarser.powf(ORDER) - 1.0)
}

/// Standard deviation over the shift to an edge twice as wide: an edge is anything from sharp to that, evenly.
const SD_OVER_EDGE: f64 = 0.58;

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
    let columns = derivatives(laboratory, &fitted.material, &fitted.causes, &fitted.prediction)?;
    let weighed: Vec<_> = columns.iter().map(|c| metric.weigh(c)).collect();
    let matrix = normal_matrix(metric, &weighed, &fitted.material, &fitted.causes, settings);
    let Some(factor) = matrix.cholesky() else { return Ok(()) };
    let mut square = DVector::<f64>::zeros(weighed.len());
    for coarser in COARSER {
        let mesh = MeshOptions::scaled(&observed.specimen, coarser * mesh_factor);
        let mut other = Laboratory::new(observed, &mesh)?;
        let theirs = other.predict(&fitted.material, &fitted.scene(), is_cancelled)?;
        let change = metric.weigh(&fitted.prediction.trace.plus(-1.0, &theirs.trace));
        let gradient = DVector::from_iterator(weighed.len(), weighed.iter().map(|c| metric.inner(c, &change)));
        let shift = factor.solve(&gradient) * sd_over_shift(coarser);
        square += shift.component_mul(&shift) / COARSER.len() as f64;
    }
    let mut wider = Scene::default();
    let mut has_edge = false;
    for c in &fitted.causes {
        if c.cause.apply_wider(&c.values, &mut wider) {
            has_edge = true;
        } else {
            c.cause.apply(&c.values, &mut wider);
        }
    }
    if has_edge {
        let theirs = laboratory.predict(&fitted.material, &wider, is_cancelled)?;
        let change = metric.weigh(&fitted.prediction.trace.plus(-1.0, &theirs.trace));
        let gradient = DVector::from_iterator(weighed.len(), weighed.iter().map(|c| metric.inner(c, &change)));
        let shift = factor.solve(&gradient) * SD_OVER_EDGE;
        square += shift.component_mul(&shift);
    }
    let scales = scales(&fitted.material, &fitted.causes);
    for ((sd, square), scale) in fitted.sd.iter_mut().zip(square.iter()).zip(scales) {
        *sd = sd.hypot(scale * square.sqrt());
    }
    // The bulk modulus, the first, is not known less than it was beforehand.
    if let Some(sd) = fitted.sd.first_mut() {
        *sd = sd.min(settings.bulk.log_sd * fitted.material.bulk_kpa);
    }
    Ok(())
}
