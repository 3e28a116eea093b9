//! Prescribed displacements and dead loads: what a patch test and a manufactured solution need.
//!
//! A test of a specimen only moves plates. Verification also needs an arbitrary displacement on a boundary and a load
//! in the interior. The elements, the assembly and the linear solver are those of [`ForwardModel::solve`]; only the
//! boundary values and the right-hand side differ.

use super::condensation::pressure_update;
use super::equilibrium::Equilibrium;
use super::error::{SolveError, StepFailure};
use super::forward_model::ForwardModel;
use super::mesh_model::MeshModel;
use super::newton::finished;
use super::options::SolveOptions;
use crate::material::Material;

impl ForwardModel {
    /// Solves with the nodes of `fixed_nodes` and `moved_nodes` kept at their values in `guess`, under nodal dead
    /// loads.
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
        material: &Material,
        guess: &[[f64; 3]],
        load: Option<&[[f64; 3]]>,
        options: &SolveOptions,
    ) -> Result<Equilibrium, SolveError> {
        let diverged = |cause| SolveError::diverged_at(0.0, cause);
        let MeshModel { assembler, linearisation } = &mut self.fine;
        let mesh = assembler.mesh();
        let mut trial = Equilibrium::at_rest(mesh.nodes.len(), mesh.num_elements());
        trial.displacement.copy_from_slice(guess);
        let mut iteration = 0;
        loop {
            assembler.linearise(material, &trial, linearisation).map_err(diverged)?;
            if let Some(load) = load {
                for (r, f) in linearisation.residual.iter_mut().zip(load) {
                    for i in 0..3 {
                        r[i] -= f[i];
                    }
                }
            }
            let residual = &linearisation.residual;
            let right = assembler.collect(residual, -1.0);
            let norm = |x: &mut dyn Iterator<Item = f64>| x.map(|v| v * v).sum::<f64>().sqrt();
            let mut kept = mesh.moved_nodes.iter().chain(&mesh.fixed_nodes);
            let scale = norm(&mut kept.by_ref().flat_map(|&v| residual[v as usize]));
            let relative = norm(&mut right.iter().copied()) / scale.max(1e-6);
            if relative < options.tolerance {
                return Ok(finished(assembler, linearisation, trial));
            }
            if !relative.is_finite() || iteration >= options.max_iterations {
                return Err(diverged(StepFailure::NotConverged { iterations: iteration, residual: relative }));
            }
            iteration += 1;
            linearisation.system.factorise()?;
            let x = linearisation.system.solve(&[right], 1e-10)?;
            let delta = assembler.spread(&x[0]);
            let delta_pressure = pressure_update(mesh, &linearisation.condensation, &delta);
            for (p, d) in trial.pressure.iter_mut().zip(delta_pressure) {
                for m in 0..4 {
                    p[m] += d[m];
                }
            }
            for (u, d) in trial.displacement.iter_mut().zip(&delta) {
                for i in 0..3 {
                    u[i] += d[i];
                }
            }
        }
    }
}
