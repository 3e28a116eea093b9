//! What a correction leaves of the mesh's error.

use crate::calibration::{Observed, ObservedForce, RecordingFit};

/// What the error of the mesh may still be after a correction: one standard deviation of it, of the whole at once. It
/// is one unknown factor on the part that is extrapolated, so that all of this goes together.
pub(super) struct ErrorLeft {
    /// Per parameter, in its unit: what it makes of the estimate.
    pub(super) shift: Vec<f64>,
    /// Per recording and drive: displacements of the compared voxels that no change of the parameters takes up, mm.
    pub(super) displacement_mm: Vec<Vec<Vec<[f64; 3]>>>,
    /// Per recording and drive, those of the forces read on the way last: likewise of the force, N.
    pub(super) force_n: Vec<Vec<f64>>,
}

impl ErrorLeft {
    /// Where nothing was taken off, nothing is said either.
    pub(super) fn none(observed: &[Observed], num_parameters: usize) -> ErrorLeft {
        let still = |o: &Observed| o.steps.iter().map(|s| vec![[0.0; 3]; s.displacement.len()]).collect();
        ErrorLeft {
            shift: vec![0.0; num_parameters],
            displacement_mm: observed.iter().map(still).collect(),
            force_n: observed.iter().map(|o| o.forces().map(|_| 0.0).collect()).collect(),
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
        let (mut displacement_mm, mut force_n): (Vec<_>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
        for (r, (corrected, told)) in corrected.iter().zip(told).enumerate() {
            let mut fields = Vec::new();
            for (s, (corrected, told)) in corrected.steps.iter().zip(&told.steps).enumerate() {
                let (by_parameter, _) = fit.sensitivities(r, s);
                let taken_up = |v: usize, c: usize| -> f64 {
                    by_parameter.iter().zip(shift).map(|(field, shift)| field[v][c] * shift).sum()
                };
                let pairs = corrected.displacement.iter().zip(&told.displacement).enumerate();
                fields
                    .push(pairs.map(|(v, (u, t))| [0, 1, 2].map(|c| part * (t[c] - u[c] - taken_up(v, c)))).collect());
            }
            let of_force = |(d, (corrected, told)): (usize, (Option<ObservedForce>, Option<ObservedForce>))| {
                let taken_up: f64 = fit.sensitivities(r, d).1.iter().zip(shift).map(|(f, shift)| f * shift).sum();
                corrected.zip(told).map_or(0.0, |(f, t)| part * (t.value_n - f.value_n - taken_up))
            };
            let forces = corrected.forces().zip(told.forces()).enumerate().map(of_force).collect();
            displacement_mm.push(fields);
            force_n.push(forces);
        }
        ErrorLeft { shift: shift.iter().map(|shift| part * shift).collect(), displacement_mm, force_n }
    }
}
