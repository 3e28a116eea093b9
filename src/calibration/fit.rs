//! Maximum-likelihood fit of Ogden parameters to voxel displacements and forces.
//!
//! Levenberg–Marquardt on the χ² of [`super::system`], with ∂u/∂ξ and ∂F/∂ξ from the factorised tangent and the model
//! averaged over the voxels as the data are. Every equilibrium starts from the last one. The step keeps to the limits
//! of [`super::step`]: each μᵢαᵢ keeps its sign, exponents keep their order and distance, κ stays where the elements
//! are good.
//!
//! The fit has converged when the optimum of the linear model at the present parameters is nearer than a fraction of a
//! standard deviation, in every combination of parameters. A small step alone proves nothing: damping makes steps
//! small. Where the misfit is more than noise the standard deviation is that of the misfit.

use super::bench::Bench;
use super::descend::{Descent, Start, descend};
use super::error::CalibrationError;
use super::options::{Bulk, FitOptions, check_options};
use super::prediction::Prediction;
use super::step::Constraints;
use super::stress_path::StressPath;
use super::synthetic::Measurement;
use super::system::NormalSystem;
use super::target::Target;
use crate::fem::Equilibrium;
use crate::material::{Material, Parameter};
use crate::sensitivity::{FisherInformation, ScanSettings};

/// A fitted material. Its existence means that the fit converged; one that did not is a [`CalibrationError`].
#[derive(Clone, Debug)]
pub struct Fit {
    /// The estimate.
    pub material: Material,
    /// Fisher information at the estimate, prior included; its covariance is that of the estimate.
    pub information: FisherInformation,
    /// χ² / (data − fitted parameters): 1 where model and noise are right.
    pub chi2_per_datum: f64,
    /// The paper's ℓ_u: mean over voxels of |u_model − u|² / |u|²_max, mean over drives. Voxels count alike.
    pub loss_u: f64,
    /// The paper's ℓ_F = (1 − F_model/F)², mean over drives.
    pub loss_f: f64,
    /// Iterations made, rejected ones included.
    pub iterations: usize,
    /// Distance from the optimum of the linear model, in standard deviations.
    pub distance: f64,
    /// Limits at which the estimate stands, in words. Where there are any, the covariance is too wide.
    pub reached_limits: Vec<String>,
    /// Equilibria of the estimate, one per drive; of several kinds of samples the first one's.
    pub states: Vec<Equilibrium>,
    /// What it predicts of the voxels per drive, mm.
    pub(super) displacements: Vec<Vec<[f64; 3]>>,
    /// Its forces, all samples together, N.
    pub(super) forces_n: Vec<f64>,
    pub(super) is_bulk_held: bool,
}

impl Fit {
    /// Standard deviation of a parameter in its unit; none where the data do not determine it or it was held.
    pub fn sd(&self, parameter: Parameter) -> Option<f64> {
        if self.is_bulk_held && parameter == Parameter::Kappa {
            return None;
        }
        self.information.covariance().sd(self.information.index_of(parameter).ok()?)
    }
}

/// Where a fit starts: a material with its equilibria and their derivatives. One start serves any number of data sets.
#[derive(Clone, Debug)]
pub struct FitStart {
    constraints: Constraints,
    prediction: Prediction,
    path: StressPath,
    options: FitOptions,
}

