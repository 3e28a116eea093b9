//! Between which values something may vary.

use super::study_limits::{AngleDeg, EdgesMm, HoleCount, LengthMm, OffsetMm};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Two counts, both included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CountRange {
    /// Smallest.
    #[schema(value_type = HoleCount)]
    pub min: usize,
    /// Largest.
    #[schema(value_type = HoleCount)]
    pub max: usize,
}

/// Two lengths, mm, both included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RangeMm)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// Smallest.
    #[schema(value_type = LengthMm)]
    pub min: f64,
    /// Largest.
    #[schema(value_type = LengthMm)]
    pub max: f64,
}

/// Two lengths either way, mm, both included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = OffsetRangeMm)]
#[serde(deny_unknown_fields)]
pub struct OffsetRange {
    /// Smallest.
    #[schema(value_type = OffsetMm)]
    pub min: f64,
    /// Largest.
    #[schema(value_type = OffsetMm)]
    pub max: f64,
}

/// Two angles, degrees, both included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AngleRange {
    /// Smallest.
    #[schema(value_type = AngleDeg)]
    pub min: f64,
    /// Largest.
    #[schema(value_type = AngleDeg)]
    pub max: f64,
}

/// Every angle: a hole looks alike after half a turn.
impl Default for AngleRange {
    fn default() -> Self {
        AngleRange { min: -90.0, max: 90.0 }
    }
}

/// Three edges at least and at most, all included, mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct EdgeRange {
    /// Smallest along x, y and z.
    #[schema(value_type = EdgesMm)]
    pub min: [f64; 3],
    /// Largest along x, y and z.
    #[schema(value_type = EdgesMm)]
    pub max: [f64; 3],
}
