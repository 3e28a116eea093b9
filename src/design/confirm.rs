//! Confirmation: a design at the reported fidelity, fine meshes and the scan's own voxels, for every material.
//!
//! The bonded edges are singular, and those of the free faces are on the brink of folding: what the displacement there
//! changes with an exponent depends on how they are meshed, and promised standard deviations with it, by a few percent
//! up and down, with no order in the element size. A design is therefore confirmed on several meshes. Means of
//! logarithms over them count, and their scatter is the mesh's uncertainty of a gain.

use super::aim::{Normalisation, ObjectiveKind};
use super::detection::{counted, log_sizes, sizes_of};
use super::evaluation_failure::EvaluationFailure;
use super::evaluator::{Evaluated, Evaluator};
use super::fidelity::Fidelity;
use super::material_samples::sample_materials;
use super::objective::{Judged, Reference};
use super::response::{Response, criteria_as_relative_sd, log_or_undetermined, normalised, tearing_stretch};
use super::study::Study;
use super::tell_apart::{Imitation, log_separation, state_of};
use crate::fem::{Equilibrium, SolveOptions};
use crate::kinematics::principal_stretches;
use crate::mesh::MeshOptions;
use crate::sensitivity::{
    DriveSelection, Evaluation, EvaluationError, EvaluationMaps, EvaluationOptions, Fixture, MaterialState,
    ScanSettings, SharedTime, best_shares, evaluate_fixture,
};
use crate::specimen::{LimitMargin, Specimen, TestResponse, farthest_from_zero};
use crate::voxel::Sampling;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Element sizes along the plates of a confirmation ([`MeshOptions::graded`]), as factors on the standard one; the
/// last is the one that is reported.
const MESHES: [f64; 3] = [1.8, 1.6, 1.4];

/// A confirmed design.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Confirmed {
    /// The design; its drives are those it is scanned at.
    pub specimen: Specimen,
    /// The evaluation with each prior's central values.
    pub by_material: Vec<MaterialEvaluation>,
    /// What each material sample of [`sample_materials`] gives, the priors' variants included, in that order: means
    /// over the meshes.
    pub responses: Vec<Response>,
    /// The same on each mesh.
    pub responses_by_mesh: Vec<Vec<Response>>,
    /// Gain over the base specimen, from the means.
    pub objective: f64,
    /// Standard error of the objective's mean over the meshes, relative to it.
    pub mesh_relative_sd: f64,
    /// Gains that make up the objective.
    pub gains: Vec<Gain>,
    /// Every limit, closest first; forces and stretch are the largest over the material samples.
    pub limits: Vec<LimitMargin>,
    /// Whether all of them, and the guard if the study asks for it, are kept with every material sample.
    pub is_within_limits: bool,
    /// Volume of the scanned material, mm³.
    pub volume_mm3: f64,
    /// What is to be known about how it came here: a limit that only the fine mesh broke, or a repair.
    #[serde(default)]
    pub remark: Option<String>,
}

/// One prior's evaluation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MaterialEvaluation {
    /// Name of the prior.
    pub material: String,
    /// Its evaluation at the design's drive.
    pub evaluation: Evaluation,
    /// D-, A-, E-optimal and worst-parameter figures of all μᵢ and αᵢ, as relative standard deviations; null where
    /// undetermined.
    pub relative_sd_by_criterion: CriterionValues,
    /// Principal stretch exceeded in 0.2 % of the volume of the sample where it is largest.
    pub tearing_stretch: f64,
    /// Force, N.
    pub force_n: f64,
    /// Force across the plates, N: positive where it pulls them together. Absent in tests without plates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal_force_n: Option<f64>,
    /// Distance of this material's scan from the closest fit of an earlier material to it, in noise standard
    /// deviations; null for the first material, and where the study does not ask to tell materials apart.
    #[serde(default)]
    pub separation_sd: Option<f64>,
}

/// The optimality criteria, as relative standard deviations: smaller is better.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
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
    /// The least such ratio over the prior's central values and its variants.
    #[serde(default)]
    pub worst_promised_sd: Option<f64>,
}

