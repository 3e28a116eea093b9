//! Recordings, the models of their specimens and how the scan saw them: what a fit to recordings needs.

use super::descend::{Descent, Start, descend};
use super::error::CalibrationError;
use super::observed::{Observed, View};
use super::options::{Bulk, FitOptions, Held, check_options};
use super::prediction::{Prediction, SolverWork};
use super::step::Constraints;
use super::stress_path::StressPath;
use super::system::NormalSystem;
use super::target::{Objective, Target};
use crate::fem::{Departures, Equilibrium, ForwardModel, SolveOptions};
use crate::kinematics::IDENTITY;
use crate::material::{Ogden, Parameter};
use crate::mesh::MeshOptions;
use crate::sensitivity::{Covariance, FisherInformation};
use crate::specimen::Specimen;
use nalgebra::DMatrix;

/// A misfit counts as more than noise beyond this many standard deviations of χ².
const MISFIT_LIMIT: f64 = 4.0;

/// Recordings with a model of each.
pub struct CalibrationProblem<'a> {
    observed: &'a [Observed],
    models: Vec<ForwardModel>,
    views: Vec<View>,
    objective: Objective,
}

/// A material fitted to recordings.
#[derive(Clone, Debug)]
pub struct RecordingFit {
    /// The estimate.
    pub material: Ogden,
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

    /// The largest shift of a parameter that a structured error as large as the structured misfit could make.
    pub fn possible_shift(&self, parameter: Parameter) -> Option<f64> {
        let index = self.information.index_of(parameter).ok()?;
        let plain = self.information.covariance().sd(index).filter(|_| !self.held.contains(index))?;
        Some(plain * self.structured_misfit)
    }

    /// ½ Σ μᵢαᵢ, kPa, and its standard deviation by the delta method.
    pub fn initial_shear_modulus(&self) -> (f64, Option<f64>) {
        let terms = &self.material.terms;
        let value = self.material.initial_shear_modulus_kpa();
        let mut gradient = vec![0.0];
        for term in terms {
            gradient.extend([0.5 * term.alpha, 0.5 * term.mu_kpa]);
        }
        let is_known = !self.held.contains(1);
        let sd = self.covariance.sd_along(&gradient).filter(|_| is_known);
        (value, sd.map(|sd| sd * self.misfit_factor.sqrt()))
    }

    /// Equilibria of one recording, one per drive.
    pub fn states(&self, recording: usize) -> &[Equilibrium] {
        &self.predictions[recording].states
    }

