//! The result of a diagnosis (`diagnosis/1`).

use super::cause::Category;
use super::cause_fit::CauseFit;
use super::experiment::Experiment;
use super::found::FoundCause;
use super::interior::InteriorTest;
use super::interval::{interval, log_interval};
use super::location::Location;
use super::outcome::Diagnosis;
use super::prior::shear_modulus;
use super::registry::remedy_of;
use crate::material::{Material, Parameter};
use crate::rate::{BeforeAfter, Verdict};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A number with its 95 % interval.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = DiagnosedParameter)]
#[serde(deny_unknown_fields)]
pub struct ParameterResult {
    /// Name, with its unit.
    pub name: String,
    /// Estimate.
    pub value: f64,
    /// 95 % interval; null where the data do not bound it.
    pub interval_95: Option<[f64; 2]>,
}

/// A cause in a result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CauseResult {
    /// Name.
    pub name: String,
    /// Kind.
    pub category: Category,
    /// In words.
    pub description: String,
    /// Parameters.
    pub parameters: Vec<ParameterResult>,
    /// Where; null for what is everywhere.
    pub location: Option<Location>,
    /// Fall of the deviance, less ln n per parameter.
    pub evidence: f64,
    /// Displacement explained, mm rms.
    pub effect_rms_mm: f64,
    /// Of an alternative: further steps that would tell it apart, most telling first.
    #[serde(default)]
    pub experiments: Vec<Experiment>,
    /// What a laboratory can do about it.
    #[serde(default)]
    pub remedy: String,
}

/// A sample stiffer or softer than believed. A load cell that reads too much or too little would look the same:
/// displacements tell ratios of moduli, not their size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ModulusAgainstBelief {
    /// Initial shear modulus of the material as believed, kPa.
    pub believed_kpa: f64,
    /// Initial shear modulus of the material found, with the causes, kPa.
    pub found_kpa: f64,
    /// The relative gain error of the load cell that would make the believed modulus look like the one found.
    pub as_relative_cell_gain_error: f64,
}

/// Smallest relative difference of moduli that is stated: five times what meshes do to the force.
const SMALLEST_DIFFERENCE: f64 = 0.02;

impl ModulusAgainstBelief {
    /// Of `found` against `believed`; none where they agree.
    pub fn new(believed: &Material, found: &Material) -> Option<ModulusAgainstBelief> {
        let (believed_kpa, found_kpa) = (shear_modulus(believed), shear_modulus(found));
        let as_relative_cell_gain_error = found_kpa / believed_kpa - 1.0;
        (as_relative_cell_gain_error.abs() > SMALLEST_DIFFERENCE).then_some(ModulusAgainstBelief {
            believed_kpa,
            found_kpa,
            as_relative_cell_gain_error,
        })
    }

    /// In words, with the experiment that tells the two apart.
    pub fn in_words(&self) -> String {
        let percent = 100.0 * self.as_relative_cell_gain_error;
        let (stiffer, much) = if percent > 0.0 { ("stiffer", "much") } else { ("softer", "little") };
        format!(
            "the sample is {:.1} % {stiffer} than believed ({:.3} against {:.3} kPa); a load cell that reads {:.1} % too {much} \
             would look the same: a known weight hung on it tells",
            percent.abs(),
            self.found_kpa,
            self.believed_kpa,
            percent.abs()
        )
    }
}

/// A cause that was tested.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RankedResult {
    /// Round of the search, from 1.
    pub round: usize,
    /// Name.
    pub name: String,
    /// In words.
    pub description: String,
    /// Fall of the deviance to first order.
    pub score: f64,
    /// Fall in a full fit, less ln n per parameter; null where not fitted.
    pub fitted: Option<f64>,
}

