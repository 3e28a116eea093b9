//! What a sample, its bonds or its loading departs from the nominal experiment in.
//!
//! The nominal experiment is one material everywhere, plates that hold every point of the bonded faces, and a drive along
//! x. Each departure here is at rest in its default; the element kernels, the factorisation and the derivatives are the
//! same with and without.

use super::element_data::{ElementOutput, MAX_GROUPS};
use super::error::{SolveError, StepFailure};
use super::model::ForwardModel;
use super::newton::{Equilibrium, SolveOptions};
use crate::material::{LANES, Lanes, Ogden};
use std::fmt;
use std::sync::Arc;

/// A scalar function of the reference position (mm).
#[derive(Clone)]
pub struct Field(Arc<dyn Fn([f64; 3]) -> f64 + Send + Sync>);

impl Field {
    /// A field from its formula.
    pub fn new(formula: impl Fn([f64; 3]) -> f64 + Send + Sync + 'static) -> Field {
        Field(Arc::new(formula))
    }

    /// Its value at a reference position, mm.
    pub fn at(&self, position: [f64; 3]) -> f64 {
        (self.0)(position)
    }
}

impl fmt::Debug for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Field")
    }
}

/// Fibres of one direction: Ψ_f = k/2 (I₄ − 1)², I₄ = a·C a (standard reinforcing model).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fibre {
    /// a, a unit vector in the reference configuration.
    pub direction: [f64; 3],
    /// k, kPa.
    pub modulus_kpa: f64,
}

/// How a plate departs from its nominal motion: a rigid motion about the centre of its bonded face, a constant part and one
/// in proportion to the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlateMotion {
    /// Translation, mm.
    pub translation_mm: [f64; 3],
    /// Translation per mm of drive.
    pub translation_per_mm: [f64; 3],
    /// Rotation vector, rad.
    pub rotation_rad: [f64; 3],
    /// Rotation vector per mm of drive, rad/mm.
    pub rotation_rad_per_mm: [f64; 3],
}

impl PlateMotion {
    /// Displacement (mm) that the departure adds at `arm`, a position relative to the centre of the face.
    pub fn displacement(&self, arm: [f64; 3], drive_mm: f64) -> [f64; 3] {
        let sum = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|i| a[i] + drive_mm * b[i]);
        let t = sum(self.translation_mm, self.translation_per_mm);
        let w = sum(self.rotation_rad, self.rotation_rad_per_mm);
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        // Rodrigues: R x − x = sin(θ)/θ w×x + (1 − cos θ)/θ² w×(w×x), both factors by their series near zero.
        let square: f64 = w.iter().map(|x| x * x).sum();
        let (a, b) = if square < 1e-8 {
            (1.0 - square / 6.0, 0.5 - square / 24.0)
        } else {
            let angle = square.sqrt();
            (angle.sin() / angle, (1.0 - angle.cos()) / square)
        };
        let once = cross(w, arm);
        let twice = cross(w, once);
        [0, 1, 2].map(|i| t[i] + a * once[i] + b * twice[i])
    }

    fn scaled(&self, factor: f64) -> PlateMotion {
        let times = |v: [f64; 3]| v.map(|x| factor * x);
        PlateMotion {
            translation_mm: times(self.translation_mm),
            translation_per_mm: times(self.translation_per_mm),
            rotation_rad: times(self.rotation_rad),
            rotation_rad_per_mm: times(self.rotation_rad_per_mm),
        }
    }
}

/// In how many parts plates are brought to where they are by [`ForwardModel::solve_by_parts`].
const PARTS: i32 = 8;

/// All departures of one experiment.
#[derive(Clone, Debug, Default)]
pub struct Departures {
    /// Factor on the isochoric stiffness at a reference position; one where none is given. The volumetric part stays.
    pub stiffness_factor: Option<Field>,
    /// Logarithm of the volume ratio at which the sample would be free of pressure (swelling); zero where none is given.
    pub log_growth: Option<Field>,
    /// Fibres.
    pub fibre: Option<Fibre>,
    /// The fixed plate or grip (−y or −x).
    pub fixed_plate: PlateMotion,
    /// The moved plate or grip (+y or +x).
    pub moved_plate: PlateMotion,
    /// Stiffness of the bond, kPa/mm, on faces that were released (see [`ForwardModel::with_released`]).
    pub bond_kpa_per_mm: Option<Field>,
}

