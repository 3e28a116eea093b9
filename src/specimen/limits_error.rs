//! What can be wrong with manufacturability limits.

use super::JsonProblem;

/// Why a set of limits is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LimitsError {
    /// The text is not JSON, or a field is missing, unknown, doubled or of the wrong type.
    #[error("limits JSON, {0}")]
    Json(JsonProblem),
    /// A limit is not a finite positive number.
    #[error("{field} is {value}; give a finite number above {above}")]
    OutOfRange {
        /// Name of the field.
        field: String,
        /// Its value.
        value: f64,
        /// It must be above this.
        above: f64,
    },
    /// Neither or both of the two ways to limit diameters are given.
    #[error("diameter_mm given: {has_range}, punches_mm given: {has_punches}; give exactly one of them")]
    DiametersAmbiguous {
        /// Whether `diameter_mm` is given.
        has_range: bool,
        /// Whether `punches_mm` is given.
        has_punches: bool,
    },
    /// The range of diameters is empty.
    #[error("diameter_mm runs from {min_mm} to {max_mm} mm; the minimum must not exceed the maximum")]
    EmptyRange {
        /// `diameter_mm.min`.
        min_mm: f64,
        /// `diameter_mm.max`.
        max_mm: f64,
    },
    /// No punch is given.
    #[error("punches_mm is empty; list at least one punch diameter, mm, or give diameter_mm instead")]
    NoPunches,
    /// More holes are allowed than the program supports.
    #[error("max_holes is {value}; choose at most {limit}")]
    TooManyHoles {
        /// Its value.
        value: usize,
        /// Most.
        limit: usize,
    },
}
