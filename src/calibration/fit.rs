//! Maximum-likelihood fit of Ogden parameters to voxel displacements and forces.
//!
//! Minimises χ² = Σ_drives [ Σ_voxels |u_model − u|²/σ² + (F_model − F)²/σ_F² ] by Levenberg–Marquardt in scaled parameters
//! (ln κ; μ, α relative to their present values), with ∂u/∂ξ and ∂F/∂ξ from the factorised tangent. The step solves a
//! quadratic program with Clarabel: stability μᵢαᵢ > 0 keeps each parameter's sign, and a step changes none by more than a
//! given fraction. The model is averaged over the voxels as the data are.

use super::synthetic::Measurement;
use crate::fem::{Equilibrium, ForwardModel, PrepareError, SolveError, SolveOptions};
use crate::material::{Ogden, Parameter};
use crate::sensitivity::{FisherInformation, InformationError, ScanSettings};
use crate::voxel::{VoxelError, VoxelOperator};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus};
use nalgebra::{DMatrix, DVector};

/// Why a calibration has no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// No model of the specimen.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    /// No equilibrium at the start or at a trial.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// Grid and specimen do not fit.
    #[error(transparent)]
    Voxel(#[from] VoxelError),
    /// Noise or sensitivities are unusable.
    #[error(transparent)]
    Information(#[from] InformationError),
    /// The fit did not settle.
    #[error(
        "the fit did not converge in {iterations} iterations (last relative step {step:.2e}); start closer or raise the limit"
    )]
    NotConverged {
        /// Iterations made.
        iterations: usize,
        /// Largest scaled step of the last one.
        step: f64,
    },
}

/// Settings of [`fit`].
#[derive(Clone, Copy, Debug)]
pub struct FitOptions {
    /// Levenberg–Marquardt iterations.
    pub max_iterations: usize,
    /// Converged when no scaled parameter moves by more than this fraction of its standard deviation.
    pub tolerance: f64,
    /// The equilibria.
    pub solve: SolveOptions,
}

impl Default for FitOptions {
    fn default() -> Self {
        FitOptions { max_iterations: 25, tolerance: 0.02, solve: SolveOptions::default() }
    }
}

/// A fitted material.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The estimate.
    pub material: Ogden,
    /// Fisher information at the estimate.
    pub information: FisherInformation,
    /// χ² per datum.
    pub chi2_per_datum: f64,
    /// Iterations made.
    pub iterations: usize,
    /// Equilibria of the estimate, one per drive: a warm start for the next fit.
    pub states: Vec<Equilibrium>,
}

/// A parameter and a step change it by at most this fraction (κ: this in ln κ).
const MAX_CHANGE: f64 = 0.4;

