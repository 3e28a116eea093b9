//! Designs evaluated by finite elements.
//!
//! Search fidelity: coarse mesh ([`MeshOptions::search`]) and integrals over the quadrature points, smooth in the design
//! and differentiated exactly. Confirmation: standard mesh and sums over the scan's voxels.

use super::evaluator::{
    EvaluationFailure, Evaluator, Fidelity, MaterialState, Motion, Outcome, OutcomeWithRates, StateOutcome,
    material_states,
};
use super::fe_rates::{Differentiator, StateAt};
use super::study::{Normalisation, Study};
use crate::fem::{Equilibrium, ForwardModel, PrepareError, SolveError, SolveOptions};
use crate::mesh::{MeshOptions, shape_velocity};
use crate::sensitivity::{
    DriveSelection, DrivenState, EvaluationError, EvaluationOptions, FisherInformation, InformationError,
    IntegratedSensitivity, Scanner, evaluate_model, information_over_quadrature, integrate_over_quadrature,
    largest_principal_stretch,
};
use crate::specimen::Specimen;

/// Evaluates the designs of one study.
#[derive(Clone, Copy, Debug)]
pub struct FeEvaluator<'a> {
    study: &'a Study,
    search_size: Option<f64>,
    confirm_size: Option<f64>,
}

/// A [`Motion`] on a mesh: node velocities (`None`: the mesh stays) and the drive's rate.
struct Move {
    velocity: Option<Vec<[f64; 3]>>,
    drive_mm: f64,
}

type Cancel<'a> = &'a (dyn Fn() -> bool + Sync);
type Needs<'a> = &'a (dyn Fn(&Outcome) -> bool + Sync);

impl<'a> FeEvaluator<'a> {
    /// With search and standard meshes.
    pub fn new(study: &'a Study) -> Self {
        FeEvaluator { study, search_size: None, confirm_size: None }
    }

    /// With other element sizes, as factors on the standard one ([`MeshOptions::scaled`]).
    pub fn with_sizes(study: &'a Study, search: f64, confirm: f64) -> Self {
        FeEvaluator { study, search_size: Some(search), confirm_size: Some(confirm) }
    }

    /// Mesh on which a design is confirmed.
    pub fn confirm_mesh(&self, specimen: &Specimen) -> MeshOptions {
        self.confirm_size.map_or_else(|| MeshOptions::standard(specimen), |f| MeshOptions::scaled(specimen, f))
    }

    fn search_model(&self, specimen: &Specimen) -> Result<ForwardModel, EvaluationFailure> {
        let options =
            self.search_size.map_or_else(|| MeshOptions::search(specimen), |f| MeshOptions::scaled(specimen, f));
        ForwardModel::of_specimen(specimen, &options).map_err(of_preparing)
    }

    /// The form of 𝒮 that the study counts.
    fn chosen(&self, all: &[IntegratedSensitivity]) -> Vec<f64> {
        all.iter()
            .map(|s| match self.study.objective.normalisation {
                Normalisation::Sum => s.sum,
                Normalisation::MeanPerVoxel => s.mean_per_voxel,
                Normalisation::VolumeIntegral => s.volume_integral,
            })
            .collect()
    }

    fn voxel_volume(&self) -> f64 {
        self.study.scan.voxel_mm.iter().product()
    }

    fn search(
        &self,
        specimen: &Specimen,
        states: &[MaterialState],
        motions: &[Motion],
        needs_information: Needs,
        is_cancelled: Cancel,
    ) -> Result<OutcomeWithRates, EvaluationFailure> {
        let mut model = self.search_model(specimen)?;
        let moves: Vec<Move> =
            motions.iter().map(|m| Move { velocity: velocity(&model, specimen, m), drive_mm: m.drive_mm }).collect();
        self.search_on(&mut model, drive_of(specimen)?, states, &moves, needs_information, is_cancelled)
    }

