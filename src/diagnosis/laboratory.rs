//! The laboratory: what would be recorded of a scene, and how that changes with the scene (`changes`).

mod changes;

use super::error::DiagnosisError;
use super::memory_kernel::KernelState;
use super::scene::Scene;
use super::station::Stations;
use super::trace::Trace;
use crate::calibration::Observed;
use crate::fem::{Departures, Equilibrium, ForwardModel, Nesting, SolveError, SolveOptions};
use crate::material::Material;
use crate::mesh::{Mesh, MeshOptions, half_extents_mm, mesh_specimen};
use crate::specimen::TestKind;
use rayon::prelude::*;

/// Spacing of nodes on a bonded face against which a bond is loose, mm.
const BOND_LENGTH_MM: f64 = 0.5;

/// What would be recorded of a scene.
#[derive(Clone)]
pub struct Prediction {
    /// The recording.
    pub trace: Trace,
    /// One equilibrium per step.
    pub states: Vec<Equilibrium>,
    /// Voxel averages before the image's changes.
    pub(super) seen: Vec<Vec<[f64; 3]>>,
}

/// From where equilibria are looked for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Starts {
    /// From those found last, and where these lead to none from the step before, from rest and by parts.
    Any,
    /// From those found last alone, where there are any. A fit's trial that is too far from these costs a shorter step,
    /// which is cheaper than to ask from everywhere whether it has an equilibrium.
    FoundLast,
}

/// Predicts recordings of scenes.
pub struct Laboratory<'a> {
    observed: &'a Observed,
    stations: Stations<'a>,
    solve: SolveOptions,
    face_axis: usize,
    half_extents: [f64; 3],
    /// What a finer mesh predicts beyond ours; it is taken off what is measured.
    own_error: Option<Trace>,
    /// Equilibria solved so far.
    pub num_solves: usize,
}

impl<'a> Laboratory<'a> {
    /// For `observed`, on a mesh of the whole specimen with `mesh`'s element sizes.
    ///
    /// # Errors
    /// [`DiagnosisError`]: the specimen cannot be meshed, or cameras measured a face.
    pub fn new(observed: &'a Observed, mesh: &MeshOptions) -> Result<Laboratory<'a>, DiagnosisError> {
        observed.check_volume("a diagnosis")?;
        if !observed.specimen.is_driven_along_x() {
            return Err(DiagnosisError::DriveAngle { value_deg: observed.specimen.drive_angle_deg });
        }
        if !observed.specimen.block.taper().is_even() {
            return Err(DiagnosisError::Wedge { value_mm: observed.specimen.block.wedge_mm });
        }
        let options = MeshOptions { use_mirror: false, ..*mesh };
        let nominal = mesh_specimen(&observed.specimen, &options).map_err(crate::fem::PrepareError::from)?;
        Ok(Laboratory {
            observed,
            stations: Stations::new(observed, nominal, options),
            own_error: None,
            solve: SolveOptions::trial(),
            face_axis: match observed.specimen.test {
                TestKind::DoubleLapShear => 1,
                TestKind::Uniaxial => 0,
            },
            half_extents: half_extents_mm(&observed.specimen),
            num_solves: 0,
        })
    }

    /// The same for work beside it: what was prepared is shared, and what either finds the other does not see. Its
    /// count of equilibria begins anew.
    pub(super) fn twin(&self) -> Laboratory<'a> {
        let (stations, own_error) = (self.stations.twin(), self.own_error.clone());
        Laboratory { stations, own_error, num_solves: 0, ..*self }
    }

