//! Confirmation: a design at the reported fidelity, standard mesh and the scan's own voxels, for every material.

use super::objective::combine;
use super::response::{EvaluationFailure, criteria_as_relative_sd, tearing_stretch};
use super::study::{ObjectiveKind, Study};
use crate::fem::ForwardModel;
use crate::kinematics::principal_stretches;
use crate::sensitivity::{
    DriveSelection, Evaluation, EvaluationError, EvaluationMaps, EvaluationOptions, evaluate_model,
};
use crate::specimen::{LimitMargin, Specimen};
use serde::{Deserialize, Serialize};

/// A confirmed design.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Confirmed {
    /// The design; its only drive is the one it is scanned at.
    pub specimen: Specimen,
    /// The evaluation with each prior's central values.
    pub by_material: Vec<MaterialEvaluation>,
    /// Gain over the base specimen, from these evaluations.
    pub objective: f64,
    /// Gains that make up the objective.
    pub gains: Vec<Gain>,
    /// Every limit, closest first.
    pub limits: Vec<LimitMargin>,
    /// Whether all of them, and the guard if the study asks for it, are kept.
    pub is_within_limits: bool,
    /// Volume of material, mm³.
    pub volume_mm3: f64,
}

/// One prior's evaluation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialEvaluation {
    /// Name of the prior.
    pub material: String,
    /// Its evaluation at the design's drive.
    pub evaluation: Evaluation,
    /// D-, A-, E-optimal and worst-parameter figures of all μᵢ and αᵢ, as relative standard deviations; null where
    /// undetermined.
    pub relative_sd_by_criterion: CriterionValues,
    /// Principal stretch exceeded in 0.2 % of the volume.
    pub tearing_stretch: f64,
    /// Force, N.
    pub force_n: f64,
}

/// The optimality criteria, as relative standard deviations: smaller is better.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CriterionValues {
    /// (det C)^(1/2n).
    pub d_optimal: Option<f64>,
    /// √trace C.
    pub a_optimal: Option<f64>,
    /// √largest eigenvalue of C.
    pub e_optimal: Option<f64>,
    /// Largest relative standard deviation.
    pub worst_parameter: Option<f64>,
}

/// One gain over the base.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gain {
    /// Name of the prior.
    pub material: String,
    /// Parameter, or the criterion's name.
    pub parameter: String,
    /// 𝒮 of this design / of the base; null for criteria.
    pub integrated_sensitivity: Option<f64>,
    /// Promised standard deviation of the base / of this design (above 1: better); null where undetermined.
    pub promised_sd: Option<f64>,
}

