//! What can be wrong with manufacturability limits.

use super::JsonProblem;
use crate::field::{FieldError, FieldPath};

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
        /// Path of the field.
        field: FieldPath,
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

impl LimitsError {
    /// The same as an error of a field, with a pointer into the limits.
    pub fn field_error(&self) -> FieldError {
        use LimitsError as E;
        match self {
            E::Json(problem) => FieldError::new("", "", "JSON of limits").remedy(problem.to_string()),
            E::OutOfRange { field, value, above } => {
                FieldError::new(field.pointer(), value, format!("a finite number above {above}"))
            }
            E::DiametersAmbiguous { has_range: true, .. } => {
                FieldError::new("/punches_mm", "given besides diameter_mm", "left out, or given instead of diameter_mm")
            }
            E::DiametersAmbiguous { has_range: false, .. } => {
                FieldError::new("/diameter_mm", "", "given, or punches_mm instead of it")
            }
            E::EmptyRange { min_mm, max_mm } => {
                FieldError::new("/diameter_mm/max", max_mm, format!("at least the minimum, {min_mm} mm"))
            }
            E::NoPunches => FieldError::new("/punches_mm", "[]", "a list of at least one diameter, mm")
                .remedy("or give diameter_mm instead"),
            E::TooManyHoles { value, limit } => FieldError::new("/max_holes", value, format!("at most {limit}")),
        }
    }
}
