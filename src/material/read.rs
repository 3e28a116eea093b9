//! Reading, writing and validating a material (`ogden/1`, `yeoh/1`, `gent/1`, `arruda_boyce/1`).

use super::invariant_law::InvariantLaw;
use super::limits::{MAX_ALPHA, MAX_MODULUS_KPA, MIN_ALPHA, SCHEMAS};
use super::stability::has_stable_product;
use super::{MAX_TERMS, Material, MaterialError};
use crate::field::{FieldError, FieldPath};
use crate::specimen::JsonProblem;
use crate::specimen::json::schema_of;

impl Material {
    /// Reads and validates a material of any of its schemas.
    ///
    /// ```
    /// use lambdak::material::Material;
    /// let text = r#"{ "schema": "ogden/1", "bulk_kpa": 2173.0, "terms": [{ "mu_kpa": 17.0, "alpha": 1.91 }] }"#;
    /// assert_eq!(Material::from_json(text)?.terms[0].alpha, 1.91);
    /// # Ok::<(), lambdak::material::MaterialError>(())
    /// ```
    ///
    /// # Errors
    /// [`MaterialError`]: the text does not fit the schema, or the material is not valid.
    pub fn from_json(text: &str) -> Result<Material, MaterialError> {
        let material: Material = serde_json::from_str(text).map_err(|error| match schema_of(text) {
            Some(found) if !SCHEMAS.contains(&found.as_str()) => {
                MaterialError::WrongSchema { found, expected: &SCHEMAS }
            }
            _ => MaterialError::Json(JsonProblem::new(text, &error)),
        })?;
        material.validate()?;
        Ok(material)
    }

    /// The material in the schema of its law, indented, with a line break at the end. Reading it back gives the same
    /// numbers.
    pub fn to_json(&self) -> String {
        // Serialising fails only for maps with keys that are not strings and for failing writers: neither is here.
        let mut text = serde_json::to_string_pretty(self).expect("a struct of strings and numbers serialises");
        text.push('\n');
        text
    }

    /// Checks what the types do not: finite numbers, ranges, κ > 0, ½ Σ μα > 0, and for one or two terms each
    /// μα > 0 (Hill). For three and more terms the tangent must also be positive definite over the states that a
    /// specimen visits, which is not checked here.
    ///
    /// # Errors
    /// [`MaterialError`] with the value, the limit and what to change: the first problem found.
    pub fn validate(&self) -> Result<(), MaterialError> {
        self.problems().into_iter().next().map_or(Ok(()), Err)
    }

    /// Every rule that the material violates, with pointers into it; the first is that of [`Material::validate`].
    pub fn field_errors(&self) -> Vec<FieldError> {
        self.problems().iter().map(MaterialError::field_error).collect()
    }

    fn problems(&self) -> Vec<MaterialError> {
        let mut problems = Vec::new();
        if self.law.is_none() && self.terms.is_empty() || self.terms.len() > MAX_TERMS {
            problems.push(MaterialError::NumTerms { count: self.terms.len(), limit: MAX_TERMS });
        }
        if self.law.is_some() && !self.terms.is_empty() {
            problems.push(MaterialError::TermsBesideLaw { count: self.terms.len() });
        }
        if !self.bulk_kpa.is_finite() {
            problems.push(MaterialError::NotFinite { field: FieldPath::of("bulk_kpa"), value: self.bulk_kpa });
        } else if self.bulk_kpa <= 0.0 || self.bulk_kpa > MAX_MODULUS_KPA {
            problems.push(MaterialError::BulkOutOfRange { value: self.bulk_kpa, limit: MAX_MODULUS_KPA });
        }
        // Beyond the limit one error stands for all terms.
        for term in 0..self.terms.len().min(MAX_TERMS) {
            self.check_term(term, &mut problems);
        }
        if let Some(law) = &self.law {
            check_law(law, &mut problems);
        }
        if problems.is_empty() {
            let value = self.initial_shear_modulus_kpa();
            if value <= 0.0 {
                problems.push(MaterialError::ShearModulusNotPositive { value });
            }
        }
        problems
    }

    fn check_term(&self, term: usize, problems: &mut Vec<MaterialError>) {
        let (mu, alpha) = (self.terms[term].mu_kpa, self.terms[term].alpha);
        for (name, value) in [("mu_kpa", mu), ("alpha", alpha)] {
            if !value.is_finite() {
                let field = FieldPath::of("terms").index(term).name(name);
                problems.push(MaterialError::NotFinite { field, value });
            }
        }
        if mu.is_finite() && mu.abs() > MAX_MODULUS_KPA {
            problems.push(MaterialError::MuOutOfRange { term, value: mu, limit: MAX_MODULUS_KPA });
        }
        if alpha.is_finite() && !(MIN_ALPHA..=MAX_ALPHA).contains(&alpha.abs()) {
            problems.push(MaterialError::AlphaOutOfRange { term, value: alpha, min: MIN_ALPHA, max: MAX_ALPHA });
        } else if !has_stable_product(&self.terms[term], self.terms.len()) {
            problems.push(MaterialError::HillViolated { term, mu, alpha });
        }
    }
}

