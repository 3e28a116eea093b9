//! A material fitted to recordings: the estimate, its uncertainty, and what it predicts.

use super::error::CalibrationError;
use super::options::Held;
use super::prediction::{Prediction, SolverWork};
use crate::fem::Equilibrium;
use crate::material::{Material, Parameter};
use crate::sensitivity::{Covariance, FisherInformation};

/// Within this many standard deviations of the optimum of the linear model a fit has settled: what it may still gain,
/// at most one in χ², is within the noise, and could only add to the evidence for its terms.
const SETTLED: f64 = 1.0;

/// Whether a fit that converged, or ended so many standard deviations from the optimum of its linear model, has
/// settled.
pub(super) fn is_settled(is_converged: bool, distance_sd: f64) -> bool {
    is_converged || distance_sd < SETTLED
}

/// A material fitted to recordings.
#[derive(Clone, Debug)]
pub struct RecordingFit {
    /// The estimate.
    pub material: Material,
    /// Fisher information at the estimate with the objective's weights, prior included.
    pub information: FisherInformation,
    /// Covariance of the estimate under the noise: the inverse information, or the sandwich where weights and noise
    /// differ.
    pub covariance: Covariance,
    /// χ²: values by their variances, filtered ones once per acquired voxel.
    pub chi2: f64,
    /// χ² over its expectation: 1 where model and noise are right.
    pub chi2_per_datum: f64,
    /// What the covariance is to be multiplied with because the misfit is more than noise; 1 where it is not.
    pub misfit_factor: f64,
    /// √(objective − its expectation) where the misfit is more than noise, else zero: the size of the structured misfit
    /// in units of the noise. An error of that size and of the shape of a parameter's sensitivity would shift the
    /// parameter by this times its standard deviation (Cauchy–Schwarz).
    pub structured_misfit: f64,
    /// Numbers compared.
    pub num_data: usize,
    /// The paper's ℓ_u, mean over drives.
    pub loss_u: f64,
    /// The paper's ℓ_F, mean over drives with a force; none without forces.
    pub loss_f: Option<f64>,
    /// Whether the optimum was reached within the iterations allowed.
    pub is_converged: bool,
    /// Iterations made, rejected ones included.
    pub iterations: usize,
    /// Distance from the optimum of the linear model, in standard deviations.
    pub distance: f64,
    /// Limits at which the estimate stands, in words.
    pub reached_limits: Vec<String>,
    /// The objective at the start and after every accepted step.
    pub history: Vec<f64>,
    /// What the fit took, its start included.
    pub work: SolverWork,
    /// Parameters that were not fitted.
    pub held: Held,
    pub(super) predictions: Vec<Prediction>,
}

impl RecordingFit {
    /// Standard deviation of a parameter from the noise, widened where the misfit is more than noise; none where the
    /// data do not determine it or it was held.
    pub fn sd(&self, parameter: Parameter) -> Option<f64> {
        let index = self.information.index_of(parameter).ok()?;
        if self.held.contains(index) {
            return None;
        }
        Some(self.covariance.sd(index)? * self.misfit_factor.sqrt())
    }

    /// Covariance of two parameters in their units, of which [`Self::sd`] is the diagonal's root; none where either is
    /// undetermined or was held.
    pub fn covariance_of(&self, one: Parameter, other: Parameter) -> Option<f64> {
        let index_of = |p| self.information.index_of(p).ok().filter(|&i| !self.held.contains(i));
        Some(self.covariance.covariance(index_of(one)?, index_of(other)?)? * self.misfit_factor)
    }

    /// Standard deviation of what changes with the parameters (in the order of [`Material::parameters`]) by `gradient`,
    /// as [`Self::sd`]; none where it depends on one that is undetermined.
    pub fn sd_along(&self, gradient: &[f64]) -> Option<f64> {
        Some(self.covariance.sd_along(gradient)? * self.misfit_factor.sqrt())
    }

    /// Standard deviation of a parameter by the curvature of the objective alone, which is that of the noise where the
    /// objective weighs by it; none as for [`Self::sd`].
    pub(super) fn sd_by_curvature(&self, parameter: Parameter) -> Option<f64> {
        let index = self.information.index_of(parameter).ok()?;
        self.information.covariance().sd(index).filter(|_| !self.held.contains(index))
    }

    /// The largest shift of a parameter that a structured error as large as the structured misfit could make.
    pub fn possible_shift(&self, parameter: Parameter) -> Option<f64> {
        Some(self.sd_by_curvature(parameter)? * self.structured_misfit)
    }

    /// By how much the objective is higher one standard deviation ([`Self::sd`]) of a parameter away, all others
    /// following: 1 where weights are those of the noise and the misfit is noise.
    pub(super) fn objective_per_variance(&self, index: usize) -> f64 {
        // Where weights and noise differ the curvature is not the inverse variance.
        let plain = self.information.covariance().sd(index).unwrap_or(1.0);
        let true_sd = self.covariance.sd(index).unwrap_or(plain);
        self.misfit_factor * (true_sd / plain).powi(2)
    }

    /// The initial shear modulus, kPa, and its standard deviation by the delta method.
    pub fn initial_shear_modulus(&self) -> (f64, Option<f64>) {
        let value = self.material.initial_shear_modulus_kpa();
        let gradient = self.material.initial_shear_modulus_derivatives();
        let is_known = !self.held.contains(1);
        (value, self.sd_along(&gradient).filter(|_| is_known))
    }

    /// Equilibria of the sample that one recording is of, one per drive.
    pub fn states(&self, recording: usize) -> &[Equilibrium] {
        &self.predictions[recording].states
    }

    /// Force of all samples of one recording at a drive, N.
    pub fn force_n(&self, recording: usize, step: usize) -> f64 {
        self.predictions[recording].forces_n[step]
    }

    /// What the estimate predicts of a drive: displacements of the compared voxels, mm.
    pub fn predicted(&self, recording: usize, step: usize) -> &[[f64; 3]] {
        &self.predictions[recording].displacements[step]
    }

    /// What is left of a drive's `measured` displacements (of the compared voxels, mm): measured − predicted; NaN where
    /// missing.
    pub fn misfit(&self, recording: usize, step: usize, measured: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let rest = |(u, m): (&[f64; 3], &[f64; 3])| [0, 1, 2].map(|c| u[c] - m[c]);
        measured.iter().zip(self.predicted(recording, step)).map(rest).collect()
    }

    /// Whether it is at the optimum, or so near it that what is left to gain is within the noise.
    pub fn is_settled(&self) -> bool {
        is_settled(self.is_converged, self.distance)
    }

    /// An error where it has not settled; `limit` is the distance at which it would have converged.
    ///
    /// # Errors
    /// [`CalibrationError::NotConverged`].
    pub fn settled(&self, limit: f64) -> Result<(), CalibrationError> {
        let (iterations, distance) = (self.iterations, self.distance);
        match self.is_settled() {
            true => Ok(()),
            false => Err(CalibrationError::NotConverged { iterations, distance, limit }),
        }
    }

    /// How that changes with every parameter, in the order of [`Material::parameters`]: displacements of the compared
    /// voxels (mm per unit) and the force (N per unit).
    pub fn sensitivities(&self, recording: usize, step: usize) -> (&[Vec<[f64; 3]>], &[f64]) {
        let prediction = &self.predictions[recording];
        (&prediction.sensitivities[step], &prediction.force_sensitivities[step])
    }
}