    /// As [`Self::search`] on a model.
    fn search_on(
        &self,
        model: &mut ForwardModel,
        drive: f64,
        states: &[MaterialState],
        motions: &[Move],
        needs_information: Needs,
        is_cancelled: Cancel,
    ) -> Result<OutcomeWithRates, EvaluationFailure> {
        let mut outcome = Outcome::default();
        let mut solved = Vec::with_capacity(states.len());
        let mut last: Option<Equilibrium> = None;
        for state in states {
            let found = self.solve(model, state, drive, last.as_ref(), is_cancelled)?;
            let material = &state.values;
            let sensitivities = model.material_sensitivities(material, &found).map_err(of_solving)?;
            let points = model.quadrature_fields(material, &found);
            let information = information_over_quadrature(
                material,
                model.mesh(),
                &points,
                &sensitivities,
                &self.study.scan.noise(),
                self.voxel_volume(),
            )
            .map_err(of_information)?;
            let integrated = integrate_over_quadrature(material, &points, model.mesh().mirror, self.voxel_volume());
            outcome.states.push(StateOutcome {
                integrated: self.chosen(&integrated),
                information: rows(&information),
                force_n: found.force_n,
                largest_stretch: largest_principal_stretch(&points),
            });
            last = Some(found.clone());
            if !motions.is_empty() {
                solved.push((found, sensitivities, points, integrated));
            }
        }
        let mut rates: Vec<Vec<StateOutcome>> = motions.iter().map(|_| Vec::new()).collect();
        if motions.is_empty() {
            return Ok(OutcomeWithRates { outcome, rates });
        }
        let with_information = needs_information(&outcome);
        let differentiator = Differentiator::new(model.mesh());
        for (state, (found, sensitivities, points, integrated)) in states.iter().zip(&solved) {
            let material = &state.values;
            let sensitivities = if with_information { &sensitivities[..] } else { &[] };
            for (motion, rates) in motions.iter().zip(&mut rates) {
                if is_cancelled() {
                    return Err(EvaluationFailure::Cancelled);
                }
                let velocity = motion.velocity.as_deref();
                let path = model
                    .path_sensitivity(material, found, sensitivities, velocity, motion.drive_mm)
                    .map_err(of_solving)?;
                let mesh = model.mesh();
                let at = StateAt { study: self.study, material, mesh, points, sensitivities, integrated };
                rates.push(differentiator.rate(&at, velocity, &path));
            }
        }
        Ok(OutcomeWithRates { outcome, rates })
    }

    fn solve(
        &self,
        model: &mut ForwardModel,
        state: &MaterialState,
        drive: f64,
        start: Option<&Equilibrium>,
        is_cancelled: Cancel,
    ) -> Result<Equilibrium, EvaluationFailure> {
        let options = SolveOptions::default();
        if start.is_some()
            && let Ok(found) = model.solve(&state.values, drive, start, &options, &|| is_cancelled())
        {
            return Ok(found);
        }
        // From rest where another material's state is no good start.
        model.solve(&state.values, drive, None, &options, &|| is_cancelled()).map_err(of_solving)
    }

    fn confirm(&self, specimen: &Specimen, is_cancelled: Cancel) -> Result<Outcome, EvaluationFailure> {
        let drive = drive_of(specimen)?;
        let states = material_states(self.study, Fidelity::Confirm);
        let options =
            EvaluationOptions { mesh: self.confirm_mesh(specimen), ..EvaluationOptions::standard(specimen) };
        let mut model = ForwardModel::of_specimen(specimen, &options.mesh).map_err(of_preparing)?;
        let scan = &self.study.scan;
        let scanner = Scanner::new(specimen, model.mesh(), scan, options.sampling)
            .map_err(|e| EvaluationFailure::Observe { message: e.to_string() })?;
        let mut outcome = Outcome::default();
        let mut central: Option<(usize, Equilibrium)> = None;
        for state in &states {
            let is_central = central.as_ref().is_none_or(|(material, _)| *material != state.material);
            if is_central {
                let drives = DriveSelection::DriveMm(vec![drive]);
                let (evaluation, mut maps) =
                    evaluate_model(&mut model, specimen, &state.values, scan, &drives, &options, &|| is_cancelled())
                        .map_err(of_evaluating)?;
                let step = evaluation
                    .steps
                    .first()
                    .ok_or_else(|| EvaluationFailure::Observe { message: "no step was evaluated".into() })?;
                outcome.states.push(StateOutcome {
                    integrated: self.chosen(&step.integrated_sensitivity),
                    information: rows(&maps.information),
                    force_n: step.force_n,
                    largest_stretch: step.largest_principal_stretch,
                });
                outcome.evaluations.push(evaluation);
                central = maps.equilibria.pop().map(|e| (state.material, e));
                continue;
            }
            let start = central.as_ref().map(|(_, e)| e);
            let found = self.solve(&mut model, state, drive, start, is_cancelled)?;
            let sensitivities = model.material_sensitivities(&state.values, &found).map_err(of_solving)?;
            let stretch = largest_principal_stretch(&model.quadrature_fields(&state.values, &found));
            let driven = DrivenState {
                drive_mm: drive,
                force_n: found.force_n,
                displacement: &found.displacement,
                sensitivities: &sensitivities,
                largest_principal_stretch: stretch,
            };
            let seen = scanner
                .observe(&state.values, &driven, options.identifiability_limit)
                .map_err(of_evaluating)?;
            outcome.states.push(StateOutcome {
                integrated: self.chosen(&seen.step.integrated_sensitivity),
                information: rows(&seen.information),
                force_n: found.force_n,
                largest_stretch: stretch,
            });
        }
        Ok(outcome)
    }
}