fn check_law(law: &InvariantLaw, problems: &mut Vec<MaterialError>) {
    for parameter in law.parameters() {
        let value = law.value(*parameter);
        let [min, max] = parameter.range();
        let unit = if parameter.is_modulus() { "_kpa" } else { "" };
        let name = format!("{}{unit}", parameter.name());
        if !value.is_finite() {
            problems.push(MaterialError::NotFinite { field: FieldPath::of(&name), value });
        } else if !(min..=max).contains(&value) || (parameter.is_modulus() && !parameter.has_any_sign() && value <= 0.0)
        {
            problems.push(MaterialError::LawOutOfRange { field: FieldPath::of(&name), value, min, max });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::OgdenTerm;
    use proptest::prelude::*;

    fn ogden(bulk_kpa: f64, terms: &[(f64, f64)]) -> Material {
        let terms = terms.iter().map(|&(mu_kpa, alpha)| OgdenTerm { mu_kpa, alpha }).collect();
        Material { bulk_kpa, terms, law: None }
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
        let MaterialError::Json(problem) = Material::from_json(text).unwrap_err() else { panic!("not a JSON error") };
        assert_eq!(problem.field, "terms[0].alfa");
        let text = r#"{ "schema": "ogden/2", "bulk_mpa": 1.0 }"#;
        assert!(matches!(Material::from_json(text), Err(MaterialError::WrongSchema { .. })));
    }

    #[test]
    fn all_errors_come_at_once_with_pointers() {
        let bad = ogden(f64::NAN, &[(1e7, 0.0), (1.0, f64::INFINITY), (1.0, -1.0)]);
        let pointers: Vec<String> = bad.field_errors().into_iter().map(|e| e.pointer).collect();
        assert_eq!(pointers, ["/bulk_kpa", "/terms/0/mu_kpa", "/terms/0/alpha", "/terms/1/alpha"]);
        let unstable = ogden(1.0, &[(9.0, 1.0), (1.0, -1.0)]);
        assert_eq!(unstable.field_errors()[0].pointer, "/terms/1");
        assert_eq!(ogden(2173.0, &[(17.0, 1.91)]).field_errors(), []);
    }

    /// Each law has its own schema; what it writes it reads, and fields of another law are errors.
    #[test]
    fn laws_have_their_own_schemas() {
        let texts = [
            r#"{"schema":"yeoh/1","bulk_kpa":2000.0,"c_1_kpa":8.0,"c_2_kpa":-0.2,"c_3_kpa":0.04}"#,
            r#"{"schema":"gent/1","bulk_kpa":2000.0,"mu_kpa":16.0,"j_m":30.0}"#,
            r#"{"schema":"arruda_boyce/1","bulk_kpa":2000.0,"mu_kpa":15.0,"lambda_m":2.5}"#,
        ];
        for text in texts {
            let material = Material::from_json(text).unwrap();
            assert_eq!(serde_json::to_string(&material).unwrap(), text);
            assert!(Material::from_json(&text.replace("bulk_kpa", "terms\":[],\"bulk_kpa")).is_err(), "{text}");
        }
        let refused = |text: &str| Material::from_json(text).unwrap_err().to_string();
        assert!(refused(&texts[1].replace("\"mu_kpa\":16.0,", "")).contains("missing field `mu_kpa`"));
        assert!(refused(&texts[1].replace("j_m", "lambda_m\":2.0,\"j_m")).contains("unknown field `lambda_m`"));
        assert!(refused(&texts[1].replace("30.0", "0.0")).contains("j_m is 0"));
        assert!(refused(&texts[0].replace("8.0", "-8.0")).contains("c_1_kpa is -8"));
        let mut mixed = Material::from_json(texts[1]).unwrap();
        mixed.terms.push(OgdenTerm { mu_kpa: 1.0, alpha: 2.0 });
        assert!(matches!(mixed.validate(), Err(MaterialError::TermsBesideLaw { count: 1 })));
    }

    /// The tag stands first in JSON, and reading needs it.
    #[test]
    fn the_tag_is_of_the_file() {
        let written = serde_json::to_string(&ogden(2000.0, &[(17.0, 1.5)])).unwrap();
        assert_eq!(written, r#"{"schema":"ogden/1","bulk_kpa":2000.0,"terms":[{"mu_kpa":17.0,"alpha":1.5}]}"#);
        assert!(serde_json::from_str::<Material>(&written.replace("ogden/1", "ogden/2")).is_err());
        assert!(serde_json::from_str::<Material>(r#"{"bulk_kpa":2000.0,"terms":[]}"#).is_err());
    }

    #[test]
    fn shipped_materials_are_valid() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/geometries/materials");
        let mut count = 0;
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let material = Material::from_json(&std::fs::read_to_string(&path).unwrap());
            assert!(material.is_ok(), "{}: {material:?}", path.display());
            count += 1;
        }
        assert!(count >= 2);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_text_is_read_or_refused(text in ".*") {
            let _ = Material::from_json(&text);
        }

        #[test]
        fn reading_back_gives_the_same_material(
            bulk in 1e-3..1e6f64,
            terms in prop::collection::vec((1e-3..1e3f64, 1e-2..50.0f64), 1..=MAX_TERMS),
        ) {
            let material = ogden(bulk, &terms);
            let back = Material::from_json(&material.to_json()).unwrap();
            prop_assert_eq!(back.terms.len(), material.terms.len());
            for parameter in material.parameters() {
                // The shortest decimal that reads back to the same number is written.
                prop_assert_eq!(back.value(parameter).to_bits(), material.value(parameter).to_bits());
            }
        }
    }
}
