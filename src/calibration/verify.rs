//! Verification of a design: calibrate on many noisy synthetic scans and set the spread found beside the spread
//! promised.
//!
//! The truth is solved on a finer and different mesh. The fits to the noiseless scan and to one more noisy scan begin
//! blind, off the truth in every parameter; the draws begin where the latter ended, as a laboratory would begin that
//! has calibrated one such scan before. Two errors are told apart: the scatter over the draws, which the Fisher
//! information promises, and the shift that the fitting mesh makes, which is what a fit to the noiseless scan misses
//! the truth by.

use super::bench::Bench;
use super::error::CalibrationError;
use super::fit::{Fit, FitStart};
use super::mesh_correction::FinerMesh;
use super::options::{Bulk, FitOptions};
use super::synthetic::SyntheticScan;
use super::system::NormalSystem;
use super::target::Target;
use crate::material::{Material, Parameter};
use crate::mesh::MeshOptions;
use crate::sensitivity::{FisherInformation, IDENTIFIABILITY_LIMIT, Protocol, ScanSettings};
use crate::specimen::Specimen;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// One parameter over all draws.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ParameterSpread {
    /// `kappa`, `mu_1`, …
    pub parameter: String,
    /// The value that made the data.
    pub truth: f64,
    /// Mean of the estimates; NaN (null in JSON) without any.
    #[serde(with = "nan_as_null")]
    pub mean: f64,
    /// Standard deviation of the estimates; NaN (null in JSON) with fewer than two.
    #[serde(with = "nan_as_null")]
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
    /// What a fit to the noiseless scan misses the truth by: the mesh's error. Null where that fit failed.
    #[serde(default)]
    pub discretisation_bias: Option<f64>,
    /// Whether the fits were corrected by a mesh finer than the one fitted on.
    #[serde(default)]
    pub is_mesh_corrected: bool,
    /// Draws whose estimate stands at a limit of the fit; their scatter is not the promised one.
    #[serde(default)]
    pub limited_draws: usize,
    /// Why what is promised of the parameter is not to be trusted, in words; empty where it is, or where nothing is
    /// promised.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<String>,
}

/// JSON has no NaN.
mod nan_as_null {
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        if value.is_finite() { serializer.serialize_f64(*value) } else { serializer.serialize_none() }
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::NAN))
    }
}

/// A weakly determined second term makes a long valley: the way along it may take more than the usual iterations.
const MAX_ITERATIONS: usize = 60;

/// Elements of the correcting mesh over standard ones: finer than the fit's, coarser than the truth's and graded
/// otherwise.
const CORRECTION_FACTOR: f64 = 0.8;

/// Elements along the plates of the truth, the correction and the fit over standard ones, where those of
/// [`VerifyOptions::new`] fold.
const LARGER_ELEMENTS: [f64; 3] = [1.4, 1.6, 1.8];

/// Settings of [`verify`].
#[derive(Clone, Debug)]
pub struct VerifyOptions {
    /// Mesh of the truth.
    pub truth_mesh: MeshOptions,
    /// Mesh of the fit.
    pub fit_mesh: MeshOptions,
    /// A finer mesh by which the fits are corrected, where one is given and has the equilibria.
    pub correction_mesh: Option<MeshOptions>,
    /// Which samples are scanned and for how long, forces read on the way, and a load cell whose gain and zero are
    /// drawn anew for every draw.
    pub protocol: Protocol,
    /// Noise draws.
    pub draws: usize,
    /// Seed of the noise.
    pub seed: u64,
    /// The fit. A prior on κ is drawn anew around the truth for every draw, as an independent earlier measurement would
    /// be; a held κ is held at the truth.
    pub fit: FitOptions,
}

impl VerifyOptions {
    /// Truth on a mesh finer than standard with another grading, fit on the standard one, corrected by one between the
    /// two.
    pub fn new(specimen: &Specimen, draws: usize, seed: u64) -> VerifyOptions {
        let fine = MeshOptions::scaled(specimen, 0.7);
        VerifyOptions {
            truth_mesh: MeshOptions { grading: 0.4, ..fine },
            fit_mesh: MeshOptions::scaled(specimen, 1.0),
            correction_mesh: Some(MeshOptions::scaled(specimen, CORRECTION_FACTOR)),
            protocol: Protocol::default(),
            draws,
            seed,
            fit: FitOptions { max_iterations: MAX_ITERATIONS, ..FitOptions::default() },
        }
    }

    /// As [`Self::new`] on meshes like those by which a design is confirmed: as fine toward the plates, and with a
    /// layer along the free faces, but with larger elements along the plates. For a specimen whose free edges or walls
    /// of holes fold on smaller elements.
    pub fn on_larger_elements(specimen: &Specimen, draws: usize, seed: u64) -> VerifyOptions {
        VerifyOptions {
            truth_mesh: MeshOptions { grading: 0.4, ..MeshOptions::graded(specimen, LARGER_ELEMENTS[0]) },
            correction_mesh: Some(MeshOptions::graded(specimen, LARGER_ELEMENTS[1])),
            fit_mesh: MeshOptions::graded(specimen, LARGER_ELEMENTS[2]),
            ..VerifyOptions::new(specimen, draws, seed)
        }
    }
}

