//! The sweep study (`sweep-study/1`).

use super::column_names::is_reserved;
use super::error::SweepStudyError;
use super::target::Target;
use crate::design::{Inline, resolve};
use crate::material::Ogden;
use crate::mesh::MeshOptions;
use crate::provenance::{VERSION, input_hash};
use crate::sensitivity::ScanSettings;
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The schema that this version reads and writes.
pub const SCHEMA: &str = "sweep-study/1";
/// Most tasks of a study.
const MAX_TASKS: usize = 10_000_000;

/// A sweep: every design of a sampled space, with every material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SweepStudy {
    /// Always `sweep-study/1`.
    pub schema: String,
    /// Free name.
    pub name: String,
    /// What the variables change.
    pub base: Specimen,
    /// Materials; each design is evaluated with each of them.
    pub materials: Vec<NamedMaterial>,
    /// The scan.
    pub scan: ScanSettings,
    /// What varies; the order is that of the table's columns.
    pub variables: Vec<SweepVariable>,
    /// How the space is sampled.
    pub sampling: Sampling,
    /// The mesh.
    pub mesh: MeshFidelity,
    /// Seed of the Latin hypercube.
    pub seed: u64,
}

/// A material with its name in the table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedMaterial {
    /// Name in results.
    pub name: String,
    /// Its values.
    pub material: Ogden,
}

/// One axis of the space.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SweepVariable {
    /// Name of the column; ends in the unit (`_mm`, `_kpa`, `_n`).
    pub name: String,
    /// What its value is written to; see [`Target::parse`].
    pub sets: Vec<String>,
    /// Values of a grid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub values: Option<Vec<f64>>,
    /// Range of a grid (with `count`) or of a Latin hypercube.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<SampleRange>,
}

/// Two ends, both included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SampleRange {
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Values of a grid, evenly spaced, ends included.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<usize>,
}

/// How the space is sampled.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind", deny_unknown_fields)]
pub enum Sampling {
    /// Every combination; the last variable changes fastest.
    Grid {},
    /// `count` points; each variable's range is cut into `count` strata and each stratum hit once.
    LatinHypercube {
        /// Number of points.
        count: usize,
    },
    /// These points, one row each, in the order of the variables.
    List {
        /// The rows.
        rows: Vec<Vec<f64>>,
    },
}

/// How fine the mesh is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum MeshFidelity {
    /// A named one.
    Named(MeshName),
    /// Element size relative to the standard mesh, 0.2 to 5.
    Factor(f64),
}

/// Named meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MeshName {
    /// [`MeshOptions::search`].
    Search,
    /// [`MeshOptions::standard`].
    Standard,
    /// [`MeshOptions::fine`].
    Fine,
}

impl MeshFidelity {
    /// The options for a specimen.
    pub fn options(self, specimen: &Specimen) -> MeshOptions {
        match self {
            MeshFidelity::Named(MeshName::Search) => MeshOptions::search(specimen),
            MeshFidelity::Named(MeshName::Standard) => MeshOptions::standard(specimen),
            MeshFidelity::Named(MeshName::Fine) => MeshOptions::fine(specimen),
            MeshFidelity::Factor(factor) => MeshOptions::scaled(specimen, factor),
        }
    }
}

/// A study as written: files may be named instead of spelled out.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StudyFile {
    schema: String,
    name: String,
    base: Inline<Specimen>,
    materials: Vec<MaterialEntry>,
    scan: ScanSettings,
    variables: Vec<SweepVariable>,
    sampling: Sampling,
    #[serde(default = "search_mesh")]
    mesh: MeshFidelity,
    #[serde(default = "default_seed")]
    seed: u64,
}

fn search_mesh() -> MeshFidelity {
    MeshFidelity::Named(MeshName::Search)
}

