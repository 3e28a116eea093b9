//! The error of the coarse mesh, predicted by a finer one and taken off what was measured (deferred correction).
//!
//! Without it the coarse mesh's own error would count as a misfit of the law.

use super::error::NextError;
use crate::calibration::{Observed, RecordingFit};
use crate::fem::{ForwardModel, SolveOptions};
use crate::mesh::MeshOptions;

/// Element size of the finer mesh relative to that of the fit.
const FINER: f64 = 0.5;

/// `observed` less what the law of `fit` gives on a mesh of half the size more than on the fit's, of `mesh_factor`.
///
/// # Errors
/// [`NextError`] where a specimen cannot be meshed or has no equilibrium there.
pub(super) fn without_mesh_error(
    observed: &[Observed],
    fit: &RecordingFit,
    mesh_factor: f64,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Vec<Observed>, NextError> {
    let mut corrected = observed.to_vec();
    for (r, recording) in corrected.iter_mut().enumerate() {
        let specimen = recording.specimen.clone();
        let mut model = ForwardModel::of_specimen(&specimen, &MeshOptions::scaled(&specimen, FINER * mesh_factor))?;
        let view = recording.view(&specimen, model.mesh())?;
        let drives: Vec<f64> = recording.steps.iter().map(|s| s.drive_mm).collect();
        let fine = model.solve_path(&fit.material, &drives, &SolveOptions::trial(), is_cancelled)?;
        for (s, (step, state)) in recording.steps.iter_mut().zip(&fine).enumerate() {
            let finer = view.average(&state.displacement)?;
            for ((u, fine), coarse) in step.displacement.iter_mut().zip(&finer).zip(fit.predicted(r, s)) {
                *u = [0, 1, 2].map(|c| u[c] - (fine[c] - coarse[c]));
            }
            let excess_n = state.force_n - fit.force_n(r, s);
            if let Some(force) = &mut step.force {
                force.value_n -= excess_n;
            }
        }
    }
    Ok(corrected)
}