    /// What the estimate predicts of a drive: displacements of the compared voxels, mm.
    pub fn predicted(&self, recording: usize, step: usize) -> &[[f64; 3]] {
        &self.predictions[recording].displacements[step]
    }
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
        let mut problem = CalibrationProblem { observed, models: Vec::new(), views: Vec::new(), objective };
        for recording in observed {
            let specimen = &recording.specimen;
            let model = ForwardModel::of_specimen(specimen, &mesh(specimen))?;
            problem.views.push(recording.view(specimen, model.mesh())?);
            problem.models.push(with_boundary(model, recording)?);
        }
        Ok(problem)
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
        let CalibrationProblem { models, views, objective, .. } = self;
        Ok(CalibrationProblem { observed, models, views, objective })
    }

    /// The recordings.
    pub fn observed(&self) -> &'a [Observed] {
        self.observed
    }

    /// Whether any step has a force. Without one only ratios of moduli are determined.
    pub fn has_force(&self) -> bool {
        self.observed.iter().flat_map(|o| &o.steps).any(|s| s.force.is_some())
    }

    /// Free displacement unknowns of each model.
    pub fn num_unknowns(&self) -> Vec<usize> {
        self.models.iter().map(ForwardModel::num_unknowns).collect()
    }

    pub(super) fn objective(&self) -> Objective {
        self.objective
    }

    pub(super) fn parts(&mut self) -> (&'a [Observed], &mut [ForwardModel], &[View]) {
        (self.observed, &mut self.models, &self.views)
    }

    pub(super) fn targets(&self) -> Result<Vec<Target<'_>>, CalibrationError> {
        Target::of_recordings(self.observed, &self.views, self.objective)
    }

    pub(super) fn predict(
        &mut self,
        material: &Ogden,
        near: Option<&[Prediction]>,
        solve: &SolveOptions,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Vec<Prediction>, CalibrationError> {
        predict(self.observed, &mut self.models, &self.views, material, near, solve, is_cancelled)
    }

    /// Fits from `start`; `near` is an earlier fit of this problem whose equilibria are used as first guesses. A fit
    /// that does not converge comes back as such.
    ///
    /// # Errors
    /// [`CalibrationError`].
    pub fn fit(
        &mut self,
        start: &Ogden,
        near: Option<&RecordingFit>,
        options: &FitOptions,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<RecordingFit, CalibrationError> {
        check_options(options)?;
        let near = near.map(|n| &n.predictions[..]);
        let first = self.predict(start, near, &options.solve, is_cancelled)?;
        self.descend_from(first, start, options, is_cancelled)
    }

    /// Fits from where `from` stands, an earlier fit on this mesh, whose equilibria and derivatives are taken as they
    /// are.
    pub(super) fn fit_from(
        &mut self,
        from: &RecordingFit,
        options: &FitOptions,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<RecordingFit, CalibrationError> {
        check_options(options)?;
        self.descend_from(from.predictions.clone(), &from.material, options, is_cancelled)
    }

    fn descend_from(
        &mut self,
        first: Vec<Prediction>,
        start: &Ogden,
        options: &FitOptions,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<RecordingFit, CalibrationError> {
        let constraints = Constraints::new(start, options)?;
        let mut work = SolverWork::default();
        first.iter().for_each(|p| work.add(p.work));
        let CalibrationProblem { observed, models, views, objective } = self;
        let path = first
            .iter()
            .zip(models.iter())
            .map(|(prediction, model)| StressPath::new(model, start, &prediction.states))
            .fold(StressPath::default(), StressPath::join);
        let targets = Target::of_recordings(observed, views, *objective)?;
        let mut trial = |material: &Ogden, near: &[Prediction]| {
            predict(observed, models, views, material, Some(near), &options.solve, is_cancelled)
        };
        let evaluate = |p: &[Prediction]| NormalSystem::new(p, &targets, options.bulk, options.held);
        let (expected, _) = sum_of_expectations(&targets);
        let first = Start { path, predictions: first };
        let descent = descend(&constraints, options, first, expected, &mut trial, &evaluate)?;
        work.add(descent.work);
        let mut fit = finished(descent, &targets, observed, views, options, *objective)?;
        fit.work = work;
        Ok(fit)
    }

    /// `material` as if it had been fitted: its losses and predictions. Nothing moves.
    ///
    /// # Errors
    /// [`CalibrationError`].
    pub fn at(&mut self, material: &Ogden, is_cancelled: &dyn Fn() -> bool) -> Result<RecordingFit, CalibrationError> {
        // A huge tolerance: converged where it stands.
        let options = FitOptions { tolerance: f64::MAX, ..FitOptions::default() };
        self.fit(material, None, &options, is_cancelled)
    }

    /// Forces (N) that `material` needs, per recording and drive.
    ///
    /// # Errors
    /// [`CalibrationError::Solve`].
    pub fn force_at(
        &mut self,
        material: &Ogden,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Vec<Vec<f64>>, CalibrationError> {
        let found = self.predict(material, None, &SolveOptions::default(), is_cancelled)?;
        Ok(found.iter().map(|p| p.states.iter().map(|s| s.force_n).collect()).collect())
    }

    /// The isochoric principal stretches that a fit's voxels visit, all recordings and drives together.
    ///
    /// # Errors
    /// [`CalibrationError::Voxel`].
    pub fn visited_stretches(&self, fit: &RecordingFit) -> Result<Vec<[f64; 3]>, CalibrationError> {
        let mut all = Vec::new();
        for (view, prediction) in self.views.iter().zip(&fit.predictions) {
            for state in &prediction.states {
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

/// A model with what was measured at the boundary of a recording.
fn with_boundary(model: ForwardModel, recording: &Observed) -> Result<ForwardModel, CalibrationError> {
    match &recording.steps[..] {
        _ if !recording.has_measured_faces() => Ok(model),
        [step] => Ok(model.departed(&Departures { faces_per_mm: step.faces_per_mm.clone(), ..Departures::default() })),
        _ => {
            let reason = "several steps share a model; take the steps apart";
            Err(CalibrationError::NoMeasuredBoundary { reason })
        }
    }
}

fn predict(
    observed: &[Observed],
    models: &mut [ForwardModel],
    views: &[View],
    material: &Ogden,
    near: Option<&[Prediction]>,
    solve: &SolveOptions,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Vec<Prediction>, CalibrationError> {
    let mut predictions = Vec::with_capacity(observed.len());
    for (index, ((recording, model), view)) in observed.iter().zip(models).zip(views).enumerate() {
        let drives: Vec<f64> = recording.steps.iter().map(|s| s.drive_mm).collect();
        let near = near.and_then(|n| n.get(index)).map(|p| &p.states[..]);
        predictions.push(Prediction::new(model, view, &drives, material, near, solve, is_cancelled)?);
    }
    Ok(predictions)
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
    let mut score = DMatrix::zeros(n, n);
    for (target, prediction) in targets.iter().zip(&predictions) {
        target.add_score(prediction, &mut score)?;
    }
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
    let num_forces = observed.iter().flat_map(|o| &o.steps).filter(|s| s.force.is_some()).count();
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
