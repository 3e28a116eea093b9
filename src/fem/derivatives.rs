//! Exact derivatives of an equilibrium from its factorised tangent.
//!
//! With the condensed residual r(u, X, ξ) (displacements, node positions, material):
//!
//! * material: K s = −∂r/∂ξ, s = ∂u/∂ξ;
//! * along a path X + tV, drive + tḋ: K u′ = −d/dt r(u + t ḋ w, X + tV), u′ the derivative *following the node*;
//! * of s along that path: K s′ = −d/dt [∂r/∂ξ + K s](u + t u′, X + tV) at fixed s.
//!
//! The derivatives of r in u and ξ are closed forms. Those along a path are fourth-order central differences of
//! closed-form element vectors (no solve is differenced): with t a 1/500 of the smallest element their error is
//! (1/500)⁴ κ/μ ≈ 10⁻⁸ at κ/μ = 10³.

use super::error::{SolveError, StepFailure};
use super::model::ForwardModel;
use super::newton::Equilibrium;
use crate::material::{Ogden, Parameter};

/// Derivative of an equilibrium with respect to one material parameter.
#[derive(Clone, Debug)]
pub struct ParameterSensitivity {
    /// The parameter ξ.
    pub parameter: Parameter,
    /// ∂u/∂ξ at each node, mm per unit of ξ.
    pub displacement: Vec<[f64; 3]>,
    /// ∂F/∂ξ, N per unit of ξ (as [`Equilibrium::force_n`]).
    pub force_n: f64,
}

/// Derivative of an equilibrium and of its material sensitivities along a path of node positions and drive.
#[derive(Clone, Debug)]
pub struct PathSensitivity {
    /// du/dt following each node, mm per unit of t.
    pub displacement: Vec<[f64; 3]>,
    /// dF/dt, N per unit of t.
    pub force_n: f64,
    /// d/dt of the sensitivities given, in their order (displacements following each node).
    pub parameters: Vec<ParameterSensitivity>,
}

/// Relative accuracy of the linear solves (two iterations with the single-precision factor).
const ACCURACY: f64 = 1e-8;

impl ForwardModel {
    /// Makes the stored tangent that of `equilibrium`, and a factor near it.
    pub(super) fn ensure_tangent(&mut self, material: &Ogden, equilibrium: &Equilibrium) -> Result<(), SolveError> {
        if self.tangent_at == equilibrium.serial && equilibrium.serial != 0 && self.system.has_factor() {
            return Ok(());
        }
        let mut residual = vec![[0.0; 3]; self.mesh.nodes.len()];
        self.assemble_tangent(
            material,
            equilibrium.drive_mm,
            &equilibrium.displacement,
            Some(&equilibrium.pressure),
            &mut residual,
        )
        .map_err(|cause| at(equilibrium, cause))?;
        self.system.factorise(&self.topology)?;
        self.tangent_at = equilibrium.serial;
        Ok(())
    }

    /// ∂u/∂ξ and ∂F/∂ξ for every parameter, in the order of [`Ogden::parameters`], at an equilibrium of `material`.
    ///
    /// # Errors
    /// [`SolveError::Linear`] if the tangent at the equilibrium is not positive definite.
    pub fn material_sensitivities(
        &mut self,
        material: &Ogden,
        equilibrium: &Equilibrium,
    ) -> Result<Vec<ParameterSensitivity>, SolveError> {
        self.ensure_tangent(material, equilibrium)?;
        let num_nodes = self.mesh.nodes.len();
        let parameters = material.parameters();
        let positions = self.mesh.nodes.clone();
        let mut derivative = vec![[0.0; 3]; num_nodes];
        let mut right = Vec::with_capacity(parameters.len());
        for &parameter in &parameters {
            self.assemble_directional(
                material,
                &positions,
                &equilibrium.displacement,
                None,
                Some(parameter),
                None,
                &mut derivative,
            )
            .map_err(|cause| at(equilibrium, cause))?;
            right.push(self.collect(&derivative, -1.0));
        }
        let solutions = self.solve_all(&right)?;
        let driven = self.driven_elements.clone();
        let mut all = Vec::with_capacity(parameters.len());
        for (&parameter, x) in parameters.iter().zip(&solutions) {
            let displacement = self.spread(x);
            self.assemble_directional(
                material,
                &positions,
                &equilibrium.displacement,
                Some(&displacement),
                Some(parameter),
                Some(&driven),
                &mut derivative,
            )
            .map_err(|cause| at(equilibrium, cause))?;
            let force_n = self.reaction(&derivative)[0] * self.multiplicity * 1e-3;
            all.push(ParameterSensitivity { parameter, displacement, force_n });
        }
        Ok(all)
    }

