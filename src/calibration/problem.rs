//! Recordings, the models of their specimens and how the scan saw them: what a fit to recordings needs.

use super::descend::{Descent, Start, descend};
use super::error::CalibrationError;
use super::models::Models;
use super::observed::{Observed, View};
use super::options::{Bulk, FitOptions, check_options};
use super::prediction::{Prediction, SolverWork};
use super::recording_fit::RecordingFit;
use super::step::Constraints;
use super::stress_path::StressPath;
use super::system::{NormalSystem, raw_sums, score};
use super::target::{Objective, Target};
use crate::fem::{ForwardModel, ModelPool, SolveOptions};
use crate::kinematics::IDENTITY;
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::specimen::Specimen;

/// A misfit counts as more than noise beyond this many standard deviations of χ².
const MISFIT_LIMIT: f64 = 4.0;

/// Recordings with a model of each.
pub struct CalibrationProblem<'a> {
    observed: &'a [Observed],
    models: Models,
    objective: Objective,
}

impl<'a> CalibrationProblem<'a> {
    /// Meshes every recording's specimen with `mesh` and prepares what the fits share.
    ///
    /// # Errors
    /// [`CalibrationError`]; [`CalibrationError::NoMeasuredBoundary`] where several steps of one recording have
    /// measured boundaries ([`Observed::steps_apart`]).
    pub fn new(
        observed: &'a [Observed],
        mesh: &dyn Fn(&Specimen) -> MeshOptions,
        objective: Objective,
    ) -> Result<CalibrationProblem<'a>, CalibrationError> {
        Ok(CalibrationProblem { observed, models: Models::new(observed, mesh)?, objective })
    }

    /// The same models for other data of the same specimens, voxels and filter: draws of noise.
    ///
    /// # Errors
    /// [`CalibrationError::DataLength`] where the voxels are others.
    pub fn with_data<'b>(self, observed: &'b [Observed]) -> Result<CalibrationProblem<'b>, CalibrationError> {
        let length = |what, found: usize, expected: usize| {
            if found == expected { Ok(()) } else { Err(CalibrationError::DataLength { what, found, expected }) }
        };
        length("list of recordings", observed.len(), self.observed.len())?;
        for (new, old) in observed.iter().zip(self.observed) {
            length("list of compared voxels", new.mask.num_voxels(), old.mask.num_voxels())?;
        }
        let CalibrationProblem { models, objective, .. } = self;
        Ok(CalibrationProblem { observed, models, objective })
    }

    /// The recordings.
    pub fn observed(&self) -> &'a [Observed] {
        self.observed
    }

    /// Whether any step has a force. Without one only ratios of moduli are determined.
    pub fn has_force(&self) -> bool {
        self.observed.iter().any(|o| o.num_forces() > 0)
    }

    /// An error where a recording's force is that of unlike samples, of which `what` is not supported.
    ///
    /// # Errors
    /// [`CalibrationError::UnlikeSamples`].
    pub fn refuse_unlike_samples(&self, what: &'static str) -> Result<(), CalibrationError> {
        if self.models.others.iter().all(Vec::is_empty) {
            Ok(())
        } else {
            Err(CalibrationError::UnlikeSamples { what })
        }
    }

    /// The model of each recording's specimen and how the scan sees it, in the order of the recordings.
    pub fn models_and_views(&mut self) -> impl Iterator<Item = (&mut ForwardModel, &View)> {
        self.models.scanned.iter_mut().map(ModelPool::own_mut).zip(&self.models.views)
    }

    /// Free displacement unknowns of each model.
    pub fn num_unknowns(&self) -> Vec<usize> {
        self.models.scanned.iter().map(|m| m.own().num_unknowns()).collect()
    }

    pub(super) fn objective(&self) -> Objective {
        self.objective
    }

    pub(super) fn parts(&self) -> (&'a [Observed], &[ModelPool], &[View]) {
        (self.observed, &self.models.scanned, &self.models.views)
    }

    pub(super) fn targets(&self) -> Result<Vec<Target<'_>>, CalibrationError> {
        Target::of_recordings(self.observed, &self.models.views, self.objective)
    }

    /// The states that predictions of `material` visit.
    pub(super) fn stress_path(&self, material: &Material, predictions: &[Prediction]) -> StressPath {
        self.models.stress_path(material, predictions)
    }

    pub(super) fn predict(
        &self,
        material: &Material,
        near: Option<&[Prediction]>,
        solve: &SolveOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<Prediction>, CalibrationError> {
        self.models.predict(self.observed, material, near, solve, is_cancelled)
    }

    /// The predictions of `fit`, a fit of this problem, with derivatives by the moduli of further terms of `exponents`
    /// (per kPa, of terms that are not there yet), in their order behind those by its own parameters. Does not depend
    /// on the data.
    ///
    /// # Errors
    /// [`CalibrationError::Solve`]: the material has as many terms as it may have, or it was cancelled.
    pub(super) fn with_further_terms(
        &self,
        fit: &RecordingFit,
        exponents: &[f64],
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<Prediction>, CalibrationError> {
        self.models.with_further_terms(&fit.predictions, exponents, is_cancelled)
    }

    /// Fits from `start`; `near` is an earlier fit of this problem whose equilibria are used as first guesses. A fit
    /// that does not converge comes back as such.
    ///
    /// # Errors
    /// [`CalibrationError`].
    pub fn fit(
        &self,
        start: &Material,
        near: Option<&RecordingFit>,
        options: &FitOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<RecordingFit, CalibrationError> {
        check_options(options)?;
        let near = near.map(|n| &n.predictions[..]);
        let first = self.predict(start, near, &options.solve, is_cancelled)?;
        self.descend_from(first, start, options, is_cancelled)
    }

    /// Fits from where `from` stands, an earlier fit on this mesh, whose equilibria and derivatives are taken as they
    /// are; where these are not of all drives, from a start near it.
    pub(super) fn fit_from(
        &self,
        from: &RecordingFit,
        options: &FitOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<RecordingFit, CalibrationError> {
        check_options(options)?;
        let mut pairs = from.predictions.iter().zip(self.observed);
        if pairs.any(|(prediction, recording)| prediction.states.len() != recording.all_drives_mm().len()) {
            return self.fit(&from.material, Some(from), options, is_cancelled);
        }
        self.descend_from(from.predictions.clone(), &from.material, options, is_cancelled)
    }

    fn descend_from(
        &self,
        first: Vec<Prediction>,
        start: &Material,
        options: &FitOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<RecordingFit, CalibrationError> {
        let constraints = Constraints::new(start, options)?;
        let mut work = SolverWork::default();
        first.iter().for_each(|p| work.add(p.work));
        let CalibrationProblem { observed, models, objective } = self;
        let path = models.stress_path(start, &first);
        let targets = Target::of_recordings(observed, &models.views, *objective)?;
        let mut trial = |material: &Material, near: &[Prediction]| {
            models.predict(observed, material, Some(near), &options.solve, is_cancelled)
        };
        let evaluate = |p: &[Prediction]| NormalSystem::new(p, &targets, options.bulk, options.held);
        let (expected, _) = sum_of_expectations(&targets);
        let first = Start { path, predictions: first };
        let descent = descend(&constraints, options, first, expected, &mut trial, &evaluate)?;
        work.add(descent.work);
        let mut fit = finished(descent, &targets, observed, &models.views, options, *objective)?;
        fit.work = work;
        Ok(fit)
    }

    /// `material` as if it had been fitted: its losses and predictions. Nothing moves.
    ///
    /// # Errors
    /// [`CalibrationError`].
    pub fn at(
        &self,
        material: &Material,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<RecordingFit, CalibrationError> {
        // A huge tolerance: converged where it stands.
        let options = FitOptions { tolerance: f64::MAX, ..FitOptions::default() };
        self.fit(material, None, &options, is_cancelled)
    }

    /// Forces (N) that `material` needs, per recording and drive.
    ///
    /// # Errors
    /// [`CalibrationError::Solve`].
    pub fn force_at(
        &self,
        material: &Material,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<Vec<f64>>, CalibrationError> {
        let found = self.predict(material, None, &SolveOptions::trial(), is_cancelled)?;
        Ok(found.into_iter().map(|p| p.forces_n).collect())
    }

    /// By how much `fit`, a fit of this problem, would shift to first order were the data `other`, of the same
    /// specimens and voxels: per parameter, in its unit; zero where the data do not determine it.
    ///
    /// # Errors
    /// [`CalibrationError`]: nothing to compare.
    pub fn shift_to(&self, fit: &RecordingFit, other: &[Observed]) -> Result<Vec<f64>, CalibrationError> {
        let gradient = |targets: &[Target]| raw_sums(&fit.predictions, targets).1;
        let moved = Target::of_recordings(other, &self.models.views, self.objective)?;
        let change = gradient(&moved) - gradient(&self.targets()?);
        let covariance = fit.information.covariance();
        let part = |i: usize, j: usize| covariance.covariance(i, j).map_or(0.0, |c| c * change[j]);
        Ok((0..change.len()).map(|i| (0..change.len()).map(|j| part(i, j)).sum()).collect())
    }

    /// The isochoric principal stretches that a fit's voxels visit, all recordings and drives together.
    ///
    /// # Errors
    /// [`CalibrationError::Voxel`].
    pub fn visited_stretches(&self, fit: &RecordingFit) -> Result<Vec<[f64; 3]>, CalibrationError> {
        let mut all = Vec::new();
        for ((view, recording), prediction) in self.models.views.iter().zip(self.observed).zip(&fit.predictions) {
            for state in prediction.states.iter().take(recording.steps.len()) {
                for slope in view.gradients(&state.displacement)? {
                    let f = [0, 1, 2].map(|i| [0, 1, 2].map(|j| IDENTITY[i][j] + slope[i][j]));
                    let seen = crate::kinematics::decompose(&f);
                    if seen.is_admissible() {
                        all.push(seen.principal_stretches.map(|s| s / seen.jacobian.cbrt()));
                    }
                }
            }
        }
        Ok(all)
    }
}

fn finished(
    descent: Descent,
    targets: &[Target],
    observed: &[Observed],
    views: &[View],
    options: &FitOptions,
    objective: Objective,
) -> Result<RecordingFit, CalibrationError> {
    let Descent { predictions, system, is_converged, iterations, distance, reached, history, .. } = descent;
    let n = system.parameters.len();
    let held = if options.bulk == Bulk::Held { options.held.with(0) } else { options.held };
    let mut score = score(targets, &predictions, n)?;
    if let Bulk::LogPrior { log_sd, .. } = options.bulk {
        score[(0, 0)] += (log_sd * system.values[0]).powi(-2);
    }
    let inverse = system.information.covariance();
    let covariance = inverse.with_score(&score);
    let mut absorbed = inverse.absorbed(&score);
    // χ² with the weights of the noise, whatever was minimised.
    let (chi2, expected) = match objective {
        Objective::Weighted => (system.chi2, sum_of_expectations(targets)),
        Objective::Paper { .. } => {
            let weighted = Target::of_recordings(observed, views, Objective::Weighted)?;
            absorbed = (n - held.count()) as f64;
            let chi2 = NormalSystem::new(&predictions, &weighted, options.bulk, options.held)?.chi2;
            (chi2, sum_of_expectations(&weighted))
        }
    };
    let (objective_value, own_expectation) = (system.chi2, sum_of_expectations(targets).0);
    let prior = f64::from(u8::from(matches!(options.bulk, Bulk::LogPrior { .. })));
    let (expected, num_data) = expected;
    let chi2_per_datum = chi2 / (expected + prior - absorbed).max(1.0);
    let num_forces: usize = observed.iter().map(Observed::num_forces).sum();
    // Values that share noise make χ² scatter more.
    let independent = num_data as f64 / observed.iter().map(Observed::noise_correlation).fold(1.0, f64::max);
    let is_noise = chi2_per_datum < 1.0 + MISFIT_LIMIT * (2.0 / independent).sqrt();
    let Some(material) = predictions.first().map(|p| p.material.clone()) else {
        let name = "the number of recordings";
        return Err(CalibrationError::InvalidValue { name, value: 0.0, requirement: "positive" });
    };
    Ok(RecordingFit {
        material,
        information: system.information,
        covariance,
        chi2,
        chi2_per_datum,
        misfit_factor: if is_noise { 1.0 } else { chi2_per_datum },
        structured_misfit: if is_noise { 0.0 } else { (objective_value - own_expectation).max(0.0).sqrt() },
        num_data,
        loss_u: system.loss_u,
        loss_f: (num_forces > 0).then_some(system.loss_f),
        is_converged,
        iterations,
        distance,
        reached_limits: reached,
        history,
        work: SolverWork::default(),
        held,
        predictions,
    })
}

fn sum_of_expectations(targets: &[Target]) -> (f64, usize) {
    targets.iter().map(Target::expectation).fold((0.0, 0), |(a, n), (b, m)| (a + b, n + m))
}

#[cfg(test)]
#[path = "problem_tests.rs"]
mod tests;
