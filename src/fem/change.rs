//! Derivatives of an equilibrium along changes of anything that it depends on, many of them at once.
//!
//! With the condensed residual r(u, z), z all that may change: K u′ = −∂r/∂z ż, and the plate's force changes by the
//! residual's change along both. Everything is a closed form but what departures are at the quadrature points and
//! faces, which is differenced.

use super::assembler::Assembler;
use super::departures::{Departures, PlateMotion};
use super::element_data::{FibreDifference, MAX_GROUPS};
use super::error::SolveError;
use super::law_correction::LawCorrection;
use super::rates::Rates;
use super::tangent::Tangent;
use crate::material::Lanes;

/// Relative accuracy of the linear solves (two iterations with the single-precision factor).
pub(super) const ACCURACY: f64 = 1e-8;

/// A change of what an equilibrium depends on, as rates per unit of t; made by a [`Tangent`].
#[derive(Default)]
pub struct Change {
    /// Of the nodes' reference positions, mm.
    pub(super) velocity: Option<Vec<[f64; 3]>>,
    /// Of the displacement that plates impose, mm; zero elsewhere.
    pub(super) imposed: Vec<[f64; 3]>,
    stiffness_factor: Option<Vec<[Lanes; MAX_GROUPS]>>,
    log_growth: Option<Vec<[Lanes; MAX_GROUPS]>>,
    fibre: Option<FibreDifference>,
    law: Option<LawCorrection>,
    /// Of the springs' forces at the nodes that they hold, where these stay, kPa·mm².
    spring_forces: Vec<(u32, [f64; 3])>,
}

impl Change {
    fn rates<'a>(&'a self, displacement: &'a [[f64; 3]]) -> Rates<'a> {
        Rates {
            velocity: self.velocity.as_deref(),
            displacement: Some(displacement),
            parameter: None,
            stiffness_factor: self.stiffness_factor.as_deref(),
            log_growth: self.log_growth.as_deref(),
            fibre: self.fibre,
            law: self.law,
        }
    }
}

/// Derivative of an equilibrium along a change.
#[derive(Clone, Debug)]
pub struct ChangeSensitivity {
    /// du/dt following each node, mm per unit of t.
    pub displacement: Vec<[f64; 3]>,
    /// dF/dt, N per unit of t.
    pub force_n: f64,
    /// The same of the force along +y ([`Equilibrium::normal_force_n`](super::Equilibrium::normal_force_n)).
    pub normal_force_n: f64,
}

