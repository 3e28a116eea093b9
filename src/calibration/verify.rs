//! Verification of a design: calibrate on many noisy synthetic scans and set the spread found beside the spread promised.

use super::fit::{CalibrationError, FitOptions, fit};
use super::synthetic::SyntheticScan;
use crate::fem::{Equilibrium, ForwardModel, SolveOptions};
use crate::material::{Ogden, Parameter};
use crate::mesh::MeshOptions;
use crate::sensitivity::{FisherInformation, IDENTIFIABILITY_LIMIT, ScanSettings};
use crate::specimen::Specimen;
use crate::voxel::{Sampling, VoxelOperator};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// One parameter over all draws.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterSpread {
    /// `kappa`, `mu_1`, …
    pub parameter: String,
    /// The value that made the data.
    pub truth: f64,
    /// Mean of the estimates.
    pub mean: f64,
    /// Standard deviation of the estimates.
    pub found_sd: f64,
    /// What the Fisher information of the fitting mesh promises; null where undetermined.
    pub promised_sd: Option<f64>,
    /// Whether the promise is below half of the parameter's value.
    pub identifiable: bool,
    /// Draws whose fit converged.
    pub draws: usize,
    /// Draws whose fit did not.
    pub failed_draws: usize,
    /// The estimates, in the order of the draws.
    pub estimates: Vec<f64>,
}

/// Settings of [`verify`].
#[derive(Clone, Copy, Debug)]
pub struct VerifyOptions {
    /// Mesh of the truth.
    pub truth_mesh: MeshOptions,
    /// Mesh of the fit.
    pub fit_mesh: MeshOptions,
    /// Noise draws.
    pub draws: usize,
    /// Seed of the noise.
    pub seed: u64,
    /// The fit.
    pub fit: FitOptions,
}

impl VerifyOptions {
    /// Truth on a mesh finer than standard with another grading, fit near standard.
    pub fn new(specimen: &Specimen, draws: usize, seed: u64) -> VerifyOptions {
        let fine = MeshOptions::scaled(specimen, 0.85);
        VerifyOptions {
            truth_mesh: MeshOptions { grading: 0.4, ..fine },
            fit_mesh: MeshOptions::scaled(specimen, 1.35),
            draws,
            seed,
            fit: FitOptions::default(),
        }
    }
}

/// Where every fit starts: 30 % away from the truth in each parameter, alternating, κ a factor of two.
fn blind_start(truth: &Ogden) -> Ogden {
    let mut start = truth.clone();
    start.bulk_kpa *= 2.0;
    for (index, term) in start.terms.iter_mut().enumerate() {
        let sign = if index % 2 == 0 { 1.0 } else { -1.0 };
        term.mu_kpa *= 1.0 + 0.3 * sign;
        term.alpha *= 1.0 - 0.3 * sign;
    }
    start
}

/// Calibrates on `options.draws` noisy scans of `truth`; draws run in parallel, each from the same blind start, and come
/// back in order.
///
/// # Errors
/// [`CalibrationError`] where the truth cannot be solved, or the work was cancelled. A fit that does not converge is counted.
pub fn verify(
    specimen: &Specimen,
    truth: &Ogden,
    scan: &ScanSettings,
    options: &VerifyOptions,
    on_draw: &(dyn Fn() + Sync),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<ParameterSpread>, CalibrationError> {
    let synthetic = SyntheticScan::new(specimen, truth, scan, &options.truth_mesh, &|| is_cancelled())?;
    let mut model = ForwardModel::of_specimen(specimen, &options.fit_mesh)?;
    let operator = VoxelOperator::new(specimen, model.mesh(), &synthetic.mask, Sampling::default())?;
    let start = blind_start(truth);
    let solve = SolveOptions::default();
    // The blind start's own path is the same for all draws: solved once.
    let warm = model.solve_path(&start, &specimen.drive_mm, &solve, &|| is_cancelled())?;
    let promised =
        promise(&mut model, &operator, truth, scan, &synthetic.noiseless().weights, &specimen.drive_mm, &|| {
            is_cancelled()
        })?;
    let chunk = options.draws.div_ceil(rayon::current_num_threads().max(1)).max(1);
    let draws: Vec<u64> = (0..options.draws as u64).collect();
    let estimates: Vec<Vec<Option<Ogden>>> = draws
        .par_chunks(chunk)
        .map(|chunk| -> Result<Vec<Option<Ogden>>, CalibrationError> {
            // A model per thread: each draw depends on its own noise alone.
            let mut model = ForwardModel::of_specimen(specimen, &options.fit_mesh)?;
            let mut found = Vec::with_capacity(chunk.len());
            for &draw in chunk {
                let data = synthetic.draw(options.seed, draw);
                let result =
                    fit(&mut model, &operator, scan, &data, &start, Some(&warm), &options.fit, &|| is_cancelled());
                on_draw();
                if is_cancelled() {
                    result?;
                    continue;
                }
                found.push(result.ok().map(|fit| fit.material));
            }
            Ok(found)
        })
        .collect::<Result<_, _>>()?;
    let estimates: Vec<Option<Ogden>> = estimates.into_iter().flatten().collect();
    Ok(spread(truth, &estimates, &promised))
}

/// The information that the fitting model promises at the truth.
fn promise(
    model: &mut ForwardModel,
    operator: &VoxelOperator,
    truth: &Ogden,
    scan: &ScanSettings,
    weights: &[f64],
    drives_mm: &[f64],
    is_cancelled: &dyn Fn() -> bool,
) -> Result<FisherInformation, CalibrationError> {
    let mut information = FisherInformation::none(truth);
    let path: Vec<Equilibrium> = model.solve_path(truth, drives_mm, &SolveOptions::default(), is_cancelled)?;
    for state in &path {
        let sensitivities = model.material_sensitivities(truth, state)?;
        let averaged =
            sensitivities.iter().map(|s| operator.average(&s.displacement)).collect::<Result<Vec<_>, _>>()?;
        let forces: Vec<f64> = sensitivities.iter().map(|s| s.force_n).collect();
        information.add(&FisherInformation::of_drive(truth, &averaged, weights, &forces, &scan.noise())?)?;
    }
    Ok(information)
}

fn spread(truth: &Ogden, estimates: &[Option<Ogden>], promised: &FisherInformation) -> Vec<ParameterSpread> {
    let covariance = promised.covariance();
    let good: Vec<&Ogden> = estimates.iter().flatten().collect();
    truth
        .parameters()
        .into_iter()
        .enumerate()
        .map(|(index, parameter): (usize, Parameter)| {
            let values: Vec<f64> = good.iter().map(|m| m.value(parameter)).collect();
            let count = values.len() as f64;
            let mean = values.iter().sum::<f64>() / count.max(1.0);
            let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
            ParameterSpread {
                parameter: parameter.name(),
                truth: truth.value(parameter),
                mean,
                found_sd: variance.sqrt(),
                promised_sd: covariance.sd(index),
                identifiable: covariance.relative_sd(index).is_some_and(|r| r <= IDENTIFIABILITY_LIMIT),
                draws: good.len(),
                failed_draws: estimates.len() - good.len(),
                estimates: values,
            }
        })
        .collect()
}
