//! The misfit χ² of a model's prediction and its Gauss–Newton system in scaled parameters.
//!
//! χ² = Σ_drives [ Σ_voxels w Σ_c (u_c − ū_c)²/σ_c² + (F − F_model)²/σ_F² ] + (ln κ − ln κ₀)²/σ_κ² where a prior is set.
//! Scaled parameters: ln κ; every other ξ relative to its present value, ξ (1 + s). With the residuals r and their
//! derivatives the gradient is g = −½ ∂χ²/∂s and the matrix is H = ½ ∂²χ²/∂s² without the second derivatives of the model.

use super::error::CalibrationError;
use super::fit::{Bulk, FitOptions};
use super::synthetic::Measurement;
use crate::fem::{Equilibrium, ForwardModel};
use crate::material::{Ogden, Parameter};
use crate::sensitivity::{FisherInformation, ScanSettings};
use crate::voxel::VoxelOperator;
use nalgebra::{DMatrix, DVector};

/// A held κ counts in the information as known to this relative standard deviation: exact to its square.
const HELD_LOG_SD: f64 = 1e-6;

/// What a material predicts of a measurement, with its derivatives. Does not depend on the data.
#[derive(Clone, Debug)]
pub(super) struct Prediction {
    pub(super) material: Ogden,
    pub(super) states: Vec<Equilibrium>,
    /// Voxel displacements per drive, mm.
    displacements: Vec<Vec<[f64; 3]>>,
    /// ∂ū/∂ξ per drive and parameter, mm per unit.
    sensitivities: Vec<Vec<Vec<[f64; 3]>>>,
    /// ∂F/∂ξ per drive and parameter, N per unit.
    force_sensitivities: Vec<Vec<f64>>,
}

