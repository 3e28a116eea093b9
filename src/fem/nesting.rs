//! How a fine mesh lies in a coarse one of the same sample, and what a state of the one is on the other.

use super::assembler::{Assembler, Configuration};
use super::element_data::ElementOutput;
use super::equilibrium::Equilibrium;
use crate::material::{LANES, Material};
use crate::mesh::{Location, Locator, Mesh};

/// How the nodes and elements of a fine mesh lie in a coarse one.
pub struct Nesting {
    /// Place of each fine node in the coarse mesh.
    nodes: Vec<Location>,
    /// Coarse element of each fine element.
    parents: Vec<u32>,
}

impl Nesting {
    /// Of fine nodes at `nodes` and fine elements in `parents`.
    pub(super) fn new(nodes: Vec<Location>, parents: Vec<u32>) -> Nesting {
        Nesting { nodes, parents }
    }

    /// Of two meshes that need not share their nodes; `None` where a node of `fine` lies outside of `coarse`. (Walls
    /// are concave: a parabola through three points of an arc lies on the arc or in the hole, so that coarse meshes
    /// hold the nodes of finer ones.)
    pub fn located(coarse: &Mesh, fine: &Mesh) -> Option<Nesting> {
        let locator = Locator::new(coarse);
        let center = |e: usize| {
            let nodes = fine.element(e);
            let sum = |i: usize| nodes.iter().map(|&n| fine.nodes[n as usize][i]).sum::<f64>();
            [0, 1, 2].map(|i| sum(i) / nodes.len() as f64)
        };
        let nodes = fine.nodes.iter().map(|&x| locator.locate(coarse, x)).collect::<Option<_>>()?;
        let parent = |e: usize| Some(locator.locate(coarse, center(e))?.element);
        let parents = (0..fine.num_elements()).map(parent).collect::<Option<_>>()?;
        Some(Nesting { nodes, parents })
    }

    /// The state `from` of the coarse mesh on the fine one: a first guess, which is not yet where the plates want it.
    pub(super) fn transfer(
        &self,
        [coarse, fine]: [&Assembler; 2],
        material: &Material,
        from: &Equilibrium,
    ) -> Equilibrium {
        let (coarse_mesh, mesh) = (coarse.mesh(), fine.mesh());
        let kind = coarse_mesh.element_kind;
        let mut displacement: Vec<[f64; 3]> = self
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
        for &v in &mesh.mirror_y_nodes {
            displacement[v as usize][1] = 0.0;
        }
        for &v in &mesh.mirror_z_nodes {
            displacement[v as usize][2] = 0.0;
        }
        let affine = affine_pressures(coarse, material, from);
        let mut out = ElementOutput::default();
        let rest = vec![[0.0; 3]; mesh.nodes.len()];
        let at_rest = Configuration { material, positions: &mesh.nodes, displacement: &rest };
        let mut pressure = Vec::with_capacity(mesh.num_elements());
        for e in 0..mesh.num_elements() {
            fine.kernels().residual(fine.tables(), &fine.input(e, &at_rest, None), &mut out);
            let mut p = [0.0; 4];
            for q in 0..fine.tables().num_nodes() {
                let (g, l) = (q / LANES, q % LANES);
                let a = &affine[self.parents[e] as usize];
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
}

/// The coarse pressure of each element as a + b·x.
fn affine_pressures(coarse: &Assembler, material: &Material, from: &Equilibrium) -> Vec<[f64; 4]> {
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
