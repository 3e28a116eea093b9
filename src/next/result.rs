//! The result of a job `next` (`next/1`).

use crate::material::Material;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// `next/1`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NextResult {
    /// Always `next/1`.
    pub schema: String,
    /// What to do, in a sentence.
    pub sentence: String,
    /// Names of the recordings.
    pub recordings: Vec<String>,
    /// The law fitted to all of them.
    pub material: Material,
    /// Every μ and α.
    pub parameters: Vec<NextParameter>,
    /// The parameter that is known least, or the farthest from its precision where one is asked.
    pub least_known: String,
    /// What the law leaves of the recordings beyond noise.
    pub misfit: MisfitResult,
    /// What may be scanned next, the best first.
    pub candidates: Vec<CandidateResult>,
    /// Whether it is enough; null where no precision is asked.
    pub stop: Option<Stop>,
    /// What may not be scanned.
    pub left_out: Vec<LeftOut>,
    /// Materials that the promises are averaged over.
    pub num_materials: usize,
    /// Remarks.
    pub notes: Vec<String>,
    /// Version of the program.
    pub version: String,
    /// SHA-256 of recordings and settings, hexadecimal.
    pub input_hash: String,
}

/// A parameter as it is known so far, with the misfit in the noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NextParameter {
    /// `mu_1` (kPa), `alpha_1`, …
    pub name: String,
    /// The estimate.
    pub value: f64,
    /// Standard deviation over the estimate; 1 where the recordings do not determine it, or no better.
    pub relative_sd: f64,
    /// Standard deviation over the estimate of what the mesh's error may still make of it. Scans do not lower it, and
    /// no precision that is asked counts it.
    #[serde(default)]
    pub discretisation_relative_sd: f64,
    /// 95 % interval, of noise, misfit and mesh.
    pub interval_95: [f64; 2],
    /// The precision that is asked; null for none.
    pub precision: Option<f64>,
}

/// What the law leaves of the recordings beyond noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MisfitResult {
    /// Of means over boxes of voxels, rms, per component, mm; 0 where no more than noise was found.
    pub structured_by_component_mm: [f64; 3],
    /// Of the forces, as a part of them.
    pub force_relative: f64,
    /// χ² over its expectation under noise alone.
    pub chi2_per_datum: f64,
}

/// A scan that may come next.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CandidateResult {
    /// What it is, in words.
    pub name: String,
    /// Name of its specimen.
    pub specimen: String,
    /// Drives that are scanned, mm.
    pub drive_mm: Vec<f64>,
    /// Drives at which the force alone is read, mm.
    pub force_drive_mm: Vec<f64>,
    /// Whether it repeats what was done.
    pub is_repeat: bool,
    /// Minutes that it takes, a change of the specimen included.
    pub minutes: f64,
    /// Force at its largest drive, N.
    pub force_n: f64,
    /// Part of its voxels that go beyond the states (λ, k) visited so far.
    pub part_beyond: f64,
    /// Relative standard deviations after it, in the order of the parameters.
    pub promised_relative_sd: Vec<f64>,
    /// By how much it lowers the logarithm of the largest relative standard deviation (over its precision, where one is
    /// asked).
    pub gain: f64,
    /// The same per minute.
    pub gain_per_minute: f64,
    /// By how much it lowers ½ ln det of the relative covariance of all μ and α: information in nats.
    pub gain_of_all: f64,
    /// Further scans of this kind with which every parameter has its precision; null where none is asked or no number
    /// suffices.
    pub num_scans_to_precision: Option<usize>,
}

/// Whether it is enough.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Stop {
    /// The verdict.
    pub verdict: StopVerdict,
    /// Further scans of the best candidate that suffice; 0 where it is enough, null where none does.
    pub num_scans: Option<usize>,
    /// The parameter that stands in the way; null where none does.
    pub held_back_by: Option<String>,
    /// Its relative standard deviation after any number of scans of the best candidate; null where none stands in the
    /// way.
    pub reachable_relative_sd: Option<f64>,
}

/// Verdicts on a precision.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum StopVerdict {
    /// It is reached.
    Reached,
    /// Some more scans of the best candidate reach it.
    MoreScans,
    /// No candidate reaches it, however often it is scanned.
    OutOfReach,
}

/// What may not be scanned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct LeftOut {
    /// What it is, in words.
    pub name: String,
    /// Why.
    pub reason: String,
}