impl Prediction {
    /// Solves at every drive; `near` are equilibria of another material at the same drives.
    pub(super) fn new(
        model: &mut ForwardModel,
        operator: &VoxelOperator,
        drives_mm: &[f64],
        material: &Ogden,
        near: Option<&[Equilibrium]>,
        options: &FitOptions,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Prediction, CalibrationError> {
        let mut prediction = Prediction {
            material: material.clone(),
            states: Vec::with_capacity(drives_mm.len()),
            displacements: Vec::new(),
            sensitivities: Vec::new(),
            force_sensitivities: Vec::new(),
        };
        for (index, &drive) in drives_mm.iter().enumerate() {
            let start = near.and_then(|n| n.get(index)).or(prediction.states.last());
            let warm = model.solve(material, drive, start, &options.solve, is_cancelled);
            let state = match warm {
                // From rest, unless that is what failed or the caller wants to stop.
                Err(_) if start.is_some() && !is_cancelled() => {
                    model.solve(material, drive, None, &options.solve, is_cancelled)?
                }
                other => other?,
            };
            // At once, while the tangent of this state stands.
            let sensitivities = model.material_sensitivities(material, &state)?;
            prediction.displacements.push(operator.average(&state.displacement)?);
            prediction
                .sensitivities
                .push(sensitivities.iter().map(|s| operator.average(&s.displacement)).collect::<Result<Vec<_>, _>>()?);
            prediction.force_sensitivities.push(sensitivities.iter().map(|s| s.force_n).collect());
            prediction.states.push(state);
        }
        Ok(prediction)
    }

    /// Information of all drives with the voxel weights `weights` (one list per drive), and of the prior.
    pub(super) fn information(
        &self,
        scan: &ScanSettings,
        weights: &[Vec<f64>],
        bulk: Bulk,
    ) -> Result<FisherInformation, CalibrationError> {
        let mut information = FisherInformation::none(&self.material);
        for ((fields, forces), weights) in self.sensitivities.iter().zip(&self.force_sensitivities).zip(weights) {
            let of_drive = FisherInformation::of_drive(&self.material, fields, weights, forces, &scan.noise())?;
            information.add(&of_drive)?;
        }
        match bulk {
            Bulk::Free => {}
            Bulk::LogPrior { log_sd, .. } => information.add_log_prior(Parameter::Kappa, log_sd)?,
            Bulk::Held => information.add_log_prior(Parameter::Kappa, HELD_LOG_SD)?,
        }
        Ok(information)
    }
}

/// χ², its gradient and Gauss–Newton matrix in scaled parameters.
#[derive(Clone, Debug)]
pub(super) struct NormalSystem {
    pub(super) parameters: Vec<Parameter>,
    pub(super) values: Vec<f64>,
    pub(super) information: FisherInformation,
    /// H; for all parameters, held ones included.
    pub(super) matrix: DMatrix<f64>,
    /// g = −½ ∂χ²/∂s.
    pub(super) gradient: DVector<f64>,
    pub(super) chi2: f64,
    pub(super) num_data: usize,
    /// The paper's ℓ_u, mean over drives.
    pub(super) loss_u: f64,
    /// The paper's ℓ_F, mean over drives.
    pub(super) loss_f: f64,
}

impl NormalSystem {
    /// Of checked data: see [`Measurement::check`].
    pub(super) fn new(
        prediction: &Prediction,
        scan: &ScanSettings,
        data: &Measurement,
        bulk: Bulk,
    ) -> Result<NormalSystem, CalibrationError> {
        let parameters = prediction.material.parameters();
        let n = parameters.len();
        let values: Vec<f64> = parameters.iter().map(|p| prediction.material.value(*p)).collect();
        let weights: Vec<Vec<f64>> = (0..data.drives_mm.len()).map(|d| data.weights_of(d)).collect();
        let information = prediction.information(scan, &weights, bulk)?;
        let precision = scan.noise_sd_mm.map(|sd| 1.0 / (sd * sd));
        let force_precision = 1.0 / (scan.force_sd_n * scan.force_sd_n);
        let mut gradient = DVector::zeros(n);
        let (mut chi2, mut num_data, mut loss_u, mut loss_f) = (0.0, 0, 0.0, 0.0);
        for (d, state) in prediction.states.iter().enumerate() {
            let (mut squares, mut largest, mut num_voxels) = (0.0, 0.0f64, 0usize);
            for (v, (model, measured)) in prediction.displacements[d].iter().zip(&data.displacements[d]).enumerate() {
                // Missing voxels have no weight; their NaN must not enter a product.
                if weights[d][v] <= 0.0 {
                    continue;
                }
                let mut square = 0.0;
                for c in 0..3 {
                    let misfit = measured[c] - model[c];
                    let weight = precision[c] * weights[d][v];
                    square += misfit * misfit;
                    chi2 += weight * misfit * misfit;
                    for (g, s) in gradient.iter_mut().zip(&prediction.sensitivities[d]) {
                        *g += weight * misfit * s[v][c];
                    }
                }
                squares += square;
                largest = largest.max(measured.iter().map(|x| x * x).sum());
                num_voxels += 1;
            }
            num_data += 3 * num_voxels + 1;
            loss_u += squares / (num_voxels as f64 * largest);
            let misfit = data.forces_n[d] - state.force_n;
            chi2 += force_precision * misfit * misfit;
            for (g, f) in gradient.iter_mut().zip(&prediction.force_sensitivities[d]) {
                *g += force_precision * misfit * f;
            }
            loss_f += (misfit / data.forces_n[d]).powi(2);
        }
        // dξ = ξ ds, with its sign.
        let matrix = DMatrix::from_fn(n, n, |i, j| information.matrix()[(i, j)] * values[i] * values[j]);
        gradient.component_mul_assign(&DVector::from_column_slice(&values));
        if let Bulk::LogPrior { center_kpa, log_sd } = bulk {
            let misfit = (center_kpa / values[0]).ln();
            chi2 += (misfit / log_sd).powi(2);
            gradient[0] += misfit / (log_sd * log_sd);
        }
        let num_drives = prediction.states.len().max(1) as f64;
        if !chi2.is_finite() {
            return Err(CalibrationError::InvalidValue { name: "chi2", value: chi2, requirement: "finite" });
        }
        Ok(NormalSystem {
            parameters,
            values,
            information,
            matrix,
            gradient,
            chi2,
            num_data,
            loss_u: loss_u / num_drives,
            loss_f: loss_f / num_drives,
        })
    }

    /// `material` after the scaled change `step`.
    pub(super) fn moved(&self, material: &Ogden, step: &DVector<f64>) -> Ogden {
        let mut next = material.clone();
        for (i, &parameter) in self.parameters.iter().enumerate() {
            let value = self.values[i];
            let moved = if parameter == Parameter::Kappa { value * step[i].exp() } else { value * (1.0 + step[i]) };
            next.set(parameter, moved);
        }
        next
    }
}
