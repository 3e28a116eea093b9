//! The table as Parquet. Nothing in the file depends on the machine, the time or the order in which results came.

use super::error::SweepError;
use super::table::{Cells, SweepTable};
use crate::provenance::VERSION;
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::sync::Arc;

/// Rows of a row group.
const GROUP_ROWS: usize = 65_536;

/// The table as a Parquet file: optional columns, uncompressed.
///
/// # Errors
/// [`SweepError::Parquet`].
pub fn to_parquet(table: &SweepTable) -> Result<Vec<u8>, SweepError> {
    encode(table).map_err(|e| SweepError::Parquet { message: e.to_string() })
}

fn encode(table: &SweepTable) -> Result<Vec<u8>, ParquetError> {
    let fields = table
        .columns
        .iter()
        .map(|column| {
            let (physical, logical) = match column.cells {
                Cells::Integers(_) => (Physical::INT64, None),
                Cells::Numbers(_) => (Physical::DOUBLE, None),
                Cells::Texts(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            };
            let builder = Type::primitive_type_builder(&column.name, physical).with_repetition(Repetition::OPTIONAL);
            Ok(Arc::new(builder.with_logical_type(logical).build()?))
        })
        .collect::<Result<Vec<_>, ParquetError>>()?;
    let schema = Arc::new(Type::group_type_builder("sweep").with_fields(fields).build()?);
    let properties = WriterProperties::builder().set_created_by(format!("lambdak version {VERSION}")).build();
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::new(properties))?;
    for start in (0..table.num_rows).step_by(GROUP_ROWS) {
        let range = start..(start + GROUP_ROWS).min(table.num_rows);
        let mut group = writer.next_row_group()?;
        for column in &table.columns {
            // The schema has exactly the table's columns.
            let Some(mut target) = group.next_column()? else { break };
            match &column.cells {
                Cells::Integers(v) => {
                    let (values, levels) = present(&v[range.clone()], |v| *v);
                    target.typed::<Int64Type>().write_batch(&values, Some(&levels), None)?;
                }
                Cells::Numbers(v) => {
                    let (values, levels) = present(&v[range.clone()], |v| *v);
                    target.typed::<DoubleType>().write_batch(&values, Some(&levels), None)?;
                }
                Cells::Texts(v) => {
                    let (values, levels) = present(&v[range.clone()], |v| ByteArray::from(v.as_str()));
                    target.typed::<ByteArrayType>().write_batch(&values, Some(&levels), None)?;
                }
            }
            target.close()?;
        }
        group.close()?;
    }
    writer.into_inner()
}

/// Values that are there, and a 1 for each of them and a 0 for each missing one.
fn present<T, U>(cells: &[Option<T>], convert: impl Fn(&T) -> U) -> (Vec<U>, Vec<i16>) {
    let values = cells.iter().flatten().map(convert).collect();
    (values, cells.iter().map(|c| i16::from(c.is_some())).collect())
}
