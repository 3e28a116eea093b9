//! A material in a file (`ogden/1`): the fields of [`Ogden`] behind the tag that names the format.

#[cfg(feature = "schema")]
use super::MAX_TERMS;
use super::limits::SCHEMA;
#[cfg(feature = "schema")]
use super::limits::{MAX_ALPHA, MAX_MODULUS_KPA};
use super::{Ogden, OgdenTerm};
use crate::field::file_tag;
#[cfg(feature = "schema")]
use crate::field::schema::{list_of, number_above, number_within, schema_of_file, schema_type};
use serde::{Deserialize, Serialize};

file_tag!(MaterialTag, SCHEMA);

#[cfg(feature = "schema")]
schema_type! {
    /// The bulk modulus κ, kPa.
    BulkKpa = number_above(0.0).maximum(Some(MAX_MODULUS_KPA));
    /// A modulus μ of a term, kPa.
    pub(super) MuKpa = number_within(-MAX_MODULUS_KPA..=MAX_MODULUS_KPA);
    /// An exponent α of a term, which is not zero.
    pub(super) Alpha = number_within(-MAX_ALPHA..=MAX_ALPHA);
    /// Terms of the strain energy.
    Terms = list_of::<OgdenTerm>(1..=MAX_TERMS), of OgdenTerm;
}

/// An Ogden material (`ogden/1`).
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = MaterialSchema))]
#[serde(deny_unknown_fields, expecting = "struct Ogden")]
pub(super) struct OgdenFile {
    /// Always `ogden/1`.
    schema: MaterialTag,
    /// κ, kPa.
    #[cfg_attr(feature = "schema", schema(value_type = BulkKpa))]
    bulk_kpa: f64,
    /// Terms.
    #[cfg_attr(feature = "schema", schema(value_type = Terms))]
    terms: Vec<OgdenTerm>,
}

impl From<OgdenFile> for Ogden {
    fn from(file: OgdenFile) -> Ogden {
        let OgdenFile { schema: MaterialTag, bulk_kpa, terms } = file;
        Ogden { bulk_kpa, terms }
    }
}

impl From<Ogden> for OgdenFile {
    fn from(material: Ogden) -> OgdenFile {
        let Ogden { bulk_kpa, terms } = material;
        OgdenFile { schema: MaterialTag, bulk_kpa, terms }
    }
}

#[cfg(feature = "schema")]
schema_of_file!(Ogden, OgdenFile);
