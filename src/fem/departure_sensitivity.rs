//! Derivatives of an equilibrium along a path of departures, or as the plates' nodes move.

use super::assembler::{Assembler, Configuration};
use super::departures::Departures;
use super::error::SolveError;
use super::tangent::Tangent;

/// Relative accuracy of the linear solve.
const ACCURACY: f64 = 1e-7;

/// Derivative of an equilibrium along a path of departures.
#[derive(Clone, Debug)]
pub struct DepartureSensitivity {
    /// du/dt at each node, mm per unit of t.
    pub displacement: Vec<[f64; 3]>,
    /// dF/dt, N per unit of t.
    pub force_n: f64,
}

/// The two ends of a central difference: assemblers at t = `step` and t = −`step`.
struct Ends<'a> {
    ahead: &'a Assembler,
    behind: &'a Assembler,
    step: f64,
}

impl Tangent<'_> {
    /// Derivative of the equilibrium along t ↦ `path`(t) at t = 0, which must be the departures of the model that made
    /// the tangent; differences of the residual over ±`step`, in units of t.
    ///
    /// # Errors
    /// [`SolveError::Linear`] if the tangent is not positive definite, [`SolveError::Diverged`] if `step` inverts an
    /// element.
    pub fn departure_sensitivity(
        &mut self,
        path: &dyn Fn(f64) -> Departures,
        step: f64,
    ) -> Result<DepartureSensitivity, SolveError> {
        let (ahead, behind) = (self.assembler.departed(&path(step)), self.assembler.departed(&path(-step)));
        let drive = self.equilibrium.drive_mm;
        let mut imposed_rate = vec![[0.0; 3]; self.equilibrium.displacement.len()];
        for v in self.assembler.plates().held_nodes() {
            let (a, b) = (ahead.imposed(v, drive), behind.imposed(v, drive));
            imposed_rate[v] = [0, 1, 2].map(|i| (a[i] - b[i]) / (2.0 * step));
        }
        self.sensitivity_between(&Ends { ahead: &ahead, behind: &behind, step }, imposed_rate)
    }

    /// As [`Self::departure_sensitivity`] along a path that changes nothing but how plates and faces move: closed forms
    /// in place of differences of the residual, and only in the elements beside the plates.
    ///
    /// # Errors
    /// As [`Self::departure_sensitivity`].
    pub fn plates_sensitivity(
        &mut self,
        path: &dyn Fn(f64) -> Departures,
        step: f64,
    ) -> Result<DepartureSensitivity, SolveError> {
        let plates = self.assembler.plates();
        if !plates.released.is_empty() {
            // Springs pull at what moves.
            return self.departure_sensitivity(path, step);
        }
        let (ahead, behind, drive) = (path(step), path(-step), self.equilibrium.drive_mm);
        let nodes = &self.assembler.mesh().nodes;
        let mut rate = vec![[0.0; 3]; nodes.len()];
        for v in plates.held_nodes() {
            let at = |departures: &Departures| plates.imposed(nodes[v], departures, v, drive);
            let (a, b) = (at(&ahead), at(&behind));
            rate[v] = [0, 1, 2].map(|i| (a[i] - b[i]) / (2.0 * step));
        }
        let mut force = vec![[0.0; 3]; nodes.len()];
        let assembler = self.assembler.clone();
        let beside = &assembler.plates().elements_beside;
        assembler
            .assemble_directional(&self.configuration(), Some(&rate), None, Some(beside), &mut force)
            .map_err(|cause| self.diverged(cause))?;
        let x = self.solve_all(&[assembler.collect(&force, -1.0)], ACCURACY)?;
        for (r, d) in rate.iter_mut().zip(assembler.spread(&x[0])) {
            for i in 0..3 {
                r[i] += d[i];
            }
        }
        let driven = Some(&assembler.plates().driven_elements[..]);
        assembler
            .assemble_directional(&self.configuration(), Some(&rate), None, driven, &mut force)
            .map_err(|cause| self.diverged(cause))?;
        Ok(DepartureSensitivity { force_n: assembler.force_n(&force), displacement: rate })
    }

    /// Derivative of the equilibrium as the held nodes move by `rate` (mm per unit of t; other nodes' entries are
    /// ignored).
    ///
    /// # Errors
    /// As [`Self::departure_sensitivity`].
    pub fn imposed_sensitivity(&mut self, rate: &[[f64; 3]]) -> Result<DepartureSensitivity, SolveError> {
        let mut imposed_rate = vec![[0.0; 3]; self.equilibrium.displacement.len()];
        let mut largest = 1e-12f64;
        for v in self.assembler.plates().held_nodes() {
            imposed_rate[v] = rate[v];
            largest = rate[v].iter().fold(largest, |s, x| s.max(x.abs()));
        }
        // Differences over a micrometre: elements are some hundred times larger, their vectors smooth.
        let present = self.assembler.clone();
        self.sensitivity_between(&Ends { ahead: &present, behind: &present, step: 1e-3 / largest }, imposed_rate)
    }

    /// The derivative between `ends` as the held nodes move by `rate`.
    fn sensitivity_between(
        &mut self,
        ends: &Ends,
        mut rate: Vec<[f64; 3]>,
    ) -> Result<DepartureSensitivity, SolveError> {
        let residual = self.residual_between(ends, &rate, None, true)?;
        let right = self.assembler.collect(&residual, -1.0);
        let x = self.solve_all(&[right], ACCURACY)?;
        for (r, d) in rate.iter_mut().zip(self.assembler.spread(&x[0])) {
            for i in 0..3 {
                r[i] += d[i];
            }
        }
        // What the plate feels is the sample's part, without the springs.
        let driven = &self.assembler.plates().driven_elements;
        let on_plate = self.residual_between(ends, &rate, Some(driven), false)?;
        Ok(DepartureSensitivity { force_n: self.assembler.force_n(&on_plate), displacement: rate })
    }

    /// d/dt of the residual along (u + t `rate`, departures of the ends); `elements` restricts the sum.
    fn residual_between(
        &self,
        ends: &Ends,
        rate: &[[f64; 3]],
        elements: Option<&[u32]>,
        with_springs: bool,
    ) -> Result<Vec<[f64; 3]>, SolveError> {
        let step = ends.step;
        let mut sum = vec![[0.0; 3]; rate.len()];
        let mut value = vec![[0.0; 3]; rate.len()];
        for (end, sign) in [(ends.ahead, 1.0), (ends.behind, -1.0)] {
            let u: Vec<[f64; 3]> = self
                .equilibrium
                .displacement
                .iter()
                .zip(rate)
                .map(|(u, r)| [0, 1, 2].map(|i| u[i] + sign * step * r[i]))
                .collect();
            let at = Configuration { displacement: &u, ..self.configuration() };
            end.assemble_residual(&at, elements, &mut value).map_err(|cause| self.diverged(cause))?;
            if with_springs {
                end.add_spring_forces(self.equilibrium.drive_mm, &u, &mut value);
            }
            for (s, v) in sum.iter_mut().zip(&value) {
                for i in 0..3 {
                    s[i] += sign * v[i] / (2.0 * step);
                }
            }
        }
        Ok(sum)
    }
}
