//! What can be wrong with a material.

use crate::field::{FieldError, FieldPath};
use crate::specimen::JsonProblem;

/// Why a material is refused. Every variant carries the value, the limit and what to change.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MaterialError {
    /// The text is not JSON, or a field is missing, unknown, doubled or of the wrong type.
    #[error("material JSON, {0}")]
    Json(JsonProblem),
    /// The schema is another one.
    #[error("schema is {found:?}; set it to one of {expected:?}")]
    WrongSchema {
        /// What the text says.
        found: String,
        /// What this version reads.
        expected: &'static [&'static str],
    },
    /// No or too many terms.
    #[error("there are {count} terms; give 1 to {limit}")]
    NumTerms {
        /// How many.
        count: usize,
        /// Most.
        limit: usize,
    },
    /// A law in the first invariant has no terms.
    #[error("there are {count} Ogden terms beside a law in the first invariant; leave out one of the two")]
    TermsBesideLaw {
        /// How many.
        count: usize,
    },
    /// A number is NaN or infinite.
    #[error("{field} is {value}; give a finite number")]
    NotFinite {
        /// Path of the field.
        field: FieldPath,
        /// Its value.
        value: f64,
    },
    /// κ is not positive, or too large.
    #[error("bulk_kpa is {value}; it must be above 0 and at most {limit} kPa")]
    BulkOutOfRange {
        /// κ, kPa.
        value: f64,
        /// Largest, kPa.
        limit: f64,
    },
    /// |μ| is too large.
    #[error("terms[{term}].mu_kpa is {value}; its magnitude must be at most {limit} kPa")]
    MuOutOfRange {
        /// Index of the term.
        term: usize,
        /// μ, kPa.
        value: f64,
        /// Largest |μ|, kPa.
        limit: f64,
    },
    /// |α| is too small or too large.
    #[error("terms[{term}].alpha is {value}; its magnitude must be from {min} to {max}")]
    AlphaOutOfRange {
        /// Index of the term.
        term: usize,
        /// α.
        value: f64,
        /// Smallest |α|.
        min: f64,
        /// Largest |α|.
        max: f64,
    },
    /// A parameter of a law in the first invariant is out of range.
    #[error("{field} is {value}; it must be from {min} to {max}, a modulus above 0")]
    LawOutOfRange {
        /// The field.
        field: FieldPath,
        /// Its value.
        value: f64,
        /// Smallest.
        min: f64,
        /// Largest.
        max: f64,
    },
    /// Hill's condition for up to two terms: each μα is positive.
    #[error(
        "terms[{term}]: mu_kpa {mu} times alpha {alpha} is not above 0; with one or two terms each product must be (Hill's stability): give both the same sign"
    )]
    HillViolated {
        /// Index of the term.
        term: usize,
        /// μ, kPa.
        mu: f64,
        /// α.
        alpha: f64,
    },
    /// The initial shear modulus ½ Σ μα is not positive.
    #[error("half the sum of mu_kpa times alpha, the initial shear modulus, is {value} kPa; it must be above 0")]
    ShearModulusNotPositive {
        /// ½ Σ μα, kPa.
        value: f64,
    },
}

impl MaterialError {
    /// The same as an error of a field, with a pointer into the material.
    pub fn field_error(&self) -> FieldError {
        use MaterialError as E;
        let of_term = |term: usize| FieldPath::of("terms").index(term);
        match self {
            E::Json(problem) => FieldError::new("", "", "JSON of a material").remedy(problem.to_string()),
            E::WrongSchema { found, expected } => {
                FieldError::new("/schema", format!("{found:?}"), format!("one of {expected:?}"))
            }
            E::NumTerms { count, limit } => {
                FieldError::new("/terms", format!("a list of {count}"), format!("a list of 1 to {limit} terms"))
            }
            E::TermsBesideLaw { count } => {
                FieldError::new("/terms", format!("a list of {count} beside a law"), "left out")
            }
            E::NotFinite { field, value } => FieldError::new(field.pointer(), value, "a finite number"),
            E::BulkOutOfRange { value, limit } => {
                FieldError::new("/bulk_kpa", value, format!("above 0 and at most {limit} kPa"))
            }
            E::MuOutOfRange { term, value, limit } => {
                let pointer = of_term(*term).name("mu_kpa").pointer();
                FieldError::new(pointer, value, format!("of a magnitude of at most {limit} kPa"))
            }
            E::AlphaOutOfRange { term, value, min, max } => {
                let pointer = of_term(*term).name("alpha").pointer();
                FieldError::new(pointer, value, format!("of a magnitude from {min} to {max}"))
            }
            E::LawOutOfRange { field, value, min, max } => {
                FieldError::new(field.pointer(), value, format!("from {min} to {max}, a modulus above 0"))
            }
            E::HillViolated { term, mu, alpha } => {
                let value = format!("mu_kpa {mu} and alpha {alpha}");
                FieldError::new(of_term(*term).pointer(), value, "two numbers of the same sign")
                    .remedy("with one or two terms each product of mu_kpa and alpha is above 0 (Hill's stability)")
            }
            E::ShearModulusNotPositive { value } => {
                let value = format!("a list with an initial shear modulus of {value} kPa");
                FieldError::new("/terms", value, "one with half the sum of mu_kpa times alpha above 0")
            }
        }
    }
}