/// Evaluates a design at its last drive.
///
/// # Errors
/// [`EvaluationFailure`].
pub fn confirm(
    study: &Study,
    specimen: &Specimen,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Confirmed, EvaluationFailure> {
    let mut by_material = Vec::new();
    let options = EvaluationOptions::standard(specimen);
    let mut model = ForwardModel::of_specimen(specimen, &options.mesh)?;
    for prior in &study.materials {
        let drives = DriveSelection::DriveMm(specimen.drive_mm.clone());
        let (evaluation, maps) =
            evaluate_model(&mut model, specimen, &prior.material, &study.scan, &drives, &options, is_cancelled)
                .map_err(failure)?;
        by_material.push(of_material(&model, &prior.name, &prior.material, evaluation, &maps));
    }
    let mut limits = study.limits.check_geometry(specimen, study.scan.voxel_mm);
    let largest = |f: fn(&MaterialEvaluation) -> f64| by_material.iter().map(f).fold(f64::NEG_INFINITY, f64::max);
    let drive = specimen.drive_mm.last().copied().unwrap_or(0.0);
    limits.extend(study.limits.check_response(drive, largest(|m| m.force_n), largest(|m| m.tearing_stretch)));
    limits.sort_by(|a, b| a.margin_relative.total_cmp(&b.margin_relative));
    Ok(Confirmed {
        specimen: specimen.clone(),
        by_material,
        objective: 1.0,
        gains: Vec::new(),
        is_within_limits: limits.iter().all(|m| m.is_satisfied),
        limits,
        volume_mm3: specimen.volume_mm3(),
    })
}

fn failure(error: EvaluationError) -> EvaluationFailure {
    match error {
        EvaluationError::Solve(e) => e.into(),
        EvaluationError::Mesh(e) => EvaluationFailure::Geometry { reason: e.to_string() },
        other => EvaluationFailure::Geometry { reason: other.to_string() },
    }
}

fn of_material(
    model: &ForwardModel,
    name: &str,
    material: &crate::material::Ogden,
    evaluation: Evaluation,
    maps: &EvaluationMaps,
) -> MaterialEvaluation {
    let covariance = maps.information.covariance();
    let [d, a, e, w] = criteria_as_relative_sd(&covariance, &maps.information.shear_indices());
    let stretch = maps.equilibria.last().map_or(1.0, |state| {
        let fields = model.quadrature_fields(material, state);
        tearing_stretch(fields.iter().map(|q| (principal_stretches(&q.deformation_gradient)[0], q.volume_mm3)))
    });
    MaterialEvaluation {
        material: name.into(),
        force_n: evaluation.steps.last().map_or(0.0, |s| s.force_n),
        evaluation,
        relative_sd_by_criterion: CriterionValues { d_optimal: d, a_optimal: a, e_optimal: e, worst_parameter: w },
        tearing_stretch: stretch,
    }
}

impl MaterialEvaluation {
    /// 𝒮 (sum over voxels) of a parameter at the drive.
    pub fn integrated(&self, parameter: &str) -> Option<f64> {
        let step = self.evaluation.steps.last()?;
        step.integrated_sensitivity.iter().find(|s| s.parameter == parameter).map(|s| s.sum)
    }

    /// Whether a parameter's relative standard deviation is below the identifiability limit.
    pub fn is_visible(&self, parameter: &str) -> bool {
        self.evaluation.promised_sd.iter().any(|p| p.parameter == parameter && p.identifiable)
    }

    /// Promised standard deviation of a parameter.
    pub fn promised(&self, parameter: &str) -> Option<f64> {
        self.evaluation.promised_sd.iter().find(|p| p.parameter == parameter).and_then(|p| p.value)
    }
}

impl Confirmed {
    /// Fills gains, objective and guard by comparison with the base.
    pub fn compare(&mut self, study: &Study, base: &Confirmed) {
        self.gains.clear();
        let (mut ln_gains, mut weights) = (Vec::new(), Vec::new());
        let total: f64 = study.materials.iter().map(|p| p.weight).sum();
        for ((own, of_base), prior) in self.by_material.iter().zip(&base.by_material).zip(&study.materials) {
            let parameters: Vec<String> =
                prior.material.parameters().into_iter().map(|p| p.name()).filter(|n| n != "kappa").collect();
            let start = ln_gains.len();
            for parameter in &parameters {
                let ratio = |a: Option<f64>, b: Option<f64>| Some(a? / b?);
                let integrated = ratio(own.integrated(parameter), of_base.integrated(parameter));
                let promised = ratio(of_base.promised(parameter), own.promised(parameter));
                if study.objective.kind == ObjectiveKind::IntegratedSensitivity {
                    ln_gains.push(integrated.map_or(f64::NEG_INFINITY, f64::ln));
                }
                if study.objective.guard_promised_sd {
                    let is_main = own.material == study.materials[0].name;
                    let is_kept = if is_main {
                        promised.is_none_or(|p| p >= 1.0 - 1e-9)
                    } else {
                        !of_base.is_visible(parameter) || own.is_visible(parameter)
                    };
                    self.is_within_limits &= is_kept;
                }
                self.gains.push(Gain {
                    material: own.material.clone(),
                    parameter: parameter.clone(),
                    integrated_sensitivity: integrated,
                    promised_sd: promised,
                });
            }
            let (a, b) = (&own.relative_sd_by_criterion, &of_base.relative_sd_by_criterion);
            let criterion = match study.objective.kind {
                ObjectiveKind::IntegratedSensitivity => None,
                ObjectiveKind::DOptimal => Some((b.d_optimal, a.d_optimal)),
                ObjectiveKind::AOptimal => Some((b.a_optimal, a.a_optimal)),
                ObjectiveKind::EOptimal => Some((b.e_optimal, a.e_optimal)),
                ObjectiveKind::WorstRelativeSd => Some((b.worst_parameter, a.worst_parameter)),
            };
            if let Some((base, own)) = criterion {
                ln_gains.push(base.zip(own).map_or(f64::NEG_INFINITY, |(b, o)| (b / o).ln()));
            }
            let count = ln_gains.len() - start;
            weights.extend(std::iter::repeat_n(prior.weight / total / count as f64, count));
        }
        self.objective = combine(study.objective.combine, &ln_gains, &weights).exp();
    }

    /// The limit with the smallest relative margin.
    pub fn closest_limit(&self) -> Option<&LimitMargin> {
        self.limits.first()
    }
}
