//! Nested iteration: the equilibrium of a coarse mesh as first guess on a fine one.
//!
//! A load step on a fine mesh costs five to twelve factorisations from rest; from the interpolated coarse solution it
//! takes one to three. The coarse model costs a few percent of one fine factorisation.

use super::error::SolveError;
use super::kernel::ElementOutput;
use super::model::ForwardModel;
use super::newton::Equilibrium;
use crate::material::{LANES, Ogden};
use crate::mesh::{Locator, MeshError, MeshOptions, mesh_specimen};
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

/// Element size of the coarse mesh relative to the fine one. In three dimensions this is a tenth of the unknowns and
/// a hundredth of the factorisation.
const COARSENING: f64 = 2.4;

/// Fine meshes smaller than this many unknowns are solved from rest.
const WORTHWHILE: usize = 16_000;

impl ForwardModel {
    /// Meshes `specimen` and prepares it, with a coarse model for first guesses where the mesh is large.
    ///
    /// # Errors
    /// [`PrepareError`].
    pub fn of_specimen(specimen: &Specimen, options: &MeshOptions) -> Result<ForwardModel, PrepareError> {
        let mut fine = ForwardModel::new(mesh_specimen(specimen, options)?, specimen)?;
        if fine.num_unknowns() >= WORTHWHILE {
            let coarser = MeshOptions {
                section_size_mm: options.section_size_mm * COARSENING,
                levels: ((options.levels as f64 / COARSENING).round() as usize).max(2),
                ..options.clone()
            };
            // A coarse mesh that fails (a thin ligament, say) costs the short cut, not the solution.
            if let Ok(mesh) = mesh_specimen(specimen, &coarser)
                && let Ok(coarse) = ForwardModel::new(mesh, specimen)
            {
                fine.guide(coarse);
            }
        }
        Ok(fine)
    }

    /// Takes first guesses from `coarse`, another mesh of the same specimen with the same mirror planes.
    pub fn guide(&mut self, coarse: ForwardModel) {
        let locator = Locator::new(coarse.mesh());
        let located: Option<Vec<_>> = self.mesh.nodes.iter().map(|&x| locate_near(&locator, &coarse, x)).collect();
        self.guide = located.map(|nodes| Box::new(Guide { coarse, locator, nodes }));
    }
}

/// A coarse model and where the fine nodes lie in it.
pub(super) struct Guide {
    pub(super) coarse: ForwardModel,
    locator: Locator,
    nodes: Vec<crate::mesh::Location>,
}

/// Curved walls of two meshes differ by the chord error: a point just outside is pulled towards the inside.
fn locate_near(locator: &Locator, coarse: &ForwardModel, x: [f64; 3]) -> Option<crate::mesh::Location> {
    if let Some(found) = locator.locate(coarse.mesh(), x) {
        return Some(found);
    }
    // Try a few directions at growing distances; only a first guess depends on it.
    for distance in [1e-3, 1e-2, 3e-2, 1e-1, 0.3] {
        for direction in 0..26 {
            let code = if direction < 13 { direction } else { direction + 1 };
            let offset = [code % 3, (code / 3) % 3, code / 9].map(|c| (c as f64 - 1.0) * distance);
            if let Some(found) = locator.locate(coarse.mesh(), [x[0] + offset[0], x[1] + offset[1], x[2] + offset[2]]) {
                return Some(found);
            }
        }
    }
    None
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
                let x = [0, 1, 2].map(|i| out.points[i][g].0[l]);
                let value = self.locator.locate(&self.coarse.mesh, x).map_or(0.0, |found| {
                    let a = &affine[found.element as usize];
                    a[0] + a[1] * x[0] + a[2] * x[1] + a[3] * x[2]
                });
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
