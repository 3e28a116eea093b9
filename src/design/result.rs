//! The result of a design search (`design/1`) and what it says in plain words.

use super::aim::Objective;
use super::disagreement::{Disagreement, disagreement};
use super::entry::DesignEntry;
use super::findings::{Equals, findings};
use super::recommendation::Recommendation;
use super::search::Found;
use super::study::Study;
use super::study_hash::study_hash;
use super::tolerances::{DimensionTolerance, on_drawings};
use super::vary_scan::ChosenScan;
use crate::calibration::ParameterSpread;
use crate::material::symbol_of_parameter;
use crate::provenance::VERSION;
use crate::sensitivity::Protocol;
use crate::specimen::Tolerances;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A finished search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DesignResult {
    /// Always `design/1`.
    pub schema: String,
    /// Name of the study.
    pub name: String,
    /// What to make and how to scan it, in words.
    #[serde(default)]
    pub recommendation: Recommendation,
    /// How every design is measured.
    #[serde(default)]
    pub protocol: Protocol,
    /// The base specimen at its drive.
    pub base: DesignEntry,
    /// The winner.
    pub best: DesignEntry,
    /// The winner's objective over the base's if the scan's grid lay anywhere, in place of on the middle of each
    /// specimen; absent where the study takes it to do so, or its objective does not hang on it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub objective_grid_anywhere: Option<f64>,
    /// The same of the design that is recommended.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recommended_objective_grid_anywhere: Option<f64>,
    /// The scan that was found for the winner, in which all of `ranked` are confirmed; absent where it is the study's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scan: Option<ChosenScan>,
    /// Every confirmed design, best first, those within every limit before others.
    pub ranked: Vec<DesignEntry>,
    /// Indices in `ranked` of the designs that are equal to the best within what meshes leave open, the best included.
    #[serde(default)]
    pub equal_to_best: Vec<usize>,
    /// Index in `ranked` of the one of them that is simplest to make: fewest holes, then fewest different diameters.
    #[serde(default)]
    pub simplest: usize,
    /// What the design that is recommended loses where its dimensions are off, and by how much they may be.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tolerances: Vec<DimensionTolerance>,
    /// Indices in `ranked` of the trade-off between information (D-optimal figure of the first material) and force:
    /// none of the others has both less force and a smaller standard deviation.
    pub pareto: Vec<usize>,
    /// Where integrated sensitivity and Fisher information rank designs differently, per material.
    pub disagreement: Vec<Disagreement>,
    /// What the numbers say, in plain words.
    pub findings: Vec<String>,
    /// Calibration of the best and of the base specimen on synthetic noisy scans, first material.
    pub verification: Verification,
    /// The same for every material.
    pub verification_by_material: Vec<MaterialVerification>,
    /// What was maximised.
    pub objective: Objective,
    /// Largest objective within limits after each evaluation, at search fidelity.
    pub history: Vec<f64>,
    /// Evaluations at search fidelity.
    pub num_evaluations: usize,
    /// Those that failed, with their reasons.
    pub failures: Vec<String>,
    /// Seed of everything random.
    pub seed: u64,
    /// Version of the program.
    pub version: String,
    /// SHA-256 of the study, hexadecimal.
    pub input_hash: String,
}

/// Spread found against spread promised.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Verification {
    /// Of the best design.
    pub best: Vec<ParameterSpread>,
    /// Of the base specimen.
    pub base: Vec<ParameterSpread>,
}

/// One material's verification.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MaterialVerification {
    /// Name of the prior.
    pub material: String,
    /// Of the best design.
    pub best: Vec<ParameterSpread>,
    /// Of the base specimen.
    pub base: Vec<ParameterSpread>,
    /// Why the first of the best design's fits that failed did so; null if none failed.
    #[serde(default)]
    pub best_failure: Option<String>,
    /// The same of the base specimen.
    #[serde(default)]
    pub base_failure: Option<String>,
    /// Whether the best design was verified on larger elements, because it has no equilibrium on those that a
    /// verification begins with.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub best_on_larger_elements: bool,
    /// The same of the base specimen.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub base_on_larger_elements: bool,
}

impl DesignResult {
    /// The design to make: the simplest of those equal to the best.
    pub fn recommended(&self) -> &DesignEntry {
        self.ranked.get(self.simplest).unwrap_or(&self.best)
    }

    /// Tolerances of the drawing of every sample of the design to make.
    pub fn drawing_tolerances(&self) -> Vec<Tolerances> {
        on_drawings(&self.tolerances, &self.recommended().specimen)
    }

