//! The laboratory: what would be recorded of a scene, and how that changes with the scene.

use super::error::DiagnosisError;
use super::memory_kernel::KernelState;
use super::scene::Scene;
use super::station::Stations;
use super::supposed::Path;
use super::trace::Trace;
use crate::calibration::Observed;
use crate::fem::{Change, Departures, Equilibrium, ForwardModel, Nesting, SolveError, SolveOptions, Tangent};
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

/// Changes of the voxel averages (mm) and of the force (N), before the image and the load cell.
type SeenChange = (Vec<[f64; 3]>, f64);

/// A step at which changes are looked at.
struct OfStep<'a> {
    /// The station.
    at: usize,
    /// The step's number.
    n: usize,
    /// Half the difference of t over which departures are differenced.
    step: f64,
    /// The gradient of the displacement at every voxel; empty where no path moves nodes.
    gradients: &'a [[[f64; 3]; 3]],
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
        let options = MeshOptions { use_mirror: false, ..*mesh };
        let nominal = mesh_specimen(&observed.specimen, &options).map_err(crate::fem::PrepareError::from)?;
        Ok(Laboratory {
            observed,
            stations: Stations::new(observed, nominal, options),
            own_error: None,
            solve: SolveOptions::default(),
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
        let at = self.stations.at(scene)?;
        // A cancellation is seen between the steps' equilibria, of which each takes a second at most.
        let warm = if is_cancelled() { Vec::new() } else { self.warm_states(at, material, scene) };
        let mut states: Vec<Equilibrium> = Vec::with_capacity(self.observed.steps.len());
        let mut warm = warm.into_iter();
        for (n, step) in self.observed.steps.iter().enumerate() {
            self.num_solves += 1;
            let state = match warm.next().flatten().filter(|_| !is_cancelled()) {
                Some(state) => state,
                None => {
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
    /// from or finds none from there.
    fn warm_states(&self, at: usize, material: &Material, scene: &Scene) -> Vec<Option<Equilibrium>> {
        let station = &self.stations[at];
        let solved = |n: usize| {
            let near = station.states.get(n)?;
            let mut model = station.model.departed(&self.departures(material, scene, n));
            model.solve(material, self.observed.steps[n].drive_mm, Some(near), &self.solve, &|| false).ok()
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

    /// Derivatives of `prediction`, which is that of `material` and `scene`: first with respect to every material
    /// parameter (in the order of [`Material::parameters`]), then along each path t ↦ path(t) at t = 0. path(0) must be
    /// `scene`. What is cheap is differenced over ±`step`: the residual of the equilibrium, the image and the load
    /// cell. Changes of holes and faces use the exact derivative of the mesh's nodes instead.
    ///
    /// # Errors
    /// [`DiagnosisError::Solve`].
    pub fn derivatives(
        &mut self,
        material: &Material,
        scene: &Scene,
        prediction: &Prediction,
        with_material: bool,
        paths: &[&Path],
        step: f64,
    ) -> Result<Vec<Trace>, DiagnosisError> {
        let at = self.stations.at(scene)?;
        let num_parameters = if with_material { material.parameters().len() } else { 0 };
        let mut of_material = vec![Trace::default(); num_parameters];
        let ends: Vec<[Scene; 2]> = paths.iter().map(|path| [(path.to)(step), (path.to)(-step)]).collect();
        let velocities: Vec<Option<Vec<[f64; 3]>>> =
            ends.iter().map(|e| self.stations.node_velocity(at, e, step)).collect();
        // Per path: change of the voxel averages and of the force, before the image and the load cell.
        let mut changes = vec![Trace::default(); paths.len()];
        let numbers: Vec<usize> = (0..prediction.states.len()).collect();
        // As many factors as threads are held at once.
        for group in numbers.chunks(rayon::current_num_threads().max(1)) {
            let tangents = self.tangents(at, material, scene, prediction, with_material, group)?;
            // What moves with the nodes is seen against the gradient of the displacement, alike for all paths.
            let moves_nodes = velocities.iter().any(Option::is_some);
            let gradients: Vec<Vec<[[f64; 3]; 3]>> = if moves_nodes {
                let view = &self.stations[at].view;
                let of_step = |&n: &usize| view.gradients(&prediction.states[n].displacement);
                group.par_iter().map(of_step).collect::<Result<_, _>>()?
            } else {
                Vec::new()
            };
            // Paths that are differentiated together share the work on the state; threads share the paths.
            let indices: Vec<usize> = (0..paths.len()).collect();
            let size = paths.len().div_ceil(2 * rayon::current_num_threads()).max(1);
            let tasks: Vec<(usize, &[usize])> =
                (0..group.len()).flat_map(|k| indices.chunks(size).map(move |some| (k, some))).collect();
            let found = tasks
                .par_iter()
                .map(|&(k, some)| {
                    let tangent = tangents[k].0.shared();
                    let of_step = OfStep { at, n: group[k], step, gradients: gradients.get(k).map_or(&[][..], |g| g) };
                    let of_path = |&index: &usize| (paths[index], velocities[index].as_deref());
                    self.changes_along(tangent, material, &of_step, &some.iter().map(of_path).collect::<Vec<_>>())
                })
                .collect::<Result<Vec<_>, DiagnosisError>>()?;
            for (&(_, some), found) in tasks.iter().zip(found) {
                for (&index, (field, force)) in some.iter().zip(found) {
                    changes[index].displacement.push(field);
                    changes[index].force.push(force);
                }
            }
            for ((_, sensitivities), &n) in tangents.into_iter().zip(group) {
                let has_force = self.observed.steps[n].force.is_some();
                for ((field, force), trace) in sensitivities.into_iter().zip(&mut of_material) {
                    trace.displacement.push(self.shown(scene, field));
                    trace.force.push(if has_force { force * (1.0 + scene.force_gain) } else { 0.0 });
                }
            }
        }
        let recorded: Vec<Trace> = changes
            .par_iter()
            .zip(&ends)
            .map(|(change, ends)| self.recorded_change(at, prediction, change, ends, step))
            .collect::<Result<_, _>>()?;
        of_material.extend(recorded);
        Ok(of_material)
    }

    /// The tangents of some steps, with the voxel averages and forces of the material's sensitivities.
    fn tangents<'t>(
        &self,
        at: usize,
        material: &'t Material,
        scene: &Scene,
        prediction: &'t Prediction,
        with_material: bool,
        steps: &[usize],
    ) -> Result<Vec<(Tangent<'t>, Vec<SeenChange>)>, DiagnosisError> {
        let station = &self.stations[at];
        steps
            .par_iter()
            .map(|&n| {
                let departures = self.departures(material, scene, n);
                let mut tangent = station.model.departed(&departures).tangent(material, &prediction.states[n])?;
                let mut seen = Vec::new();
                if with_material {
                    for s in tangent.material_sensitivities()? {
                        seen.push((station.view.average(&s.displacement)?, s.force_n));
                    }
                }
                Ok((tangent, seen))
            })
            .collect()
    }

    /// Changes of the voxel averages and of the force along some paths, each with the velocity of the nodes where it
    /// moves them.
    fn changes_along(
        &self,
        mut tangent: Tangent,
        material: &Material,
        of_step: &OfStep,
        paths: &[(&Path, Option<&[[f64; 3]]>)],
    ) -> Result<Vec<SeenChange>, DiagnosisError> {
        let &OfStep { at, n, step, gradients } = of_step;
        let change_of = |&(path, velocity): &(&Path, Option<&[[f64; 3]]>)| -> Option<Change> {
            if velocity.is_some() {
                return Some(tangent.change_of_nodes(velocity, 0.0));
            }
            if !path.changes_sample || path.only_step.is_some_and(|only| only != n) {
                return None;
            }
            let departures = |t: f64| self.departures(material, &(path.to)(t), n);
            Some(match path.moves_only_plates {
                true => tangent.change_of_plates(&departures, step),
                false => tangent.change_of_departures(&departures, step),
            })
        };
        let changes: Vec<Option<Change>> = paths.iter().map(change_of).collect();
        let is_still: Vec<bool> = changes.iter().map(Option::is_none).collect();
        let changes: Vec<Change> = changes.into_iter().flatten().collect();
        let mut found = tangent.sensitivities(&changes)?.into_iter();
        let view = &self.stations[at].view;
        let mut all = Vec::with_capacity(paths.len());
        for (&(_, velocity), is_still) in paths.iter().zip(is_still) {
            let Some(s) = (if is_still { None } else { found.next() }) else {
                all.push((vec![[0.0; 3]; self.observed.mask.voxels.len()], 0.0));
                continue;
            };
            let mut field = view.average(&s.displacement)?;
            if let Some(velocity) = velocity {
                // The derivative follows the nodes; the scan's voxels stay: u′ − ∇u V.
                for ((u, v), g) in field.iter_mut().zip(&view.average(velocity)?).zip(gradients) {
                    for i in 0..3 {
                        u[i] -= (0..3).map(|j| g[i][j] * v[j]).sum::<f64>();
                    }
                }
            }
            all.push((field, s.force_n));
        }
        Ok(all)
    }

    /// What the image and the load cell make of a change of the sample, and their own change: a difference of both.
    fn recorded_change(
        &self,
        at: usize,
        prediction: &Prediction,
        change: &Trace,
        ends: &[Scene; 2],
        step: f64,
    ) -> Result<Trace, DiagnosisError> {
        let [ahead, behind] = ends;
        if ahead.image.is_as(&behind.image) && self.stations[at].pose() == &ahead.image.pose {
            // Only the sample changes: the image turns and scales that.
            let displacement = change.displacement.iter().map(|field| self.shown(ahead, field.clone())).collect();
            let (gain, offset) =
                (1.0 + 0.5 * (ahead.force_gain + behind.force_gain), ahead.force_offset_n - behind.force_offset_n);
            let (d_gain, d_offset) = ((ahead.force_gain - behind.force_gain) / (2.0 * step), offset / (2.0 * step));
            let force = |(n, f): (usize, &f64)| match self.observed.steps[n].force {
                Some(_) => f * gain + prediction.states[n].force_n * d_gain + d_offset,
                None => 0.0,
            };
            return Ok(Trace { displacement, force: change.force.iter().enumerate().map(force).collect() });
        }
        let mut recorded = Vec::with_capacity(2);
        for (scene, sign) in ends.iter().zip([1.0, -1.0]) {
            let seen: Vec<Vec<[f64; 3]>> = prediction
                .seen
                .iter()
                .zip(&change.displacement)
                .map(|(u, r)| u.iter().zip(r).map(|(u, r)| [0, 1, 2].map(|i| u[i] + sign * step * r[i])).collect())
                .collect();
            let forces: Vec<f64> =
                prediction.states.iter().zip(&change.force).map(|(s, f)| s.force_n + sign * step * f).collect();
            recorded.push(self.recorded(scene, at, &prediction.states, &forces, &seen)?);
        }
        Ok(recorded[0].plus(-1.0, &recorded[1]).scaled(0.5 / step))
    }

    /// Changes of `prediction`, which is that of `material` and `scene`, as unit compliances (mm/kPa) of parts of a
    /// bonded face move the sample against the plate: `part_of`(position) says to which of `num_parts` a node belongs.
    ///
    /// # Errors
    /// [`DiagnosisError::Solve`].
    pub fn bond_derivatives(
        &mut self,
        material: &Material,
        scene: &Scene,
        prediction: &Prediction,
        is_moved_face: bool,
        num_parts: usize,
        part_of: &(dyn Fn([f64; 3]) -> usize + Sync),
    ) -> Result<Vec<Trace>, DiagnosisError> {
        let at = self.stations.at(scene)?;
        let mut all = vec![Trace::default(); num_parts];
        for (n, state) in prediction.states.iter().enumerate() {
            let departures = self.departures(material, scene, n);
            let station = &self.stations[at];
            let mut model = station.model.departed(&departures);
            let tractions = model.plate_tractions(material, state)?;
            let tangent = model.tangent(material, state)?;
            let mesh = model.mesh();
            let face = if is_moved_face { &mesh.moved_nodes } else { &mesh.fixed_nodes };
            let parts: Vec<(u32, usize)> = face.iter().map(|&v| (v, part_of(mesh.nodes[v as usize]))).collect();
            let has_force = self.observed.steps[n].force.is_some();
            let size = num_parts.div_ceil(2 * rayon::current_num_threads()).max(1);
            all.par_chunks_mut(size).enumerate().try_for_each(|(chunk, traces)| -> Result<(), DiagnosisError> {
                let mut tangent = tangent.shared();
                let change_of = |part: usize| {
                    let mut rate = vec![[0.0; 3]; tractions.len()];
                    for (v, _) in parts.iter().filter(|(_, p)| *p == part) {
                        // The sample lags behind what pulls it.
                        rate[*v as usize] = tractions[*v as usize].map(|t| -t);
                    }
                    tangent.change_of_held_nodes(&rate)
                };
                let changes: Vec<Change> = (0..traces.len()).map(|i| change_of(chunk * size + i)).collect();
                for (s, trace) in tangent.sensitivities(&changes)?.into_iter().zip(traces) {
                    trace.displacement.push(self.shown(scene, station.view.average(&s.displacement)?));
                    trace.force.push(if has_force { s.force_n * (1.0 + scene.force_gain) } else { 0.0 });
                }
                Ok(())
            })?;
        }
        Ok(all)
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
