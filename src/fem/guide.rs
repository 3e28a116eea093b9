//! Nested iteration: the equilibrium of a coarse mesh as first guess on a fine one.
//!
//! A load step on a fine mesh costs five to twelve factorisations from rest; from the interpolated coarse solution it
//! takes one to three. The coarse model costs a few percent of one fine factorisation.

use super::assembler::{Assembler, Configuration};
use super::element_data::ElementOutput;
use super::equilibrium::Equilibrium;
use super::mesh_model::MeshModel;
use super::newton::Newton;
use super::options::SolveOptions;
use crate::material::{LANES, Material};
use crate::mesh::{Location, Locator, Mesh};
use crate::specimen::Specimen;
use std::sync::Arc;

/// A coarse model and how the fine mesh lies in it.
pub(super) struct Guide {
    coarse: MeshModel,
    nesting: Arc<Nesting>,
}

/// How the nodes and elements of a fine mesh lie in a coarse one.
struct Nesting {
    /// Place of each fine node in the coarse mesh.
    nodes: Vec<Location>,
    /// Coarse element of each fine element.
    parents: Vec<u32>,
}

impl Guide {
    /// Of a coarse model in which fine nodes lie at `nodes` and fine elements in `parents`.
    pub(super) fn new(coarse: MeshModel, nodes: Vec<Location>, parents: Vec<u32>) -> Guide {
        Guide { coarse, nesting: Arc::new(Nesting { nodes, parents }) }
    }

    /// Of a coarse mesh of the same `specimen` that does not share its nodes with `fine`; `None` where a node of `fine`
    /// lies outside of it, or where it makes no model. (Walls are concave: a parabola through three points of an
    /// arc lies on the arc or in the hole, so that coarse meshes hold the nodes of finer ones.)
    pub(super) fn beside(coarse: Mesh, fine: &Mesh, specimen: &Specimen) -> Option<Guide> {
        let locator = Locator::new(&coarse);
        let center = |e: usize| {
            let nodes = fine.element(e);
            let sum = |i: usize| nodes.iter().map(|&n| fine.nodes[n as usize][i]).sum::<f64>();
            [0, 1, 2].map(|i| sum(i) / nodes.len() as f64)
        };
        let nodes: Vec<Location> = fine.nodes.iter().map(|&x| locator.locate(&coarse, x)).collect::<Option<_>>()?;
        let parent = |e: usize| Some(locator.locate(&coarse, center(e))?.element);
        let parents: Vec<u32> = (0..fine.num_elements()).map(parent).collect::<Option<_>>()?;
        Some(Guide::new(MeshModel::new(coarse, specimen, &|_, _| false).ok()?, nodes, parents))
    }

    /// The same guide with nothing solved.
    pub(super) fn anew(&self) -> Guide {
        Guide { coarse: self.coarse.departed(self.coarse.assembler.departures()), nesting: self.nesting.clone() }
    }

    /// Takes `fine` to a drive (mm) in one load step from the coarse equilibrium there; `None` where either fails.
    ///
    /// With an equilibrium of the fine mesh at another drive of the same direction as `start`, what the coarse mesh
    /// gets wrong there is taken off in proportion to the drive: the error of a mesh changes far more slowly than what
    /// it is the error of. Two factorisations are left of four or five.
    pub(super) fn lead(
        &mut self,
        fine: &mut Newton,
        drive_mm: f64,
        start: Option<&Equilibrium>,
    ) -> Option<Equilibrium> {
        // A loose coarse solution is enough: its error is the mesh's.
        let loose = SolveOptions { tolerance: 1e-4, ..*fine.options };
        let mut coarse = self.coarse.newton(fine.material, &loose, fine.is_cancelled);
        let start = start.filter(|s| s.drive_mm * drive_mm > 0.0);
        let beside_start = start.and_then(|start| Some((start, coarse.solve(start.drive_mm, None).ok()?)));
        let there = coarse.solve(drive_mm, beside_start.as_ref().map(|(_, at_start)| at_start)).ok();
        let found = there.and_then(|there| {
            let mut first_guess = self.transfer(fine.assembler, fine.material, &there);
            if let Some((start, at_start)) = beside_start {
                let from_coarse = self.transfer(fine.assembler, fine.material, &at_start);
                first_guess.add_difference(drive_mm / start.drive_mm, start, &from_coarse);
            }
            fine.step(&first_guess, None, drive_mm).ok()
        });
        match &found {
            Some(_) => fine.statistics.load_steps += 1,
            None => fine.statistics.failed_steps += 1,
        }
        found
    }