impl Departures {
    /// Whether nothing departs.
    pub fn is_none(&self) -> bool {
        self.stiffness_factor.is_none()
            && self.log_growth.is_none()
            && self.fibre.is_none()
            && !self.moves_plates()
            && self.bond_kpa_per_mm.is_none()
    }

    /// Whether a plate departs from its nominal motion.
    pub fn moves_plates(&self) -> bool {
        [self.fixed_plate, self.moved_plate] != [PlateMotion::default(); 2]
    }
}

/// A bond this stiff (kPa/mm) holds: a traction of 100 kPa slips 10⁻⁴ mm.
pub const FIRM_BOND_KPA_PER_MM: f64 = 1e6;

/// Departures, ready for a mesh.
#[derive(Clone, Debug, Default)]
pub(super) struct Prepared {
    pub(super) departures: Departures,
    pub(super) factor: Vec<[Lanes; MAX_GROUPS]>,
    pub(super) growth: Vec<[Lanes; MAX_GROUPS]>,
    /// Stiffness of the spring at each released node, kPa·mm.
    pub(super) springs: Vec<(u32, f64)>,
}

/// Derivative of an equilibrium along a path of departures.
#[derive(Clone, Debug)]
pub struct DepartureSensitivity {
    /// du/dt at each node, mm per unit of t.
    pub displacement: Vec<[f64; 3]>,
    /// dF/dt, N per unit of t.
    pub force_n: f64,
}

impl ForwardModel {
    /// Sets what the model departs from the nominal experiment in, for all that follows.
    pub fn set_departures(&mut self, departures: &Departures) {
        self.prepared = self.prepare(departures);
        self.is_nominal = departures.is_none();
        self.tangent_at = 0;
    }

