//! What neither our mesh nor the data resolve: an allowance for discretisation errors.
//!
//! A synthetic recording comes from somebody's mesh, and ours has an error too. Fits on two meshes tell ours: the
//! difference of the estimates, carried to the limit of fine meshes, is what our mesh shifts a parameter by. The data's
//! error is unknown; it is taken to be of the same kind and, to one standard deviation, a stated multiple of ours. Its
//! effect on each parameter is added to the covariance, and the misfit that it leaves after a fit is no evidence of
//! anything else.
//!
//! Weighing data down where meshes differ does not help: errors of meshes look like changes of the exponents to a few
//! micrometres, so that what is weighed down in the misfit is weighed down in the sensitivities too.

use super::all_forces::AllForces;
use super::recording_fit::RecordingFit;
use super::target::Target;
use crate::mesh::error_over_difference;

/// Element size of the coarser mesh relative to the finer one.
pub(super) const MESH_RATIO: f64 = 1.0 / 0.7;

/// Error of the finer mesh over the difference of the two, 1.54.
pub(super) fn error_over_shift() -> f64 {
    error_over_difference(MESH_RATIO).abs()
}

/// The allowance of one calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allowance {
    /// Standard deviation of a discretisation error over the estimated error of our own mesh.
    pub factor: f64,
    /// Estimated displacement error of the finer mesh at the largest drive, rms over voxels and components, mm.
    pub own_error_mm: f64,
    /// What an error of `factor` times ours adds to the objective after a fit.
    pub objective: f64,
}

impl Allowance {
    /// From fits of one number of terms on two meshes; `targets` are the finer one's.
    pub(super) fn new(fine: &RecordingFit, coarse: &RecordingFit, targets: &[Target], factor: f64) -> Allowance {
        let values = |fit: &RecordingFit| -> Vec<f64> {
            fit.material.parameters().iter().map(|p| fit.material.value(*p)).collect()
        };
        let change: Vec<f64> = values(fine).iter().zip(values(coarse)).map(|(f, c)| f - c).collect();
        let mut objective = 0.0;
        let (mut squares, mut count) = (0.0, 0usize);
        for ((ours, theirs), target) in fine.predictions.iter().zip(&coarse.predictions).zip(targets) {
            let largest = ours.states.iter().map(|s| s.drive_mm.abs()).fold(0.0, f64::max);
            for (d, (step, (fields, _))) in target.steps.iter().zip(theirs.derivatives()).enumerate() {
                let is_largest = ours.states[d].drive_mm.abs() >= largest;
                for v in step.used() {
                    for c in 0..3 {
                        // The estimates have taken up what looks like a change of the material.
                        let left = theirs.displacements[d][v][c] - ours.displacements[d][v][c];
                        objective += step.precision[v][c] * left * left;
                        if is_largest && step.precision[v][c] > 0.0 {
                            let moved: f64 = fields.iter().zip(&change).map(|(f, x)| f[v][c] * x).sum();
                            squares += (left + moved).powi(2);
                            count += 1;
                        }
                    }
                }
            }
        }
        let forces = AllForces::of(targets);
        let apart = forces.misfits_of(&fine.predictions) - forces.misfits_of(&coarse.predictions);
        objective += apart.dot(&(forces.weights() * &apart));
        Allowance {
            factor,
            own_error_mm: error_over_shift() * (squares / count.max(1) as f64).sqrt(),
            objective: (factor * error_over_shift()).powi(2) * objective,
        }
    }

    /// What is left of a structured misfit of size `structured` (see [`RecordingFit::structured_misfit`]).
    pub(super) fn unexplained(&self, structured: f64) -> f64 {
        (structured * structured - self.objective).max(0.0).sqrt()
    }
}
