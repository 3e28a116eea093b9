//! What one design does, at search fidelity, and its exact derivatives: the FE-backed evaluation of the search.
//!
//! Voxel sums are replaced by integrals over quadrature points (see [`crate::sensitivity`]), which vary smoothly with the
//! design, so that gradients are meaningful. The derivative of every number along a design variable follows from one
//! back-solve for the state, one for each material sensitivity, and a central difference of the integrals along the known
//! direction (X + tV, u + tu′, s + ts′): no solution is differenced.

use super::aim::Normalisation;
use super::space::{Subspace, Variable};
use super::study::{MaterialPrior, Study};
use crate::fem::{Equilibrium, ForwardModel, ParameterSensitivity, PrepareError, SolveError, SolveOptions};
use crate::kinematics::principal_stretches;
use crate::material::Ogden;
use crate::mesh::{MeshOptions, shape_velocity};
use crate::sensitivity::{
    Covariance, Criterion, FisherInformation, InformationError, IntegratedSensitivity, information_over_quadrature,
    integrate_over_quadrature,
};
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};

/// Why a design was not evaluated: data for the search, not an error of it.
#[derive(Clone, Debug, PartialEq, thiserror::Error, Serialize, Deserialize)]
#[non_exhaustive]
pub enum EvaluationFailure {
    /// The specimen cannot be made or meshed.
    #[error("{reason}")]
    Geometry {
        /// Why.
        reason: String,
    },
    /// No equilibrium.
    #[error("{reason}")]
    Equilibrium {
        /// Why.
        reason: String,
    },
    /// Stopped from outside.
    #[error("stopped")]
    Cancelled,
}

impl From<PrepareError> for EvaluationFailure {
    fn from(error: PrepareError) -> Self {
        match error {
            PrepareError::Mesh(e) => EvaluationFailure::Geometry { reason: e.to_string() },
            PrepareError::Solve(e) => e.into(),
        }
    }
}

impl From<SolveError> for EvaluationFailure {
    fn from(error: SolveError) -> Self {
        match error {
            SolveError::Cancelled { .. } => EvaluationFailure::Cancelled,
            other => EvaluationFailure::Equilibrium { reason: other.to_string() },
        }
    }
}

impl From<InformationError> for EvaluationFailure {
    fn from(error: InformationError) -> Self {
        EvaluationFailure::Equilibrium { reason: error.to_string() }
    }
}

/// Volume fraction above whose principal stretch a design is judged for tearing: the singular bonded edges, where the
/// stretch of a finite mesh means nothing, fill less.
pub const TEARING_FRACTION: f64 = 0.002;

/// What a design does with one material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// ln 𝒮 of every μᵢ and αᵢ, in the study's normalisation.
    pub log_integrated: Vec<f64>,
    /// ln of the relative standard deviation of every μᵢ and αᵢ (+∞ replaced by a large number where undetermined).
    pub log_relative_sd: Vec<f64>,
    /// ln of the D-, A-, E- and worst-parameter figures, each as a relative standard deviation.
    pub log_criteria: [f64; 4],
    /// ln of the force in N.
    pub log_force: f64,
    /// ln of the principal stretch exceeded in [`TEARING_FRACTION`] of the volume.
    pub log_stretch: f64,
}

/// ln of a relative standard deviation that stands for "not determined".
const UNDETERMINED: f64 = 12.0;

/// ln of a relative standard deviation, a large number where it is not determined.
pub(super) fn log_or_undetermined(value: Option<f64>) -> f64 {
    match value {
        Some(v) if v > 0.0 && v.ln() < UNDETERMINED => v.ln(),
        _ => UNDETERMINED,
    }
}

/// 𝒮 in the normalisation asked for.
pub(super) fn normalised(sensitivity: &IntegratedSensitivity, normalisation: Normalisation) -> f64 {
    match normalisation {
        Normalisation::Sum => sensitivity.sum,
        Normalisation::MeanPerVoxel => sensitivity.mean_per_voxel,
        Normalisation::VolumeIntegral => sensitivity.volume_integral,
    }
}

impl Response {
    /// All numbers in one list, in a fixed order.
    pub fn to_vector(&self) -> Vec<f64> {
        let mut v = self.log_integrated.clone();
        v.extend(&self.log_relative_sd);
        v.extend(self.log_criteria);
        v.extend([self.log_force, self.log_stretch]);
        v
    }

    /// The inverse of [`Self::to_vector`].
    pub fn from_vector(v: &[f64]) -> Response {
        let n = (v.len() - 6) / 2;
        Response {
            log_integrated: v[..n].to_vec(),
            log_relative_sd: v[n..2 * n].to_vec(),
            log_criteria: [v[2 * n], v[2 * n + 1], v[2 * n + 2], v[2 * n + 3]],
            log_force: v[2 * n + 4],
            log_stretch: v[2 * n + 5],
        }
    }
}

