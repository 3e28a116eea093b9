//! The forces of all recordings of a fit, which are those of one load cell.

use super::force_readings::LoadCell;
use super::prediction::Prediction;
use super::target::{Target, TargetForce};
use nalgebra::{DMatrix, DVector};

/// The forces that are compared. Gain and zero of the load cell are those of all of them: a further recording does not
/// average them away.
pub(super) struct AllForces {
    /// Of which recording and step each is.
    places: Vec<(usize, usize)>,
    forces: Vec<TargetForce>,
    /// N, by the number of the force and by what is unknown of the load cell: what one standard deviation of it makes.
    shared: DMatrix<f64>,
    /// Whether the weights are the inverse of the covariance.
    is_weighed_by_noise: bool,
}

impl AllForces {
    /// Those of `targets`.
    pub(super) fn of(targets: &[Target]) -> AllForces {
        let (mut places, mut forces, mut cells) = (Vec::new(), Vec::new(), Vec::new());
        for (r, target) in targets.iter().enumerate() {
            for (d, force) in target.forces() {
                places.push((r, d));
                forces.push(force);
                cells.push(target.load_cell);
            }
        }
        let made = |cell: &LoadCell, force: &TargetForce| [cell.gain_sd * force.value_n, cell.zero_sd_n];
        let shared = DMatrix::from_fn(forces.len(), 2, |i, a| made(&cells[i], &forces[i])[a]);
        let is_weighed_by_noise = targets.iter().all(|t| t.is_weighed_by_noise);
        AllForces { places, forces, shared, is_weighed_by_noise }
    }

    /// Of which recording and step each force is.
    pub(super) fn places(&self) -> &[(usize, usize)] {
        &self.places
    }

    /// The forces.
    pub(super) fn forces(&self) -> &[TargetForce] {
        &self.forces
    }

    /// Variances of the readings themselves, N².
    fn own_variances(&self) -> DVector<f64> {
        DVector::from_iterator(self.forces.len(), self.forces.iter().map(|f| f.sd_n * f.sd_n))
    }

    /// Covariance C = diag(σ²) + B Bᵀ, N², with the columns σ_gain F and σ_zero of B.
    pub(super) fn covariance(&self) -> DMatrix<f64> {
        DMatrix::from_diagonal(&self.own_variances()) + &self.shared * self.shared.transpose()
    }

    /// Weights of the products of the misfits in the objective, N⁻²: C⁻¹, where it is weighed by the noise. Readings
    /// have standard deviations above zero, so that C is positive definite.
    pub(super) fn weights(&self) -> DMatrix<f64> {
        if !self.is_weighed_by_noise || self.shared.iter().all(|s| *s == 0.0) {
            let weights = self.forces.iter().map(|f| f.weight);
            return DMatrix::from_diagonal(&DVector::from_iterator(self.forces.len(), weights));
        }
        // C⁻¹ = D − D B (I + Bᵀ D B)⁻¹ Bᵀ D with D = diag(1/σ²) (Woodbury).
        let own = DMatrix::from_diagonal(&self.own_variances().map(|v| 1.0 / v));
        let weighed = &own * &self.shared;
        let inner = DMatrix::identity(2, 2) + self.shared.transpose() * &weighed;
        match inner.try_inverse() {
            Some(inverse) => own - &weighed * inverse * weighed.transpose(),
            // I + something positive has an inverse.
            None => own,
        }
    }

    /// Misfits, N: measured minus those predicted, `forces_n` of every recording and step.
    pub(super) fn misfits(&self, forces_n: &dyn Fn(usize, usize) -> f64) -> DVector<f64> {
        let misfits = self.forces.iter().zip(&self.places).map(|(force, &(r, d))| force.value_n - forces_n(r, d));
        DVector::from_iterator(self.forces.len(), misfits)
    }

    /// Those of predictions.
    pub(super) fn misfits_of(&self, predictions: &[Prediction]) -> DVector<f64> {
        self.misfits(&|r, d| predictions[r].forces_n[d])
    }

    /// Derivatives of the forces (rows) by the `num` parameters, N per unit.
    pub(super) fn slopes(&self, predictions: &[Prediction], num: usize) -> DMatrix<f64> {
        let slope = |i: usize, parameter: usize| {
            let (r, d) = self.places[i];
            predictions[r].force_sensitivities[d][parameter]
        };
        DMatrix::from_fn(self.forces.len(), num, slope)
    }
}

#[cfg(test)]
#[path = "all_forces_tests.rs"]
mod tests;