/// All that a verification found.
#[derive(Debug)]
pub struct Verification {
    /// Per parameter.
    pub spreads: Vec<ParameterSpread>,
    /// The fit to the noiseless scan.
    pub noiseless: Result<Fit, CalibrationError>,
    /// The fits, in the order of the draws.
    pub fits: Vec<Result<Fit, CalibrationError>>,
}

/// Where the first fits start: 30 % away from the truth in each parameter, alternating, κ a factor of two.
fn blind_start(truth: &Material, bulk: Bulk) -> Material {
    let mut start = truth.clone();
    if bulk != Bulk::Held {
        start.bulk_kpa *= 2.0;
    }
    for (index, term) in start.terms.iter_mut().enumerate() {
        let sign = if index % 2 == 0 { 1.0 } else { -1.0 };
        term.mu_kpa *= 1.0 + 0.3 * sign;
        term.alpha *= 1.0 - 0.3 * sign;
    }
    for (index, parameter) in truth.parameters().into_iter().filter(|p| matches!(p, Parameter::Law(_))).enumerate() {
        let sign = if index % 2 == 0 { 1.0 } else { -1.0 };
        start.set(parameter, truth.value(parameter) * (1.0 + 0.3 * sign));
    }
    start
}

/// Calibrates on `options.draws` noisy scans of `truth`; draws run in parallel, each from the same start, and come back
/// in order, with the same bits at any number of threads. `on_draw` is called after each.
///
/// # Errors
/// [`CalibrationError`] where the truth or the start cannot be solved, the settings are wrong or the work was
/// cancelled. A draw whose fit does not converge is counted.
pub fn verify(
    specimen: &Specimen,
    truth: &Material,
    scan: &ScanSettings,
    options: &VerifyOptions,
    on_draw: &(dyn Fn() + Sync),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<ParameterSpread>, CalibrationError> {
    Ok(verify_in_full(specimen, truth, scan, options, on_draw, is_cancelled)?.spreads)
}

/// As [`verify`], with every fit.
///
/// # Errors
/// As [`verify`].
pub fn verify_in_full(
    specimen: &Specimen,
    truth: &Material,
    scan: &ScanSettings,
    options: &VerifyOptions,
    on_draw: &(dyn Fn() + Sync),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Verification, CalibrationError> {
    let chunk = options.draws.div_ceil(rayon::current_num_threads().max(1)).max(1);
    // A model per thread.
    let num_models = options.draws.div_ceil(chunk).max(1);
    let solve = &options.fit.solve;
    let (protocol, mesh) = (&options.protocol, &options.truth_mesh);
    let synthetic = SyntheticScan::new(specimen, truth, scan, protocol, mesh, solve, is_cancelled)?;
    let masks = synthetic.masks();
    let mut benches = (0..num_models)
        .into_par_iter()
        .map(|_| Bench::of_specimen(specimen, &options.fit_mesh, &masks))
        .collect::<Result<Vec<_>, _>>()?;
    verify_with(&mut benches, specimen, truth, &synthetic, options, on_draw, is_cancelled)
}

/// Draws shared out to `benches`, which are alike.
fn verify_with(
    benches: &mut [Bench],
    specimen: &Specimen,
    truth: &Material,
    synthetic: &SyntheticScan,
    options: &VerifyOptions,
    on_draw: &(dyn Fn() + Sync),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Verification, CalibrationError> {
    let scan = &synthetic.scan;
    let stop = || is_cancelled();
    let chunk = options.draws.div_ceil(benches.len().max(1)).max(1);
    let Some((bench, others)) = benches.split_first_mut() else {
        let requirement = "positive";
        return Err(CalibrationError::InvalidValue { name: "the number of models", value: 0.0, requirement });
    };
    let data = synthetic.noiseless();
    // The noiseless scan's prior is centred on the truth.
    let centred = match options.fit.bulk {
        Bulk::LogPrior { log_sd, .. } => Bulk::LogPrior { center_kpa: truth.bulk_kpa, log_sd },
        other => other,
    };
    let fit_options = FitOptions { bulk: centred, ..options.fit };
    let blind = blind_start(truth, centred);
    let drives_mm = data.all_drives_mm();
    let start = FitStart::new(bench, &drives_mm, &blind, &fit_options, &stop)?;
    // Every draw has its own prior, as its own noise.
    let with_prior = |start: &FitStart, draw: u64| match centred {
        Bulk::LogPrior { center_kpa, log_sd } => start.with_bulk(Bulk::LogPrior {
            center_kpa: center_kpa * (log_sd * SyntheticScan::prior_draw(options.seed, draw)).exp(),
            log_sd,
        }),
        _ => start.clone(),
    };
    // The scan that leads to where the draws begin is none of them.
    let earlier = options.draws as u64;
    let lead = |bench: &mut Bench| {
        let drawn = synthetic.draw(options.seed, earlier);
        with_prior(&start, earlier).led_by(bench, scan, &drawn, is_cancelled)
    };
    let fit = |bench: &mut Bench| start.fit(bench, scan, data, is_cancelled);
    let (begun, noiseless) = match others.first_mut() {
        Some(other) => rayon::join(|| lead(bench), || fit(other)),
        None => (lead(bench), fit(bench)),
    };
    let begun = begun?.with_bulk(centred);
    let noiseless = match noiseless {
        Err(e) if !e.is_of_the_data() => return Err(e),
        other => other,
    };
    let correction = match (&options.correction_mesh, &noiseless) {
        (Some(mesh), Ok(first)) => {
            let solver = (&fit_options.solve, &stop as &(dyn Fn() -> bool + Sync));
            let corrected = FinerMesh::new(specimen, mesh, synthetic)
                .and_then(|mut finer| finer.correct(&begun, bench, synthetic, first, solver));
            match corrected {
                Err(e) if is_cancelled() || !e.is_of_the_data() => return Err(e),
                // A finer model may have no equilibrium: the estimates are then those of the fitting mesh.
                other => other.ok(),
            }
        }
        _ => None,
    };
    let (defect, noiseless) = match correction {
        Some((defect, fit)) => (Some(defect), Ok(fit)),
        None => (None, noiseless),
    };
    // The promise holds at the truth, as an evaluation's does.
    let at_truth = bench.predict(&drives_mm, truth, None, &fit_options.solve, &stop)?;
    let target = Target::of_measurement(data, scan);
    let promised = NormalSystem::new(&[at_truth], &[target], centred, fit_options.held)?.information;
    let draws: Vec<u64> = (0..options.draws as u64).collect();
    let fits: Vec<Vec<Result<Fit, CalibrationError>>> = benches
        .par_iter_mut()
        .zip(draws.par_chunks(chunk))
        .map(|(bench, chunk)| {
            let mut fits = Vec::with_capacity(chunk.len());
            for &draw in chunk {
                let drawn = synthetic.draw(options.seed, draw);
                let noisy = defect.as_ref().map_or_else(|| drawn.clone(), |d| d.taken_off(&drawn));
                let own = with_prior(&begun, draw);
                let result = own.fit(bench, scan, &noisy, is_cancelled);
                on_draw();
                match result {
                    Err(e) if !e.is_of_the_data() => return Err(e),
                    other => fits.push(other),
                }
            }
            Ok(fits)
        })
        .collect::<Result<_, _>>()?;
    let fits: Vec<Result<Fit, CalibrationError>> = fits.into_iter().flatten().collect();
    let mut spreads = spread(truth, &fits, noiseless.as_ref().ok(), &promised, centred == Bulk::Held);
    for spread in &mut spreads {
        spread.is_mesh_corrected = defect.is_some();
        spread.doubts = spread.reasons_for_doubt();
    }
    Ok(Verification { spreads, noiseless, fits })
}

/// Statistics per parameter. A held κ is not estimated: nothing is promised of it and it is not identifiable.
fn spread(
    truth: &Material,
    fits: &[Result<Fit, CalibrationError>],
    noiseless: Option<&Fit>,
    promised: &FisherInformation,
    is_bulk_held: bool,
) -> Vec<ParameterSpread> {
    let covariance = promised.covariance();
    let good: Vec<&Fit> = fits.iter().filter_map(|f| f.as_ref().ok()).collect();
    truth
        .parameters()
        .into_iter()
        .enumerate()
        .map(|(index, parameter)| {
            let is_held = is_bulk_held && parameter == Parameter::Kappa;
            let values: Vec<f64> = good.iter().map(|f| f.material.value(parameter)).collect();
            // 0/0 is the NaN that is meant.
            let count = values.len() as f64;
            let mean = values.iter().sum::<f64>() / count;
            let squares = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
            let found_sd = if values.len() < 2 { f64::NAN } else { (squares / (count - 1.0)).sqrt() };
            ParameterSpread {
                parameter: parameter.name(),
                truth: truth.value(parameter),
                mean,
                found_sd,
                promised_sd: covariance.sd(index).filter(|_| !is_held),
                identifiable: !is_held && covariance.relative_sd(index).is_some_and(|r| r < IDENTIFIABILITY_LIMIT),
                draws: good.len(),
                failed_draws: fits.len() - good.len(),
                estimates: values,
                discretisation_bias: noiseless.map(|f| f.material.value(parameter) - truth.value(parameter)),
                is_mesh_corrected: false,
                limited_draws: good.iter().filter(|f| !f.reached_limits.is_empty()).count(),
                doubts: Vec::new(),
            }
        })
        .collect()
}

#[cfg(test)]
#[path = "verify_tests.rs"]
mod tests;
