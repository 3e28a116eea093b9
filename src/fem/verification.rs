//! Prescribed displacements and dead loads: what a patch test and a manufactured solution need.
//!
//! A test of a specimen only moves plates. Verification also needs an arbitrary displacement on a boundary and a load
//! in the interior. The elements, the assembly and the linear solver are those of [`ForwardModel::solve`]; only the
//! boundary values and the right-hand side differ.

use super::error::{SolveError, StepFailure};
use super::model::ForwardModel;
use super::newton::{Equilibrium, SolveOptions};
use crate::material::Ogden;

impl ForwardModel {
    /// Solves with the nodes of `fixed_nodes` and `moved_nodes` kept at their values in `guess`, under nodal dead loads.
    ///
    /// `guess`: displacement of every node, mm; it is also where Newton's method starts, in one load step and without
    /// line search. `load`: force on every node, kPa·mm² (= 10⁻³ N), ignored at kept nodes; `None` for zero. The forces
    /// of the result are the reactions on `moved_nodes`; its `drive_mm` is zero. For verification; not meant for
    /// specimens.
    ///
    /// # Errors
    /// [`SolveError::Diverged`].
    #[doc(hidden)]
    pub fn solve_prescribed(
        &mut self,
        material: &Ogden,
        guess: &[[f64; 3]],
        load: Option<&[[f64; 3]]>,
        options: &SolveOptions,
    ) -> Result<Equilibrium, SolveError> {
        let diverged = |cause| SolveError::Diverged { reached_mm: 0.0, asked_mm: 0.0, cause };
        let mut displacement = guess.to_vec();
        let mut pressure = vec![[0.0; 4]; self.mesh.num_elements()];
        let mut residual = vec![[0.0; 3]; self.mesh.nodes.len()];
        let mut iteration = 0;
        loop {
            self.assemble_tangent(material, 0.0, &displacement, Some(&pressure), &mut residual).map_err(diverged)?;
            if let Some(load) = load {
                for (r, f) in residual.iter_mut().zip(load) {
                    for i in 0..3 {
                        r[i] -= f[i];
                    }
                }
            }
            let right = self.collect(&residual, -1.0);
            let norm = |x: &mut dyn Iterator<Item = f64>| x.map(|v| v * v).sum::<f64>().sqrt();
            let mut kept = self.mesh.moved_nodes.iter().chain(&self.mesh.fixed_nodes);
            let scale = norm(&mut kept.by_ref().flat_map(|&v| residual[v as usize]));
            let relative = norm(&mut right.iter().copied()) / scale.max(1e-6);
            if relative < options.tolerance {
                let state = Equilibrium {
                    drive_mm: 0.0,
                    displacement,
                    pressure,
                    force_n: 0.0,
                    normal_force_n: 0.0,
                    reaction_imbalance: 0.0,
                    serial: 0,
                };
                return Ok(self.finish(state, &residual));
            }
            if !relative.is_finite() || iteration >= options.max_iterations {
                return Err(diverged(StepFailure::NotConverged { iterations: iteration, residual: relative }));
            }
            iteration += 1;
            self.system.factorise(&self.topology)?;
            let x = self.system.solve(&self.topology, &[right], 1e-10)?;
            let delta = self.spread(&x[0]);
            for (p, d) in pressure.iter_mut().zip(self.pressure_update(&delta)) {
                for m in 0..4 {
                    p[m] += d[m];
                }
            }
            for (u, d) in displacement.iter_mut().zip(&delta) {
                for i in 0..3 {
                    u[i] += d[i];
                }
            }
        }
    }
}