/// Evaluates a design at its last drive.
///
/// # Errors
/// [`EvaluationFailure`].
pub fn confirm(
    study: &Study,
    specimen: &Specimen,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Confirmed, EvaluationFailure> {
    let mut evaluated = Vec::new();
    let mut responses_by_mesh = Vec::new();
    let variants = Variants::of(study, specimen, is_cancelled)?;
    for factor in MESHES {
        let mesh = MeshOptions::graded(specimen, factor);
        let options = EvaluationOptions { mesh, solve: SolveOptions::trial(), ..EvaluationOptions::standard(specimen) };
        evaluated = by_material(study, specimen, options, factor, is_cancelled)?;
        responses_by_mesh.push(variants.responses(study, &evaluated));
    }
    let responses = mean_over_meshes(&responses_by_mesh);
    let largest = |f: fn(&Response) -> f64| responses.iter().map(f).fold(f64::NEG_INFINITY, f64::max).exp();
    let mut limits = study.limits.check_geometry(specimen, study.scan.voxel_mm);
    limits.extend(study.limits.check_response(&TestResponse {
        drive_mm: specimen.drive_mm.last().copied().unwrap_or(0.0),
        force_n: largest(|r| r.log_force),
        normal_force_n: specimen.has_plates().then(|| farthest_from_zero(responses.iter().map(|r| r.normal_force_n))),
        local_stretch: largest(|r| r.log_stretch),
    }));
    limits.sort_by(|a, b| a.margin_relative.total_cmp(&b.margin_relative));
    Ok(Confirmed {
        specimen: specimen.clone(),
        by_material: evaluated,
        responses,
        responses_by_mesh,
        objective: 1.0,
        mesh_relative_sd: 0.0,
        gains: Vec::new(),
        is_within_limits: limits.iter().all(|m| m.is_satisfied),
        limits,
        volume_mm3: specimen.scanned_volume_mm3(study.protocol.blocks_scanned),
        remark: None,
    })
}

/// Every sample's response, the mean of its entries over the meshes.
fn mean_over_meshes(by_mesh: &[Vec<Response>]) -> Vec<Response> {
    let num_samples = by_mesh.first().map_or(0, Vec::len);
    let of_sample = |sample: usize| {
        let all: Vec<Vec<f64>> = by_mesh.iter().map(|r| r[sample].to_vector()).collect();
        let num = all.len() as f64;
        let mean = |entry: usize| all.iter().map(|v| v[entry]).sum::<f64>() / num;
        let num_parameters = by_mesh[0][sample].log_integrated.len();
        Response::from_vector(&(0..all[0].len()).map(mean).collect::<Vec<_>>(), num_parameters)
    };
    (0..num_samples).map(of_sample).collect()
}

/// What a design is judged by in the search: the same figures from the same voxels, on one mesh; at the priors' central
/// values, or at their variants too where the study's budget says so.
///
/// # Errors
/// [`EvaluationFailure`].
pub fn estimate(
    study: &Study,
    specimen: &Specimen,
    fidelity: Fidelity,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Evaluated, EvaluationFailure> {
    specimen.validate().map_err(|e| EvaluationFailure::Geometry { reason: e.to_string() })?;
    let mesh = fidelity.mesh_options(specimen);
    let sampling = Sampling::on_elements_of(mesh.section_size_mm, study.scan.voxel_mm);
    let options =
        EvaluationOptions { mesh, sampling, solve: SolveOptions::trial(), ..EvaluationOptions::standard(specimen) };
    let by_material = by_material(study, specimen, options, fidelity.factor(), is_cancelled)?;
    let responses = if study.budget.variants_in_search {
        Variants::of(study, specimen, is_cancelled)?.responses(study, &by_material)
    } else {
        by_material.iter().map(|m| m.response(study)).collect()
    };
    Ok(Evaluated { responses, gradients: Vec::new() })
}

/// Every prior's central values, at the specimen's last drive; on the mesh of `options`, whose elements are those of
/// the standard one times `mesh_factor`.
fn by_material(
    study: &Study,
    specimen: &Specimen,
    options: EvaluationOptions,
    mesh_factor: f64,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<MaterialEvaluation>, EvaluationFailure> {
    let mut evaluated: Vec<(Evaluation, EvaluationMaps)> = Vec::new();
    let scanned_mm = specimen.drive_mm.last().copied().unwrap_or(0.0);
    let protocol = study.protocol.on_the_way_to(scanned_mm);
    let options = EvaluationOptions { protocol, ..options };
    let mut fixture = Fixture::new(specimen, &study.scan, &options).map_err(failure)?;
    let mut neighbours: Vec<Vec<Equilibrium>> = Vec::new();
    let mut solved: Vec<(MaterialState, Equilibrium)> = Vec::new();
    for prior in &study.materials {
        let drives = DriveSelection::DriveMm(specimen.drive_mm.clone());
        let (evaluation, maps) =
            evaluate_fixture(&mut fixture, &prior.material, &drives, &neighbours, &options, is_cancelled)
                .map_err(failure)?;
        // A study that tells materials apart has one block: its check sees to it.
        if study.objective.kind == ObjectiveKind::TellApart
            && let (Some(part), Some(sample)) = (fixture.parts_mut().first_mut(), maps.samples.first())
            && let Some(state) = sample.equilibria.last()
        {
            let mut tangent = part.model.tangent(&prior.material, state)?;
            solved.push((state_of(state, &mut tangent)?, state.clone()));
        }
        neighbours = maps.equilibria();
        evaluated.push((evaluation, maps));
    }
    if specimen.drive_mm.len() > 1 {
        share_time(&mut evaluated, options.identifiability_limit).map_err(failure)?;
    }
    if study.objective.kind == ObjectiveKind::Detect {
        for (prior, (evaluation, _)) in study.materials.iter().zip(&mut evaluated) {
            evaluation.detectable = sizes_of(study, specimen, &prior.material, evaluation, mesh_factor, is_cancelled)?;
        }
    }
    let mut by_material: Vec<MaterialEvaluation> = Vec::new();
    for (prior, (evaluation, maps)) in study.materials.iter().zip(evaluated) {
        by_material.push(of_material(&fixture, &prior.name, &prior.material, evaluation, &maps));
    }
    for later in 1..solved.len() {
        let mut closest = f64::INFINITY;
        for (earlier, (_, start)) in solved.iter().enumerate().take(later) {
            let (material, theirs) = (&study.materials[earlier].material, &solved[later].0);
            let Some(part) = fixture.parts_mut().first_mut() else { continue };
            let imitation = Imitation {
                study,
                model: &mut part.model,
                theirs,
                drive_mm: start.drive_mm,
                solve: &options.solve,
                is_cancelled,
            };
            closest = closest.min(imitation.nearest(material, start)?.distance_sd);
        }
        by_material[later].separation_sd = Some(closest);
    }
    Ok(by_material)
}

/// Shares the time of one scan out to the drives of a design in the way that is best for all materials together; evenly
/// where they do not determine the parameters.
fn share_time(evaluated: &mut [(Evaluation, EvaluationMaps)], limit: f64) -> Result<(), EvaluationError> {
    let times: Vec<&SharedTime> = evaluated.iter().map(|(_, maps)| &maps.time).collect();
    let num_drives = evaluated.first().map_or(0, |(evaluation, _)| evaluation.steps.len());
    let shares = best_shares(&times)?.unwrap_or_else(|| vec![1.0 / num_drives as f64; num_drives]);
    evaluated.iter_mut().try_for_each(|(evaluation, maps)| maps.promise(evaluation, &shares, limit))
}

/// What the priors' variants change.
struct Variants {
    /// Of every sample of [`sample_materials`]: its prior, and what it changes of the entries of the response at the
    /// prior's central values.
    changes: Vec<(usize, Vec<f64>)>,
}

impl Variants {
    /// On the search's mesh: differences of logarithms at one mesh are far more accurate than the values, and cost
    /// little.
    fn of(
        study: &Study,
        specimen: &Specimen,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Variants, EvaluationFailure> {
        let samples = sample_materials(&study.materials);
        if samples.len() == study.materials.len() {
            return Ok(Variants {
                changes: (0..samples.len()).map(|index| (samples[index].prior, Vec::new())).collect(),
            });
        }
        let searched = Evaluator::with_variants(study).evaluate(specimen, None, is_cancelled)?;
        let all: Vec<Vec<f64>> = searched.responses.iter().map(Response::to_vector).collect();
        let of_sample = |index: usize| {
            let prior = samples[index].prior;
            // A prior's central values come first among its samples.
            let centre = samples.iter().position(|s| s.prior == prior).unwrap_or(index);
            (prior, all[index].iter().zip(&all[centre]).map(|(variant, centre)| variant - centre).collect())
        };
        Ok(Variants { changes: (0..samples.len()).map(of_sample).collect() })
    }

    /// Responses at every material sample, from those at the central values.
    fn responses(&self, study: &Study, by_material: &[MaterialEvaluation]) -> Vec<Response> {
        let central: Vec<Response> = by_material.iter().map(|m| m.response(study)).collect();
        let of_sample = |(prior, changes): &(usize, Vec<f64>)| {
            let centre = &central[*prior];
            if changes.is_empty() {
                return centre.clone();
            }
            let moved: Vec<f64> =
                centre.to_vector().iter().zip(changes).map(|(value, change)| value + change).collect();
            Response::from_vector(&moved, centre.log_integrated.len())
        };
        self.changes.iter().map(of_sample).collect()
    }
}

fn failure(error: EvaluationError) -> EvaluationFailure {
    match error {
        EvaluationError::Solve(e) => e.into(),
        EvaluationError::Mesh(e) => EvaluationFailure::Geometry { reason: e.to_string() },
        other => EvaluationFailure::Geometry { reason: other.to_string() },
    }
}

fn of_material(
    fixture: &Fixture,
    name: &str,
    material: &crate::material::Material,
    evaluation: Evaluation,
    maps: &EvaluationMaps,
) -> MaterialEvaluation {
    let covariance = maps.information.covariance();
    let [d, a, e, w] = criteria_as_relative_sd(&covariance, &maps.information.shear_indices());
    let stretches = fixture.parts().iter().zip(&maps.samples).filter_map(|(part, sample)| {
        let fields = part.model.quadrature_fields(material, sample.equilibria.last()?);
        let of_points = fields.iter().map(|q| (principal_stretches(&q.deformation_gradient)[0], q.volume_mm3));
        Some(tearing_stretch(of_points))
    });
    let stretch = stretches.fold(1.0, f64::max);
    MaterialEvaluation {
        material: name.into(),
        force_n: evaluation.steps.last().map_or(0.0, |s| s.force_n),
        normal_force_n: evaluation.steps.last().and_then(|s| s.normal_force_n),
        evaluation,
        relative_sd_by_criterion: CriterionValues { d_optimal: d, a_optimal: a, e_optimal: e, worst_parameter: w },
        tearing_stretch: stretch,
        separation_sd: None,
    }
}

impl MaterialEvaluation {
    /// 𝒮 of a parameter at the drive, in a normalisation.
    pub fn integrated(&self, parameter: &str, normalisation: Normalisation) -> Option<f64> {
        let step = self.evaluation.steps.last()?;
        let of_parameter = step.integrated_sensitivity.iter().find(|s| s.parameter == parameter)?;
        Some(normalised(of_parameter, normalisation))
    }

    /// The figures that designs are judged by.
    fn response(&self, study: &Study) -> Response {
        let normalisation = study.objective.normalisation;
        let sensitivities = self.evaluation.steps.last().map_or(&[][..], |step| &step.integrated_sensitivity);
        let promised = self.evaluation.promised_sd.iter().filter(|p| p.is_of_shear());
        let c = &self.relative_sd_by_criterion;
        let log_detectable = match (study.objective.kind, counted(study)) {
            (ObjectiveKind::Detect, Ok(counted)) => log_sizes(&counted, &self.evaluation.detectable),
            _ => Vec::new(),
        };
        Response {
            log_integrated: sensitivities.iter().map(|s| normalised(s, normalisation).max(1e-300).ln()).collect(),
            log_relative_sd: promised.map(|p| log_or_undetermined(p.relative_sd)).collect(),
            log_criteria: [c.d_optimal, c.a_optimal, c.e_optimal, c.worst_parameter].map(log_or_undetermined),
            log_separation: log_separation(self.separation_sd),
            log_detectable,
            log_force: self.force_n.abs().max(1e-12).ln(),
            normal_force_n: self.normal_force_n.unwrap_or(0.0),
            log_stretch: self.tearing_stretch.ln(),
        }
    }

    /// Promised standard deviation of a parameter.
    pub fn promised(&self, parameter: &str) -> Option<f64> {
        self.evaluation.promised_sd.iter().find(|p| p.parameter == parameter).and_then(|p| p.value)
    }
}

impl Confirmed {
    /// Fills gains, objective and guard by comparison with the base.
    pub fn compare(&mut self, study: &Study, base: &Confirmed) {
        let samples = sample_materials(&study.materials);
        let reference = Reference::new(study, &samples, &base.responses);
        let judged = self.judged(&reference);
        self.objective = reference.objective(&judged).exp();
        self.mesh_relative_sd = standard_error(&self.log_objectives(study, base));
        // The ratio of two equal numbers rounds.
        self.is_within_limits =
            self.limits.iter().all(|m| m.is_satisfied) && judged.margins.iter().all(|m| *m >= -1e-9);
        self.gains.clear();
        for (index, (own, of_base)) in self.by_material.iter().zip(&base.by_material).enumerate() {
            let parameters = study.materials[index].material.shear_parameters().map(|p| p.name());
            for (entry, parameter) in parameters.enumerate() {
                // A prior's central values come first among its samples.
                let central = samples.iter().position(|s| s.prior == index);
                let mean = |of: fn(&Response) -> &Vec<f64>| {
                    let at = |c: &Confirmed| of(c.responses.get(central?)?).get(entry).copied();
                    Some((at(self)?, at(base)?))
                };
                let is_determined = own.promised(&parameter).and(of_base.promised(&parameter)).is_some();
                let promised = mean(|r| &r.log_relative_sd).filter(|_| is_determined);
                let promised_sd = promised.map(|(own, base)| (base - own).exp());
                let integrated_sensitivity = mean(|r| &r.log_integrated).map(|(own, base)| (own - base).exp());
                let worst = samples
                    .iter()
                    .zip(self.responses.iter().zip(&base.responses))
                    .filter(|(sample, _)| sample.prior == index)
                    .filter_map(|(_, (own, of_base))| {
                        Some((of_base.log_relative_sd.get(entry)? - own.log_relative_sd.get(entry)?).exp())
                    })
                    .reduce(f64::min);
                self.gains.push(Gain {
                    material: own.material.clone(),
                    integrated_sensitivity,
                    worst_promised_sd: promised_sd.and(worst),
                    promised_sd,
                    parameter,
                });
            }
        }
    }

    /// ln of the objective on each mesh, over the base on the same one.
    pub(super) fn log_objectives(&self, study: &Study, base: &Confirmed) -> Vec<f64> {
        let samples = sample_materials(&study.materials);
        let on_mesh = |(own, of_base): (&Vec<Response>, &Vec<Response>)| {
            let reference = Reference::new(study, &samples, of_base);
            let own = Evaluated { responses: own.clone(), gradients: Vec::new() };
            reference.objective(&reference.judge(&own))
        };
        self.responses_by_mesh.iter().zip(&base.responses_by_mesh).map(on_mesh).collect()
    }

    /// Gains and margins, counted from a reference to the base's confirmed responses.
    pub(super) fn judged(&self, reference: &Reference) -> Judged {
        reference.judge(&Evaluated { responses: self.responses.clone(), gradients: Vec::new() })
    }

    /// The order of rank: best objective first, those within every limit before others.
    pub(super) fn by_rank(a: &Confirmed, b: &Confirmed) -> std::cmp::Ordering {
        b.is_within_limits.cmp(&a.is_within_limits).then(b.objective.total_cmp(&a.objective))
    }

    /// The scan that it was confirmed in; `None` of a study without a material.
    pub(super) fn scan(&self) -> Option<&ScanSettings> {
        self.by_material.first().map(|m| &m.evaluation.scan)
    }

    /// The limit with the smallest relative margin.
    pub fn closest_limit(&self) -> Option<&LimitMargin> {
        self.limits.first()
    }
}

/// Standard error of the mean of some values; zero with fewer than two.
pub(super) fn standard_error(values: &[f64]) -> f64 {
    let num = values.len() as f64;
    if values.len() < 2 {
        return 0.0;
    }
    let mean = values.iter().sum::<f64>() / num;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / ((num - 1.0) * num)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standard_errors() {
        assert_eq!(standard_error(&[]), 0.0);
        assert_eq!(standard_error(&[0.3]), 0.0);
        // The variance of 1, 2, 3 is 1; rounding only.
        assert!((standard_error(&[1.0, 2.0, 3.0]) - (1.0f64 / 3.0).sqrt()).abs() < 1e-15);
    }

    #[test]
    fn means_are_of_every_entry() {
        let response = |x: f64| Response {
            log_integrated: vec![x, 2.0 * x],
            log_relative_sd: vec![-x, 0.5 * x],
            log_criteria: [x; 4],
            log_separation: 0.0,
            log_detectable: vec![Some(x), None],
            log_force: 3.0 * x,
            normal_force_n: -4.0 * x,
            log_stretch: x,
        };
        let mean = mean_over_meshes(&[vec![response(1.0), response(5.0)], vec![response(3.0), response(7.0)]]);
        assert_eq!(mean, [2.0, 6.0].map(response));
    }
}