/// The relative figures of a covariance: D, A, E, worst, as relative standard deviations.
pub fn criteria_as_relative_sd(covariance: &Covariance, shear: &[usize]) -> [Option<f64>; 4] {
    let n = shear.len().max(1) as f64;
    [
        covariance.criterion(Criterion::LogDeterminant, shear).map(|d| (d / (2.0 * n)).exp()),
        covariance.criterion(Criterion::Trace, shear).map(f64::sqrt),
        covariance.criterion(Criterion::LargestEigenvalue, shear).map(f64::sqrt),
        covariance.criterion(Criterion::WorstRelativeSd, shear),
    ]
}

/// A design's responses to each material of [`sample_materials`], and, where asked for, their derivatives.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evaluated {
    /// One per material sample.
    pub responses: Vec<Response>,
    /// `[material sample][variable][entry of Response::to_vector]`; empty unless asked for.
    pub gradients: Vec<Vec<Vec<f64>>>,
}

/// A material at which designs are judged, and its weight.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialSample {
    /// Index of the prior.
    pub prior: usize,
    /// Values.
    pub material: Ogden,
    /// Weight; all sum to one.
    pub weight: f64,
}

/// The priors' central values and, where a prior is uncertain, two more points: all |α| larger and |μ| smaller by the
/// relative standard deviation, and the reverse (weights ½, ¼, ¼: the three-point rule that has the prior's mean, and
/// half of its variance in α at either side).
pub fn sample_materials(priors: &[MaterialPrior]) -> Vec<MaterialSample> {
    let total: f64 = priors.iter().map(|p| p.weight).sum();
    let mut samples = Vec::new();
    for (index, prior) in priors.iter().enumerate() {
        let share = prior.weight / total;
        let certain = prior.relative_sd == 0.0;
        samples.push(MaterialSample {
            prior: index,
            material: prior.material.clone(),
            weight: if certain { share } else { 0.5 * share },
        });
        if !certain {
            for sign in [1.0, -1.0] {
                let mut material = prior.material.clone();
                for term in &mut material.terms {
                    term.alpha *= 1.0 + sign * prior.relative_sd;
                    term.mu_kpa *= 1.0 - sign * prior.relative_sd;
                }
                samples.push(MaterialSample { prior: index, material, weight: 0.25 * share });
            }
        }
    }
    samples
}

/// Evaluates designs of a study at search fidelity.
pub struct Evaluator<'a> {
    study: &'a Study,
    samples: Vec<MaterialSample>,
    /// Factor on the search mesh's element size.
    coarseness: f64,
}

