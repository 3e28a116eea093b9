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
}
