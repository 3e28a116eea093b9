//! The laboratory: what would be recorded of a scene, and how that changes with the scene.

use super::error::DiagnosisError;
use super::memory_kernel::KernelState;
use super::scene::Scene;
use super::trace::Trace;
use crate::calibration::{Observed, View};
use crate::fem::{Equilibrium, ForwardModel, SolveError, SolveOptions};
use crate::material::{Ogden, Parameter};
use crate::mesh::{DesignVariable, Mesh, MeshOptions, mesh_specimen, morphed, shape_velocity};
use crate::specimen::TestKind;

/// Most prepared models kept: one nominal, some with released faces or other holes.
const MAX_STATIONS: usize = 4;
/// Spacing of nodes on a bonded face against which a bond is loose, mm.
const BOND_LENGTH_MM: f64 = 0.5;

/// A prepared model: one mesh, one set of released faces.
struct Station {
    holes: Vec<[f64; 3]>,
    releases: [bool; 2],
    model: ForwardModel,
    /// Of the voxels moved by `shift_mm`.
    view: View,
    shift_mm: [f64; 3],
    /// The last equilibria, from which the next start.
    states: Vec<Equilibrium>,
}

/// What would be recorded of a scene.
#[derive(Clone)]
pub struct Prediction {
    /// The recording.
    pub trace: Trace,
    /// One equilibrium per step.
    pub states: Vec<Equilibrium>,
    /// Voxel averages before the image's changes.
    seen: Vec<Vec<[f64; 3]>>,
}

/// Predicts recordings of scenes.
pub struct Laboratory<'a> {
    observed: &'a Observed,
    nominal: Mesh,
    stations: Vec<Station>,
    solve: SolveOptions,
    face_axis: usize,
    half_extents: [f64; 3],
    /// Equilibria solved so far.
    pub num_solves: usize,
}

