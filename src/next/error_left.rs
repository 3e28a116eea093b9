//! What a correction leaves of the mesh's error.

use crate::calibration::{Observed, RecordingFit};

/// What the error of the mesh may still be after a correction: one standard deviation of it, of the whole at once. It
/// is one unknown factor on the part that is extrapolated, so that all of this goes together.
pub(super) struct ErrorLeft {
    /// Per parameter, in its unit: what it makes of the estimate.
    pub(super) shift: Vec<f64>,
    /// Per recording and drive: displacements of the compared voxels that no change of the parameters takes up, mm.
    pub(super) displacement_mm: Vec<Vec<Vec<[f64; 3]>>>,
    /// Likewise of the force, N.
    pub(super) force_n: Vec<Vec<f64>>,
}

impl ErrorLeft {
    /// Where nothing was taken off, nothing is said either.
    pub(super) fn none(observed: &[Observed], num_parameters: usize) -> ErrorLeft {
        let still = |o: &Observed| o.steps.iter().map(|s| vec![[0.0; 3]; s.displacement.len()]).collect();
        ErrorLeft {
            shift: vec![0.0; num_parameters],
            displacement_mm: observed.iter().map(still).collect(),
            force_n: observed.iter().map(|o| vec![0.0; o.steps.len()]).collect(),
        }
    }

    /// With `part` of the shift and of the misfit that `fit` of the recordings `corrected` would have, were they
    /// `told`.
    pub(super) fn new(
        part: f64,
        fit: &RecordingFit,
        shift: &[f64],
        corrected: &[Observed],
        told: &[Observed],
    ) -> ErrorLeft {
        let (mut displacement_mm, mut force_n) = (Vec::new(), Vec::new());
        for (r, (corrected, told)) in corrected.iter().zip(told).enumerate() {
            let (mut fields, mut forces) = (Vec::new(), Vec::new());
            for (s, (corrected, told)) in corrected.steps.iter().zip(&told.steps).enumerate() {
                let (by_parameter, force_by_parameter) = fit.sensitivities(r, s);
                let taken_up = |v: usize, c: usize| -> f64 {
                    by_parameter.iter().zip(shift).map(|(field, shift)| field[v][c] * shift).sum()
                };
                let pairs = corrected.displacement.iter().zip(&told.displacement).enumerate();
                fields
                    .push(pairs.map(|(v, (u, t))| [0, 1, 2].map(|c| part * (t[c] - u[c] - taken_up(v, c)))).collect());
                let of_force: f64 = force_by_parameter.iter().zip(shift).map(|(f, shift)| f * shift).sum();
                let both = corrected.force.zip(told.force);
                forces.push(both.map_or(0.0, |(f, t)| part * (t.value_n - f.value_n - of_force)));
            }
            displacement_mm.push(fields);
            force_n.push(forces);
        }
        ErrorLeft { shift: shift.iter().map(|shift| part * shift).collect(), displacement_mm, force_n }
    }
}
