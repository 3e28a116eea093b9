//! The sweep study (`sweep-study/1`).

use super::target::Target;
use crate::field::schema::{integer_within, schema_type};
use crate::material::Material;
use crate::mesh::MeshSize;
use crate::provenance::{VERSION, input_hash};
use crate::sensitivity::ScanSettings;
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The schema that this version reads and writes.
pub const SCHEMA: &str = "sweep-study/1";
/// Most tasks of a study.
pub(super) const MAX_TASKS: usize = 10_000_000;

schema_type! {
    /// A number of points of a sweep.
    pub NumPoints = integer_within(1..=MAX_TASKS);
}

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
    pub mesh: MeshSize,
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
    pub material: Material,
}

/// One axis of the space.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SweepVariable {
    /// Name of the column; ends in the unit (`_mm`, `_kpa`, `_n`).
    pub name: String,
    /// What its value is written to; see [`Target::parse`].
    #[schema(min_items = 1)]
    pub sets: Vec<String>,
    /// Values of a grid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub values: Option<Vec<f64>>,
    /// Range of a grid (with `count`) or of a Latin hypercube.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub range: Option<SampleRange>,
}

/// Two ends, both included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SampleRange {
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Values of a grid, evenly spaced, ends included.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<NumPoints>, nullable = false)]
    pub count: Option<usize>,
}

/// How the space is sampled.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case", tag = "kind", deny_unknown_fields)]
pub enum Sampling {
    /// Every combination; the last variable changes fastest.
    Grid {},
    /// `count` points; each variable's range is cut into `count` strata and each stratum hit once.
    LatinHypercube {
        /// Number of points.
        #[schema(value_type = NumPoints)]
        count: usize,
    },
    /// These points, one row each, in the order of the variables.
    List {
        /// The rows.
        rows: Vec<Vec<f64>>,
    },
}

impl SweepStudy {
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

#[cfg(test)]
#[path = "study_tests.rs"]
mod tests;
