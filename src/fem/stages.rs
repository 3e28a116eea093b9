//! Single stages of a solution, so that benchmarks can time them one by one.

use super::equilibrium::Equilibrium;
use super::error::SolveError;
use super::forward_model::ForwardModel;
use super::mesh_model::MeshModel;
use crate::material::Material;

impl ForwardModel {
    /// Assembles residual and tangent at `equilibrium`; returns the largest residual entry, kPa·mm².
    ///
    /// # Errors
    /// [`SolveError::Diverged`] where an element is inverted.
    pub fn assemble_stage(&mut self, material: &Material, equilibrium: &Equilibrium) -> Result<f64, SolveError> {
        let MeshModel { assembler, linearisation } = &mut self.fine;
        assembler
            .linearise(material, equilibrium, linearisation)
            .map_err(|cause| SolveError::diverged_at(equilibrium.drive_mm, cause))?;
        Ok(assembler.collect(&linearisation.residual, 1.0).iter().fold(0.0, |s, x| s.max(x.abs())))
    }

    /// Factorises the assembled tangent.
    ///
    /// # Errors
    /// [`SolveError::Linear`].
    pub fn factorise_stage(&mut self) -> Result<(), SolveError> {
        Ok(self.fine.linearisation.system.factorise()?)
    }

    /// One solve with the factor, to a relative residual of 10⁻³ (a Newton step's accuracy).
    ///
    /// # Errors
    /// [`SolveError::Linear`].
    pub fn back_solve_stage(&mut self) -> Result<f64, SolveError> {
        let system = &mut self.fine.linearisation.system;
        let right = vec![1.0; system.num_unknowns()];
        let x = system.solve(&[right], 1e-3)?;
        Ok(x[0].iter().fold(0.0, |s, v| s.max(v.abs())))
    }

    /// Floating-point operations, multiplications and additions, of [`ForwardModel::factorise_stage`], which is in
    /// single precision; `None` where the tangent gets no factor of its own.
    pub fn factor_operations(&self) -> Option<f64> {
        self.fine.linearisation.system.factor_operations()
    }

    /// Floating-point operations of the matrix products that the tangents are made of, all elements together: the sums
    /// over levels and over places of the section (`fem/stiffness_kernel.rs`), and Bᵀ D B. What
    /// [`ForwardModel::assemble_stage`] does beside them (kinematics, stresses and moduli of the material, adding up)
    /// is not counted.
    pub fn stiffness_operations(&self) -> f64 {
        let assembler = &self.fine.assembler;
        stiffness_operations(assembler.tables().num) * assembler.mesh().num_elements() as f64
    }
}

/// Of one element of `num` nodes and as many quadrature points; see [`ForwardModel::stiffness_operations`].
fn stiffness_operations(num: usize) -> f64 {
    let section = num / 3;
    // Components k, i of three pairs of levels l > l′ and of three with l = l′.
    let (below, along) = (3 * 9, 3 * 9);
    // At each place of the section, for c and d: three levels.
    let line = section * 9 * 3 * (below + along);
    // Of each place of a node and each of a point, for c: three products.
    let tractions = section * section * 3 * 3 * (below + along);
    // Each entry: three products at each place of a point, and four of the pressure.
    let entries = below * section * section + along * section * (section + 1) / 2;
    let products = line + tractions + entries * (3 * section + 4);
    // A product is added to a sum.
    2.0 * products as f64
}

#[cfg(test)]
mod tests {
    use super::stiffness_operations;
    use crate::fem::ForwardModel;
    use crate::mesh::MeshOptions;
    use crate::specimen::Specimen;

    /// A dense Cholesky factor of n unknowns takes n³/3 operations and needs them all; that of a mesh takes less, and
    /// more than its diagonal blocks alone would.
    #[test]
    fn operations_are_those_of_the_mesh() {
        let specimen = Specimen::from_json(include_str!("../../geometries/solid-shear.json")).expect("shipped");
        let model = ForwardModel::of_specimen(&specimen, &MeshOptions::search(&specimen)).expect("a model");
        let operations = model.factor_operations().expect("a small mesh has a factor");
        let num = model.num_unknowns() as f64;
        assert!(operations < num.powi(3) / 3.0 && operations > 9.0 * num, "{operations} of {num} unknowns");
        // A hexahedron: 9·9·3·54 products along the line, 9·9·9·54 of tractions, 31 of each of 27·(81 + 45) entries.
        let per_element = model.stiffness_operations() / model.mesh().num_elements() as f64;
        assert_eq!(per_element, 2.0 * (13_122.0 + 39_366.0 + 105_462.0));
        assert_eq!(per_element, stiffness_operations(27));
    }
}