    /// The coarse equilibrium `from` on the mesh of `fine`.
    fn transfer(&self, fine: &Assembler, material: &Material, from: &Equilibrium) -> Equilibrium {
        let (coarse_mesh, mesh) = (self.coarse.assembler.mesh(), fine.mesh());
        let kind = coarse_mesh.element_kind;
        let mut displacement: Vec<[f64; 3]> = self
            .nesting
            .nodes
            .iter()
            .map(|l| {
                let n = kind.shape_functions(l.reference_coordinates);
                let mut u = [0.0; 3];
                for (a, &v) in coarse_mesh.element(l.element as usize).iter().enumerate() {
                    for i in 0..3 {
                        u[i] += n[a] * from.displacement[v as usize][i];
                    }
                }
                u
            })
            .collect();
        for &v in &mesh.fixed_nodes {
            displacement[v as usize] = [0.0; 3];
        }
        for &v in &mesh.moved_nodes {
            displacement[v as usize] = fine.plates().vector(from.drive_mm);
        }
        for &v in &mesh.mirror_y_nodes {
            displacement[v as usize][1] = 0.0;
        }
        for &v in &mesh.mirror_z_nodes {
            displacement[v as usize][2] = 0.0;
        }
        let affine = self.affine_pressures(material, from);
        let mut out = ElementOutput::default();
        let rest = vec![[0.0; 3]; mesh.nodes.len()];
        let at_rest = Configuration { material, positions: &mesh.nodes, displacement: &rest };
        let mut pressure = Vec::with_capacity(mesh.num_elements());
        for e in 0..mesh.num_elements() {
            fine.kernels().residual(fine.tables(), &fine.input(e, &at_rest, None), &mut out);
            let mut p = [0.0; 4];
            for q in 0..fine.tables().num_nodes() {
                let (g, l) = (q / LANES, q % LANES);
                let a = &affine[self.nesting.parents[e] as usize];
                let value =
                    a[0] + a[1] * out.points[0][g].0[l] + a[2] * out.points[1][g].0[l] + a[3] * out.points[2][g].0[l];
                for (m, p) in p.iter_mut().enumerate() {
                    *p += value * out.basis[m][g].0[l] * out.volume[g].0[l];
                }
            }
            pressure.push(p);
        }
        Equilibrium { displacement, pressure, ..from.clone() }
    }

    /// The coarse pressure of each element as a + b·x.
    fn affine_pressures(&self, material: &Material, from: &Equilibrium) -> Vec<[f64; 4]> {
        let coarse = &self.coarse.assembler;
        let at = Configuration { material, positions: &coarse.mesh().nodes, displacement: &from.displacement };
        let mut out = ElementOutput::default();
        (0..coarse.mesh().num_elements())
            .map(|e| {
                coarse.kernels().residual(coarse.tables(), &coarse.input(e, &at, None), &mut out);
                // The basis is orthonormal and spans 1, x, y, z:
                // monomial_n = Σ_m M_mn φ_m with M_mn = ∫ φ_m monomial_n.
                let mut moments = nalgebra::Matrix4::<f64>::zeros();
                for q in 0..coarse.tables().num_nodes() {
                    let (g, l) = (q / LANES, q % LANES);
                    let monomials = [1.0, out.points[0][g].0[l], out.points[1][g].0[l], out.points[2][g].0[l]];
                    for m in 0..4 {
                        for n in 0..4 {
                            moments[(m, n)] += out.basis[m][g].0[l] * out.volume[g].0[l] * monomials[n];
                        }
                    }
                }
                // Σ p_m φ_m = Σ c_n monomial_n ⇒ M c = p.
                let p = nalgebra::Vector4::from(from.pressure[e]);
                moments.lu().solve(&p).map_or([0.0; 4], |c| c.into())
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::ForwardModel;
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