    /// Derivatives along t ↦ (node positions X + t `velocity`, drive + t `drive_rate`) at t = 0; `sensitivities` are those
    /// of the same equilibrium (may be empty). `velocity` in mm per unit of t at each node (`None`: the mesh stays).
    ///
    /// # Errors
    /// [`SolveError::Linear`] if the tangent is not positive definite.
    pub fn path_sensitivity(
        &mut self,
        material: &Ogden,
        equilibrium: &Equilibrium,
        sensitivities: &[ParameterSensitivity],
        velocity: Option<&[[f64; 3]]>,
        drive_rate: f64,
    ) -> Result<PathSensitivity, SolveError> {
        self.ensure_tangent(material, equilibrium)?;
        let num_nodes = self.mesh.nodes.len();
        let still = vec![[0.0; 3]; num_nodes];
        let velocity = velocity.unwrap_or(&still);
        let mut drive = vec![[0.0; 3]; num_nodes];
        for &v in &self.mesh.moved_nodes {
            drive[v as usize][0] = drive_rate;
        }
        let speed = velocity.iter().chain(&drive).flatten().fold(0.0f64, |s, x| s.max(x.abs()));
        let t = self.difference_length() / speed.max(1e-12);
        let derivative = self.residual_along(material, equilibrium, velocity, &drive, t, false)?;
        let x = self.solve_all(&[self.collect(&derivative, -1.0)])?;
        let mut displacement = self.spread(&x[0]);
        for (u, d) in displacement.iter_mut().zip(&drive) {
            for i in 0..3 {
                u[i] += d[i];
            }
        }
        let speed = velocity.iter().chain(&displacement).flatten().fold(0.0f64, |s, x| s.max(x.abs()));
        let t = self.difference_length() / speed.max(1e-12);
        let force = self.residual_along(material, equilibrium, velocity, &displacement, t, true)?;
        let force_n = self.reaction(&force)[0] * self.multiplicity * 1e-3;
        let mut gradients = Vec::with_capacity(sensitivities.len());
        let mut right = Vec::with_capacity(sensitivities.len());
        for s in sensitivities {
            let g = self.linearisation_along(material, equilibrium, s, velocity, &displacement, t)?;
            right.push(self.collect(&g, -1.0));
            gradients.push(self.reaction(&g)[0]);
        }
        let solutions = self.solve_all(&right)?;
        let driven = self.driven_elements.clone();
        let positions = self.mesh.nodes.clone();
        let mut buffer = vec![[0.0; 3]; num_nodes];
        let mut parameters = Vec::with_capacity(sensitivities.len());
        for ((s, x), g) in sensitivities.iter().zip(&solutions).zip(&gradients) {
            let change = self.spread(x);
            self.assemble_directional(
                material,
                &positions,
                &equilibrium.displacement,
                Some(&change),
                None,
                Some(&driven),
                &mut buffer,
            )
            .map_err(|cause| at(equilibrium, cause))?;
            parameters.push(ParameterSensitivity {
                parameter: s.parameter,
                displacement: change,
                force_n: (g + self.reaction(&buffer)[0]) * self.multiplicity * 1e-3,
            });
        }
        Ok(PathSensitivity { displacement, force_n, parameters })
    }

