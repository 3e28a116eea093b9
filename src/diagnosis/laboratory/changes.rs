//! How what would be recorded of a scene changes with the material and with the scene.

use super::Laboratory;
use crate::diagnosis::error::DiagnosisError;
use crate::diagnosis::laboratory::Prediction;
use crate::diagnosis::scene::Scene;
use crate::diagnosis::supposed::Path;
use crate::diagnosis::trace::Trace;
use crate::fem::{Change, Tangent};
use crate::material::Material;
use rayon::prelude::*;

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

impl Laboratory<'_> {
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
}
