//! What neither our mesh nor the data resolve: an allowance for discretisation errors.
//!
//! A synthetic recording comes from somebody's mesh, and ours has an error too. Fits on two meshes tell ours: the
//! difference of the estimates, carried to the limit of fine meshes, is what our mesh shifts a parameter by. Now and
//! then both meshes agree on a parameter by chance, though their displacements differ: what the parts of that
//! difference would shift it by cancels out. The shift is therefore pooled with the one that a difference of its size
//! typically makes, as a variance from one value is pooled with what is known of it beforehand. The data's error is
//! unknown; it is taken to be of the same kind and, to one standard deviation, a stated multiple of ours. Its effect on
//! each parameter is added to the covariance, and the misfit that it leaves after a fit is no evidence of anything
//! else.
//!
//! Weighing data down where meshes differ does not help: errors of meshes look like changes of the exponents to a few
//! micrometres, so that what is weighed down in the misfit is weighed down in the sensitivities too.

use super::all_forces::AllForces;
use super::recording_fit::RecordingFit;
use super::target::Target;
use crate::material::{Material, Parameter};
use crate::mesh::error_over_difference;

/// Element size of the coarser mesh relative to the finer one.
pub(super) const MESH_RATIO: f64 = 1.0 / 0.7;

/// What the difference of two meshes typically shifts a parameter by, as a part of the most that a difference of its
/// size could (Cauchy–Schwarz): 1.48 times the median over the parameters of 49 random cases
/// (`tests/calibration_allowance.rs`, seed 5) of what their errors would be the [`error_over_shift`] of. In a normal
/// distribution 1.48 times the median of the magnitude is the standard deviation.
const TYPICAL_PART: f64 = 0.07;

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
    /// Root of the objective of what the two fits predict otherwise: the meshes' difference but for what the estimates
    /// have taken up. A difference of that size and of the shape of a parameter's sensitivity would shift the parameter
    /// by this times its standard deviation.
    pub difference: f64,
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
            difference: objective.sqrt(),
        }
    }

    /// What our mesh puts a parameter wrong by, to one standard deviation, where the estimates of the two meshes lie
    /// `shift` apart and `sd` is the parameter's standard deviation by the objective's curvature; without one the shift
    /// is all there is.
    pub(super) fn mesh_error(&self, shift: f64, sd: Option<f64>) -> f64 {
        let pooled = match sd {
            Some(sd) => (0.5 * (shift.powi(2) + (TYPICAL_PART * sd * self.difference).powi(2))).sqrt(),
            None => shift.abs(),
        };
        error_over_shift() * pooled
    }

    /// [`Self::mesh_error`] of a parameter of `fit`, in its unit, with what the coarser mesh makes of it. κ is positive
    /// and hardly known: its logarithm is nearer to Gaussian, and it is that which shifts.
    pub(super) fn mesh_error_of(&self, parameter: Parameter, fit: &RecordingFit, coarse: &Material) -> f64 {
        let [value, coarse] = [&fit.material, coarse].map(|m| m.value(parameter));
        let sd = fit.sd_by_curvature(parameter);
        match parameter {
            Parameter::Kappa => value * self.mesh_error((value / coarse).ln(), sd.map(|sd| sd / value)),
            _ => self.mesh_error(value - coarse, sd),
        }
    }

    /// What is left of a structured misfit of size `structured` (see [`RecordingFit::structured_misfit`]).
    pub(super) fn unexplained(&self, structured: f64) -> f64 {
        // What an error of `factor` times ours adds to the objective after a fit.
        let explained = self.factor * error_over_shift() * self.difference;
        (structured * structured - explained * explained).max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Meshes that agree on a parameter by chance leave it what meshes that differ as much typically do; what shifts it
    /// far beyond that counts as one of two estimates.
    #[test]
    fn agreement_by_chance_is_no_proof() {
        let allowance = Allowance { factor: 2.0, own_error_mm: 0.01, difference: 30.0 };
        let typical = error_over_shift() * TYPICAL_PART * 0.004 * 30.0 * 0.5f64.sqrt();
        assert!((allowance.mesh_error(0.0, Some(0.004)) / typical - 1.0).abs() < 1e-12);
        let far = allowance.mesh_error(-1.0, Some(0.004)) / (error_over_shift() * 0.5f64.sqrt());
        assert!((far - 1.0).abs() < 1e-3, "{far}");
        // A parameter without a standard deviation of its own has nothing but its shift.
        assert!((allowance.mesh_error(-0.2, None) - 0.2 * error_over_shift()).abs() < 1e-15);
        // Twice the error that leaves a misfit of 30 explains one of 1.54 × 60.
        let explained = 60.0 * error_over_shift();
        assert!(allowance.unexplained(explained) < 1e-6 && allowance.unexplained(explained.hypot(7.0)) > 6.9);
    }
}
