//! What a proof with several causes at once comes to.

use super::detection::DetectionCurve;
use super::draw::HiddenCause;
use super::experiment::Experiment;
use crate::diagnosis::Verdict;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What is hidden in a recording of such a proof.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExperimentKind {
    /// Two to four causes at once.
    Several,
    /// A mount that is not perfect, by less than does any harm.
    Harmless,
    /// A cause that the diagnosis knows and one that it is not told of (the last).
    Unknown,
}

/// How the diagnosis fared on one of the hidden causes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CauseScore {
    /// The cause.
    pub cause: HiddenCause,
    /// What it does to the displacement that neither the material nor the other causes could do, mm rms.
    pub own_effect_rms_mm: f64,
    /// Largest relative change of a force with it.
    pub own_force_relative: f64,
    /// Whether it can be seen.
    pub is_detectable: bool,
    /// Whether it was named, as a cause or as one that the data cannot tell apart from it.
    pub is_named: bool,
    /// Its parameters: name, and estimate minus truth in half widths of the 95 % interval.
    #[schema(value_type = Vec<Vec<serde_json::Value>>)]
    pub deviations: Vec<(String, f64)>,
}

/// One diagnosis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SeveralScored {
    /// What kind of recording it is.
    pub kind: ExperimentKind,
    /// What was hidden.
    pub experiment: Experiment,
    /// The verdict; null where the diagnosis failed.
    pub verdict: Option<Verdict>,
    /// Causes named, those with the most evidence first.
    pub named: Vec<String>,
    /// Alternatives to them.
    pub alternatives: Vec<String>,
    /// Named causes that were not hidden.
    pub false_names: Vec<String>,
    /// The hidden causes.
    pub causes: Vec<CauseScore>,
    /// Whether it is right: all that can be seen named (several), no mismatch (harmless), unexplained (unknown).
    pub is_right: bool,
    /// Distance from where most is left to the unknown cause, and half the diagonal of that cause, mm.
    pub location_mm: Option<[f64; 2]>,
    /// χ² per datum before and after.
    pub chi2: Option<[f64; 2]>,
    /// Why there is no diagnosis.
    pub failure: Option<String>,
}

/// Sums over one hidden cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CauseOfSeveral {
    /// The cause.
    pub cause: HiddenCause,
    /// How often it was hidden.
    pub num_hidden: usize,
    /// Of these, detectable.
    pub num_detectable: usize,
    /// Of the detectable, named.
    pub num_named: usize,
    /// How often it was named where it was not hidden.
    pub num_false: usize,
    /// Intervals that hold the truth, and all intervals.
    pub num_covered: [usize; 2],
    /// Probability of detection against the size of its own effect.
    pub detection: Option<DetectionCurve>,
}

/// A proof with several causes at once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SeveralProof {
    /// `proof-of-several/1`.
    pub schema: String,
    /// Every diagnosis.
    pub scored: Vec<SeveralScored>,
    /// Sums per cause.
    pub causes: Vec<CauseOfSeveral>,
    /// Recordings with several causes in which all that could be seen were named, of those in which any could be seen.
    pub all_named: [usize; 2],
    /// Named causes that were not hidden, of all that were named (recordings with several causes).
    pub false_of_named: [usize; 2],
    /// Controls without an alarm, of all.
    pub quiet_controls: [usize; 2],
    /// Unexplained recordings of those with an unknown cause that can be seen.
    pub unexplained_of_unknown: [usize; 2],
    /// Of these, the place found, of those whose cause has one.
    pub located_of_unknown: [usize; 2],
    /// Intervals that hold the truth, and all intervals.
    pub covered: [usize; 2],
    /// Program version.
    pub version: String,
    /// The build (see [`crate::provenance::build_id`]).
    pub build: String,
    /// Hash of the settings.
    pub input_hash: String,
}
