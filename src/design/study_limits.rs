//! What a study may hold.

use crate::field::schema::{integer_within, number_above, number_within, numbers, schema_type};
use crate::specimen::MAX_HOLE_ANGLE_DEG;

/// The schema that this version reads and writes.
pub(super) const SCHEMA: &str = "study/1";
/// Seed of a study that gives none.
pub(super) const DEFAULT_SEED: u64 = 1;
/// Weight of a material that gives none.
pub(super) const DEFAULT_WEIGHT: f64 = 1.0;
/// Largest relative standard deviation of a prior.
pub(super) const MAX_RELATIVE_SD: f64 = 0.5;
/// Smallest weight of a material: practically none.
pub(super) const MIN_WEIGHT: f64 = 1e-6;
/// Largest weight of a material or a parameter.
pub(super) const MAX_WEIGHT: f64 = 1e6;
/// Most holes of a design: the number of structures grows with it.
pub(super) const MAX_HOLES_TO_TRY: usize = 8;
/// Smallest length or drive that a range may hold, mm.
pub(super) const MIN_LENGTH_MM: f64 = 1e-3;
/// Largest length or drive that a range may hold, mm.
pub(super) const MAX_LENGTH_MM: f64 = 1e3;
/// Most designs, steps or draws that a budget may ask for.
pub(super) const MAX_COUNT: usize = 1_000_000;

schema_type! {
    /// The relative standard deviation of a prior.
    pub(super) RelativeSd = number_within(0.0..=MAX_RELATIVE_SD).default(Some(0.0.into()));
    /// The weight of a material in averages.
    pub(super) Weight = number_within(MIN_WEIGHT..=MAX_WEIGHT).default(Some(DEFAULT_WEIGHT.into()));
    /// The weight of a parameter.
    pub(super) ParameterWeight = number_within(0.0..=MAX_WEIGHT);
    /// A number of holes to try.
    pub(super) HoleCount = integer_within(0..=MAX_HOLES_TO_TRY);
    /// A length or a drive, mm.
    pub(super) LengthMm = number_within(MIN_LENGTH_MM..=MAX_LENGTH_MM);
    /// Three lengths along x, y and z, mm, each above 0.
    pub(super) EdgesMm = numbers(number_above(0.0), 3..=3);
    /// A length either way, mm.
    pub(super) OffsetMm = number_within(-MAX_LENGTH_MM..=MAX_LENGTH_MM);
    /// An angle of a hole, degrees.
    pub(super) AngleDeg = number_within(-MAX_HOLE_ANGLE_DEG..=MAX_HOLE_ANGLE_DEG);
    /// A number of designs, steps or draws.
    pub(super) Count = integer_within(1..=MAX_COUNT);
    /// A number of designs that may be none.
    pub(super) CountOrNone = integer_within(0..=MAX_COUNT);
}
