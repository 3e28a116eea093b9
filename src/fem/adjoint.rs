//! The discrete adjoint: the gradient of a function of displacements and force from one linear solve.
//!
//! For J(u, F) with u and F of an equilibrium of the material ξ, r(u, ξ) = 0 and F = m Σ_plate r_x(u, ξ):
//!
//! * K z = ∂J/∂u + ∂J/∂F ∂F/∂u,
//! * dJ/dξ = −z·∂r/∂ξ + ∂J/∂F ∂F/∂ξ.
//!
//! K is symmetric, so ∂F/∂u is K times the unit motion of the plate.

use super::error::SolveError;
use super::tangent::Tangent;

/// Relative accuracy of the adjoint solve, that of the sensitivities.
const ACCURACY: f64 = 1e-8;

impl Tangent<'_> {
    /// dJ/dξ for every parameter in the order of [`Material::parameters`](crate::material::Material::parameters).
    /// `by_displacement` is ∂J/∂u at each node (per mm), `by_force` is ∂J/∂F (per N). For the nominal experiment (no
    /// released faces).
    ///
    /// # Errors
    /// [`SolveError::Linear`] if the tangent is not positive definite.
    pub fn adjoint_gradient(&mut self, by_displacement: &[[f64; 3]], by_force: f64) -> Result<Vec<f64>, SolveError> {
        let assembler = self.assembler.clone();
        let plates = assembler.plates();
        let force_factor = by_force * assembler.multiplicity() * 1e-3;
        let plate: Vec<[f64; 3]> =
            plates.is_moved.iter().map(|m| plates.vector(if *m { force_factor } else { 0.0 })).collect();
        let mut buffer = vec![[0.0; 3]; plate.len()];
        let driven = Some(&plates.driven_elements[..]);
        assembler
            .assemble_directional(&self.configuration(), Some(&plate), None, driven, &mut buffer)
            .map_err(|cause| self.diverged(cause))?;
        for (sum, load) in buffer.iter_mut().zip(by_displacement) {
            for i in 0..3 {
                sum[i] += load[i];
            }
        }
        let solution = self.solve_all(&[assembler.collect(&buffer, 1.0)], ACCURACY)?;
        let mut weights = assembler.spread(&solution[0]);
        for (w, p) in weights.iter_mut().zip(&plate) {
            for i in 0..3 {
                w[i] = p[i] - w[i];
            }
        }
        let mut gradient = Vec::new();
        for parameter in self.material.parameters() {
            assembler
                .assemble_directional(&self.configuration(), None, Some(parameter), None, &mut buffer)
                .map_err(|cause| self.diverged(cause))?;
            gradient.push(buffer.iter().zip(&weights).map(|(r, w)| r[0] * w[0] + r[1] * w[1] + r[2] * w[2]).sum());
        }
        Ok(gradient)
    }
}