    /// A 1/500 of the shortest element edge, roughly: the cube root of the smallest element volume over 500, mm.
    fn difference_length(&self) -> f64 {
        let mut shortest = f64::INFINITY;
        for e in 0..self.mesh.num_elements() {
            let nodes = self.mesh.element(e);
            for pair in nodes.windows(2) {
                let (a, b) = (self.mesh.nodes[pair[0] as usize], self.mesh.nodes[pair[1] as usize]);
                let d: f64 = (0..3).map(|i| (a[i] - b[i]).powi(2)).sum();
                shortest = shortest.min(d);
            }
        }
        2.0 * shortest.sqrt() / 500.0
    }

    /// d/dt r(u + t `rate`, X + t `velocity`).
    fn residual_along(
        &mut self,
        material: &Ogden,
        equilibrium: &Equilibrium,
        velocity: &[[f64; 3]],
        rate: &[[f64; 3]],
        t: f64,
        only_driven: bool,
    ) -> Result<Vec<[f64; 3]>, SolveError> {
        let driven = self.driven_elements.clone();
        let list = only_driven.then_some(&driven[..]);
        self.difference(equilibrium, velocity, rate, t, |model, x, u, out| {
            model.assemble_residual_at(material, x, u, list, out)
        })
    }

    /// d/dt [∂r/∂ξ + K s](u + t `rate`, X + t `velocity`).
    fn linearisation_along(
        &mut self,
        material: &Ogden,
        equilibrium: &Equilibrium,
        sensitivity: &ParameterSensitivity,
        velocity: &[[f64; 3]],
        rate: &[[f64; 3]],
        t: f64,
    ) -> Result<Vec<[f64; 3]>, SolveError> {
        let direction = Some(&sensitivity.displacement[..]);
        self.difference(equilibrium, velocity, rate, t, |model, x, u, out| {
            model.assemble_directional(material, x, u, direction, Some(sensitivity.parameter), None, out)
        })
    }

    /// Fourth-order central difference of a nodal vector along the path.
    fn difference(
        &mut self,
        equilibrium: &Equilibrium,
        velocity: &[[f64; 3]],
        rate: &[[f64; 3]],
        t: f64,
        mut vector: impl FnMut(&mut Self, &[[f64; 3]], &[[f64; 3]], &mut [[f64; 3]]) -> Result<(), StepFailure>,
    ) -> Result<Vec<[f64; 3]>, SolveError> {
        let num_nodes = self.mesh.nodes.len();
        let mut sum = vec![[0.0; 3]; num_nodes];
        let mut value = vec![[0.0; 3]; num_nodes];
        for (multiple, weight) in [(1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0)] {
            let move_by = |base: &[[f64; 3]], by: &[[f64; 3]]| -> Vec<[f64; 3]> {
                base.iter().zip(by).map(|(a, b)| [0, 1, 2].map(|i| a[i] + multiple * t * b[i])).collect()
            };
            let positions = move_by(&self.mesh.nodes, velocity);
            let displacement = move_by(&equilibrium.displacement, rate);
            vector(self, &positions, &displacement, &mut value).map_err(|cause| at(equilibrium, cause))?;
            for (s, v) in sum.iter_mut().zip(&value) {
                for i in 0..3 {
                    s[i] += weight / (12.0 * t) * v[i];
                }
            }
        }
        Ok(sum)
    }

    fn solve_all(&mut self, right: &[Vec<f64>]) -> Result<Vec<Vec<f64>>, SolveError> {
        let mut all = Vec::with_capacity(right.len());
        for chunk in right.chunks(4) {
            all.extend(self.system.solve(&self.topology, chunk, ACCURACY)?);
        }
        Ok(all)
    }
}

fn at(equilibrium: &Equilibrium, cause: StepFailure) -> SolveError {
    SolveError::Diverged { reached_mm: equilibrium.drive_mm, asked_mm: equilibrium.drive_mm, cause }
}
