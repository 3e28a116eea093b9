//! Nested iteration: the equilibrium of a coarse mesh as first guess on a fine one.
//!
//! A load step on a fine mesh costs five to twelve factorisations from rest; from the interpolated coarse solution it
//! takes one to three. The coarse model costs a few percent of one fine factorisation.

use super::element_data::ElementOutput;
use super::error::SolveError;
use super::model::ForwardModel;
use super::newton::Equilibrium;
use crate::material::{LANES, Ogden};
use crate::mesh::{Location, MeshError, MeshOptions, mesh_specimen, refined};
use crate::specimen::Specimen;

/// A specimen could not be meshed, or its mesh not be solved on.
#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    /// No mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// No model.
    #[error(transparent)]
    Solve(#[from] SolveError),
}

/// Meshes of fewer elements are solved from rest.
const WORTHWHILE: usize = 1_000;

impl ForwardModel {
    /// Meshes `specimen` and prepares it, with a coarse model for first guesses where the mesh is large.
    ///
    /// # Errors
    /// [`PrepareError`].
    pub fn of_specimen(specimen: &Specimen, options: &MeshOptions) -> Result<ForwardModel, PrepareError> {
        let mesh = mesh_specimen(specimen, options)?;
        if mesh.num_elements() < WORTHWHILE {
            return Ok(ForwardModel::new(mesh, specimen)?);
        }
        // Twice the element size, then split: about the same mesh, with a coarse one inside it.
        let coarser = MeshOptions {
            section_size_mm: 2.0 * options.section_size_mm,
            levels: (options.levels / 2).max(2),
            hole_segments: (options.hole_segments / 2).max(8),
            radial_layers: (options.radial_layers / 2).max(1),
            ..*options
        };
        let nested = mesh_specimen(specimen, &coarser).ok().and_then(|coarse| Some((refined(&coarse)?, coarse)));
        let Some((refinement, coarse)) = nested else {
            return Ok(ForwardModel::new(mesh, specimen)?);
        };
        let mut fine = ForwardModel::new(refinement.mesh, specimen)?;
        fine.guide = Some(Box::new(Guide {
            coarse: ForwardModel::new(coarse, specimen)?,
            nodes: refinement.nodes,
            parents: refinement.parents,
        }));
        Ok(fine)
    }
}

/// A coarse model and how the fine mesh lies in it.
pub(super) struct Guide {
    pub(super) coarse: ForwardModel,
    nodes: Vec<Location>,
    parents: Vec<u32>,
}

impl Guide {
    /// The coarse equilibrium `from` on the fine mesh of `fine`.
    pub(super) fn transfer(&self, fine: &ForwardModel, material: &Ogden, from: &Equilibrium) -> Equilibrium {
        let kind = self.coarse.mesh.element_kind;
        let mut displacement: Vec<[f64; 3]> = self
            .nodes
            .iter()
            .map(|l| {
                let n = kind.shape_functions(l.reference_coordinates);
                let mut u = [0.0; 3];
                for (a, &v) in self.coarse.mesh.element(l.element as usize).iter().enumerate() {
                    for i in 0..3 {
                        u[i] += n[a] * from.displacement[v as usize][i];
                    }
                }
                u
            })
            .collect();
        for &v in &fine.mesh.fixed_nodes {
            displacement[v as usize] = [0.0; 3];
        }
        for &v in &fine.mesh.moved_nodes {
            displacement[v as usize] = [from.drive_mm, 0.0, 0.0];
        }
        for &v in &fine.mesh.mirror_y_nodes {
            displacement[v as usize][1] = 0.0;
        }
        for &v in &fine.mesh.mirror_z_nodes {
            displacement[v as usize][2] = 0.0;
        }
        let affine = self.affine_pressures(material, from);
        let mut out = ElementOutput::default();
        let rest = vec![[0.0; 3]; fine.mesh.nodes.len()];
        let mut pressure = Vec::with_capacity(fine.mesh.num_elements());
        for e in 0..fine.mesh.num_elements() {
            let input = fine.input(e, &fine.mesh.nodes, &rest, None, material);
            fine.kernels.residual(&fine.tables, &input, &mut out);
            let mut p = [0.0; 4];
            for q in 0..fine.tables.num_nodes() {
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

    /// The coarse pressure of each element as a + b·x.
    fn affine_pressures(&self, material: &Ogden, from: &Equilibrium) -> Vec<[f64; 4]> {
        let model = &self.coarse;
        let mut out = ElementOutput::default();
        (0..model.mesh.num_elements())
            .map(|e| {
                let input = model.input(e, &model.mesh.nodes, &from.displacement, None, material);
                model.kernels.residual(&model.tables, &input, &mut out);
                // The basis is orthonormal and spans 1, x, y, z: monomial_n = Σ_m M_mn φ_m with M_mn = ∫ φ_m monomial_n.
                let mut moments = nalgebra::Matrix4::<f64>::zeros();
                for q in 0..model.tables.num_nodes() {
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
