//! A material in a file: the fields of [`Material`] behind the tag that names the format, one format per law.
//!
//! It is read through [`MaterialFields`], which holds the fields of all formats, so that errors keep their place in the
//! text, and written through [`MaterialFile`], which has a form of its own for each.

use super::invariant_energy::{ArrudaBoyce, Gent, MooneyRivlin, NeoHookean, Yeoh};
use super::invariant_law::InvariantLaw;
use super::limits::{ARRUDA_BOYCE_SCHEMA, GENT_SCHEMA, MOONEY_RIVLIN_SCHEMA, NEO_HOOKEAN_SCHEMA, SCHEMA, YEOH_SCHEMA};
#[cfg(feature = "schema")]
use super::limits::{
    MAX_ALPHA, MAX_CHAIN_LIMIT, MAX_LOCKING_STRETCH, MAX_MODULUS_KPA, MIN_CHAIN_LIMIT, MIN_LOCKING_STRETCH,
};
use super::{Material, OgdenTerm};
use crate::field::file_tag;
#[cfg(feature = "schema")]
use crate::field::schema::{list_of, number_above, number_within, schema_of_file, schema_type};
use serde::{Deserialize, Serialize};

file_tag!(MaterialTag, SCHEMA);
file_tag!(NeoHookeanTag, NEO_HOOKEAN_SCHEMA);
file_tag!(MooneyRivlinTag, MOONEY_RIVLIN_SCHEMA);
file_tag!(YeohTag, YEOH_SCHEMA);
file_tag!(GentTag, GENT_SCHEMA);
file_tag!(ArrudaBoyceTag, ARRUDA_BOYCE_SCHEMA);

#[cfg(feature = "schema")]
schema_type! {
    /// The bulk modulus κ, kPa.
    BulkKpa = number_above(0.0).maximum(Some(MAX_MODULUS_KPA));
    /// A modulus μ of a term, kPa.
    pub(super) MuKpa = number_within(-MAX_MODULUS_KPA..=MAX_MODULUS_KPA);
    /// An exponent α of a term, which is not zero.
    pub(super) Alpha = number_within(-MAX_ALPHA..=MAX_ALPHA);
    /// Terms of the strain energy.
    Terms = list_of::<OgdenTerm>(1..=super::MAX_TERMS), of OgdenTerm;
    /// A modulus that is positive, kPa.
    PositiveKpa = number_above(0.0).maximum(Some(MAX_MODULUS_KPA));
    /// A coefficient of either sign, kPa.
    CoefficientKpa = number_within(-MAX_MODULUS_KPA..=MAX_MODULUS_KPA);
    /// The limit J_m of Ī₁ − 3.
    ChainLimit = number_within(MIN_CHAIN_LIMIT..=MAX_CHAIN_LIMIT);
    /// The stretch λ_m at which chains lock.
    LockingStretch = number_within(MIN_LOCKING_STRETCH..=MAX_LOCKING_STRETCH);
}

/// An Ogden material (`ogden/1`).
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = OgdenSchema))]
#[serde(deny_unknown_fields)]
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

/// A neo-Hookean material (`neo_hookean/1`): W = ½ μ x, x = Ī₁ − 3.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = NeoHookeanSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct NeoHookeanFile {
    /// Always `neo_hookean/1`.
    schema: NeoHookeanTag,
    /// κ, kPa.
    #[cfg_attr(feature = "schema", schema(value_type = BulkKpa))]
    bulk_kpa: f64,
    /// μ, the initial shear modulus, kPa.
    #[cfg_attr(feature = "schema", schema(value_type = PositiveKpa))]
    mu_kpa: f64,
}

/// Mooney and Rivlin's material (`mooney_rivlin/1`): c₁ (Ī₁ − 3) + c₂ (Ī₂ − 3), with the initial shear modulus
/// 2 (c₁ + c₂).
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = MooneyRivlinSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct MooneyRivlinFile {
    /// Always `mooney_rivlin/1`.
    schema: MooneyRivlinTag,
    /// κ, kPa.
    #[cfg_attr(feature = "schema", schema(value_type = BulkKpa))]
    bulk_kpa: f64,
    /// c₁, kPa.
    #[cfg_attr(feature = "schema", schema(value_type = PositiveKpa))]
    c_1_kpa: f64,
    /// c₂, kPa.
    #[cfg_attr(feature = "schema", schema(value_type = CoefficientKpa))]
    c_2_kpa: f64,
}

