//! The misfit of a model's prediction and its Gauss–Newton system in scaled parameters.
//!
//! The objective is that of [`super::target`], plus (ln κ − ln κ₀)²/σ_κ² where a prior is set.
//! Scaled parameters: ln κ and ln |μ|, κ eˢ and μ eˢ, as of all others that keep their sign; α relative to its present
//! value, α (1 + s); those that may have either sign in units of half the initial shear modulus. What a term's stress
//! at the largest stretches fixes, ln |μ| + α ln λ, is then a straight valley: with μ (1 + s) steps along it have to be
//! short. With the residuals r and their derivatives the gradient is g = −½ ∂χ²/∂s and the matrix is H = ½ ∂²χ²/∂s²
//! without the second derivatives of the model.

use super::all_forces::AllForces;
use super::error::CalibrationError;
use super::options::{Bulk, Held};
use super::prediction::{HELD_LOG_SD, Prediction};
use super::target::Target;
use crate::material::{Material, Parameter};
use crate::optimise::OnTheWay;
use crate::sensitivity::FisherInformation;
use nalgebra::{DMatrix, DVector};

/// The objective, its gradient and Gauss–Newton matrix in scaled parameters.
#[derive(Clone, Debug)]
pub(super) struct NormalSystem {
    pub(super) parameters: Vec<Parameter>,
    pub(super) values: Vec<f64>,
    /// ∂ξ/∂s.
    pub(super) scales: Vec<f64>,
    pub(super) information: FisherInformation,
    /// H; for all parameters, held ones included.
    pub(super) matrix: DMatrix<f64>,
    /// g = −½ ∂χ²/∂s.
    pub(super) gradient: DVector<f64>,
    /// The objective; χ² with the weights of the noise.
    pub(super) chi2: f64,
    /// The paper's ℓ_u, mean over drives.
    pub(super) loss_u: f64,
    /// The paper's ℓ_F, mean over drives with a force.
    pub(super) loss_f: f64,
}

impl NormalSystem {
    /// Of one prediction per target, all of one material. The data must have been checked.
    pub(super) fn new(
        predictions: &[Prediction],
        targets: &[Target],
        bulk: Bulk,
        held: Held,
    ) -> Result<NormalSystem, CalibrationError> {
        let Some(first) = predictions.first() else {
            let name = "the number of recordings";
            return Err(CalibrationError::InvalidValue { name, value: 0.0, requirement: "positive" });
        };
        let material = &first.material;
        let parameters = material.parameters();
        let n = parameters.len();
        let values: Vec<f64> = parameters.iter().map(|p| material.value(*p)).collect();
        let sums = Sums::of(predictions, targets, n);
        let mut information = FisherInformation::from_matrix(material, sums.matrix.clone())?;
        match bulk {
            Bulk::Free => {}
            Bulk::LogPrior { log_sd, .. } => information.add_log_prior(Parameter::Kappa, log_sd)?,
            Bulk::Held => information.add_log_prior(Parameter::Kappa, HELD_LOG_SD)?,
        }
        for (i, &parameter) in parameters.iter().enumerate() {
            if held.contains(i) {
                information.add_log_prior(parameter, HELD_LOG_SD)?;
            }
        }
        let scales = scales_of(material);
        let matrix = DMatrix::from_fn(n, n, |i, j| information.matrix()[(i, j)] * scales[i] * scales[j]);
        let mut gradient = sums.gradient;
        gradient.component_mul_assign(&DVector::from_column_slice(&scales));
        let mut chi2 = sums.chi2;
        if let Bulk::LogPrior { center_kpa, log_sd } = bulk {
            let misfit = (center_kpa / values[0]).ln();
            chi2 += (misfit / log_sd).powi(2);
            gradient[0] += misfit / (log_sd * log_sd);
        }
        if !chi2.is_finite() {
            return Err(CalibrationError::InvalidValue { name: "chi2", value: chi2, requirement: "finite" });
        }
        Ok(NormalSystem {
            parameters,
            values,
            scales,
            information,
            matrix,
            gradient,
            chi2,
            loss_u: sums.loss_u / f64::from(sums.num_drives.max(1)),
            loss_f: sums.loss_f / f64::from(sums.num_forces.max(1)),
        })
    }

    /// `material` after the scaled change `step`.
    pub(super) fn moved(&self, material: &Material, step: &DVector<f64>) -> Material {
        let mut next = material.clone();
        for (i, &parameter) in self.parameters.iter().enumerate() {
            let value = self.values[i];
            let moved = match parameter {
                Parameter::Alpha(_) => value * (1.0 + step[i]),
                _ if parameter.has_any_sign() => value + self.scales[i] * step[i],
                _ => value * step[i].exp(),
            };
            next.set(parameter, moved);
        }
        next
    }

    /// The scaled change from here to the material of `other`.
    pub(super) fn change_to(&self, other: &NormalSystem) -> DVector<f64> {
        DVector::from_fn(self.values.len(), |i, _| {
            let (from, to) = (self.values[i], other.values[i]);
            if self.parameters[i].has_any_sign() { (to - from) / self.scales[i] } else { (to / from).ln() }
        })
    }