/// Fits `start` to `data`. `warm` are equilibria of any material at the same drives, if there are some.
///
/// # Errors
/// [`CalibrationError`].
pub fn fit(
    model: &mut ForwardModel,
    operator: &VoxelOperator,
    scan: &ScanSettings,
    data: &Measurement,
    start: &Ogden,
    warm: Option<&[Equilibrium]>,
    options: &FitOptions,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Fit, CalibrationError> {
    let mut material = start.clone();
    let mut states = solve_all(model, &material, data, warm, options, is_cancelled)?;
    let mut system = NormalSystem::new(model, operator, scan, data, &material, &states)?;
    let mut damping = 1e-4;
    let mut last_step = f64::INFINITY;
    for iteration in 1..=options.max_iterations {
        let Some(step) = system.step(damping) else {
            damping *= 10.0;
            continue;
        };
        let trial = system.moved(&material, &step);
        let tried = solve_all(model, &trial, data, Some(&states), options, is_cancelled)
            .and_then(|s| Ok((NormalSystem::new(model, operator, scan, data, &trial, &s)?, s)));
        if let Err(CalibrationError::Solve(SolveError::Cancelled { .. })) = tried {
            tried?;
            continue;
        }
        match tried {
            // Equal up to rounding counts: at the optimum nothing is gained any more.
            Ok((next, next_states)) if next.chi2 <= system.chi2 * (1.0 + 1e-9) => {
                last_step = system.step_in_sd(&step);
                material = trial;
                states = next_states;
                system = next;
                damping = (damping * 0.1).max(1e-12);
                if last_step < options.tolerance {
                    return Ok(Fit {
                        material,
                        information: system.information,
                        chi2_per_datum: system.chi2 / system.num_data as f64,
                        iterations: iteration,
                        states,
                    });
                }
            }
            _ => damping = (damping * 10.0).max(1e-6),
        }
    }
    Err(CalibrationError::NotConverged { iterations: options.max_iterations, step: last_step })
}

fn solve_all(
    model: &mut ForwardModel,
    material: &Ogden,
    data: &Measurement,
    warm: Option<&[Equilibrium]>,
    options: &FitOptions,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Vec<Equilibrium>, CalibrationError> {
    let mut states: Vec<Equilibrium> = Vec::with_capacity(data.drives_mm.len());
    for (index, &drive) in data.drives_mm.iter().enumerate() {
        let near = warm.and_then(|w| w.get(index)).or(states.last());
        let state = model
            .solve(material, drive, near, &options.solve, is_cancelled)
            .or_else(|_| model.solve(material, drive, None, &options.solve, is_cancelled))?;
        states.push(state);
    }
    Ok(states)
}

/// χ², its gradient and Gauss–Newton matrix in scaled parameters.
struct NormalSystem {
    parameters: Vec<Parameter>,
    values: Vec<f64>,
    information: FisherInformation,
    matrix: DMatrix<f64>,
    gradient: DVector<f64>,
    chi2: f64,
    num_data: usize,
}

impl NormalSystem {
    fn new(
        model: &mut ForwardModel,
        operator: &VoxelOperator,
        scan: &ScanSettings,
        data: &Measurement,
        material: &Ogden,
        states: &[Equilibrium],
    ) -> Result<NormalSystem, CalibrationError> {
        let parameters = material.parameters();
        let n = parameters.len();
        let values: Vec<f64> = parameters.iter().map(|p| material.value(*p)).collect();
        let mut information = FisherInformation::none(material);
        let mut gradient = DVector::zeros(n);
        let (mut chi2, mut num_data) = (0.0, 0);
        let weights = scan.noise_sd_mm.map(|sd| 1.0 / (sd * sd));
        for (d, state) in states.iter().enumerate() {
            let sensitivities = model.material_sensitivities(material, state)?;
            let model_displacement = operator.average(&state.displacement)?;
            let averaged =
                sensitivities.iter().map(|s| operator.average(&s.displacement)).collect::<Result<Vec<_>, _>>()?;
            let forces: Vec<f64> = sensitivities.iter().map(|s| s.force_n).collect();
            for (v, (m, u)) in model_displacement.iter().zip(&data.displacements[d]).enumerate() {
                for c in 0..3 {
                    let misfit = u[c] - m[c];
                    if !misfit.is_finite() {
                        continue;
                    }
                    let weight = weights[c] * data.weights[v];
                    chi2 += weight * misfit * misfit;
                    num_data += 1;
                    for (g, s) in gradient.iter_mut().zip(&averaged) {
                        *g += weight * misfit * s[v][c];
                    }
                }
            }
            let force_misfit = data.forces_n[d] - state.force_n;
            let weight = 1.0 / (scan.force_sd_n * scan.force_sd_n);
            chi2 += weight * force_misfit * force_misfit;
            num_data += 1;
            for (g, f) in gradient.iter_mut().zip(&forces) {
                *g += weight * force_misfit * f;
            }
            let weights = &data.weights;
            information.add(&FisherInformation::of_drive(material, &averaged, weights, &forces, &scan.noise())?)?;
        }
        let scales = DVector::from_iterator(n, values.iter().map(|v| v.abs().max(1e-9)));
        let matrix = DMatrix::from_fn(n, n, |i, j| information.matrix()[(i, j)] * scales[i] * scales[j]);
        let gradient = gradient.component_mul(&scales);
        Ok(NormalSystem { parameters, values, information, matrix, gradient, chi2, num_data })
    }

    /// Levenberg–Marquardt step within the bounds; `None` where Clarabel has no usable answer.
    fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let n = self.values.len();
        let (mut pointers, mut rows, mut entries) = (vec![0], Vec::new(), Vec::new());
        for j in 0..n {
            for i in 0..=j {
                let extra = if i == j { damping * self.matrix[(i, i)].max(1e-12) } else { 0.0 };
                rows.push(i);
                entries.push(self.matrix[(i, j)] + extra);
            }
            pointers.push(rows.len());
        }
        // Scaled to a unit largest entry: interior-point tolerances are absolute.
        let largest = entries.iter().fold(1e-300f64, |s, x| s.max(x.abs()));
        for e in &mut entries {
            *e /= largest;
        }
        let p = CscMatrix::new(n, n, pointers, rows, entries);
        let q: Vec<f64> = self.gradient.iter().map(|g| -g / largest).collect();
        let mut pointers = vec![0];
        let (mut rows, mut entries) = (Vec::new(), Vec::new());
        for j in 0..n {
            rows.extend([j, n + j]);
            entries.extend([1.0, -1.0]);
            pointers.push(rows.len());
        }
        let a = CscMatrix::new(2 * n, n, pointers, rows, entries);
        let b = vec![MAX_CHANGE; 2 * n];
        let settings = DefaultSettingsBuilder::default()
            .verbose(false)
            .tol_gap_abs(1e-14)
            .tol_gap_rel(1e-12)
            .tol_feas(1e-12)
            .build()
            .ok()?;
        let mut solver = DefaultSolver::new(&p, &q, &a, &b, &[NonnegativeConeT(2 * n)], settings).ok()?;
        solver.solve();
        let is_usable = matches!(
            solver.solution.status,
            SolverStatus::Solved | SolverStatus::AlmostSolved | SolverStatus::InsufficientProgress
        );
        let inside = DVector::from_column_slice(&solver.solution.x);
        // Where no bound is active the normal equations give the same step to more digits.
        let free = (&self.matrix + DMatrix::from_diagonal(&(self.matrix.diagonal() * damping))).cholesky();
        if let Some(exact) = free.map(|c| c.solve(&self.gradient))
            && exact.amax() <= MAX_CHANGE
        {
            return Some(exact);
        }
        (is_usable && inside.iter().all(|x| x.is_finite())).then_some(inside)
    }

    fn moved(&self, material: &Ogden, step: &DVector<f64>) -> Ogden {
        let mut next = material.clone();
        for (i, &parameter) in self.parameters.iter().enumerate() {
            let value = self.values[i];
            let change = step[i].clamp(-MAX_CHANGE, MAX_CHANGE);
            next.set(
                parameter,
                if parameter == Parameter::Kappa { value * change.exp() } else { value * (1.0 + change) },
            );
        }
        next
    }

    /// The step measured in standard deviations of the parameters.
    fn step_in_sd(&self, step: &DVector<f64>) -> f64 {
        let covariance = self.information.covariance();
        (0..step.len())
            .map(|i| match covariance.relative_sd(i) {
                Some(sd) => step[i].abs() / sd,
                None => 0.0,
            })
            .fold(0.0, f64::max)
    }
}
