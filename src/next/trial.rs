//! A specimen tried at several drives with one of the materials that the posterior leaves possible.

use super::error::NextError;
use super::options::Plan;
use super::posterior::{Posterior, typical};
use super::scanned::{ForceRead, ScannedStep};
use crate::design::tearing_stretch;
use crate::fem::{Equilibrium, ForwardModel, SolveOptions};
use crate::kinematics::{decompose, principal_stretches};
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::sensitivity::{EvaluationError, Scanner, unknowns_of};
use crate::specimen::{LimitMargin, Specimen, TestResponse, farthest_from_zero};
use crate::voxel::Sampling;

/// A drive of a trial.
#[derive(Debug)]
pub(super) struct TrialStep {
    /// The drive, mm.
    pub(super) drive_mm: f64,
    /// Its force, N.
    pub(super) force_n: f64,
    /// The study's limits.
    pub(super) limits: Vec<LimitMargin>,
    /// What its scan tells.
    pub(super) scanned: ScannedStep,
}

/// A specimen at several drives with one material.
#[derive(Debug, Default)]
pub(super) struct Trial {
    /// Drives that may be scanned, increasing.
    pub(super) steps: Vec<TrialStep>,
    /// Drives at which the force alone is read.
    pub(super) readings: Vec<(f64, ForceRead)>,
    /// The drive from which on there is no equilibrium, and why.
    pub(super) failure: Option<(f64, String)>,
}

/// A specimen ready to be tried.
pub(super) struct Bench {
    model: ForwardModel,
    has_plates: bool,
    scanner: Scanner,
}

impl Bench {
    /// Meshes `specimen`.
    ///
    /// # Errors
    /// [`NextError`] where it cannot be meshed or has no voxel.
    pub(super) fn new(specimen: &Specimen, plan: &Plan, mesh_factor: f64) -> Result<Bench, NextError> {
        plan.study.protocol.suits(specimen, 1).map_err(EvaluationError::from)?;
        let model = ForwardModel::of_specimen(specimen, &MeshOptions::scaled(specimen, mesh_factor))?;
        let scanner = Scanner::new(specimen, model.mesh(), &plan.study.scan, Sampling::default())?;
        Ok(Bench { model, has_plates: specimen.has_plates(), scanner })
    }

    /// Tries `material` at `scanned_mm` and at the study's force readings on the way to the last of them.
    ///
    /// # Errors
    /// [`NextError`] where it was cancelled. A drive without an equilibrium is none.
    pub(super) fn trial(
        &mut self,
        scanned_mm: &[f64],
        material: &Material,
        plan: &Plan,
        posterior: &Posterior,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Trial, NextError> {
        let largest = farthest_from_zero(scanned_mm.iter().copied());
        let forces_mm = plan.study.protocol.on_the_way_to(largest).force_drives_mm();
        let mut drives: Vec<(f64, bool)> =
            scanned_mm.iter().map(|d| (*d, true)).chain(forces_mm.iter().map(|d| (*d, false))).collect();
        drives.sort_by(|a, b| a.0.abs().total_cmp(&b.0.abs()).then(b.1.cmp(&a.1)));
        let (mut trial, mut last) = (Trial::default(), None);
        for (drive_mm, is_scanned) in drives {
            let found = self.model.solve(material, drive_mm, last.as_ref(), &SolveOptions::trial(), is_cancelled);
            let state = match found {
                Ok(state) => state,
                Err(error) if is_cancelled() => return Err(error.into()),
                Err(error) => {
                    trial.failure = Some((drive_mm, error.to_string()));
                    break;
                }
            };
            let (scanned, force) = self.seen(material, &state, plan, posterior)?;
            if is_scanned {
                trial.steps.push(self.step(material, &state, plan, ScannedStep { force: Some(force), ..scanned }));
            } else {
                trial.readings.push((drive_mm, force));
            }
            last = Some(state);
        }
        Ok(trial)
    }

    /// What a scan of an equilibrium tells, and its force.
    fn seen(
        &mut self,
        material: &Material,
        state: &Equilibrium,
        plan: &Plan,
        posterior: &Posterior,
    ) -> Result<(ScannedStep, ForceRead), NextError> {
        let (study, scan) = (plan.study, &plan.study.scan);
        let operator = &self.scanner.operator;
        let gradients = operator.deformation_gradients(&state.displacement)?;
        let beyond: Vec<f64> = gradients.iter().map(|f| posterior.visited.beyond(&decompose(f))).collect();
        let mut tangent = self.model.tangent(material, state)?;
        let sensitivities = tangent.material_sensitivities()?;
        let unknowns = unknowns_of(&study.protocol, state, &mut tangent)?;
        let force = ForceRead {
            force_n: state.force_n,
            by_parameter: sensitivities.iter().map(|s| s.force_n).collect(),
            by_unknown: unknowns.iter().map(|u| u.force_n).collect(),
            sd_n: scan.force_sd_n,
            beyond: typical(&beyond),
        };
        let by_parameter =
            sensitivities.iter().map(|s| operator.average(&s.displacement)).collect::<Result<Vec<_>, _>>()?;
        let by_unknown = unknowns
            .iter()
            .map(|u| u.displacement.as_ref().map(|d| operator.average(d)).transpose())
            .collect::<Result<Vec<_>, _>>()?;
        let scanned = ScannedStep {
            by_parameter,
            by_unknown,
            weights: self.scanner.weights().to_vec(),
            signal: self.scanner.signal_left(&operator.average(&state.displacement)?, &gradients),
            beyond,
            // Equal blocks scanned together are as many scans of one.
            noise_mm2: scan.noise_sd_mm.map(|sd| sd * sd / f64::from(study.protocol.blocks_scanned)),
            voxel_mm3: self.scanner.mask.grid.voxel_volume_mm3(),
            force: None,
        };
        Ok((scanned, force))
    }

    /// A scanned drive with the study's limits.
    fn step(&self, material: &Material, state: &Equilibrium, plan: &Plan, scanned: ScannedStep) -> TrialStep {
        let points = self.model.quadrature_fields(material, state);
        let stretches = points.iter().map(|q| (principal_stretches(&q.deformation_gradient)[0], q.volume_mm3));
        let (drive_mm, force_n) = (state.drive_mm, state.force_n);
        let normal_force_n = self.has_plates.then_some(state.normal_force_n);
        let response = TestResponse { drive_mm, force_n, normal_force_n, local_stretch: tearing_stretch(stretches) };
        TrialStep { drive_mm, force_n, limits: plan.study.limits.check_response(&response), scanned }
    }
}