/// Yeoh's material (`yeoh/1`): W = c₁ x + c₂ x² + c₃ x³, x = Ī₁ − 3.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = YeohSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct YeohFile {
    /// Always `yeoh/1`.
    schema: YeohTag,
    /// κ, kPa.
    #[cfg_attr(feature = "schema", schema(value_type = BulkKpa))]
    bulk_kpa: f64,
    /// c₁, half the initial shear modulus, kPa.
    #[cfg_attr(feature = "schema", schema(value_type = PositiveKpa))]
    c_1_kpa: f64,
    /// c₂, kPa.
    #[cfg_attr(feature = "schema", schema(value_type = CoefficientKpa))]
    c_2_kpa: f64,
    /// c₃, kPa.
    #[cfg_attr(feature = "schema", schema(value_type = CoefficientKpa))]
    c_3_kpa: f64,
}

/// Gent's material (`gent/1`): W = −½ μ J_m ln(1 − x/J_m), x = Ī₁ − 3.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = GentSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct GentFile {
    /// Always `gent/1`.
    schema: GentTag,
    /// κ, kPa.
    #[cfg_attr(feature = "schema", schema(value_type = BulkKpa))]
    bulk_kpa: f64,
    /// μ, the initial shear modulus, kPa.
    #[cfg_attr(feature = "schema", schema(value_type = PositiveKpa))]
    mu_kpa: f64,
    /// J_m.
    #[cfg_attr(feature = "schema", schema(value_type = ChainLimit))]
    j_m: f64,
}

/// Arruda and Boyce's material (`arruda_boyce/1`): eight chains, the five-term series of the inverse Langevin function.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = ArrudaBoyceSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct ArrudaBoyceFile {
    /// Always `arruda_boyce/1`.
    schema: ArrudaBoyceTag,
    /// κ, kPa.
    #[cfg_attr(feature = "schema", schema(value_type = BulkKpa))]
    bulk_kpa: f64,
    /// μ, kPa.
    #[cfg_attr(feature = "schema", schema(value_type = PositiveKpa))]
    mu_kpa: f64,
    /// λ_m.
    #[cfg_attr(feature = "schema", schema(value_type = LockingStretch))]
    lambda_m: f64,
}

/// A material: `ogden/1`, `neo_hookean/1`, `mooney_rivlin/1`, `yeoh/1`, `gent/1` or `arruda_boyce/1`.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = MaterialSchema))]
#[serde(untagged)]
pub(super) enum MaterialFile {
    /// Ogden's.
    Ogden(OgdenFile),
    /// The neo-Hookean one.
    NeoHookean(NeoHookeanFile),
    /// Mooney and Rivlin's.
    MooneyRivlin(MooneyRivlinFile),
    /// Yeoh's.
    Yeoh(YeohFile),
    /// Gent's.
    Gent(GentFile),
    /// Arruda and Boyce's.
    ArrudaBoyce(ArrudaBoyceFile),
}

impl From<Material> for MaterialFile {
    fn from(material: Material) -> MaterialFile {
        let Material { bulk_kpa, terms, law } = material;
        match law {
            None => MaterialFile::Ogden(OgdenFile { schema: MaterialTag, bulk_kpa, terms }),
            Some(InvariantLaw::NeoHookean(NeoHookean { mu_kpa })) => {
                MaterialFile::NeoHookean(NeoHookeanFile { schema: NeoHookeanTag, bulk_kpa, mu_kpa })
            }
            Some(InvariantLaw::MooneyRivlin(MooneyRivlin { coefficients_kpa: [c_1_kpa, c_2_kpa] })) => {
                let schema = MooneyRivlinTag;
                MaterialFile::MooneyRivlin(MooneyRivlinFile { schema, bulk_kpa, c_1_kpa, c_2_kpa })
            }
            Some(InvariantLaw::Yeoh(Yeoh { coefficients_kpa: [c_1_kpa, c_2_kpa, c_3_kpa] })) => {
                MaterialFile::Yeoh(YeohFile { schema: YeohTag, bulk_kpa, c_1_kpa, c_2_kpa, c_3_kpa })
            }
            Some(InvariantLaw::Gent(Gent { mu_kpa, limit })) => {
                MaterialFile::Gent(GentFile { schema: GentTag, bulk_kpa, mu_kpa, j_m: limit })
            }
            Some(InvariantLaw::ArrudaBoyce(ArrudaBoyce { mu_kpa, locking_stretch })) => {
                let (schema, lambda_m) = (ArrudaBoyceTag, locking_stretch);
                MaterialFile::ArrudaBoyce(ArrudaBoyceFile { schema, bulk_kpa, mu_kpa, lambda_m })
            }
        }
    }
}

