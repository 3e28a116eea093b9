//! The discrete adjoint: the gradient of a function of displacements and force from one linear solve.
//!
//! For J(u, F) with u and F of an equilibrium of the material ξ, r(u, ξ) = 0 and F = m Σ_plate r_x(u, ξ):
//! K z = ∂J/∂u + ∂J/∂F ∂F/∂u, dJ/dξ = −z·∂r/∂ξ + ∂J/∂F ∂F/∂ξ. K is symmetric, so ∂F/∂u is K times the unit motion of the
//! plate.

use super::error::SolveError;
use super::model::ForwardModel;
use super::newton::Equilibrium;
use crate::material::Ogden;

/// Relative accuracy of the adjoint solve, that of the sensitivities.
const ACCURACY: f64 = 1e-8;

impl ForwardModel {
    /// dJ/dξ for every parameter in the order of [`Ogden::parameters`], at an equilibrium of `material`. `by_displacement`
    /// is ∂J/∂u at each node (per mm), `by_force` is ∂J/∂F (per N). For the nominal experiment (no released faces).
    ///
    /// # Errors
    /// [`SolveError::Linear`] if the tangent at the equilibrium is not positive definite.
    pub fn adjoint_gradient(
        &mut self,
        material: &Ogden,
        equilibrium: &Equilibrium,
        by_displacement: &[[f64; 3]],
        by_force: f64,
    ) -> Result<Vec<f64>, SolveError> {
        self.ensure_tangent(material, equilibrium)?;
        let diverged =
            |cause| SolveError::Diverged { reached_mm: equilibrium.drive_mm, asked_mm: equilibrium.drive_mm, cause };
        let positions = self.mesh.nodes.clone();
        let driven = self.driven_elements.clone();
        let force_factor = by_force * self.multiplicity * 1e-3;
        let plate: Vec<[f64; 3]> =
            self.is_moved.iter().map(|m| [if *m { force_factor } else { 0.0 }, 0.0, 0.0]).collect();
        let mut buffer = vec![[0.0; 3]; positions.len()];
        let u = &equilibrium.displacement;
        self.assemble_directional(material, &positions, u, Some(&plate), None, Some(&driven), &mut buffer)
            .map_err(diverged)?;
        for (sum, load) in buffer.iter_mut().zip(by_displacement) {
            for i in 0..3 {
                sum[i] += load[i];
            }
        }
        let right = self.collect(&buffer, 1.0);
        let solution = self.system.solve(&self.topology, &[right], ACCURACY)?;
        let mut weights = self.spread(&solution[0]);
        for (w, p) in weights.iter_mut().zip(&plate) {
            for i in 0..3 {
                w[i] = p[i] - w[i];
            }
        }
        let mut gradient = Vec::new();
        for parameter in material.parameters() {
            self.assemble_directional(material, &positions, u, None, Some(parameter), None, &mut buffer)
                .map_err(diverged)?;
            gradient.push(buffer.iter().zip(&weights).map(|(r, w)| r[0] * w[0] + r[1] * w[1] + r[2] * w[2]).sum());
        }
        Ok(gradient)
    }

    /// Factorisations and iterations of conjugate gradients since the model was made.
    pub fn linear_work(&self) -> [usize; 2] {
        [self.system.num_factorisations, self.system.num_iterations]
    }
}