impl Tangent<'_> {
    /// The change along t ↦ `path`(t) at t = 0, which must be the departures of the model that made the tangent;
    /// differences over ±`step`, in units of t.
    pub fn change_of_departures(&self, path: &dyn Fn(f64) -> Departures, step: f64) -> Change {
        let ends = [path(step), path(-step)];
        let fibre = ends.iter().any(|d| d.fibre.is_some()).then(|| [0, 1].map(|n| ends[n].fibre));
        let law = law_rate(&ends, 1.0 / (2.0 * step));
        let ends = ends.map(|departures| self.assembler.departed(&departures));
        let (drive_mm, mut imposed) = (self.equilibrium.drive_mm, self.still());
        let per_step = 1.0 / (2.0 * step);
        for v in self.assembler.plates().held_nodes() {
            let [a, b] = [0, 1].map(|n| ends[n].imposed(v, drive_mm));
            imposed[v] = [0, 1, 2].map(|i| (a[i] - b[i]) * per_step);
        }
        let [factors, growths] = [[0, 1].map(|n| ends[n].stiffness_factors()), [0, 1].map(|n| ends[n].log_growths())];
        Change {
            velocity: None,
            imposed,
            stiffness_factor: difference(factors, 1.0, per_step),
            log_growth: difference(growths, 0.0, per_step),
            fibre: fibre.map(|ends| FibreDifference { ends, step }),
            law,
            spring_forces: self.spring_rates(&ends, per_step),
        }
    }

    /// As [`Self::change_of_departures`] along a path that changes nothing but how plates and faces move.
    pub fn change_of_plates(&self, path: &dyn Fn(f64) -> Departures, step: f64) -> Change {
        let plates = self.assembler.plates();
        if !plates.released.is_empty() {
            // Springs pull at what moves.
            return self.change_of_departures(path, step);
        }
        let (ends, drive_mm) = ([path(step), path(-step)], self.equilibrium.drive_mm);
        let (nodes, mut imposed) = (&self.assembler.mesh().nodes, self.still());
        for v in plates.held_nodes() {
            let [a, b] = [0, 1].map(|n| plates.imposed(nodes[v], &ends[n], v, drive_mm));
            imposed[v] = [0, 1, 2].map(|i| (a[i] - b[i]) / (2.0 * step));
        }
        Change { imposed, ..Change::default() }
    }

    /// The change as every node moves by `velocity` (mm per unit of t; `None`: the mesh stays) and the drive by
    /// `drive_rate`.
    pub fn change_of_nodes(&self, velocity: Option<&[[f64; 3]]>, drive_rate: f64) -> Change {
        let mut imposed = self.still();
        for &v in &self.assembler.mesh().moved_nodes {
            imposed[v as usize] = self.assembler.plates().vector(drive_rate);
        }
        if let Some(velocity) = velocity {
            self.add_turning_of_plates(velocity, &mut imposed);
        }
        Change { velocity: velocity.map(<[_]>::to_vec), imposed, ..Change::default() }
    }

    /// The change as the moved plate goes by `rate` (mm per unit of t) at the same drive: as precompression brings it
    /// nearer.
    pub fn change_of_moved_plate(&self, rate: [f64; 3]) -> Change {
        let mut imposed = self.still();
        for &v in &self.assembler.mesh().moved_nodes {
            imposed[v as usize] = rate;
        }
        Change { imposed, ..Change::default() }
    }

    /// The change as the moved plate turns about the centre of its bonded face by the rotation vector `about` (rad per
    /// unit of t), once it is where the drive brings it. `None` where a mirror plane of the mesh turns that rotation
    /// round: its change is then odd across the plane, where all that the mesh tells is even.
    pub fn change_of_turning_plate(&self, about: [f64; 3]) -> Option<Change> {
        const STEP: f64 = 1e-4;
        let mirror = self.assembler.mesh().mirror;
        // A mirror keeps of a rotation vector the component across its plane.
        let is_turned_round = |across: usize| (0..3).any(|axis| axis != across && about[axis].abs() > 0.0);
        if mirror.y && is_turned_round(1) || mirror.z && is_turned_round(2) {
            return None;
        }
        let present = self.assembler.departures().clone();
        let turned = |t: f64| {
            let turn = PlateMotion { rotation_rad: about.map(|w| t * w), ..PlateMotion::default() };
            Departures { moved_plate: present.moved_plate.plus(&turn), ..present.clone() }
        };
        Some(self.change_of_plates(&turned, STEP))
    }

    /// The change as the held nodes move by `rate` (mm per unit of t; other nodes' entries are ignored).
    pub fn change_of_held_nodes(&self, rate: &[[f64; 3]]) -> Change {
        let mut imposed = self.still();
        for v in self.assembler.plates().held_nodes() {
            imposed[v] = rate[v];
        }
        Change { imposed, ..Change::default() }
    }

    /// Derivatives of the equilibrium along each of `changes`.
    ///
    /// # Errors
    /// [`SolveError::Linear`] if the tangent is not positive definite.
    pub fn sensitivities(&mut self, changes: &[Change]) -> Result<Vec<ChangeSensitivity>, SolveError> {
        let assembler = self.assembler.clone();
        let rates: Vec<Rates> = changes.iter().map(|c| c.rates(&c.imposed)).collect();
        let mut residuals =
            assembler.assemble_rates(&self.configuration(), &rates, None).map_err(|cause| self.diverged(cause))?;
        for (residual, change) in residuals.iter_mut().zip(changes) {
            for (v, force) in &change.spring_forces {
                for i in 0..3 {
                    residual[*v as usize][i] += force[i];
                }
            }
        }
        let right: Vec<Vec<f64>> = residuals.iter().map(|r| assembler.collect(r, -1.0)).collect();
        let mut displacements: Vec<Vec<[f64; 3]>> =
            self.solve_all(&right, ACCURACY)?.iter().map(|x| assembler.spread(x)).collect();
        for (displacement, change) in displacements.iter_mut().zip(changes) {
            for (u, imposed) in displacement.iter_mut().zip(&change.imposed) {
                for i in 0..3 {
                    u[i] += imposed[i];
                }
            }
        }
        // What the plate feels is the sample's part, without the springs.
        let driven = Some(&assembler.plates().driven_elements[..]);
        let rates: Vec<Rates> = changes.iter().zip(&displacements).map(|(c, u)| c.rates(u)).collect();
        let forces =
            assembler.assemble_rates(&self.configuration(), &rates, driven).map_err(|cause| self.diverged(cause))?;
        let of_change = |(displacement, residual): (Vec<[f64; 3]>, &Vec<[f64; 3]>)| {
            let [force_n, normal_force_n] = assembler.forces_n(assembler.reaction(residual));
            ChangeSensitivity { displacement, force_n, normal_force_n }
        };
        Ok(displacements.into_iter().zip(&forces).map(of_change).collect())
    }

    fn still(&self) -> Vec<[f64; 3]> {
        vec![[0.0; 3]; self.equilibrium.displacement.len()]
    }

    /// How the springs' forces change between `ends` where the nodes stay.
    fn spring_rates(&self, ends: &[Assembler; 2], per_step: f64) -> Vec<(u32, [f64; 3])> {
        let (drive_mm, mut sum) = (self.equilibrium.drive_mm, self.still());
        let [mut rates, behind] =
            [0, 1].map(|n| ends[n].add_spring_forces(drive_mm, &self.equilibrium.displacement, &mut sum));
        for ((_, rate), (_, behind)) in rates.iter_mut().zip(&behind) {
            for i in 0..3 {
                rate[i] = (rate[i] - behind[i]) * per_step;
            }
        }
        rates
    }

    /// Adds to `rate` (mm per unit of t) how the displacement that plates and faces impose changes as their nodes move:
    /// a turned plate moves a node by its arm.
    fn add_turning_of_plates(&self, velocity: &[[f64; 3]], rate: &mut [[f64; 3]]) {
        let (plates, departures) = (self.assembler.plates(), self.assembler.departures());
        if !departures.moves_plates() {
            return;
        }
        let (nodes, drive_mm) = (&self.assembler.mesh().nodes, self.equilibrium.drive_mm);
        for v in plates.held_nodes() {
            let at =
                |t: f64| plates.imposed([0, 1, 2].map(|i| nodes[v][i] + t * velocity[v][i]), departures, v, drive_mm);
            // Rigid motions are linear in the position, measured faces of low degree: differences over a micrometre
            // are exact to rounding.
            let step = 1e-3 / velocity[v].iter().fold(1e-12, |s: f64, x| s.max(x.abs()));
            let (ahead, behind) = (at(step), at(-step));
            for i in 0..3 {
                rate[v][i] += (ahead[i] - behind[i]) / (2.0 * step);
            }
        }
    }
}