fn default_seed() -> u64 {
    1
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MaterialEntry {
    name: String,
    material: Inline<Ogden>,
}

impl SweepStudy {
    /// Reads a study; files that it names are looked for in `folder`.
    ///
    /// # Errors
    /// [`SweepStudyError`].
    pub fn from_json(text: &str, folder: &Path) -> Result<SweepStudy, SweepStudyError> {
        let found = serde_json::from_str::<serde_json::Value>(text)
            .map_err(|e| SweepStudyError::Json { message: e.to_string() })?;
        match found.get("schema").and_then(|s| s.as_str()) {
            Some(SCHEMA) => {}
            Some(other) => {
                return Err(SweepStudyError::Json { message: format!("schema is '{other}', expected '{SCHEMA}'") });
            }
            None => return Err(SweepStudyError::Json { message: format!("there is no schema '{SCHEMA}'") }),
        }
        let file: StudyFile =
            serde_json::from_str(text).map_err(|e| SweepStudyError::Json { message: e.to_string() })?;
        let materials = file
            .materials
            .into_iter()
            .map(|m| Ok(NamedMaterial { name: m.name, material: resolve(m.material, folder, Ogden::from_json)? }))
            .collect::<Result<Vec<_>, SweepStudyError>>()?;
        let study = SweepStudy {
            schema: file.schema,
            name: file.name,
            base: resolve(file.base, folder, Specimen::from_json)?,
            materials,
            scan: file.scan,
            variables: file.variables,
            sampling: file.sampling,
            mesh: file.mesh,
            seed: file.seed,
        };
        study.validate()?;
        Ok(study)
    }

    /// Hash of the study, of the program's version and of the base's mesh: results of one hash may be mixed.
    pub fn hash(&self) -> String {
        input_hash(&serde_json::json!({
            "study": self,
            "version": VERSION,
            "mesh_of_base": self.mesh.options(&self.base),
        }))
    }

    /// Number of designs.
    pub fn num_points(&self) -> usize {
        match &self.sampling {
            Sampling::Grid {} => self.variables.iter().map(SweepVariable::grid_len).fold(1, usize::saturating_mul),
            Sampling::LatinHypercube { count } => *count,
            Sampling::List { rows } => rows.len(),
        }
    }

    /// Number of tasks: designs × materials.
    pub fn num_tasks(&self) -> usize {
        self.num_points().saturating_mul(self.materials.len())
    }

    /// What each variable sets, in order. Only valid studies are made, so that nothing is left out.
    pub fn targets(&self) -> Vec<Vec<Target>> {
        let parse = |v: &SweepVariable| v.sets.iter().filter_map(|s| Target::parse(&v.name, s).ok()).collect();
        self.variables.iter().map(parse).collect()
    }

    fn validate(&self) -> Result<(), SweepStudyError> {
        let inconsistent = |message: String| Err(SweepStudyError::Inconsistent { message });
        if let Err(e) = self.base.validate() {
            return inconsistent(format!("base: {e}"));
        }
        if self.materials.is_empty() {
            return inconsistent("materials is empty; give at least one".into());
        }
        for (index, m) in self.materials.iter().enumerate() {
            if let Err(e) = m.material.validate() {
                return inconsistent(format!("material '{}': {e}", m.name));
            }
            if self.materials[..index].iter().any(|other| other.name == m.name) {
                return inconsistent(format!("two materials are called '{}'", m.name));
            }
        }
        if let MeshFidelity::Factor(value) = self.mesh
            && !(0.2..=5.0).contains(&value)
        {
            let allowed = "search, standard, fine or a size factor from 0.2 to 5";
            return Err(SweepStudyError::OutOfRange { field: "mesh".into(), value, allowed });
        }
        for (index, variable) in self.variables.iter().enumerate() {
            self.validate_variable(variable)?;
            if self.variables[..index].iter().any(|other| other.name == variable.name) {
                let problem = "another variable has the same name";
                return Err(SweepStudyError::BadName { variable: variable.name.clone(), problem });
            }
        }
        match &self.sampling {
            Sampling::LatinHypercube { count: 0 } => {
                let allowed = "at least 1";
                return Err(SweepStudyError::OutOfRange { field: "sampling.count".into(), value: 0.0, allowed });
            }
            Sampling::List { rows } => {
                for (row, values) in rows.iter().enumerate() {
                    let (found, expected) = (values.len(), self.variables.len());
                    if found != expected {
                        return Err(SweepStudyError::RowLength { row, found, expected });
                    }
                    finite(|| format!("sampling.rows[{row}]"), values)?;
                }
            }
            _ => {}
        }
        let tasks = self.num_tasks();
        if tasks == 0 || tasks > MAX_TASKS {
            let allowed = "from 1 to 10 000 000 (designs × materials)";
            return Err(SweepStudyError::OutOfRange { field: "number of tasks".into(), value: tasks as f64, allowed });
        }
        Ok(())
    }

    fn validate_variable(&self, v: &SweepVariable) -> Result<(), SweepStudyError> {
        let bad = |problem| Err(SweepStudyError::BadName { variable: v.name.clone(), problem });
        if v.name.is_empty() || !v.name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
            return bad("a name consists of letters, digits and underscores");
        }
        if is_reserved(&v.name) {
            return bad("the table has a column of this name already");
        }
        if v.sets.is_empty() {
            return bad("sets is empty; name what the value goes to");
        }
        for text in &v.sets {
            let target = Target::parse(&v.name, text)?;
            for m in &self.materials {
                let (mut specimen, mut material, mut scan) = (self.base.clone(), m.material.clone(), self.scan);
                if !target.set(1.0, &mut specimen, &mut material, &mut scan) {
                    let message = format!(
                        "variable '{}' sets '{text}', but the base specimen has {} holes and material '{}' {} terms",
                        v.name,
                        self.base.holes.len(),
                        m.name,
                        m.material.terms.len()
                    );
                    return Err(SweepStudyError::Inconsistent { message });
                }
            }
            let suffix = target.unit_suffix();
            if !v.name.ends_with(suffix) {
                let (variable, target) = (v.name.clone(), text.clone());
                return Err(SweepStudyError::MissingUnit { variable, target, suffix });
            }
        }
        let missing =
            |sampling, needed| Err(SweepStudyError::MissingValues { variable: v.name.clone(), sampling, needed });
        if let Some(values) = &v.values {
            finite(|| format!("values of '{}'", v.name), values)?;
        }
        if let Some(r) = v.range {
            finite(|| format!("range of '{}'", v.name), &[r.min, r.max])?;
            if r.min > r.max {
                let message = format!("range of '{}': min {} exceeds max {}", v.name, r.min, r.max);
                return Err(SweepStudyError::Inconsistent { message });
            }
        }
        match &self.sampling {
            Sampling::Grid {} if v.values.is_some() == v.range.is_some() => {
                missing("grid", "either values or a range with a count")
            }
            Sampling::Grid {} if v.grid_len() == 0 => missing("grid", "at least one value (range: a count)"),
            Sampling::LatinHypercube { .. } if v.range.is_none() || v.values.is_some() => {
                missing("latin_hypercube", "a range, and no values")
            }
            Sampling::LatinHypercube { .. } if v.range.is_some_and(|r| r.count.is_some()) => {
                missing("latin_hypercube", "a range without a count (the sampling has it)")
            }
            Sampling::List { .. } if v.values.is_some() || v.range.is_some() => {
                missing("list", "neither values nor a range (the rows have them)")
            }
            _ => Ok(()),
        }
    }
}

impl SweepVariable {
    /// Values on a grid.
    pub(super) fn grid_len(&self) -> usize {
        match (&self.values, self.range) {
            (Some(values), _) => values.len(),
            (None, Some(range)) => range.count.unwrap_or(0),
            (None, None) => 0,
        }
    }

    /// The `index`-th value on a grid.
    pub(super) fn grid_value(&self, index: usize) -> f64 {
        match (&self.values, self.range) {
            (Some(values), _) => values[index],
            (None, Some(r)) => match r.count {
                Some(n) if n > 1 && index == n - 1 => r.max,
                Some(n) if n > 1 => r.min + (r.max - r.min) * index as f64 / (n - 1) as f64,
                _ => r.min,
            },
            (None, None) => f64::NAN,
        }
    }
}

fn finite(field: impl Fn() -> String, values: &[f64]) -> Result<(), SweepStudyError> {
    match values.iter().find(|v| !v.is_finite()) {
        None => Ok(()),
        Some(&value) => Err(SweepStudyError::OutOfRange { field: field(), value, allowed: "finite" }),
    }
}

#[cfg(test)]
#[path = "study_tests.rs"]
mod tests;