impl FitStart {
    /// Solves `material` at `drives_mm`; every fit from here uses `options`.
    ///
    /// # Errors
    /// [`CalibrationError`]: an invalid material or option, exponents too close, no equilibrium.
    pub fn new(
        bench: &mut Bench,
        drives_mm: &[f64],
        material: &Material,
        options: &FitOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<FitStart, CalibrationError> {
        check_options(options)?;
        let constraints = Constraints::new(material, options)?;
        let prediction = bench.predict(drives_mm, material, None, &options.solve, is_cancelled)?;
        let path = bench.stress_path(material, &prediction);
        Ok(FitStart { constraints, prediction, path, options: *options })
    }

    /// The same start with another prior or none; κ is held or not as before.
    pub(super) fn with_bulk(&self, bulk: Bulk) -> FitStart {
        FitStart { options: FitOptions { bulk, ..self.options }, ..self.clone() }
    }

    /// Fits `data`, which must be of the start's drives. The result depends on the data and the start alone, not on
    /// what `bench` solved before.
    ///
    /// # Errors
    /// [`CalibrationError`].
    pub fn fit(
        &self,
        bench: &mut Bench,
        scan: &ScanSettings,
        data: &Measurement,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Fit, CalibrationError> {
        let options = &self.options;
        let target = Target::of_measurement(data, scan);
        let (_, num_data) = target.expectation();
        let Descent { mut predictions, system, iterations, distance, reached, .. } =
            self.descent(bench, target, data, is_cancelled)?;
        let held = options.held.count() + usize::from(options.bulk == Bulk::Held);
        let fitted = system.parameters.len() - held;
        let prior = usize::from(matches!(options.bulk, Bulk::LogPrior { .. }));
        let freedom = (num_data + prior).saturating_sub(fitted).max(1);
        let prediction = predictions.remove(0);
        Ok(Fit {
            material: prediction.material,
            information: system.information,
            chi2_per_datum: system.chi2 / freedom as f64,
            loss_u: system.loss_u,
            loss_f: system.loss_f,
            iterations,
            distance,
            reached_limits: reached,
            states: prediction.states,
            displacements: prediction.displacements,
            forces_n: prediction.forces_n,
            is_bulk_held: options.bulk == Bulk::Held,
        })
    }

    /// A start at the estimate that `data` lead to from here, for other data of the same drives; this start itself
    /// where they lead to none, or to a limit.
    ///
    /// # Errors
    /// [`CalibrationError`] that is not of the data.
    pub(super) fn led_by(
        &self,
        bench: &mut Bench,
        scan: &ScanSettings,
        data: &Measurement,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<FitStart, CalibrationError> {
        let found = match self.descent(bench, Target::of_measurement(data, scan), data, is_cancelled) {
            Err(error) if !error.is_of_the_data() => return Err(error),
            other => other.ok().filter(|found| found.reached.is_empty()),
        };
        let Some(prediction) = found.and_then(|found| found.predictions.into_iter().next()) else {
            return Ok(self.clone());
        };
        let constraints = Constraints::new(&prediction.material, &self.options)?;
        let path = bench.stress_path(&prediction.material, &prediction);
        Ok(FitStart { constraints, prediction, path, options: self.options })
    }

    /// The way from here to the optimum of `target`, which is that of `data`.
    fn descent(
        &self,
        bench: &mut Bench,
        target: Target,
        data: &Measurement,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Descent, CalibrationError> {
        let options = &self.options;
        data.check(bench.num_voxels(), self.prediction.states.len().saturating_sub(data.on_the_way.len()))?;
        let drives_mm = data.all_drives_mm();
        let (expected, _) = target.expectation();
        let targets = [target];
        let mut predict = |material: &Material, near: &[Prediction]| {
            Ok(vec![bench.predict(&drives_mm, material, near.first(), &options.solve, is_cancelled)?])
        };
        let system = |p: &[Prediction]| NormalSystem::new(p, &targets, options.bulk, options.held);
        let start = Start { predictions: vec![self.prediction.clone()], path: self.path.clone() };
        descend(&self.constraints, options, start, expected, &mut predict, &system)?.converged(options)
    }
}

/// Fits `start` to `data`: [`FitStart::new`] and [`FitStart::fit`] in one.
///
/// # Errors
/// [`CalibrationError`].
pub fn fit(
    bench: &mut Bench,
    scan: &ScanSettings,
    data: &Measurement,
    start: &Material,
    options: &FitOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Fit, CalibrationError> {
    data.check(bench.num_voxels(), data.drives_mm.len())?;
    let start = FitStart::new(bench, &data.all_drives_mm(), start, options, is_cancelled)?;
    start.fit(bench, scan, data, is_cancelled)
}

#[cfg(test)]
#[path = "fit_tests.rs"]
mod tests;