impl<'a> Laboratory<'a> {
    /// For `observed`, on a mesh of the whole specimen with `mesh`'s element sizes.
    ///
    /// # Errors
    /// [`DiagnosisError`]: the specimen cannot be meshed.
    pub fn new(observed: &'a Observed, mesh: &MeshOptions) -> Result<Laboratory<'a>, DiagnosisError> {
        let options = MeshOptions { use_mirror: false, ..*mesh };
        let nominal = mesh_specimen(&observed.specimen, &options).map_err(crate::fem::PrepareError::from)?;
        let b = observed.specimen.block;
        Ok(Laboratory {
            observed,
            nominal,
            stations: Vec::new(),
            solve: SolveOptions::default(),
            face_axis: match observed.specimen.test {
                TestKind::DoubleLapShear => 1,
                TestKind::Uniaxial => 0,
            },
            half_extents: [0.5 * b.length_mm, 0.5 * b.thickness_mm, 0.5 * b.width_mm],
            num_solves: 0,
        })
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
        let station = self.station(&Scene::default())?;
        Ok(self.stations[station].model.num_unknowns())
    }

    /// What would be recorded of `scene` with `material`.
    ///
    /// # Errors
    /// [`DiagnosisError::Solve`] where a step has no equilibrium or the work was cancelled.
    pub fn predict(
        &mut self,
        material: &Ogden,
        scene: &Scene,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Prediction, DiagnosisError> {
        let at = self.station(scene)?;
        let mut states: Vec<Equilibrium> = Vec::with_capacity(self.observed.steps.len());
        let mut seen = Vec::with_capacity(states.capacity());
        for (n, step) in self.observed.steps.iter().enumerate() {
            let departures = self.departures(material, scene, n);
            let station = &self.stations[at];
            let mut model = station.model.departed(&departures);
            self.num_solves += 1;
            let near = station.states.get(n);
            let warm = near.map(|s| model.solve(material, step.drive_mm, Some(s), &self.solve, is_cancelled));
            let state = match warm {
                Some(Ok(state)) => state,
                Some(Err(cause @ SolveError::Cancelled { .. })) => return Err(cause.into()),
                _ => {
                    let last = states.last();
                    let cold = model.solve(material, step.drive_mm, last, &self.solve, is_cancelled);
                    match cold {
                        Ok(state) => state,
                        Err(cause @ SolveError::Cancelled { .. }) => return Err(cause.into()),
                        // From rest; plates far out of place are brought there by parts.
                        Err(_) => match model.solve(material, step.drive_mm, None, &self.solve, is_cancelled) {
                            Err(_) if departures.moves_plates() && !is_cancelled() => {
                                model.solve_by_parts(material, step.drive_mm, &self.solve, is_cancelled)?
                            }
                            found => found?,
                        },
                    }
                }
            };
            seen.push(station.view.average(&state.displacement)?);
            states.push(state);
        }
        self.stations[at].states = states.clone();
        let forces: Vec<f64> = states.iter().map(|s| s.force_n).collect();
        let trace = self.recorded(scene, at, &states, &forces, &seen)?;
        Ok(Prediction { trace, states, seen })
    }

    /// Forgets the equilibria found so far: the next prediction starts from rest.
    pub fn forget(&mut self) {
        for station in &mut self.stations {
            station.states.clear();
        }
    }

    /// An elastic load curve of the scene: at each of `drives_mm` the force (N), its derivatives with respect to the
    /// material, and what its memory needs.
    ///
    /// # Errors
    /// As [`Self::predict`].
    pub fn load_curve(
        &mut self,
        material: &Ogden,
        scene: &Scene,
        drives_mm: &[f64],
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Vec<(f64, Vec<f64>, KernelState)>, DiagnosisError> {
        let at = self.station(scene)?;
        let departures = self.departures(material, scene, 0);
        let mut model = self.stations[at].model.departed(&departures);
        let mut last: Option<Equilibrium> = None;
        let mut table = Vec::with_capacity(drives_mm.len());
        for &drive in drives_mm {
            self.num_solves += 1;
            let state = model.solve(material, drive, last.as_ref(), &self.solve, is_cancelled)?;
            let mut tangent = model.tangent(material, &state)?;
            let sensitivities = tangent.material_sensitivities()?;
            let remembered = KernelState::of(&model, material, &state, &mut tangent)?;
            table.push((state.force_n, sensitivities.iter().map(|s| s.force_n).collect(), remembered));
            last = Some(state);
        }
        Ok(table)
    }

    /// Derivatives of `prediction`, which is that of `material` and `scene`: first with respect to every material
    /// parameter (in the order of [`Ogden::parameters`]), then along each path t ↦ path(t) at t = 0. path(0) must be
    /// `scene`, and the flag of a path says whether it changes the sample. What is cheap is differenced over ±`step`:
    /// the residual of the equilibrium, the image and the load cell. Changes of holes use the exact derivative of the
    /// mesh's nodes instead.
    ///
    /// # Errors
    /// [`DiagnosisError::Solve`].
    pub fn derivatives(
        &mut self,
        material: &Ogden,
        scene: &Scene,
        prediction: &Prediction,
        with_material: bool,
        paths: &[(&dyn Fn(f64) -> Scene, bool)],
        step: f64,
    ) -> Result<Vec<Trace>, DiagnosisError> {
        let at = self.station(scene)?;
        let parameters: Vec<Parameter> = if with_material { material.parameters() } else { Vec::new() };
        let mut of_material = vec![Trace::default(); parameters.len()];
        let ends: Vec<[Scene; 2]> = paths.iter().map(|(path, _)| [path(step), path(-step)]).collect();
        let velocities: Vec<Option<Vec<[f64; 3]>>> = ends.iter().map(|e| self.hole_velocity(e, step)).collect();
        // Per path: change of the voxel averages and of the force, before the image and the load cell.
        let mut changes = vec![Trace::default(); paths.len()];
        for (n, state) in prediction.states.iter().enumerate() {
            let now = self.departures(material, scene, n);
            let (face_axis, scale) = (self.face_axis, bond_scale(material));
            let measured = self.observed.steps[n].force.map_or(0.0, |f| f.value_n);
            let has_force = self.observed.steps[n].force.is_some();
            let station = &self.stations[at];
            let mut tangent = station.model.departed(&now).tangent(material, state)?;
            if with_material {
                for (s, trace) in tangent.material_sensitivities()?.iter().zip(&mut of_material) {
                    let mut field = station.view.average(&s.displacement)?;
                    for u in &mut field {
                        for c in 0..3 {
                            u[c] *= 1.0 + scene.image.gain[c];
                        }
                    }
                    trace.displacement.push(field);
                    trace.force.push(if has_force { s.force_n * (1.0 + scene.force_gain) } else { 0.0 });
                }
            }
            for (index, (path, changes_sample)) in paths.iter().enumerate() {
                let (field, force) = match &velocities[index] {
                    Some(velocity) => {
                        let s = tangent.path_sensitivity(&[], Some(velocity), 0.0)?;
                        // The derivative follows the nodes; the scan's voxels stay: u′ − ∇u V.
                        let mut field = station.view.average(&s.displacement)?;
                        let (moved, gradients) =
                            (station.view.average(velocity)?, station.view.gradients(&state.displacement)?);
                        for ((u, v), g) in field.iter_mut().zip(&moved).zip(&gradients) {
                            for i in 0..3 {
                                u[i] -= (0..3).map(|j| g[i][j] * v[j]).sum::<f64>();
                            }
                        }
                        (field, s.force_n)
                    }
                    None if *changes_sample => {
                        let at_t = |t: f64| path(t).departures(measured, scale, face_axis);
                        let s = tangent.departure_sensitivity(&at_t, step)?;
                        (station.view.average(&s.displacement)?, s.force_n)
                    }
                    None => (vec![[0.0; 3]; prediction.seen[n].len()], 0.0),
                };
                changes[index].displacement.push(field);
                changes[index].force.push(force);
            }
        }
        let mut all = of_material;
        for (change, ends) in changes.iter().zip(&ends) {
            all.push(self.recorded_change(at, prediction, change, ends, step)?);
        }
        Ok(all)
    }

    /// Velocity of the nodes as holes change, if they do.
    fn hole_velocity(&self, [ahead, behind]: &[Scene; 2], step: f64) -> Option<Vec<[f64; 3]>> {
        let mut velocity: Option<Vec<[f64; 3]>> = None;
        for (hole, (a, b)) in ahead.holes.iter().zip(&behind.holes).enumerate() {
            let rate = [0, 1, 2].map(|i| (a[i] - b[i]) / (2.0 * step));
            for (r, variable) in rate.into_iter().zip(hole_variables(hole)) {
                if r.abs() > 0.0 {
                    let v = shape_velocity(&self.nominal, &self.observed.specimen, variable);
                    let sum = velocity.get_or_insert_with(|| vec![[0.0; 3]; v.len()]);
                    for (s, v) in sum.iter_mut().zip(&v) {
                        for i in 0..3 {
                            s[i] += r * v[i];
                        }
                    }
                }
            }
        }
        velocity
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

    /// Changes of `prediction` (the nominal scene's) as unit compliances (mm/kPa) of parts of a bonded face move the
    /// sample against the plate: `part_of`(position) says to which of `num_parts` a node belongs.
    ///
    /// # Errors
    /// [`DiagnosisError::Solve`].
    pub fn bond_derivatives(
        &mut self,
        material: &Ogden,
        prediction: &Prediction,
        is_moved_face: bool,
        num_parts: usize,
        part_of: &dyn Fn([f64; 3]) -> usize,
    ) -> Result<Vec<Trace>, DiagnosisError> {
        let scene = Scene::default();
        let at = self.station(&scene)?;
        let mut all = vec![Trace::default(); num_parts];
        for (n, state) in prediction.states.iter().enumerate() {
            let departures = self.departures(material, &scene, n);
            let station = &self.stations[at];
            let mut model = station.model.departed(&departures);
            let tractions = model.plate_tractions(material, state)?;
            let mut tangent = model.tangent(material, state)?;
            let mesh = model.mesh();
            let face = if is_moved_face { &mesh.moved_nodes } else { &mesh.fixed_nodes };
            let parts: Vec<(u32, usize)> = face.iter().map(|&v| (v, part_of(mesh.nodes[v as usize]))).collect();
            for (part, trace) in all.iter_mut().enumerate() {
                let mut rate = vec![[0.0; 3]; tractions.len()];
                for (v, _) in parts.iter().filter(|(_, p)| *p == part) {
                    // The sample lags behind what pulls it.
                    rate[*v as usize] = tractions[*v as usize].map(|t| -t);
                }
                let s = tangent.imposed_sensitivity(&rate)?;
                trace.displacement.push(station.view.average(&s.displacement)?);
                let has_force = self.observed.steps[n].force.is_some();
                trace.force.push(if has_force { s.force_n } else { 0.0 });
            }
        }
        Ok(all)
    }

    /// The departures of a scene at a step.
    fn departures(&self, material: &Ogden, scene: &Scene, step: usize) -> crate::fem::Departures {
        let measured = self.observed.steps[step].force.map_or(0.0, |f| f.value_n);
        scene.departures(measured, bond_scale(material), self.face_axis)
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
        let image = &scene.image;
        // The view is made for the scene's shift, so that the walls cut the shifted voxels. A further shift, as of a
        // scene beside it from which a derivative is taken, and rotations are applied to first order.
        let viewed = self.stations[at].shift_mm;
        let shift_mm = [0, 1, 2].map(|i| image.shift_mm[i] - viewed[i]);
        let turns = shift_mm.iter().chain(&image.rotation_rad).any(|x| x.abs() > 0.0);
        let has_background = image.background_mm.iter().flatten().any(|x| x.abs() > 0.0);
        let mask = &self.observed.mask;
        let mut trace = Trace::default();
        for (n, (state, seen)) in states.iter().zip(seen).enumerate() {
            let mut field = seen.clone();
            if turns {
                let gradients = self.stations[at].view.gradients(&state.displacement)?;
                let w = image.rotation_rad;
                let cross = |a: [f64; 3], b: [f64; 3]| {
                    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
                };
                for ((u, g), &voxel) in field.iter_mut().zip(&gradients).zip(&mask.voxels) {
                    let x = mask.grid.center_mm(voxel as usize);
                    let turned = cross(w, x);
                    let shift = [0, 1, 2].map(|i| shift_mm[i] + turned[i]);
                    let back = cross(w, *u);
                    for i in 0..3 {
                        u[i] += (0..3).map(|j| g[i][j] * shift[j]).sum::<f64>() - back[i];
                    }
                }
            }
            for u in &mut field {
                for c in 0..3 {
                    u[c] *= 1.0 + image.gain[c];
                }
            }
            if has_background {
                for (u, &voxel) in field.iter_mut().zip(&mask.voxels) {
                    let x = mask.grid.center_mm(voxel as usize);
                    let t = [0, 1, 2].map(|a| x[a] / self.half_extents[a]);
                    let terms = background_terms(t);
                    for c in 0..3 {
                        u[c] += image.background_mm[c].iter().zip(terms).map(|(a, b)| a * b).sum::<f64>();
                    }
                }
            }
            for jump in image.jumps.iter().filter(|j| j.step == n) {
                for &v in jump.voxels.iter() {
                    field[v as usize][jump.component] += jump.size_mm;
                }
            }
            trace.displacement.push(field);
            let has_force = self.observed.steps[n].force.is_some();
            let force = forces[n] * (1.0 + scene.force_gain) + scene.force_offset_n;
            trace.force.push(if has_force { force } else { 0.0 });
        }
        Ok(trace)
    }

    /// The station of a scene, made where there is none.
    fn station(&mut self, scene: &Scene) -> Result<usize, DiagnosisError> {
        let holes: Vec<[f64; 3]> = self
            .observed
            .specimen
            .holes
            .iter()
            .enumerate()
            .map(|(n, _)| scene.holes.get(n).copied().unwrap_or([0.0; 3]))
            .collect();
        let releases = scene.releases();
        let found = self.stations.iter().position(|s| {
            let same = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).all(|(x, y)| x.to_bits() == y.to_bits());
            s.releases == releases && s.holes.iter().zip(&holes).all(|(a, b)| same(a, b))
        });
        let made = scene.specimen(&self.observed.specimen);
        let shift_mm = scene.image.shift_mm;
        if let Some(at) = found {
            let station = &mut self.stations[at];
            if station.shift_mm != shift_mm {
                station.view = self.observed.shifted_view(&made, station.model.mesh(), shift_mm)?;
                station.shift_mm = shift_mm;
            }
            return Ok(at);
        }
        made.validate().map_err(DiagnosisError::Specimen)?;
        let mut mesh = self.nominal.clone();
        for (hole, change) in holes.iter().enumerate() {
            for (variable, &by) in hole_variables(hole).into_iter().zip(change) {
                if by.abs() > 0.0 {
                    let velocity = shape_velocity(&self.nominal, &self.observed.specimen, variable);
                    mesh = morphed(&mesh, &velocity, by);
                }
            }
        }
        let view = self.observed.shifted_view(&made, &mesh, shift_mm)?;
        let model = ForwardModel::with_released(mesh, &made, &|_, is_moved| releases[usize::from(is_moved)])?;
        // The nodes of two morphed meshes correspond: equilibria of one start the other.
        let states = self.stations.iter().rev().find(|s| s.releases == releases).map(|s| s.states.clone());
        if self.stations.len() >= MAX_STATIONS {
            // The nominal one stays.
            self.stations.remove(1);
        }
        self.stations.push(Station { holes, releases, model, view, shift_mm, states: states.unwrap_or_default() });
        Ok(self.stations.len() - 1)
    }
}

fn hole_variables(hole: usize) -> [DesignVariable; 3] {
    [DesignVariable::HoleDiameter(hole), DesignVariable::HoleX(hole), DesignVariable::HoleOther(hole)]
}

/// Stiffness (kPa/mm) of the sample under a node of its bond: shear modulus / node spacing.
fn bond_scale(material: &Ogden) -> f64 {
    let mu = material.initial_shear_modulus_kpa();
    mu.abs() / BOND_LENGTH_MM
}

/// 1, x, y, z, x², y², z², xy, yz, zx.
pub(super) fn background_terms([x, y, z]: [f64; 3]) -> [f64; 10] {
    [1.0, x, y, z, x * x, y * y, z * z, x * y, y * z, z * x]
}