    /// Puts a search's findings together; `None` if nothing was confirmed.
    pub fn new(study: &Study, found: &Found) -> Option<DesignResult> {
        let ranked: Vec<DesignEntry> = found.ranked.iter().filter_map(DesignEntry::of).collect();
        let base = DesignEntry::of(&found.base)?;
        let best = ranked.first()?.clone();
        let disagreement = disagreement(study, &base, &ranked);
        let equals = Equals { equal_to_best: &found.equal_to_best, simplest: found.simplest };
        Some(DesignResult {
            schema: "design/1".into(),
            name: study.name.clone(),
            pareto: pareto(&ranked),
            recommendation: Recommendation::new(study, &base, &ranked, equals, found),
            protocol: study.protocol.clone(),
            findings: findings(study, &base, &ranked, &disagreement, equals, found.gain_anywhere.map(|gain| gain.best)),
            objective_grid_anywhere: found.gain_anywhere.map(|gain| gain.best),
            recommended_objective_grid_anywhere: found.gain_anywhere.map(|gain| gain.recommended),
            scan: found.scan,
            equal_to_best: found.equal_to_best.clone(),
            simplest: found.simplest,
            tolerances: found.tolerances.clone(),
            disagreement,
            base,
            best,
            ranked,
            verification: Verification::default(),
            verification_by_material: Vec::new(),
            objective: study.objective.clone(),
            history: found.history.clone(),
            num_evaluations: found.num_evaluations,
            failures: found.failures.clone(),
            seed: study.seed,
            version: VERSION.into(),
            input_hash: study_hash(study),
        })
    }

    /// Which promises the verification found not to be trusted, and why, in words.
    pub fn verification_doubts(&self) -> Vec<String> {
        let mut said = Vec::new();
        for v in &self.verification_by_material {
            for (label, list) in [("best", &v.best), ("base", &v.base)] {
                for p in list {
                    if !p.doubts.is_empty() {
                        said.push(format!(
                            "Material \"{}\", {label} specimen: do not trust what is promised of {}: {}.",
                            v.material,
                            symbol_of_parameter(&p.parameter),
                            p.doubts.join("; ")
                        ));
                    }
                }
            }
        }
        said
    }

    /// Where fits of the verification failed, or were made on other meshes, in words.
    pub fn verification_failures(&self) -> Vec<String> {
        let mut said = Vec::new();
        for v in &self.verification_by_material {
            let larger = [("best", v.best_on_larger_elements), ("base", v.base_on_larger_elements)];
            for (label, _) in larger.into_iter().filter(|(_, is_larger)| *is_larger) {
                said.push(format!(
                    "Verification, material \"{}\", {label} specimen: on the small elements of a verification it has no equilibrium; \
                     truth and fits have larger ones. Its edges or holes are near folding.",
                    v.material
                ));
            }
            for (label, list, reason) in [("best", &v.best, &v.best_failure), ("base", &v.base, &v.base_failure)] {
                if let (Some(p), Some(reason)) = (list.first(), reason) {
                    said.push(format!(
                        "Caution. Verification, material \"{}\", {label} specimen: {} of {} calibrations failed, the first because: \
                         {reason}. Its promised standard deviations are not verified by these.",
                        v.material,
                        p.failed_draws,
                        p.draws + p.failed_draws
                    ));
                }
            }
        }
        said
    }

    /// Adds what the verification found.
    pub fn add_verification(&mut self, by_material: Vec<MaterialVerification>) {
        if let Some(first) = by_material.first() {
            self.verification = Verification { best: first.best.clone(), base: first.base.clone() };
        }
        self.verification_by_material = by_material;
    }
}

/// Entries that no other entry beats in both force and information.
fn pareto(ranked: &[DesignEntry]) -> Vec<usize> {
    let values: Vec<(f64, f64)> =
        ranked.iter().map(|e| (e.force_n(), e.information().unwrap_or(f64::INFINITY))).collect();
    let mut front: Vec<usize> = (0..values.len())
        .filter(|&i| {
            ranked[i].is_within_limits
                && !values.iter().enumerate().any(|(j, v)| {
                    j != i && v.0 <= values[i].0 && v.1 <= values[i].1 && (v.0 < values[i].0 || v.1 < values[i].1)
                })
        })
        .collect();
    front.sort_by(|a, b| values[*a].0.total_cmp(&values[*b].0));
    front
}