    /// The recording looked at.
    pub fn observed(&self) -> &'a Observed {
        self.observed
    }

    /// The recording as a trace.
    pub fn measured(&self) -> Trace {
        Trace {
            displacement: self.observed.steps.iter().map(|s| s.displacement.clone()).collect(),
            force: self.observed.steps.iter().map(|s| s.force.map_or(0.0, |f| f.value_n)).collect(),
        }
    }

    /// Displacement unknowns of the nominal model.
    pub fn num_unknowns(&mut self) -> Result<usize, DiagnosisError> {
        Ok(self.model_of(&Scene::default())?.num_unknowns())
    }

    /// What would be recorded of `scene` with `material`.
    ///
    /// # Errors
    /// [`DiagnosisError::Solve`] where a step has no equilibrium or the work was cancelled.
    pub fn predict(
        &mut self,
        material: &Material,
        scene: &Scene,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Prediction, DiagnosisError> {
        self.predict_from(material, scene, Starts::Any, is_cancelled)
    }

    /// As [`Self::predict`], from equilibria that `starts` says.
    ///
    /// # Errors
    /// As [`Self::predict`].
    pub(super) fn predict_from(
        &mut self,
        material: &Material,
        scene: &Scene,
        starts: Starts,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Prediction, DiagnosisError> {
        let at = self.stations.at(scene)?;
        // A cancellation is seen between the steps' equilibria, of which each takes a second at most.
        let warm = if is_cancelled() { Vec::new() } else { self.warm_states(at, material, scene) };
        let mut states: Vec<Equilibrium> = Vec::with_capacity(self.observed.steps.len());
        let mut warm = warm.into_iter();
        for (n, step) in self.observed.steps.iter().enumerate() {
            self.num_solves += 1;
            let state = match warm.next().flatten() {
                Some(Ok(state)) if !is_cancelled() => state,
                Some(Err(error)) if starts == Starts::FoundLast => return Err(error.into()),
                _ => {
                    let departures = self.departures(material, scene, n);
                    let mut model = self.stations[at].model.departed(&departures);
                    self.cold_state(&mut model, material, step.drive_mm, states.last(), is_cancelled)?
                }
            };
            states.push(state);
        }
        let view = &self.stations[at].view;
        let seen = states.par_iter().map(|s| view.average(&s.displacement)).collect::<Result<Vec<_>, _>>()?;
        self.stations[at].states = states.clone();
        let forces: Vec<f64> = states.iter().map(|s| s.force_n).collect();
        let mut trace = self.recorded(scene, at, &states, &forces, &seen)?;
        if let (Some(error), true) = (&self.own_error, scene.cut.is_some()) {
            // A sample with a cut has a finer mesh of its own, without that error.
            trace = trace.plus(-1.0, error);
        }
        Ok(Prediction { trace, states, seen })
    }

    /// The mesh of the specimen as drawn.
    pub(super) fn nominal_mesh(&self) -> &Mesh {
        self.stations.nominal()
    }

    /// The model of a scene.
    ///
    /// # Errors
    /// [`DiagnosisError`]: the scene's specimen cannot be modelled.
    pub(super) fn model_of(&mut self, scene: &Scene) -> Result<&ForwardModel, DiagnosisError> {
        let at = self.stations.at(scene)?;
        Ok(&self.stations[at].model)
    }

    /// Lets the next prediction of `scene` start from `states`, what `other`, in whose mesh ours lies as `nesting`
    /// says, predicts of it; `known` are equilibria of another scene there and here.
    ///
    /// # Errors
    /// [`DiagnosisError`]: the scene's specimen cannot be modelled.
    pub(super) fn start_from(
        &mut self,
        other: &ForwardModel,
        nesting: &Nesting,
        material: &Material,
        scene: &Scene,
        states: &[Equilibrium],
        known: Option<&[Vec<Equilibrium>; 2]>,
    ) -> Result<(), DiagnosisError> {
        let at = self.stations.at(scene)?;
        let ours = &self.stations[at].model;
        let start = |(n, state): (usize, &Equilibrium)| {
            let known = known.map(|[there, here]| [&there[n], &here[n]]);
            ours.start_from(other, nesting, material, state, known)
        };
        self.stations[at].states = states.par_iter().enumerate().map(start).collect();
        Ok(())
    }

    /// Says what a finer mesh predicts beyond ours of the sample as drawn. Where that is taken off what is measured,
    /// scenes whose mesh is another one are compared without it.
    pub(super) fn know_own_error(&mut self, error: Trace) {
        self.own_error = Some(error);
    }

    /// Equilibria from those that the station last found, steps side by side; `None` for a step that has none to start
    /// from.
    fn warm_states(
        &self,
        at: usize,
        material: &Material,
        scene: &Scene,
    ) -> Vec<Option<Result<Equilibrium, SolveError>>> {
        let station = &self.stations[at];
        let solved = |n: usize| {
            let near = station.states.get(n)?;
            let mut model = station.model.departed(&self.departures(material, scene, n));
            Some(model.solve(material, self.observed.steps[n].drive_mm, Some(near), &self.solve, &|| false))
        };
        (0..self.observed.steps.len()).into_par_iter().map(solved).collect()
    }

    /// An equilibrium from the last step's, or from rest; plates far out of place are brought there by parts.
    fn cold_state(
        &self,
        model: &mut ForwardModel,
        material: &Material,
        drive_mm: f64,
        last: Option<&Equilibrium>,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Equilibrium, DiagnosisError> {
        let moves_plates = model.departures().moves_plates();
        match model.solve(material, drive_mm, last, &self.solve, is_cancelled) {
            Ok(state) => Ok(state),
            Err(cause @ SolveError::Cancelled { .. }) => Err(cause.into()),
            Err(_) => match model.solve(material, drive_mm, None, &self.solve, is_cancelled) {
                Err(_) if moves_plates && !is_cancelled() => {
                    Ok(model.solve_by_parts(material, drive_mm, &self.solve, is_cancelled)?)
                }
                found => Ok(found?),
            },
        }
    }

    /// Forgets the equilibria found so far: the next prediction starts from rest.
    pub fn forget(&mut self) {
        self.stations.forget();
    }

    /// An elastic load curve of the scene: at each of `drives_mm` the force (N), its derivatives with respect to the
    /// material, and what its memory needs.
    ///
    /// # Errors
    /// As [`Self::predict`].
    pub fn load_curve(
        &mut self,
        material: &Material,
        scene: &Scene,
        drives_mm: &[f64],
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<(f64, Vec<f64>, KernelState)>, DiagnosisError> {
        let at = self.stations.at(scene)?;
        let mut last: Option<Equilibrium> = None;
        let mut table = Vec::with_capacity(drives_mm.len());
        for &drive in drives_mm {
            self.num_solves += 1;
            let (here, step) = scene.between_steps(drive, &self.observed.steps);
            let departures = here.departures(0, &step, bond_scale(material), self.face_axis);
            let mut model = self.stations[at].model.departed(&departures);
            let state = self.cold_state(&mut model, material, drive, last.as_ref(), is_cancelled)?;
            let mut tangent = model.tangent(material, &state)?;
            let sensitivities = tangent.material_sensitivities()?;
            let remembered = KernelState::of(&model, material, &state, &mut tangent)?;
            table.push((state.force_n, sensitivities.iter().map(|s| s.force_n).collect(), remembered));
            last = Some(state);
        }
        Ok(table)
    }

    /// The departures of a scene at a step.
    fn departures(&self, material: &Material, scene: &Scene, step: usize) -> Departures {
        scene.departures(step, &self.observed.steps[step], bond_scale(material), self.face_axis)
    }

    /// What the image makes of a change of the sample's displacement, voxel by voxel.
    fn shown(&self, scene: &Scene, mut change: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
        scene.image.turn_and_scale(&mut change);
        change
    }

    /// What the scan and the load cell make of equilibria.
    fn recorded(
        &self,
        scene: &Scene,
        at: usize,
        states: &[Equilibrium],
        forces: &[f64],
        seen: &[Vec<[f64; 3]>],
    ) -> Result<Trace, DiagnosisError> {
        let station = &self.stations[at];
        let mut trace = Trace::default();
        for (n, (state, seen)) in states.iter().zip(seen).enumerate() {
            // The view is made where the scene's image lies. A scene beside it, from which a derivative is taken, is
            // looked at to first order.
            let gradients = match scene.image.lies_off(station.pose()) {
                true => Some(station.view.gradients(&state.displacement)?),
                false => None,
            };
            let mask = &self.observed.mask;
            let field = scene.image.shown(n, seen, gradients.as_deref(), station.pose(), mask, self.half_extents);
            trace.displacement.push(field);
            let has_force = self.observed.steps[n].force.is_some();
            let force = forces[n] * (1.0 + scene.force_gain) + scene.force_offset_n;
            trace.force.push(if has_force { force } else { 0.0 });
        }
        Ok(trace)
    }
}

/// Stiffness (kPa/mm) of the sample under a node of its bond: shear modulus / node spacing.
fn bond_scale(material: &Material) -> f64 {
    let mu = material.initial_shear_modulus_kpa();
    mu.abs() / BOND_LENGTH_MM
}

#[cfg(test)]
#[path = "laboratory_tests.rs"]
mod tests;