    /// As [`ForwardModel::solve`] from rest, the plates' departures growing in eight parts at the drive asked for: a plate that is
    /// far out of place without any drive is a step that Newton's method does not take from rest at once.
    ///
    /// # Errors
    /// As [`ForwardModel::solve`].
    pub fn solve_by_parts(
        &mut self,
        material: &Ogden,
        drive_mm: f64,
        options: &SolveOptions,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Equilibrium, SolveError> {
        let whole = self.departures().clone();
        let mut state = None;
        for part in 0..PARTS {
            let grown = f64::from(part) / f64::from(PARTS);
            let (fixed_plate, moved_plate) = (whole.fixed_plate.scaled(grown), whole.moved_plate.scaled(grown));
            self.set_departures(&Departures { fixed_plate, moved_plate, ..whole.clone() });
            match self.solve(material, drive_mm, state.as_ref(), options, is_cancelled) {
                Ok(found) => state = Some(found),
                Err(error) => {
                    self.set_departures(&whole);
                    return Err(error);
                }
            }
        }
        self.set_departures(&whole);
        self.solve(material, drive_mm, state.as_ref(), options, is_cancelled)
    }

    /// The departures in force.
    pub fn departures(&self) -> &Departures {
        &self.prepared.departures
    }

    fn prepare(&mut self, departures: &Departures) -> Prepared {
        let needs_points = departures.stiffness_factor.is_some() || departures.log_growth.is_some();
        if needs_points && self.point_positions.is_empty() {
            self.point_positions = self.quadrature_positions();
        }
        let on_points = |field: &Option<Field>| -> Vec<[Lanes; MAX_GROUPS]> {
            let Some(field) = field else { return Vec::new() };
            self.point_positions
                .iter()
                .map(|points| {
                    let mut values = [Lanes::ZERO; MAX_GROUPS];
                    for (g, value) in values.iter_mut().enumerate() {
                        for l in 0..LANES {
                            value.0[l] = field.at([0, 1, 2].map(|i| points[i][g].0[l]));
                        }
                    }
                    values
                })
                .collect()
        };
        let springs = self
            .released
            .iter()
            .map(|&(v, area)| {
                let firm = FIRM_BOND_KPA_PER_MM;
                let bond = departures.bond_kpa_per_mm.as_ref().map_or(firm, |b| b.at(self.mesh.nodes[v as usize]));
                (v, bond.clamp(0.0, firm) * area)
            })
            .collect();
        Prepared {
            factor: on_points(&departures.stiffness_factor),
            growth: on_points(&departures.log_growth),
            springs,
            departures: departures.clone(),
        }
    }

    fn quadrature_positions(&self) -> Vec<[[Lanes; MAX_GROUPS]; 3]> {
        let rest = vec![[0.0; 3]; self.mesh.nodes.len()];
        let material = Ogden { bulk_kpa: 1.0, terms: Vec::new() };
        let mut out = ElementOutput::default();
        (0..self.mesh.num_elements())
            .map(|e| {
                let input = self.nominal_input(e, &self.mesh.nodes, &rest, None, &material);
                self.kernels.residual(&self.tables, &input, &mut out);
                out.points
            })
            .collect()
    }

    /// Displacement that the plates impose on node `v`; the node must be on a plate.
    pub(super) fn imposed(&self, v: usize, drive_mm: f64) -> [f64; 3] {
        self.imposed_by(&self.prepared.departures, v, drive_mm)
    }

    fn imposed_by(&self, departures: &Departures, v: usize, drive_mm: f64) -> [f64; 3] {
        let (motion, center, along) = if self.is_moved[v] {
            (&departures.moved_plate, self.face_centers[1], drive_mm)
        } else {
            (&departures.fixed_plate, self.face_centers[0], 0.0)
        };
        let x = self.mesh.nodes[v];
        let mut u = motion.displacement([0, 1, 2].map(|i| x[i] - center[i]), drive_mm);
        u[0] += along;
        u
    }

    /// Adds the springs of released nodes to a residual; returns their forces, node by node.
    pub(super) fn add_spring_forces(
        &self,
        drive_mm: f64,
        displacement: &[[f64; 3]],
        residual: &mut [[f64; 3]],
    ) -> Vec<(u32, [f64; 3])> {
        self.prepared
            .springs
            .iter()
            .map(|&(v, stiffness)| {
                let v_index = v as usize;
                let imposed = self.imposed(v_index, drive_mm);
                let force = [0, 1, 2].map(|i| stiffness * (displacement[v_index][i] - imposed[i]));
                for i in 0..3 {
                    residual[v_index][i] += force[i];
                }
                (v, force)
            })
            .collect()
    }

    /// Adds the springs to the diagonal of the assembled tangent.
    pub(super) fn add_spring_stiffness(&mut self) {
        for &(v, stiffness) in &self.prepared.springs {
            let place = self.topology.place[v as usize];
            let Some(&block) = self.topology.block_pointers.get(place as usize) else { continue };
            // The diagonal block comes first in its column.
            let target = &mut self.system.blocks[block as usize];
            for i in 0..3 {
                target[4 * i] += stiffness;
            }
        }
    }

    /// Derivative of `equilibrium` along t ↦ `path`(t) at t = 0, which must be the departures in force; differences of the
    /// residual over ±`step`, in units of t.
    ///
    /// # Errors
    /// [`SolveError::Linear`] if the tangent is not positive definite, [`SolveError::Diverged`] if `step` inverts an element.
    pub fn departure_sensitivity(
        &mut self,
        material: &Ogden,
        equilibrium: &Equilibrium,
        path: &dyn Fn(f64) -> Departures,
        step: f64,
    ) -> Result<DepartureSensitivity, SolveError> {
        self.ensure_tangent(material, equilibrium)?;
        let drive = equilibrium.drive_mm;
        let (ahead, behind) = (path(step), path(-step));
        let num_nodes = self.mesh.nodes.len();
        let mut imposed_rate = vec![[0.0; 3]; num_nodes];
        for v in self.held_nodes() {
            let (a, b) = (self.imposed_by(&ahead, v, drive), self.imposed_by(&behind, v, drive));
            imposed_rate[v] = [0, 1, 2].map(|i| (a[i] - b[i]) / (2.0 * step));
        }
        let (ahead, behind) = (self.prepare(&ahead), self.prepare(&behind));
        let present = std::mem::take(&mut self.prepared);
        let result = self.difference_along(material, equilibrium, [&ahead, &behind], &mut imposed_rate, step, &present);
        self.prepared = present;
        result
    }

    /// Derivative of `equilibrium` as the held nodes move by `rate` (mm per unit of t; other nodes' entries are ignored).
    ///
    /// # Errors
    /// As [`Self::departure_sensitivity`].
    pub fn imposed_sensitivity(
        &mut self,
        material: &Ogden,
        equilibrium: &Equilibrium,
        rate: &[[f64; 3]],
    ) -> Result<DepartureSensitivity, SolveError> {
        self.ensure_tangent(material, equilibrium)?;
        let mut imposed = vec![[0.0; 3]; self.mesh.nodes.len()];
        let mut largest = 1e-12f64;
        for v in self.held_nodes() {
            imposed[v] = rate[v];
            largest = rate[v].iter().fold(largest, |s, x| s.max(x.abs()));
        }
        // Differences over a micrometre: elements are some hundred times larger, their vectors smooth.
        let step = 1e-3 / largest;
        let present = std::mem::take(&mut self.prepared);
        let result = self.difference_along(material, equilibrium, [&present, &present], &mut imposed, step, &present);
        self.prepared = present;
        result
    }

    /// Traction (kPa) of the plates on the sample at each node of the bonded faces, zero elsewhere: nodal force / area.
    ///
    /// # Errors
    /// [`SolveError::Diverged`] where the state is not one of this mesh.
    pub fn plate_tractions(
        &mut self,
        material: &Ogden,
        equilibrium: &Equilibrium,
    ) -> Result<Vec<[f64; 3]>, SolveError> {
        let areas = self.mesh.face_areas();
        let positions = self.mesh.nodes.clone();
        let mut residual = vec![[0.0; 3]; positions.len()];
        self.assemble_residual_at(material, &positions, &equilibrium.displacement, None, &mut residual).map_err(
            |cause| SolveError::Diverged { reached_mm: equilibrium.drive_mm, asked_mm: equilibrium.drive_mm, cause },
        )?;
        Ok(residual
            .iter()
            .zip(&areas)
            .map(|(r, area)| if *area > 0.0 { r.map(|f| f / area) } else { [0.0; 3] })
            .collect())
    }

    /// Mesh nodes that move with a plate.
    fn held_nodes(&self) -> Vec<usize> {
        (0..self.is_held.len()).filter(|&v| self.is_held[v]).collect()
    }

    fn difference_along(
        &mut self,
        material: &Ogden,
        equilibrium: &Equilibrium,
        ends: [&Prepared; 2],
        rate: &mut [[f64; 3]],
        step: f64,
        present: &Prepared,
    ) -> Result<DepartureSensitivity, SolveError> {
        let diverged = |cause: StepFailure| SolveError::Diverged {
            reached_mm: equilibrium.drive_mm,
            asked_mm: equilibrium.drive_mm,
            cause,
        };
        let num_nodes = self.mesh.nodes.len();
        let positions = self.mesh.nodes.clone();
        let driven = self.driven_elements.clone();
        // d/dt of the residual along (u + t rate, path(t)); the plate's part without the springs.
        let difference = |model: &mut Self, rate: &[[f64; 3]], elements: Option<&[u32]>, with_springs: bool| {
            let mut sum = vec![[0.0; 3]; num_nodes];
            let mut value = vec![[0.0; 3]; num_nodes];
            for (prepared, sign) in [(ends[0], 1.0), (ends[1], -1.0)] {
                model.prepared = prepared.clone();
                let u: Vec<[f64; 3]> = equilibrium
                    .displacement
                    .iter()
                    .zip(rate)
                    .map(|(u, r)| [0, 1, 2].map(|i| u[i] + sign * step * r[i]))
                    .collect();
                model.assemble_residual_at(material, &positions, &u, elements, &mut value).map_err(diverged)?;
                if with_springs {
                    model.add_spring_forces(equilibrium.drive_mm, &u, &mut value);
                }
                for (s, v) in sum.iter_mut().zip(&value) {
                    for i in 0..3 {
                        s[i] += sign * v[i] / (2.0 * step);
                    }
                }
            }
            Ok::<_, SolveError>(sum)
        };
        let residual = difference(self, rate, None, true)?;
        self.prepared = present.clone();
        let right = self.collect(&residual, -1.0);
        let x = self.system.solve(&self.topology, &[right], 1e-7)?;
        for (r, d) in rate.iter_mut().zip(self.spread(&x[0])) {
            for i in 0..3 {
                r[i] += d[i];
            }
        }
        let on_plate = difference(self, rate, Some(&driven), false)?;
        let force_n = self.reaction(&on_plate)[0] * self.multiplicity * 1e-3;
        Ok(DepartureSensitivity { displacement: rate.to_vec(), force_n })
    }
}

#[cfg(test)]
#[path = "departures_tests.rs"]
mod tests;