impl Evaluator for FeEvaluator<'_> {
    fn evaluate(
        &self,
        specimen: &Specimen,
        fidelity: Fidelity,
        is_cancelled: Cancel,
    ) -> Result<Outcome, EvaluationFailure> {
        if fidelity == Fidelity::Confirm {
            return self.confirm(specimen, is_cancelled);
        }
        let states = material_states(self.study, fidelity);
        Ok(self.search(specimen, &states, &[], &|_| false, is_cancelled)?.outcome)
    }

    fn evaluate_with_rates(
        &self,
        specimen: &Specimen,
        motions: &[Motion],
        needs_information: Needs,
        is_cancelled: Cancel,
    ) -> Result<OutcomeWithRates, EvaluationFailure> {
        let states = material_states(self.study, Fidelity::Search);
        self.search(specimen, &states, motions, needs_information, is_cancelled)
    }
}

/// Node velocities of a motion; `None` where the mesh stays.
fn velocity(model: &ForwardModel, specimen: &Specimen, motion: &Motion) -> Option<Vec<[f64; 3]>> {
    let mut sum: Option<Vec<[f64; 3]>> = None;
    for (variable, rate) in &motion.shape {
        let one = shape_velocity(model.mesh(), specimen, *variable);
        let sum = sum.get_or_insert_with(|| vec![[0.0; 3]; one.len()]);
        for (s, v) in sum.iter_mut().zip(&one) {
            for c in 0..3 {
                s[c] += rate * v[c];
            }
        }
    }
    sum
}

fn drive_of(specimen: &Specimen) -> Result<f64, EvaluationFailure> {
    match specimen.drive_mm.last() {
        Some(drive) => Ok(*drive),
        None => Err(EvaluationFailure::Solve { message: "the specimen has no drive".into() }),
    }
}

fn rows(information: &FisherInformation) -> Vec<f64> {
    let matrix = information.matrix();
    (0..matrix.nrows()).flat_map(|i| (0..matrix.ncols()).map(move |j| matrix[(i, j)])).collect()
}

fn of_preparing(error: PrepareError) -> EvaluationFailure {
    match error {
        PrepareError::Mesh(e) => EvaluationFailure::Mesh { message: e.to_string() },
        PrepareError::Solve(e) => of_solving(e),
    }
}

fn of_solving(error: SolveError) -> EvaluationFailure {
    match error {
        SolveError::Cancelled { .. } => EvaluationFailure::Cancelled,
        other => EvaluationFailure::Solve { message: other.to_string() },
    }
}

fn of_information(error: InformationError) -> EvaluationFailure {
    EvaluationFailure::Observe { message: error.to_string() }
}

fn of_evaluating(error: EvaluationError) -> EvaluationFailure {
    match error {
        EvaluationError::Solve(e) => of_solving(e),
        EvaluationError::Mesh(e) => EvaluationFailure::Mesh { message: e.to_string() },
        other => EvaluationFailure::Observe { message: other.to_string() },
    }
}

#[cfg(test)]
#[path = "fe_tests.rs"]
mod tests;
