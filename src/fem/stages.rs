//! Single stages of a solution, so that benchmarks can time them one by one.

use super::error::{SolveError, StepFailure};
use super::model::ForwardModel;
use super::newton::Equilibrium;
use crate::material::Ogden;

impl ForwardModel {
    /// Assembles residual and tangent at `equilibrium`; returns the largest residual entry, kPa·mm².
    ///
    /// # Errors
    /// [`SolveError::Diverged`] where an element is inverted.
    pub fn assemble_stage(&mut self, material: &Ogden, equilibrium: &Equilibrium) -> Result<f64, SolveError> {
        let mut residual = vec![[0.0; 3]; self.mesh.nodes.len()];
        self.assemble_tangent(
            material,
            equilibrium.drive_mm,
            &equilibrium.displacement,
            Some(&equilibrium.pressure),
            &mut residual,
        )
        .map_err(|cause: StepFailure| SolveError::Diverged {
            reached_mm: equilibrium.drive_mm,
            asked_mm: equilibrium.drive_mm,
            cause,
        })?;
        Ok(self.collect(&residual, 1.0).iter().fold(0.0, |s, x| s.max(x.abs())))
    }

    /// Factorises the assembled tangent.
    ///
    /// # Errors
    /// [`SolveError::Linear`].
    pub fn factorise_stage(&mut self) -> Result<(), SolveError> {
        Ok(self.system.factorise(&self.topology)?)
    }

    /// One solve with the factor, to a relative residual of 10⁻³ (a Newton step's accuracy).
    ///
    /// # Errors
    /// [`SolveError::Linear`].
    pub fn back_solve_stage(&mut self) -> Result<f64, SolveError> {
        let right = vec![1.0; self.topology.num_unknowns()];
        let x = self.system.solve(&self.topology, &[right], 1e-3)?;
        Ok(x[0].iter().fold(0.0, |s, v| s.max(v.abs())))
    }
}