    /// What a descent learns from on its way through here.
    pub(super) fn on_the_way(&self) -> OnTheWay<'_> {
        OnTheWay { objective: self.chi2, gradient: &self.gradient, matrix: &self.matrix }
    }
}

/// ∂ξ/∂s of every parameter: ξ itself, with its sign, and half the initial shear modulus where ξ may be zero.
pub(super) fn scales_of(material: &Material) -> Vec<f64> {
    let half_shear = 0.5 * material.initial_shear_modulus_kpa();
    let scale = |p: Parameter| if p.has_any_sign() { half_shear } else { material.value(p) };
    material.parameters().into_iter().map(scale).collect()
}

/// Gauss–Newton matrix and half the negative gradient by everything that the predictions have derivatives by, in its
/// own unit, for parameters that may be zero.
pub(super) fn raw_sums(predictions: &[Prediction], targets: &[Target]) -> (DMatrix<f64>, DVector<f64>) {
    let n = predictions.first().and_then(|p| p.sensitivities.first()).map_or(0, Vec::len);
    let sums = Sums::of(predictions, targets, n);
    (sums.matrix, sums.gradient)
}

/// Covariance of the objective's half gradient by the `num` parameters, in their units, under the noise of `targets`.
///
/// # Errors
/// [`CalibrationError::Voxel`]: a filter does not fit the voxels.
pub(super) fn score(
    targets: &[Target],
    predictions: &[Prediction],
    num: usize,
) -> Result<DMatrix<f64>, CalibrationError> {
    let forces = AllForces::of(targets);
    let weighed = forces.weights() * forces.slopes(predictions, num);
    let mut score = weighed.transpose() * forces.covariance() * &weighed;
    for (target, prediction) in targets.iter().zip(predictions) {
        target.add_score(prediction, &mut score)?;
    }
    Ok(score)
}

/// Sums over all data, in the parameters' units.
#[derive(Default)]
struct Sums {
    matrix: DMatrix<f64>,
    gradient: DVector<f64>,
    chi2: f64,
    loss_u: f64,
    loss_f: f64,
    num_drives: u32,
    num_forces: u32,
}

impl Sums {
    /// Over everything that is compared, by `num` parameters.
    fn of(predictions: &[Prediction], targets: &[Target], num: usize) -> Sums {
        let mut sums = Sums { matrix: DMatrix::zeros(num, num), gradient: DVector::zeros(num), ..Sums::default() };
        for (prediction, target) in predictions.iter().zip(targets) {
            sums.add_displacements(prediction, target);
        }
        sums.add_forces(predictions, &AllForces::of(targets));
        sums
    }

    fn add_displacements(&mut self, prediction: &Prediction, target: &Target) {
        let n = self.gradient.len();
        for (d, step) in target.steps.iter().enumerate() {
            let fields = &prediction.sensitivities[d];
            let (mut squares, mut largest, mut num_voxels) = (0.0, 0.0f64, 0usize);
            // Missing voxels do not count; their NaN must not enter a product.
            for v in step.used() {
                let (model, measured) = (prediction.displacements[d][v], step.measured[v]);
                let weights = step.precision[v];
                let misfit = [0, 1, 2].map(|c| measured[c] - model[c]);
                let mut size = 0.0;
                for c in (0..3).filter(|&c| weights[c] > 0.0) {
                    squares += misfit[c] * misfit[c];
                    size += measured[c] * measured[c];
                    self.chi2 += weights[c] * misfit[c] * misfit[c];
                }
                for i in 0..n {
                    let s = &fields[i][v];
                    let weighted = [0, 1, 2].map(|c| weights[c] * s[c]);
                    self.gradient[i] += weighted[0] * misfit[0] + weighted[1] * misfit[1] + weighted[2] * misfit[2];
                    for j in 0..=i {
                        let t = &fields[j][v];
                        self.matrix[(i, j)] += weighted[0] * t[0] + weighted[1] * t[1] + weighted[2] * t[2];
                    }
                }
                largest = largest.max(size);
                num_voxels += 1;
            }
            if step.is_scanned() {
                self.loss_u += squares / (num_voxels as f64 * largest);
                self.num_drives += 1;
            }
        }
        for i in 0..n {
            for j in 0..i {
                self.matrix[(j, i)] = self.matrix[(i, j)];
            }
        }
    }

    fn add_forces(&mut self, predictions: &[Prediction], forces: &AllForces) {
        let (misfits, slopes) = (forces.misfits_of(predictions), forces.slopes(predictions, self.gradient.len()));
        let weights = forces.weights();
        let weighed = &weights * &misfits;
        self.chi2 += misfits.dot(&weighed);
        self.gradient += slopes.transpose() * weighed;
        self.matrix += slopes.transpose() * weights * &slopes;
        for (force, misfit) in forces.forces().iter().zip(&misfits) {
            self.loss_f += (misfit / force.value_n).powi(2);
            self.num_forces += 1;
        }
    }
}
