//! A study in a file (`study/1`): files may be named instead of specimens and materials spelled out.

use super::aim::Objective;
use super::inline::Inline;
use super::study::{Budget, MaterialPrior, Study, Vary, VerificationSettings};
use super::study_error::StudyError;
use super::study_limits::{DEFAULT_SEED, DEFAULT_WEIGHT, RelativeSd, SCHEMA, Weight};
use crate::field::file_tag;
use crate::field::schema::{Seed, schema_of_file};
use crate::field::{FieldError, read};
use crate::material::Material;
use crate::sensitivity::{Protocol, ScanSettings};
use crate::specimen::json::schema_of;
use crate::specimen::{ManufacturingLimits, Name, Specimen};
use serde::Deserialize;
use std::path::Path;
use utoipa::ToSchema;

file_tag!(StudyTag, SCHEMA);

/// A study (`study/1`), with specimen and materials spelled out.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = StudySchema)]
struct StudyFile {
    /// Always `study/1`.
    #[serde(rename = "schema")]
    _schema: StudyTag,
    /// Free name.
    #[schema(value_type = Name)]
    name: String,
    /// What designs are compared with.
    #[schema(value_type = Specimen)]
    base: Inline<Specimen>,
    /// Material priors; the first is the main one. Each has a name of its own.
    #[schema(min_items = 1)]
    materials: Vec<MaterialEntry>,
    /// The scan.
    scan: ScanSettings,
    /// Which samples are scanned, of the base as of every design, forces read on the way to the scan, and what is not
    /// known of the load cell. A force at or beyond the drive of a design's scan is left out. The drive's zero counts
    /// at confirmation alone. How designs with several scans share their time is found for each of them, so that
    /// `scan_share` is left out.
    #[serde(default)]
    protocol: Protocol,
    /// What may vary; what is absent stays as in the base specimen.
    vary: Vary,
    /// What can be made and measured.
    limits: ManufacturingLimits,
    /// What is sought.
    #[serde(default)]
    objective: Objective,
    /// How hard it is sought.
    #[serde(default)]
    budget: Budget,
    /// The proof by calibration on synthetic scans.
    #[serde(default)]
    verification: VerificationSettings,
    /// Seed of everything random; 1 by default.
    #[serde(default = "default_seed")]
    #[schema(value_type = Seed, default = default_seed)]
    seed: u64,
}

fn default_seed() -> u64 {
    DEFAULT_SEED
}

/// A material prior of a study.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = PriorSchema)]
struct MaterialEntry {
    /// Name in results.
    name: String,
    /// Central values.
    #[schema(value_type = Material)]
    material: Inline<Material>,
    /// Relative standard deviation of the prior; 0 by default.
    #[serde(default)]
    #[schema(value_type = RelativeSd)]
    relative_sd: f64,
    /// Weight in averages over materials; 1 by default.
    #[serde(default = "default_weight")]
    #[schema(value_type = Weight)]
    weight: f64,
}

fn default_weight() -> f64 {
    DEFAULT_WEIGHT
}

schema_of_file!(Study, StudyFile);
schema_of_file!(MaterialPrior, MaterialEntry);

impl StudyFile {
    /// The study, with the base specimen and the materials as the given functions take them; the second one is also
    /// given the material's place in the list.
    fn study<E>(
        self,
        base: impl FnOnce(Inline<Specimen>) -> Result<Specimen, E>,
        mut material: impl FnMut(usize, Inline<Material>) -> Result<Material, E>,
    ) -> Result<Study, E> {
        let mut materials = Vec::with_capacity(self.materials.len());
        for (index, entry) in self.materials.into_iter().enumerate() {
            let MaterialEntry { name, material: inline, relative_sd, weight } = entry;
            materials.push(MaterialPrior { name, material: material(index, inline)?, relative_sd, weight });
        }
        Ok(Study {
            name: self.name,
            base: base(self.base)?,
            materials,
            scan: self.scan,
            protocol: self.protocol,
            vary: self.vary,
            limits: self.limits,
            objective: self.objective,
            budget: self.budget,
            verification: self.verification,
            seed: self.seed,
        })
    }
}

impl Study {
    /// Reads a study; files that it names are looked for beside it, in `folder`.
    ///
    /// # Errors
    /// [`StudyError`].
    pub fn from_json(text: &str, folder: &Path) -> Result<Study, StudyError> {
        let file: StudyFile = serde_json::from_str(text).map_err(|error| match schema_of(text) {
            Some(found) if found != SCHEMA => {
                StudyError::Json { message: format!("schema is '{found}', expected '{SCHEMA}'") }
            }
            _ => StudyError::Json { message: error.to_string() },
        })?;
        let study = file.study(
            |base| base.resolve(folder, Specimen::from_json),
            |_, material| material.resolve(folder, Material::from_json),
        )?;
        study.validate()?;
        Ok(study)
    }

    /// Reads the study of a request, which spells specimen and materials out.
    ///
    /// # Errors
    /// Every rule that the study violates; a value that does not fit its type, or a file's name, alone.
    pub fn from_request(value: &serde_json::Value) -> Result<Study, Vec<FieldError>> {
        let file: StudyFile = read(value).map_err(|error| vec![error])?;
        let study = file
            .study(
                |base| base.spelled_out("/base"),
                |index, material| material.spelled_out(&format!("/materials/{index}/material")),
            )
            .map_err(|error| vec![error])?;
        let errors = study.field_errors();
        if errors.is_empty() { Ok(study) } else { Err(errors) }
    }
}
