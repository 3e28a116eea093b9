//! How small an error of an experiment may be and still be named by a diagnosis: a row of an evaluation's result.

use serde::{Deserialize, Serialize};

/// What keeps a smaller size from being named.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum DetectionLimit {
    /// Its evidence among the noise of voxels and load cell: a longer scan lowers the size.
    Noise,
    /// Its effect is no larger than what a mesh may get wrong: only a larger effect lowers the size.
    Allowance,
    /// Another cause looks so much like it that it would be named in its place.
    Rival,
    /// One drive alone: the cause is looked for where scans at several drives tell it from others.
    Drives,
}

impl DetectionLimit {
    /// In words, for tables.
    pub fn words(self) -> &'static str {
        match self {
            DetectionLimit::Noise => "noise",
            DetectionLimit::Allowance => "the allowance for the mesh",
            DetectionLimit::Rival => "a cause that looks like it",
            DetectionLimit::Drives => "one drive alone",
        }
    }
}

/// The smallest size of one parameter of a cause that a diagnosis would name with 90 % probability.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct DetectableSize {
    /// Name of the cause, as in a diagnosis.
    pub cause: String,
    /// The cause in words: which hole, for instance.
    pub description: String,
    /// The parameter that is off, with its unit; the cause's others are as drawn.
    pub parameter: String,
    /// The size, in the parameter's unit; null where it would not be named at any size that it may have.
    pub size: Option<f64>,
    /// The largest size that it may have: no fit goes beyond.
    pub largest: f64,
    /// What keeps a smaller one from being named.
    pub limited_by: DetectionLimit,
    /// The cause that would be named in its place where it is smaller; absent unless `limited_by` is `rival`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rival: Option<String>,
}
