//! What a material predicts of a measurement, with its derivatives by the material's parameters.

use super::error::CalibrationError;
use super::observed::View;
use super::options::Bulk;
use crate::fem::{Equilibrium, ForwardModel, SolveError, SolveOptions};
use crate::material::{Ogden, Parameter};
use crate::sensitivity::{FisherInformation, ScanSettings};
use crate::voxel::VoxelOperator;

/// A held parameter counts in the information as known to this relative standard deviation: exact to its square.
pub(super) const HELD_LOG_SD: f64 = 1e-6;

/// How a scan sees a nodal field.
pub(super) trait Averages {
    /// Values in the order of the data.
    fn averages(&self, field: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, CalibrationError>;
}

impl Averages for VoxelOperator {
    fn averages(&self, field: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, CalibrationError> {
        Ok(self.average(field)?)
    }
}

impl Averages for View {
    fn averages(&self, field: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, CalibrationError> {
        self.average(field)
    }
}

/// What solving took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolverWork {
    /// Equilibria found.
    pub equilibria: usize,
    /// Newton iterations of them.
    pub newton_iterations: usize,
    /// Factorisations, those of the sensitivities included.
    pub factorisations: usize,
}

impl SolverWork {
    pub(super) fn add(&mut self, other: SolverWork) {
        self.equilibria += other.equilibria;
        self.newton_iterations += other.newton_iterations;
        self.factorisations += other.factorisations;
    }
}

/// What a material predicts of a measurement, with its derivatives. Does not depend on the data.
#[derive(Clone, Debug)]
pub(super) struct Prediction {
    pub(super) material: Ogden,
    pub(super) states: Vec<Equilibrium>,
    /// Voxel displacements per drive, mm.
    pub(super) displacements: Vec<Vec<[f64; 3]>>,
    /// ∂ū/∂ξ per drive and parameter, mm per unit.
    pub(super) sensitivities: Vec<Vec<Vec<[f64; 3]>>>,
    /// ∂F/∂ξ per drive and parameter, N per unit.
    pub(super) force_sensitivities: Vec<Vec<f64>>,
    /// What making it took.
    pub(super) work: SolverWork,
}

impl Prediction {
    /// Solves at every drive; `near` are equilibria of another material at the same drives.
    pub(super) fn new(
        model: &mut ForwardModel,
        seen: &dyn Averages,
        drives_mm: &[f64],
        material: &Ogden,
        near: Option<&[Equilibrium]>,
        solve: &SolveOptions,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Prediction, CalibrationError> {
        let mut prediction = Prediction {
            material: material.clone(),
            states: Vec::with_capacity(drives_mm.len()),
            displacements: Vec::new(),
            sensitivities: Vec::new(),
            force_sensitivities: Vec::new(),
            work: SolverWork::default(),
        };
        let before = model.num_factorisations();
        for (index, &drive) in drives_mm.iter().enumerate() {
            let start = near.and_then(|n| n.get(index)).or(prediction.states.last());
            let warm = model.solve(material, drive, start, solve, is_cancelled);
            prediction.work.newton_iterations += model.statistics().newton_iterations;
            let state = match warm {
                Err(SolveError::Cancelled { reached_mm }) => return Err(SolveError::Cancelled { reached_mm }.into()),
                // From rest, unless that is what failed.
                Err(_) if start.is_some() => {
                    let cold = model.solve(material, drive, None, solve, is_cancelled);
                    prediction.work.newton_iterations += model.statistics().newton_iterations;
                    cold?
                }
                other => other?,
            };
            prediction.work.equilibria += 1;
            // At once: the tangent of a state just found costs nothing.
            let sensitivities = model.tangent(material, &state)?.material_sensitivities()?;
            prediction.displacements.push(seen.averages(&state.displacement)?);
            prediction
                .sensitivities
                .push(sensitivities.iter().map(|s| seen.averages(&s.displacement)).collect::<Result<Vec<_>, _>>()?);
            prediction.force_sensitivities.push(sensitivities.iter().map(|s| s.force_n).collect());
            prediction.states.push(state);
        }
        prediction.work.factorisations = model.num_factorisations() - before;
        Ok(prediction)
    }

    /// Per drive: ∂ū/∂ξ of every parameter, and ∂F/∂ξ.
    pub(super) fn derivatives(&self) -> impl Iterator<Item = (&Vec<Vec<[f64; 3]>>, &Vec<f64>)> {
        self.sensitivities.iter().zip(&self.force_sensitivities)
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