/// The formats.
#[derive(Clone, Copy, PartialEq, Deserialize)]
enum MaterialFormat {
    #[serde(rename = "ogden/1")]
    Ogden,
    #[serde(rename = "neo_hookean/1")]
    NeoHookean,
    #[serde(rename = "mooney_rivlin/1")]
    MooneyRivlin,
    #[serde(rename = "yeoh/1")]
    Yeoh,
    #[serde(rename = "gent/1")]
    Gent,
    #[serde(rename = "arruda_boyce/1")]
    ArrudaBoyce,
}

/// The fields of all formats.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a material")]
pub(super) struct MaterialFields {
    schema: MaterialFormat,
    bulk_kpa: f64,
    terms: Option<Vec<OgdenTerm>>,
    c_1_kpa: Option<f64>,
    c_2_kpa: Option<f64>,
    c_3_kpa: Option<f64>,
    mu_kpa: Option<f64>,
    j_m: Option<f64>,
    lambda_m: Option<f64>,
}

/// A field that a format has to have is missing, or one that belongs to another format is there.
#[derive(Debug, thiserror::Error)]
pub(super) enum FieldsProblem {
    #[error("missing field `{0}`")]
    Missing(&'static str),
    #[error("unknown field `{0}` of this schema")]
    Foreign(&'static str),
}

impl TryFrom<MaterialFields> for Material {
    type Error = FieldsProblem;

    fn try_from(fields: MaterialFields) -> Result<Material, FieldsProblem> {
        let MaterialFields { schema, bulk_kpa, mut terms, c_1_kpa, c_2_kpa, c_3_kpa, mu_kpa, j_m, lambda_m } = fields;
        let mut numbers = [
            ("c_1_kpa", c_1_kpa),
            ("c_2_kpa", c_2_kpa),
            ("c_3_kpa", c_3_kpa),
            ("mu_kpa", mu_kpa),
            ("j_m", j_m),
            ("lambda_m", lambda_m),
        ];
        let mut take = |name: &'static str| {
            let field = numbers.iter_mut().find(|(own, _)| *own == name);
            field.and_then(|(_, value)| value.take()).ok_or(FieldsProblem::Missing(name))
        };
        let law = match schema {
            MaterialFormat::Ogden => None,
            MaterialFormat::NeoHookean => Some(InvariantLaw::NeoHookean(NeoHookean { mu_kpa: take("mu_kpa")? })),
            MaterialFormat::MooneyRivlin => {
                let coefficients_kpa = [take("c_1_kpa")?, take("c_2_kpa")?];
                Some(InvariantLaw::MooneyRivlin(MooneyRivlin { coefficients_kpa }))
            }
            MaterialFormat::Yeoh => {
                let coefficients_kpa = [take("c_1_kpa")?, take("c_2_kpa")?, take("c_3_kpa")?];
                Some(InvariantLaw::Yeoh(Yeoh { coefficients_kpa }))
            }
            MaterialFormat::Gent => Some(InvariantLaw::Gent(Gent { mu_kpa: take("mu_kpa")?, limit: take("j_m")? })),
            MaterialFormat::ArrudaBoyce => Some(InvariantLaw::ArrudaBoyce(ArrudaBoyce {
                mu_kpa: take("mu_kpa")?,
                locking_stretch: take("lambda_m")?,
            })),
        };
        let own_terms = match law {
            None => terms.take().ok_or(FieldsProblem::Missing("terms"))?,
            Some(_) => Vec::new(),
        };
        match numbers.iter().find(|(_, value)| value.is_some()) {
            Some((name, _)) => Err(FieldsProblem::Foreign(name)),
            None if terms.is_some() => Err(FieldsProblem::Foreign("terms")),
            None => Ok(Material { bulk_kpa, terms: own_terms, law }),
        }
    }
}

#[cfg(feature = "schema")]
schema_of_file!(Material, MaterialFile);
