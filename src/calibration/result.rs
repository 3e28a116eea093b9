//! The result of a calibration (`calibration/1`).

use super::contours::Contour;
use super::observed::Observed;
use super::outcome::Calibration;
use super::prediction::SolverWork;
use super::profile::Profile;
use super::target::{Objective, PAPER_BETA};
use super::terms::TermSelection;
use crate::material::Material;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// `calibration/1`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CalibrationResult {
    /// Always `calibration/1`.
    pub schema: String,
    /// Names of the recordings.
    pub recordings: Vec<String>,
    /// Number of terms.
    pub num_terms: usize,
    /// κ, μ₁, α₁, …
    pub parameters: Vec<ParameterResult>,
    /// ½ Σμα; null where no force was recorded.
    pub initial_shear_modulus_kpa: Option<ValueWithInterval>,
    /// The paper's ℓ_u, mean over drives.
    pub loss_u: f64,
    /// The paper's ℓ_F, mean over drives with a force; null without.
    pub loss_f: Option<f64>,
    /// χ² over its expectation.
    pub chi2_per_datum: f64,
    /// What was minimised, and the value of both objectives.
    pub objective: ObjectiveResult,
    /// The material as fitted; what the data do not determine stands here as it was assumed.
    pub material: Material,
    /// Correlation of the estimates in the order of `parameters`; null where undetermined.
    pub correlation: Vec<Vec<Option<f64>>>,
    /// What does not depend on a force: exponents and ratios to μ₁. Empty where a force was recorded.
    pub ratios: Vec<RatioResult>,
    /// Number of terms, by each rule.
    pub term_selection: TermSelection,
    /// The two meshes; null where only one was used.
    pub discretisation: Option<DiscretisationResult>,
    /// Per recording and drive: what was compared.
    pub steps: Vec<StepResult>,
    /// Profile likelihoods, on request.
    pub profiles: Vec<Profile>,
    /// Contours of ℓ_u, ℓ_F and ℓ, on request.
    pub contours: Vec<Contour>,
    /// Remarks.
    pub notes: Vec<String>,
    /// Iterations of the last fit, and the work of all fits.
    pub iterations: usize,
    /// Equilibria, Newton iterations, factorisations.
    pub work: SolverWork,
    /// Version of the program.
    pub version: String,
    /// SHA-256 of recordings and settings, hexadecimal.
    pub input_hash: String,
}

/// One parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = CalibratedParameter)]
#[serde(deny_unknown_fields)]
pub struct ParameterResult {
    /// `kappa` (kPa), `mu_1` (kPa), `alpha_1`, …
    pub name: String,
    /// The estimate; null where the data do not determine it.
    pub value: Option<f64>,
    /// Its standard deviation from the noise; null where undetermined.
    pub sd: Option<f64>,
    /// 95 % interval from noise, discretisation and misfit; an open side is null. κ's is symmetric in ln κ; those of
    /// terms that are hardly told apart are of their profile likelihoods.
    pub interval_95: [Option<f64>; 2],
    /// What our own mesh may have shifted it by.
    pub mesh_error: f64,
    /// Standard deviation from discretisation errors, those of the data included.
    pub discretisation_sd: f64,
    /// What the structured part of the misfit may have shifted it by, at most; zero where the misfit is that of the
    /// noise.
    pub possible_shift: f64,
    /// Whether the standard deviation is below half of the value.
    pub identifiable: bool,
}

/// A value with its interval.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ValueWithInterval {
    /// The value.
    pub value: f64,
    /// 95 % interval; null where undetermined.
    pub interval_95: Option<[f64; 2]>,
}

/// A ratio that displacements alone determine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RatioResult {
    /// Such as `kappa/mu_1`.
    pub name: String,
    /// The estimate.
    pub value: f64,
    /// Its standard deviation.
    pub sd: Option<f64>,
}

/// Both objectives.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ObjectiveResult {
    /// `weighted` or `paper`.
    pub minimised: String,
    /// χ² at the estimate.
    pub chi2: f64,
    /// Numbers compared.
    pub num_data: usize,
    /// ℓ_u + βℓ_F at the estimate.
    pub paper_loss: f64,
    /// β.
    pub beta: f64,
}

/// Two meshes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DiscretisationResult {
    /// Free displacement unknowns of the coarser and the finer mesh.
    pub num_unknowns: [usize; 2],
    /// The estimate on the coarser mesh.
    pub coarse_material: Material,
    /// Estimated displacement error of the finer mesh at the largest drive, rms, mm.
    pub own_error_mm: f64,
    /// Standard deviation allowed for discretisation errors, those of the data included, over our own.
    pub factor: f64,
}

