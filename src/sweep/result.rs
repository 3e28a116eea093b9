//! The result of a sweep as JSON (`sweep/1`).

use super::study::SweepStudy;
use super::table::{Cells, SweepTable};
use crate::field::schema::{number, schema_type};
use crate::provenance::VERSION;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa::openapi::schema::{ObjectBuilder, OneOfBuilder, Type};

/// A finished sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SweepResult {
    /// Always `sweep/1`.
    pub schema: String,
    /// The study with all that it names.
    pub study: SweepStudy,
    /// Tasks: designs × materials.
    pub num_tasks: usize,
    /// Tasks that failed.
    pub num_failed: usize,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// The table, one list of cells per row.
    #[schema(value_type = Vec<Vec<CellSchema>>)]
    pub rows: Vec<Vec<SweepCell>>,
    /// Version of the program.
    pub version: String,
    /// SHA-256 of the study, hexadecimal.
    pub input_hash: String,
}

schema_type! {
    /// A cell of the table: a number, a word, or nothing where it is missing.
    pub CellSchema = OneOfBuilder::new()
        .item(number())
        .item(ObjectBuilder::new().schema_type(Type::String))
        .item(ObjectBuilder::new().schema_type(Type::Null));
}

/// A cell of the table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum SweepCell {
    /// A whole number.
    Integer(i64),
    /// A number.
    Number(f64),
    /// A word.
    Text(String),
    /// Missing.
    Null,
}

impl SweepResult {
    /// Puts a result together.
    pub fn new(study: &SweepStudy, table: &SweepTable) -> SweepResult {
        let cell = |cells: &Cells, row: usize| match cells {
            Cells::Integers(v) => v[row].map_or(SweepCell::Null, SweepCell::Integer),
            Cells::Numbers(v) => v[row].map_or(SweepCell::Null, SweepCell::Number),
            Cells::Texts(v) => v[row].clone().map_or(SweepCell::Null, SweepCell::Text),
        };
        let rows = (0..table.num_rows).map(|row| table.columns.iter().map(|c| cell(&c.cells, row)).collect());
        let num_failed = match table.column("status") {
            Some(Cells::Texts(v)) => v.iter().filter(|s| s.as_deref() == Some("failed")).count(),
            _ => 0,
        };
        SweepResult {
            schema: "sweep/1".into(),
            num_tasks: study.num_tasks(),
            num_failed,
            columns: table.columns.iter().map(|c| c.name.clone()).collect(),
            rows: rows.collect(),
            version: VERSION.into(),
            input_hash: study.hash(),
            study: study.clone(),
        }
    }
}
