//! Element sizes as people name them.

use super::MeshOptions;
use crate::field::FieldError;
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};

/// Smallest and largest factor on the standard element size.
pub const SIZE_FACTORS: std::ops::RangeInclusive<f64> = 0.2..=5.0;

/// `search`, `standard`, `fine`, or a factor on the standard element size.
///
/// In JSON a name, or the factor as a number (or as text, as command lines give it).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub enum MeshSize {
    /// For a search over many designs.
    Search,
    /// The default.
    #[default]
    Standard,
    /// For confirmed results.
    Fine,
    /// A factor on the standard size, within [`SIZE_FACTORS`].
    Factor(f64),
}

impl MeshSize {
    /// The mesh of a specimen at this size.
    pub fn options(self, specimen: &Specimen) -> MeshOptions {
        match self {
            MeshSize::Search => MeshOptions::search(specimen),
            MeshSize::Standard => MeshOptions::standard(specimen),
            MeshSize::Fine => MeshOptions::fine(specimen),
            MeshSize::Factor(factor) => MeshOptions::scaled(specimen, factor),
        }
    }

    /// The size as a factor on the standard one.
    pub fn factor(self) -> f64 {
        match self {
            MeshSize::Search => super::options::SEARCH_FACTOR,
            MeshSize::Standard => 1.0,
            MeshSize::Fine => super::options::FINE_FACTOR,
            MeshSize::Factor(factor) => factor,
        }
    }
}

impl std::str::FromStr for MeshSize {
    type Err = FieldError;

    fn from_str(text: &str) -> Result<MeshSize, FieldError> {
        match text {
            "search" => Ok(MeshSize::Search),
            "standard" => Ok(MeshSize::Standard),
            "fine" => Ok(MeshSize::Fine),
            other => match other.parse::<f64>() {
                Ok(factor) if SIZE_FACTORS.contains(&factor) => Ok(MeshSize::Factor(factor)),
                _ => {
                    let [low, high] = [SIZE_FACTORS.start(), SIZE_FACTORS.end()];
                    let allowed = format!("search, standard, fine or a size factor from {low} to {high}");
                    Err(FieldError::new("", format!("{other:?}"), allowed))
                }
            },
        }
    }
}

/// As JSON holds it.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Written {
    Factor(f64),
    Text(String),
}

impl TryFrom<Written> for MeshSize {
    type Error = FieldError;

    fn try_from(written: Written) -> Result<MeshSize, FieldError> {
        match written {
            Written::Factor(factor) => factor.to_string().parse(),
            Written::Text(text) => text.parse(),
        }
    }
}

impl From<MeshSize> for Written {
    fn from(size: MeshSize) -> Written {
        match size {
            MeshSize::Factor(factor) => Written::Factor(factor),
            named => Written::Text(named.to_string()),
        }
    }
}

impl std::fmt::Display for MeshSize {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            MeshSize::Search => f.write_str("search"),
            MeshSize::Standard => f.write_str("standard"),
            MeshSize::Fine => f.write_str("fine"),
            MeshSize::Factor(factor) => factor.fmt(f),
        }
    }
}

#[cfg(feature = "schema")]
mod schema {
    use super::{MeshSize, SIZE_FACTORS};
    use utoipa::openapi::RefOr;
    use utoipa::openapi::schema::{ObjectBuilder, OneOfBuilder, Schema, Type};
    use utoipa::{PartialSchema, ToSchema};

    impl PartialSchema for MeshSize {
        fn schema() -> RefOr<Schema> {
            let names = ObjectBuilder::new().schema_type(Type::String).max_length(Some(24));
            let [low, high] = [*SIZE_FACTORS.start(), *SIZE_FACTORS.end()];
            let factor = ObjectBuilder::new().schema_type(Type::Number).minimum(Some(low)).maximum(Some(high));
            let text =
                format!("Element size: search, standard, fine, or a factor from {low} to {high} on the standard size.");
            OneOfBuilder::new().item(factor).item(names).description(Some(text)).into()
        }
    }

    impl ToSchema for MeshSize {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_factors_come_back() {
        for text in ["search", "standard", "fine", "0.2", "5", "1.8"] {
            let size: MeshSize = text.parse().unwrap();
            assert_eq!(size.to_string(), text);
            assert_eq!(serde_json::from_str::<MeshSize>(&serde_json::to_string(&size).unwrap()).unwrap(), size);
        }
        for text in ["", "coarse", "0.19", "5.1", "nan", "inf", "-1"] {
            assert!(text.parse::<MeshSize>().is_err(), "{text}");
        }
    }
}