/// One drive of one recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StepResult {
    /// The recording.
    pub recording: String,
    /// Drive, mm.
    pub drive_mm: f64,
    /// Voxels compared.
    pub num_voxels: usize,
    /// Root mean square of model − data per component, mm; null of a component that cameras do not measure.
    pub rms_mm: [Option<f64>; 3],
    /// Recorded force, N.
    pub force_n: Option<f64>,
    /// Force of the model, N; null where no force determines it.
    pub model_force_n: Option<f64>,
}

/// Root mean square of the model's misfit per component over finite voxels, and their number.
pub fn rms_misfit_mm(model: &[[f64; 3]], measured: &[[f64; 3]]) -> ([f64; 3], usize) {
    let (mut squares, mut count) = ([0.0; 3], 0usize);
    for (u, m) in model.iter().zip(measured).filter(|(u, m)| u.iter().chain(*m).all(|x| x.is_finite())) {
        count += 1;
        for c in 0..3 {
            squares[c] += (u[c] - m[c]).powi(2);
        }
    }
    (squares.map(|s| (s / count.max(1) as f64).sqrt()), count)
}

impl CalibrationResult {
    /// Of a calibration on `observed`, named `names`.
    pub fn new(
        calibration: &Calibration,
        observed: &[Observed],
        names: &[String],
        objective: Objective,
        input_hash: String,
    ) -> CalibrationResult {
        let fit = &calibration.fit;
        let parameters = calibration
            .estimates
            .iter()
            .map(|e| ParameterResult {
                name: e.parameter.name(),
                value: e.is_identifiable.then_some(e.value),
                sd: e.sd.filter(|_| e.is_identifiable),
                interval_95: e.interval_95,
                mesh_error: e.mesh_error,
                discretisation_sd: e.discretisation_sd,
                possible_shift: e.possible_shift,
                identifiable: e.is_identifiable,
            })
            .collect();
        let (minimised, beta) = match objective {
            Objective::Weighted => ("weighted", PAPER_BETA),
            Objective::Paper { beta } => ("paper", beta),
        };
        let mut steps = Vec::new();
        for (r, recording) in observed.iter().enumerate() {
            for (s, step) in recording.steps.iter().enumerate() {
                let (rms_mm, num_voxels) = rms_misfit_mm(fit.predicted(r, s), &step.displacement);
                let measured = recording.mask.grid.measured();
                steps.push(StepResult {
                    recording: names.get(r).cloned().unwrap_or_default(),
                    drive_mm: step.drive_mm,
                    num_voxels,
                    rms_mm: [0, 1, 2].map(|c| measured[c].then_some(rms_mm[c])),
                    force_n: step.force.map(|f| f.value_n),
                    model_force_n: calibration.has_force.then(|| fit.force_n(r, s)),
                });
            }
        }
        CalibrationResult {
            schema: "calibration/1".into(),
            recordings: names.to_vec(),
            num_terms: fit.material.terms.len(),
            parameters,
            initial_shear_modulus_kpa: calibration
                .initial_shear_modulus
                .map(|(value, interval_95)| ValueWithInterval { value, interval_95 }),
            loss_u: fit.loss_u,
            loss_f: fit.loss_f,
            chi2_per_datum: fit.chi2_per_datum,
            objective: ObjectiveResult {
                minimised: minimised.into(),
                chi2: fit.chi2,
                num_data: fit.num_data,
                paper_loss: fit.loss_u + beta * fit.loss_f.unwrap_or(0.0),
                beta,
            },
            material: fit.material.clone(),
            correlation: fit.covariance.correlation_matrix(),
            ratios: if calibration.has_force { Vec::new() } else { ratios(calibration) },
            term_selection: calibration.selection.clone(),
            discretisation: calibration.meshes.as_ref().map(|m| DiscretisationResult {
                num_unknowns: m.num_unknowns,
                coarse_material: m.coarse.clone(),
                own_error_mm: m.allowance.own_error_mm,
                factor: m.allowance.factor,
            }),
            steps,
            profiles: calibration.profiles.clone(),
            contours: calibration.contours.clone(),
            notes: calibration.notes.clone(),
            iterations: fit.iterations,
            work: calibration.work,
            version: crate::provenance::VERSION.into(),
            input_hash,
        }
    }
}

/// Without a force: every modulus over the first but κ (μ₁), which was held.
fn ratios(calibration: &Calibration) -> Vec<RatioResult> {
    let fit = &calibration.fit;
    // κ stands before the first of the others, which was held.
    let reference = fit.material.parameters()[1];
    let first = fit.material.value(reference);
    calibration
        .estimates
        .iter()
        .filter(|e| e.parameter != reference && e.parameter.is_modulus())
        .map(|e| RatioResult {
            name: format!("{}/{}", e.parameter.name(), reference.name()),
            value: e.value / first,
            sd: e.sd.map(|sd| sd / first.abs()),
        })
        .collect()
}
