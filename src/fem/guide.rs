//! Nested iteration: the equilibrium of a coarse mesh as first guess on a fine one.
//!
//! A load step on a fine mesh costs five to twelve factorisations from rest; from the interpolated coarse solution it
//! takes one to three. The coarse model costs a few percent of one fine factorisation.

use super::equilibrium::Equilibrium;
use super::error::SolveError;
use super::mesh_model::MeshModel;
use super::nesting::Nesting;
use super::newton::Newton;
use super::options::SolveOptions;
use crate::mesh::{Location, Mesh};
use crate::specimen::Specimen;
use std::sync::Arc;

/// A coarse model and how the fine mesh lies in it.
pub(super) struct Guide {
    coarse: MeshModel,
    nesting: Arc<Nesting>,
}

impl Guide {
    /// Of a coarse model in which fine nodes lie at `nodes` and fine elements in `parents`.
    pub(super) fn new(coarse: MeshModel, nodes: Vec<Location>, parents: Vec<u32>) -> Guide {
        Guide { coarse, nesting: Arc::new(Nesting::new(nodes, parents)) }
    }

    /// Of a coarse mesh of the same `specimen` that does not share its nodes with `fine`; `None` where a node of `fine`
    /// lies outside of it, or where it makes no model.
    pub(super) fn beside(coarse: Mesh, fine: &Mesh, specimen: &Specimen) -> Option<Guide> {
        let nesting = Arc::new(Nesting::located(&coarse, fine)?);
        Some(Guide { coarse: MeshModel::new(coarse, specimen, &|_, _| false).ok()?, nesting })
    }

    /// The same guide with nothing solved.
    pub(super) fn anew(&self) -> Guide {
        Guide { coarse: self.coarse.departed(self.coarse.assembler.departures()), nesting: self.nesting.clone() }
    }

    /// Solves `fine` at a drive (mm) in one guided load step where that succeeds; else in two; else in steps of its own
    /// from as far as it came.
    ///
    /// # Errors
    /// As [`Newton::solve`].
    pub(super) fn solve(
        &mut self,
        fine: &mut Newton,
        drive_mm: f64,
        start: Option<&Equilibrium>,
    ) -> Result<Equilibrium, SolveError> {
        let mut known = Vec::new();
        if let Some(found) = self.lead(fine, drive_mm, start, &mut known) {
            return Ok(found);
        }
        let from_mm = start.map_or(0.0, |s| s.drive_mm);
        // What the coarse mesh gets wrong halfway is known when the other half is led.
        let Some(halfway) = self.lead(fine, 0.5 * (from_mm + drive_mm), start, &mut known) else {
            return fine.solve(drive_mm, start);
        };
        match self.lead(fine, drive_mm, Some(&halfway), &mut known) {
            Some(found) => Ok(found),
            None => fine.solve(drive_mm, Some(&halfway)),
        }
    }

    /// Takes `fine` to a drive (mm) in one load step from the coarse equilibrium there; `None` where either fails.
    /// Coarse equilibria of this material that are `known` are not sought again.
    ///
    /// With an equilibrium of the fine mesh at another drive of the same direction as `start`, what the coarse mesh
    /// gets wrong there is taken off in proportion to the drive: the error of a mesh changes far more slowly than what
    /// it is the error of. Two factorisations are left of four or five.
    fn lead(
        &mut self,
        fine: &mut Newton,
        drive_mm: f64,
        start: Option<&Equilibrium>,
        known: &mut Vec<Equilibrium>,
    ) -> Option<Equilibrium> {
        let start = start.filter(|s| s.drive_mm * drive_mm > 0.0);
        let beside_start = start.and_then(|start| Some((start, self.coarse_at(fine, start.drive_mm, known)?)));
        let found = self.coarse_at(fine, drive_mm, known).and_then(|there| {
            let mut first_guess = self.transfer(fine, &there);
            if let Some((start, at_start)) = beside_start {
                let from_coarse = self.transfer(fine, &at_start);
                first_guess.add_difference(drive_mm / start.drive_mm, start, &from_coarse);
            }
            fine.step(&first_guess, &[], drive_mm).ok()
        });
        match &found {
            Some(_) => fine.statistics.load_steps += 1,
            None => fine.statistics.failed_steps += 1,
        }
        found
    }

    /// The coarse equilibrium at a drive (mm), from the nearest one before it that is `known`, to which it is added.
    fn coarse_at(&mut self, fine: &Newton, drive_mm: f64, known: &mut Vec<Equilibrium>) -> Option<Equilibrium> {
        if let Some(found) = known.iter().find(|s| s.drive_mm == drive_mm) {
            return Some(found.clone());
        }
        let is_before = |s: &&Equilibrium| s.drive_mm * drive_mm > 0.0 && s.drive_mm.abs() < drive_mm.abs();
        let nearest = known.iter().filter(is_before).max_by(|a, b| a.drive_mm.abs().total_cmp(&b.drive_mm.abs()));
        // A loose coarse solution is enough: its error is the mesh's.
        let loose = SolveOptions { tolerance: 1e-4, ..*fine.options };
        let found = self.coarse.newton(fine.material, &loose, fine.is_cancelled).solve(drive_mm, nearest).ok()?;
        known.push(found.clone());
        Some(found)
    }

    /// The coarse equilibrium `from` on the mesh of `fine`.
    fn transfer(&self, fine: &Newton, from: &Equilibrium) -> Equilibrium {
        self.nesting.transfer([&self.coarse.assembler, fine.assembler], fine.material, from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::ForwardModel;
    use crate::material::Material;
    use crate::mesh::{MeshOptions, mesh_specimen};

    /// A mesh of some hundred elements finds the same equilibrium from a coarse mesh's as from rest, in one load step
    /// and fewer iterations.
    #[test]
    fn a_coarse_mesh_beside_leads_to_the_same_equilibrium() {
        let specimen = Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).unwrap();
        let material = Material::new(2173.0, [(17.0, 1.91)]).unwrap();
        let options = MeshOptions::scaled(&specimen, 1.2);
        let solve = SolveOptions { tolerance: 1e-9, ..SolveOptions::default() };
        let mut guided = ForwardModel::of_specimen(&specimen, &options).unwrap();
        let mut alone = ForwardModel::new(mesh_specimen(&specimen, &options).unwrap(), &specimen).unwrap();
        assert_eq!(guided.mesh().nodes, alone.mesh().nodes, "the guide changes nothing of the mesh");
        let led = guided.solve(&material, 5.0, None, &solve, &|| false).unwrap();
        let own = alone.solve(&material, 5.0, None, &solve, &|| false).unwrap();
        assert_eq!(guided.statistics().load_steps, 1);
        assert!(guided.statistics().newton_iterations < alone.statistics().newton_iterations);
        // Both stop where the residual is 1e-9 of the reactions.
        assert!((led.force_n / own.force_n - 1.0).abs() < 1e-8, "{} {}", led.force_n, own.force_n);
        for (a, b) in led.displacement.iter().zip(&own.displacement) {
            assert!((0..3).all(|i| (a[i] - b[i]).abs() < 1e-6), "{a:?} {b:?}");
        }
    }
}