/// The rate between the corrections of the law at two ends, whose reach is the same.
fn law_rate([ahead, behind]: &[Departures; 2], per_step: f64) -> Option<LawCorrection> {
    let reach = ahead.law.or(behind.law)?.reach;
    let of = |end: &Departures, n: usize| end.law.map_or(0.0, |law| law.coefficients_kpa[n]);
    let coefficients_kpa = [0, 1, 2, 3].map(|n| (of(ahead, n) - of(behind, n)) * per_step);
    coefficients_kpa.iter().any(|c| c.abs() > 0.0).then_some(LawCorrection { reach, coefficients_kpa })
}

/// The rate between two fields at quadrature points, each `constant` where it is not given; `None` where neither is.
fn difference(
    [ahead, behind]: [&[[Lanes; MAX_GROUPS]]; 2],
    constant: f64,
    per_step: f64,
) -> Option<Vec<[Lanes; MAX_GROUPS]>> {
    let num = ahead.len().max(behind.len());
    let at =
        |field: &[[Lanes; MAX_GROUPS]], e: usize| field.get(e).copied().unwrap_or([Lanes::splat(constant); MAX_GROUPS]);
    let rate = |e: usize| {
        let (a, b) = (at(ahead, e), at(behind, e));
        std::array::from_fn(|g| (a[g] - b[g]) * per_step)
    };
    (num > 0).then(|| (0..num).map(rate).collect())
}
