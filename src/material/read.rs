//! Reading, writing and validating a material (`ogden/1`).

use super::{MAX_TERMS, Ogden};
use crate::specimen::JsonProblem;
use crate::specimen::json::schema_of;

/// The schema that this version reads and writes.
pub const SCHEMA: &str = "ogden/1";
/// Smallest |α|. The energy divides by α.
pub const MIN_ALPHA: f64 = 1e-3;
/// Largest |α|. Beyond it λ^α overflows the range of useful stresses within the supported stretches.
pub const MAX_ALPHA: f64 = 50.0;
/// Largest modulus, kPa (1 GPa: far beyond soft matter).
pub const MAX_MODULUS_KPA: f64 = 1e6;

/// Why a material is refused. Every variant carries the value, the limit and what to change.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MaterialError {
    /// The text is not JSON, or a field is missing, unknown, doubled or of the wrong type.
    #[error("material JSON, {0}")]
    Json(JsonProblem),
    /// The schema is another one.
    #[error("schema is {found:?}; set it to {expected:?}")]
    WrongSchema {
        /// What the text says.
        found: String,
        /// What this version reads.
        expected: &'static str,
    },
    /// No or too many terms.
    #[error("there are {count} terms; give 1 to {limit}")]
    NumTerms {
        /// How many.
        count: usize,
        /// Most.
        limit: usize,
    },
    /// A number is NaN or infinite.
    #[error("{field} is {value}; give a finite number")]
    NotFinite {
        /// Path of the field.
        field: String,
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

impl Ogden {
    /// Reads and validates `ogden/1`.
    ///
    /// ```
    /// use lambdak::material::Ogden;
    /// let text = r#"{ "schema": "ogden/1", "bulk_kpa": 2173.0, "terms": [{ "mu_kpa": 17.0, "alpha": 1.91 }] }"#;
    /// assert_eq!(Ogden::from_json(text)?.terms[0].alpha, 1.91);
    /// # Ok::<(), lambdak::material::MaterialError>(())
    /// ```
    ///
    /// # Errors
    /// [`MaterialError`]: the text does not fit the schema, or the material is not valid.
    pub fn from_json(text: &str) -> Result<Ogden, MaterialError> {
        let material: Ogden = serde_json::from_str(text).map_err(|error| match schema_of(text) {
            Some(found) if found != SCHEMA => MaterialError::WrongSchema { found, expected: SCHEMA },
            _ => MaterialError::Json(JsonProblem::new(text, &error)),
        })?;
        material.validate()?;
        Ok(material)
    }

    /// The material as `ogden/1`, indented, with a line break at the end. Reading it back gives each number to within one unit in its
    /// last place (serde_json's default parser rounds so).
    pub fn to_json(&self) -> String {
        // Serialising fails only for maps with keys that are not strings and for failing writers: neither is here.
        let mut text = serde_json::to_string_pretty(self).expect("a struct of strings and numbers serialises");
        text.push('\n');
        text
    }

    /// Checks what the types do not: schema, finite numbers, ranges, κ > 0, ½ Σ μα > 0, and for one or two terms
    /// each μα > 0 (Hill). For three and more terms the tangent must also be positive definite over the states that
    /// a specimen visits, which is not checked here.
    ///
    /// # Errors
    /// [`MaterialError`] with the value, the limit and what to change.
    pub fn validate(&self) -> Result<(), MaterialError> {
        if self.schema != SCHEMA {
            return Err(MaterialError::WrongSchema { found: self.schema.clone(), expected: SCHEMA });
        }
        if self.terms.is_empty() || self.terms.len() > MAX_TERMS {
            return Err(MaterialError::NumTerms { count: self.terms.len(), limit: MAX_TERMS });
        }
        let finite = |field: String, value: f64| {
            if value.is_finite() { Ok(()) } else { Err(MaterialError::NotFinite { field, value }) }
        };
        finite("bulk_kpa".into(), self.bulk_kpa)?;
        if self.bulk_kpa <= 0.0 || self.bulk_kpa > MAX_MODULUS_KPA {
            return Err(MaterialError::BulkOutOfRange { value: self.bulk_kpa, limit: MAX_MODULUS_KPA });
        }
        for (term, ogden_term) in self.terms.iter().enumerate() {
            let (mu, alpha) = (ogden_term.mu_kpa, ogden_term.alpha);
            finite(format!("terms[{term}].mu_kpa"), mu)?;
            finite(format!("terms[{term}].alpha"), alpha)?;
            if mu.abs() > MAX_MODULUS_KPA {
                return Err(MaterialError::MuOutOfRange { term, value: mu, limit: MAX_MODULUS_KPA });
            }
            if !(MIN_ALPHA..=MAX_ALPHA).contains(&alpha.abs()) {
                return Err(MaterialError::AlphaOutOfRange { term, value: alpha, min: MIN_ALPHA, max: MAX_ALPHA });
            }
            if self.terms.len() <= 2 && mu * alpha <= 0.0 {
                return Err(MaterialError::HillViolated { term, mu, alpha });
            }
        }
        let value = 0.5 * self.terms.iter().map(|term| term.mu_kpa * term.alpha).sum::<f64>();
        if value <= 0.0 {
            return Err(MaterialError::ShearModulusNotPositive { value });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::OgdenTerm;
    use proptest::prelude::*;

    fn ogden(bulk_kpa: f64, terms: &[(f64, f64)]) -> Ogden {
        let terms = terms.iter().map(|&(mu_kpa, alpha)| OgdenTerm { mu_kpa, alpha }).collect();
        Ogden { schema: SCHEMA.into(), bulk_kpa, terms }
    }

    #[test]
    fn refuses_what_is_unstable_or_out_of_range() {
        use MaterialError as E;
        assert_eq!(ogden(2173.0, &[(17.0, 1.91)]).validate(), Ok(()));
        assert_eq!(ogden(2173.0, &[(-17.0, -1.91)]).validate(), Ok(()));
        assert!(matches!(ogden(1.0, &[]).validate(), Err(E::NumTerms { count: 0, .. })));
        assert!(matches!(ogden(0.0, &[(1.0, 1.0)]).validate(), Err(E::BulkOutOfRange { .. })));
        assert!(matches!(ogden(f64::NAN, &[(1.0, 1.0)]).validate(), Err(E::NotFinite { .. })));
        assert!(matches!(ogden(1.0, &[(f64::INFINITY, 1.0)]).validate(), Err(E::NotFinite { .. })));
        assert!(matches!(ogden(1.0, &[(1.0, 0.0)]).validate(), Err(E::AlphaOutOfRange { .. })));
        assert!(matches!(ogden(1.0, &[(1.0, 51.0)]).validate(), Err(E::AlphaOutOfRange { .. })));
        assert!(matches!(ogden(1.0, &[(1e7, 1.0)]).validate(), Err(E::MuOutOfRange { .. })));
        assert!(matches!(ogden(1.0, &[(9.0, 1.0), (1.0, -1.0)]).validate(), Err(E::HillViolated { term: 1, .. })));
        // Three terms may hold a negative product as long as the sum is positive.
        assert_eq!(ogden(1.0, &[(9.0, 1.0), (1.0, -1.0), (1.0, 1.0)]).validate(), Ok(()));
        let softened = ogden(1.0, &[(9.0, 1.0), (9.0, -1.0), (1.0, -1.0)]);
        assert!(matches!(softened.validate(), Err(E::ShearModulusNotPositive { .. })));
    }

    #[test]
    fn errors_name_the_field_and_the_schema() {
        let text = r#"{ "schema": "ogden/1", "bulk_kpa": 1.0, "terms": [{ "mu_kpa": 1.0, "alfa": 1.0 }] }"#;
        let MaterialError::Json(problem) = Ogden::from_json(text).unwrap_err() else { panic!("not a JSON error") };
        assert_eq!(problem.field, "terms[0].alfa");
        let text = r#"{ "schema": "ogden/2", "bulk_mpa": 1.0 }"#;
        assert!(matches!(Ogden::from_json(text), Err(MaterialError::WrongSchema { .. })));
    }

    #[test]
    fn shipped_materials_are_valid() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/geometries/materials");
        let mut count = 0;
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let material = Ogden::from_json(&std::fs::read_to_string(&path).unwrap());
            assert!(material.is_ok(), "{}: {material:?}", path.display());
            count += 1;
        }
        assert!(count >= 2);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_text_is_read_or_refused(text in ".*") {
            let _ = Ogden::from_json(&text);
        }

        #[test]
        fn reading_back_gives_the_same_material(
            bulk in 1e-3..1e6f64,
            terms in prop::collection::vec((1e-3..1e3f64, 1e-2..50.0f64), 1..=MAX_TERMS),
        ) {
            let material = ogden(bulk, &terms);
            let back = Ogden::from_json(&material.to_json()).unwrap();
            prop_assert_eq!(back.terms.len(), material.terms.len());
            for parameter in material.parameters() {
                let (a, b) = (back.value(parameter), material.value(parameter));
                // One unit in the last place, twice over.
                prop_assert!((a - b).abs() <= 2.0 * f64::EPSILON * b.abs());
            }
        }
    }
}