impl<'a> Evaluator<'a> {
    /// For `study`: at the priors' central values, and at their variants if its budget says so.
    pub fn new(study: &'a Study) -> Evaluator<'a> {
        if study.budget.variants_in_search {
            return Self::with_variants(study);
        }
        let central: Vec<MaterialPrior> =
            study.materials.iter().map(|prior| MaterialPrior { relative_sd: 0.0, ..prior.clone() }).collect();
        Evaluator { study, samples: sample_materials(&central), coarseness: 1.0 }
    }

    /// For `study`, always at the variants too.
    pub fn with_variants(study: &'a Study) -> Evaluator<'a> {
        Evaluator { study, samples: sample_materials(&study.materials), coarseness: 1.0 }
    }

    /// The same with elements larger by `factor`: for tests.
    pub fn with_coarseness(mut self, factor: f64) -> Self {
        self.coarseness = factor;
        self
    }

    /// The materials in the order of [`Evaluated::responses`].
    pub fn samples(&self) -> &[MaterialSample] {
        &self.samples
    }

    /// Mesh of a specimen at search fidelity.
    pub fn mesh_options(&self, specimen: &Specimen) -> MeshOptions {
        let options = MeshOptions::search(specimen);
        MeshOptions { section_size_mm: options.section_size_mm * self.coarseness, ..options }
    }

    /// Responses at the specimen's last drive; with gradients where `subspace` is given.
    ///
    /// # Errors
    /// [`EvaluationFailure`].
    pub fn evaluate(
        &self,
        specimen: &Specimen,
        subspace: Option<&Subspace>,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Evaluated, EvaluationFailure> {
        let no_drive = || EvaluationFailure::Geometry { reason: "the specimen has no drive".into() };
        let drive = *specimen.drive_mm.last().ok_or_else(no_drive)?;
        specimen.validate().map_err(|e| EvaluationFailure::Geometry { reason: e.to_string() })?;
        let mut model = ForwardModel::of_specimen(specimen, &self.mesh_options(specimen))?;
        let options = SolveOptions::default();
        let mut evaluated = Evaluated { responses: Vec::new(), gradients: Vec::new() };
        let mut last: Option<Equilibrium> = None;
        for sample in &self.samples {
            let material = &sample.material;
            let state = match &last {
                // A neighbouring material's state is closer than rest; where it is not, start over.
                Some(previous) => model
                    .solve(material, drive, Some(previous), &options, is_cancelled)
                    .or_else(|_| model.solve(material, drive, None, &options, is_cancelled))?,
                None => model.solve(material, drive, None, &options, is_cancelled)?,
            };
            let sensitivities = model.material_sensitivities(material, &state)?;
            let positions = model.mesh().nodes.clone();
            let response =
                self.response(&model, material, &positions, &state.displacement, &sensitivities, state.force_n)?;
            if let Some(subspace) = subspace {
                let base = response.to_vector();
                let mut rows = Vec::with_capacity(subspace.variables.len());
                for &variable in &subspace.variables {
                    rows.push(self.gradient(
                        &mut model,
                        material,
                        &state,
                        &sensitivities,
                        specimen,
                        subspace,
                        variable,
                        base.len(),
                    )?);
                }
                evaluated.gradients.push(rows);
            }
            evaluated.responses.push(response);
            last = Some(state);
        }
        Ok(evaluated)
    }

    /// Derivative of every response entry with respect to one variable, per mm.
    fn gradient(
        &self,
        model: &mut ForwardModel,
        material: &Ogden,
        state: &Equilibrium,
        sensitivities: &[ParameterSensitivity],
        specimen: &Specimen,
        subspace: &Subspace,
        variable: Variable,
        entries: usize,
    ) -> Result<Vec<f64>, EvaluationFailure> {
        let mut velocity: Option<Vec<[f64; 3]>> = None;
        for (design_variable, sign) in subspace.moves(variable) {
            let one = shape_velocity(model.mesh(), specimen, design_variable);
            let sum = velocity.get_or_insert_with(|| vec![[0.0; 3]; one.len()]);
            for (s, v) in sum.iter_mut().zip(&one) {
                for i in 0..3 {
                    s[i] += sign * v[i];
                }
            }
        }
        let rate = if variable == Variable::Drive { 1.0 } else { 0.0 };
        let path = model.path_sensitivity(material, state, sensitivities, velocity.as_deref(), rate)?;
        // A central difference along a known direction: 10⁻⁴ mm balances its truncation and rounding.
        let t = 1e-4;
        let mut sides = Vec::with_capacity(2);
        for sign in [1.0, -1.0] {
            let step = sign * t;
            let shift = |x: &[[f64; 3]], v: &[[f64; 3]]| -> Vec<[f64; 3]> {
                x.iter().zip(v).map(|(a, b)| [0, 1, 2].map(|i| a[i] + step * b[i])).collect()
            };
            let positions = match &velocity {
                Some(v) => shift(&model.mesh().nodes, v),
                None => model.mesh().nodes.clone(),
            };
            let displacement = shift(&state.displacement, &path.displacement);
            let moved: Vec<ParameterSensitivity> = sensitivities
                .iter()
                .zip(&path.parameters)
                .map(|(s, d)| ParameterSensitivity {
                    parameter: s.parameter,
                    displacement: shift(&s.displacement, &d.displacement),
                    force_n: s.force_n + step * d.force_n,
                })
                .collect();
            let force = state.force_n + step * path.force_n;
            sides.push(self.response(model, material, &positions, &displacement, &moved, force)?.to_vector());
        }
        Ok((0..entries).map(|i| (sides[0][i] - sides[1][i]) / (2.0 * t)).collect())
    }

    fn response(
        &self,
        model: &ForwardModel,
        material: &Ogden,
        positions: &[[f64; 3]],
        displacement: &[[f64; 3]],
        sensitivities: &[ParameterSensitivity],
        force_n: f64,
    ) -> Result<Response, EvaluationFailure> {
        let scan = &self.study.scan;
        let voxel_volume = scan.voxel_mm.iter().product();
        let fields = model.quadrature_fields_at(material, positions, displacement);
        let integrated = integrate_over_quadrature(material, &fields, model.mesh().mirror, voxel_volume);
        let information: FisherInformation =
            information_over_quadrature(material, model.mesh(), &fields, sensitivities, &scan.noise(), voxel_volume)?;
        let covariance = information.covariance();
        let shear = information.shear_indices();
        let normalisation = self.study.objective.normalisation;
        Ok(Response {
            log_integrated: integrated.iter().map(|s| normalised(s, normalisation).max(1e-300).ln()).collect(),
            log_relative_sd: shear.iter().map(|&i| log_or_undetermined(covariance.relative_sd(i))).collect(),
            log_criteria: criteria_as_relative_sd(&covariance, &shear).map(log_or_undetermined),
            log_force: force_n.abs().max(1e-12).ln(),
            log_stretch: tearing_stretch(
                fields.iter().map(|q| (principal_stretches(&q.deformation_gradient)[0], q.volume_mm3)),
            )
            .ln(),
        })
    }
}

/// The stretch exceeded in [`TEARING_FRACTION`] of the volume, from (stretch, volume) pairs; 1 without any.
pub fn tearing_stretch(values: impl Iterator<Item = (f64, f64)>) -> f64 {
    let mut sorted: Vec<(f64, f64)> = values.collect();
    sorted.sort_by(|a, b| b.0.total_cmp(&a.0));
    let allowed = TEARING_FRACTION * sorted.iter().map(|s| s.1).sum::<f64>();
    let mut sum = 0.0;
    sorted
        .into_iter()
        .find_map(|(stretch, volume)| {
            sum += volume;
            (sum >= allowed).then_some(stretch)
        })
        .unwrap_or(1.0)
}

#[cfg(test)]
#[path = "response_tests.rs"]
mod tests;
