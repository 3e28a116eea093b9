//! The gradient of the objective by the discrete adjoint: one linear solve per drive, whatever the number of
//! parameters.
//!
//! The fit itself uses the sensitivities, which also give the curvature. This gradient is independent of them.

use super::all_forces::AllForces;
use super::error::CalibrationError;
use super::problem::CalibrationProblem;
use crate::fem::{Equilibrium, SolveOptions};
use crate::material::Material;

impl CalibrationProblem<'_> {
    /// The objective at `material` and its derivatives by κ, μ₁, α₁, … in their own units. Priors are not in it.
    ///
    /// # Errors
    /// [`CalibrationError`].
    pub fn objective_and_adjoint_gradient(
        &self,
        material: &Material,
        solve: &SolveOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<(f64, Vec<f64>), CalibrationError> {
        self.refuse_unlike_samples("the adjoint gradient")?;
        let objective = self.objective();
        let (observed, models, views) = self.parts();
        let targets = super::target::Target::of_recordings(observed, views, objective)?;
        let mut value = 0.0;
        let mut gradient = vec![0.0; material.parameters().len()];
        let mut states: Vec<Vec<Equilibrium>> = Vec::new();
        for (recording, model) in observed.iter().zip(models) {
            let drives_mm = recording.all_drives_mm();
            states.push(model.with(|model| model.solve_path(material, &drives_mm, solve, is_cancelled))?);
        }
        let forces = AllForces::of(&targets);
        let misfits = forces.misfits(&|r, d| states[r][d].force_n);
        let weighed = forces.weights() * &misfits;
        value += misfits.dot(&weighed);
        let mut by_forces: Vec<Vec<f64>> = states.iter().map(|s| vec![0.0; s.len()]).collect();
        for (&(r, d), weighed) in forces.places().iter().zip(&weighed) {
            by_forces[r][d] = -2.0 * weighed;
        }
        for (r, (model, view)) in models.iter().zip(views).enumerate() {
            for ((state, step), &by_force) in states[r].iter().zip(&targets[r].steps).zip(&by_forces[r]) {
                let seen = view.average(&state.displacement)?;
                let mut load = vec![[0.0; 3]; seen.len()];
                for v in step.used() {
                    for c in 0..3 {
                        let (weight, misfit) = (step.precision[v][c], seen[v][c] - step.measured[v][c]);
                        value += weight * misfit * misfit;
                        load[v][c] = 2.0 * weight * misfit;
                    }
                }
                let nodal = view.average_transposed(&load)?;
                let of_step = model.with(|model| model.tangent(material, state)?.adjoint_gradient(&nodal, by_force))?;
                for (g, d) in gradient.iter_mut().zip(of_step) {
                    *g += d;
                }
            }
        }
        Ok((value, gradient))
    }
}

#[cfg(test)]
mod tests {
    use super::super::system::raw_sums;
    use super::super::test_problem::{coarse, ogden, same_mesh, tight};
    use super::*;
    use crate::calibration::{Objective, Observed, PAPER_BETA};
    use crate::recording::Filter;
    use crate::sensitivity::Protocol;

    /// Adjoint and sensitivities give one gradient, and the Taylor remainder of the objective falls with h²; χ² and the
    /// paper's loss, plain and filtered, on the whole and on a mirrored mesh; voxels are not alike in noise.
    #[test]
    fn adjoint_agrees_with_sensitivities_and_differences() {
        let (_, synthetic) = same_mesh(&ogden(200.0, &[[17.0, 1.91]]));
        let specimen = super::super::test_problem::block();
        let at = ogden(260.0, &[[12.0, 1.7], [0.6, 5.0]]);
        let solve = tight().solve;
        for (objective, filter, use_mirror) in [
            (Objective::Weighted, Filter::None, true),
            (Objective::Paper { beta: PAPER_BETA }, Filter::Hamming2, false),
        ] {
            let recording = synthetic.recording("adjoint", &specimen, &synthetic.draw(1, 0), filter).unwrap();
            // The forces are coupled by a load cell that is not perfect.
            let cell = Protocol { force_gain_sd: 0.02, force_zero_sd_n: 0.1, ..Protocol::default() };
            let plain = Observed::new(&recording, 0.01).unwrap();
            let mut observed = [plain.with_protocol(&recording, &cell, 0.01).unwrap()];
            let num_voxels = observed[0].mask.num_voxels();
            let relative = |v: usize| [1.0 + v as f64 / num_voxels as f64, 0.5, 2.0];
            observed[0].steps[0].relative_noise = Some((0..num_voxels).map(relative).collect());
            let mesh = |s: &_| crate::mesh::MeshOptions { use_mirror, ..coarse(s) };
            let problem = CalibrationProblem::new(&observed, &mesh, objective).unwrap();
            let (value, gradient) = problem.objective_and_adjoint_gradient(&at, &solve, &|| false).unwrap();
            let predictions = problem.predict(&at, None, &solve, &|| false).unwrap();
            let (_, half) = raw_sums(&predictions, &problem.targets().unwrap());
            let parameters = at.parameters();
            for (i, g) in gradient.iter().enumerate() {
                let scale = value / at.value(parameters[i]).abs();
                // Both solves stop at 10⁻⁸ of their loads.
                assert!((g + 2.0 * half[i]).abs() < 1e-6 * scale.max(g.abs()), "{objective:?} {i}: {g} {}", half[i]);
            }
            let slope: f64 = gradient.iter().zip(&parameters).map(|(g, p)| g * at.value(*p)).sum();
            let remainder = |h: f64| {
                let mut moved = at.clone();
                for p in &parameters {
                    moved.set(*p, at.value(*p) * (1.0 + h));
                }
                let (there, _) = problem.objective_and_adjoint_gradient(&moved, &solve, &|| false).unwrap();
                (there - value - h * slope).abs()
            };
            let (a, b, c) = (remainder(8e-3), remainder(4e-3), remainder(2e-3));
            for rate in [(a / b).log2(), (b / c).log2()] {
                // Order 2 up to the third-order part, which is h times the second-order one.
                assert!((rate - 2.0).abs() < 0.1, "{objective:?}: {rate} ({a:e} {b:e} {c:e})");
            }
        }
    }
}
