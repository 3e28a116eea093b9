//! A sweep study in a file (`sweep-study/1`): files may be named instead of specimens and materials spelled out.

use super::study::{NamedMaterial, SCHEMA, Sampling, SweepStudy, SweepVariable};
use super::study_error::SweepStudyError;
use crate::design::Inline;
use crate::field::file_tag;
use crate::field::schema::{Seed, schema_of_file};
use crate::field::{FieldError, read};
use crate::material::Material;
use crate::mesh::MeshSize;
use crate::sensitivity::ScanSettings;
use crate::specimen::Specimen;
use serde::Deserialize;
use std::path::Path;
use utoipa::ToSchema;

file_tag!(SweepStudyTag, SCHEMA);

/// A sweep study (`sweep-study/1`), with specimen and materials spelled out.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = SweepStudySchema)]
struct StudyFile {
    /// Always `sweep-study/1`.
    #[serde(rename = "schema")]
    _schema: SweepStudyTag,
    /// Free name.
    name: String,
    /// What the variables change.
    #[schema(value_type = Specimen)]
    base: Inline<Specimen>,
    /// Materials, each with a name of its own; each design is evaluated with each of them.
    #[schema(min_items = 1)]
    materials: Vec<MaterialEntry>,
    /// The scan.
    scan: ScanSettings,
    /// What varies; the order is that of the table's columns.
    variables: Vec<SweepVariable>,
    /// How the space is sampled.
    sampling: Sampling,
    /// The mesh; `search` by default.
    #[serde(default = "search_mesh")]
    mesh: MeshSize,
    /// Seed of the Latin hypercube; 1 by default.
    #[serde(default = "default_seed")]
    #[schema(value_type = Seed, default = default_seed)]
    seed: u64,
}

fn search_mesh() -> MeshSize {
    MeshSize::Search
}

fn default_seed() -> u64 {
    1
}

/// A material of a sweep study.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = NamedMaterial)]
struct MaterialEntry {
    /// Name in results.
    name: String,
    /// Its values.
    #[schema(value_type = Material)]
    material: Inline<Material>,
}

schema_of_file!(SweepStudy, StudyFile);
schema_of_file!(NamedMaterial, MaterialEntry);

impl StudyFile {
    /// The study, with the base specimen and the materials as the given functions take them; the second one is also
    /// given the material's place in the list.
    fn study<E>(
        self,
        base: impl FnOnce(Inline<Specimen>) -> Result<Specimen, E>,
        mut material: impl FnMut(usize, Inline<Material>) -> Result<Material, E>,
    ) -> Result<SweepStudy, E> {
        let mut materials = Vec::with_capacity(self.materials.len());
        for (index, entry) in self.materials.into_iter().enumerate() {
            materials.push(NamedMaterial { name: entry.name, material: material(index, entry.material)? });
        }
        Ok(SweepStudy {
            schema: SCHEMA.into(),
            name: self.name,
            base: base(self.base)?,
            materials,
            scan: self.scan,
            variables: self.variables,
            sampling: self.sampling,
            mesh: self.mesh,
            seed: self.seed,
        })
    }
}

impl SweepStudy {
    /// Reads a study; files that it names are looked for in `folder`.
    ///
    /// # Errors
    /// [`SweepStudyError`].
    pub fn from_json(text: &str, folder: &Path) -> Result<SweepStudy, SweepStudyError> {
        let not_a_study = |message: String| SweepStudyError::Json { message };
        let value = serde_json::from_str::<serde_json::Value>(text).map_err(|e| not_a_study(e.to_string()))?;
        match value.get("schema").and_then(|s| s.as_str()) {
            Some(SCHEMA) => {}
            Some(other) => return Err(not_a_study(format!("schema is '{other}', expected '{SCHEMA}'"))),
            None => return Err(not_a_study(format!("there is no schema '{SCHEMA}'"))),
        }
        let file: StudyFile = read(&value).map_err(|e| not_a_study(e.to_string()))?;
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
    pub fn from_request(value: &serde_json::Value) -> Result<SweepStudy, Vec<FieldError>> {
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