/// `diagnosis/1`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DiagnosisResult {
    /// `diagnosis/1`.
    pub schema: String,
    /// The recording.
    pub recording: String,
    /// How it ended.
    pub verdict: Verdict,
    /// The material with the causes modelled.
    pub material: Material,
    /// Its parameters.
    pub material_parameters: Vec<ParameterResult>,
    /// The material that the nominal model gives.
    pub nominal_material: Material,
    /// How the modulus differs from the believed one; left out where it does not, where no material was believed, or
    /// where no force was recorded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub modulus_against_belief: Option<ModulusAgainstBelief>,
    /// Whether the misfit was made at the boundary or inside; left out where there is none, or where it cannot be told.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interior: Option<InteriorTest>,
    /// Causes, most telling first.
    pub causes: Vec<CauseResult>,
    /// What the data cannot tell apart from the last cause; where the verdict is unexplained, what was tried and
    /// explains less than half.
    pub alternatives: Vec<CauseResult>,
    /// χ² of the displacement per datum.
    pub chi2_per_datum: BeforeAfter,
    /// Misfit beyond noise, mm rms.
    pub structured_rms_mm: BeforeAfter,
    /// Misfit on data kept back, mm rms, noise included; absent where a fit to half of the data has no equilibrium.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kept_back_rms_mm: Option<BeforeAfter>,
    /// Voxels of a step at most that agree with hardly any of their neighbours and were left out.
    #[serde(default)]
    pub num_outlying_voxels: usize,
    /// Where most is left.
    pub left_at: Option<Location>,
    /// All causes tested.
    pub ranked: Vec<RankedResult>,
    /// The discretisation allowance, mm rms at the largest drive.
    pub allowance_mm: f64,
    /// Noise per component, mm: that of a typical voxel, where it differs from place to place.
    pub noise_sd_mm: [f64; 3],
    /// The multiples of it that a tenth and nine tenths of all voxels stay below, per component; absent where the noise
    /// is alike everywhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_relative_range: Option<[[f64; 2]; 3]>,
    /// Whether it was estimated from the recording.
    pub is_noise_estimated: bool,
    /// Displacement unknowns of the model.
    pub num_unknowns: usize,
    /// Equilibria solved.
    pub num_solves: usize,
    /// Program version.
    pub version: String,
    /// Hash of the inputs.
    pub input_hash: String,
}

impl DiagnosisResult {
    /// The result of `diagnosis` of recording `id`.
    pub fn new(diagnosis: &Diagnosis, id: &str, input_hash: String) -> DiagnosisResult {
        let d = diagnosis;
        DiagnosisResult {
            schema: "diagnosis/1".into(),
            recording: id.into(),
            verdict: d.verdict,
            material: d.corrected.material.clone(),
            material_parameters: material_parameters(&d.corrected),
            nominal_material: d.nominal.material.clone(),
            modulus_against_belief: d
                .believed
                .as_ref()
                .filter(|_| d.observed.steps.iter().any(|s| s.force.is_some()))
                .and_then(|believed| ModulusAgainstBelief::new(believed, &d.corrected.material)),
            causes: d.causes.iter().map(cause).collect(),
            alternatives: d.alternatives.iter().map(cause).collect(),
            chi2_per_datum: BeforeAfter { before: d.left[0].chi2_per_datum, after: d.left[1].chi2_per_datum },
            structured_rms_mm: BeforeAfter { before: d.left[0].structured_rms_mm, after: d.left[1].structured_rms_mm },
            kept_back_rms_mm: d.kept_back_rms_mm.map(|[before, after]| BeforeAfter { before, after }),
            interior: d.interior,
            num_outlying_voxels: d.observed.num_outliers,
            left_at: d.left[1].location.clone(),
            ranked: d
                .ranked
                .iter()
                .map(|r| RankedResult {
                    round: r.round,
                    name: r.identity.name.as_str().into(),
                    description: r.description.clone(),
                    score: r.score,
                    fitted: r.fitted,
                })
                .collect(),
            allowance_mm: d.allowance_mm,
            noise_sd_mm: d.observed.noise_sd_mm,
            noise_relative_range: d.observed.noise_range(),
            is_noise_estimated: d.observed.is_noise_estimated,
            num_unknowns: d.num_unknowns,
            num_solves: d.num_solves,
            version: crate::provenance::VERSION.into(),
            input_hash,
        }
    }
}

fn cause(c: &FoundCause) -> CauseResult {
    CauseResult {
        name: c.name.as_str().into(),
        category: c.category,
        description: c.description.clone(),
        parameters: c.parameters.iter().map(|(name, value, interval)| parameter(name, *value, *interval)).collect(),
        location: c.location.clone(),
        evidence: c.evidence,
        effect_rms_mm: c.effect_rms_mm,
        experiments: c.experiments.clone(),
        remedy: match remedy_of(c.name) {
            "" => c.own_remedy.clone(),
            registered => registered.into(),
        },
    }
}

pub(super) fn parameter(name: &str, value: f64, interval: [f64; 2]) -> ParameterResult {
    let is_bounded = interval.iter().all(|x| x.is_finite());
    ParameterResult { name: name.into(), value, interval_95: is_bounded.then_some(interval) }
}

pub(super) fn material_parameters(fitted: &CauseFit) -> Vec<ParameterResult> {
    fitted
        .material
        .parameters()
        .into_iter()
        .zip(&fitted.sd)
        .map(|(p, sd)| {
            let value = fitted.material.value(p);
            // κ is fitted by its logarithm.
            let is_logarithm = p == Parameter::Kappa;
            let interval = if is_logarithm { log_interval(value, value, *sd) } else { interval(value, *sd) };
            parameter(&p.name(), value, interval)
        })
        .collect()
}
