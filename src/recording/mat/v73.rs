//! MAT-files of version 7.3: HDF5, read with the `hdf5-pure` crate. Cells are arrays of references, complex numbers are
//! compounds, sizes stand in reverse.

use super::{MAX_DEPTH, MatError, MatValue, take_members};
use crate::file::ReadingMemory;
use hdf5_pure::{AttrValue, DType, Dataset, File, Group, Object};
use std::collections::HashMap;
use std::path::Path;

pub(super) fn read(path: &Path, memory: &ReadingMemory) -> Result<Vec<(String, MatValue)>, MatError> {
    let file = File::open_streaming(path).map_err(failed)?;
    fields(&file.root(), Reading { memory, file_bytes: file.file_size() }, 0)
}

/// What all of a file is read with.
#[derive(Clone, Copy)]
struct Reading<'a> {
    memory: &'a ReadingMemory,
    /// Length of the file.
    file_bytes: u64,
}

/// An error where a chunk of a dataset is said to be stored in more bytes than the file has: memory for them would be
/// taken before they are read.
fn check_chunks(dataset: &Dataset, file_bytes: u64) -> Result<(), MatError> {
    // An index that cannot be listed cannot be read either, which says why.
    let Ok(chunks) = dataset.chunks() else { return Ok(()) };
    match chunks.iter().map(|chunk| chunk.storage_size).max() {
        Some(most) if most > file_bytes => {
            Err(failed(format!("a chunk of {most} bytes in a file of {file_bytes} bytes")))
        }
        _ => Ok(()),
    }
}

/// What the numbers of a dataset take while they are read: its bytes as stored, one chunk of them unpacked, and the
/// numbers themselves. All sizes are the file's own word, so nothing is read before this is granted.
fn reading_bytes(dataset: &Dataset, count: u64) -> Result<u64, MatError> {
    let width = dataset.element_size().map_err(failed)?;
    let chunk = dataset.chunk_shape().map_err(failed)?.unwrap_or_default();
    let in_chunk = chunk.iter().fold(1u64, |product, &n| product.saturating_mul(n));
    Ok(count.saturating_mul(width).saturating_add(in_chunk.saturating_mul(2).saturating_mul(width)))
}

/// What an opened object takes beside its content, bytes.
const REFERENCE_BYTES: u64 = 2048;

fn failed(error: impl std::fmt::Display) -> MatError {
    MatError::Damaged { what: error.to_string() }
}

fn fields(group: &Group, reading: Reading, depth: usize) -> Result<Vec<(String, MatValue)>, MatError> {
    if depth > MAX_DEPTH {
        let (found, limit) = (depth as u64, MAX_DEPTH as u64);
        return Err(MatError::TooLarge { what: "groups within groups", found, limit });
    }
    let mut found = Vec::new();
    for name in group.datasets().map_err(failed)? {
        if !name.starts_with('#') {
            take_members::<(String, MatValue)>(reading.memory, 1)?;
            let dataset = group.dataset(&name).map_err(failed)?;
            found.push((name, value(&dataset, reading, depth)?));
        }
    }
    for name in group.groups().map_err(failed)? {
        if !name.starts_with('#') {
            let inner = group.group(&name).map_err(failed)?;
            found.push((name, MatValue::Struct(fields(&inner, reading, depth + 1)?)));
        }
    }
    found.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(found)
}

fn text_attribute(attributes: &HashMap<String, AttrValue>, name: &str) -> Option<String> {
    match attributes.get(name)? {
        AttrValue::String(s) | AttrValue::AsciiString(s) => Some(s.trim_end_matches('\0').to_string()),
        other => {
            let text = format!("{other:?}");
            text.contains("char").then(|| "char".to_string())
        }
    }
}

fn value(dataset: &Dataset, reading: Reading, depth: usize) -> Result<MatValue, MatError> {
    if depth > MAX_DEPTH {
        let (found, limit) = (depth as u64, MAX_DEPTH as u64);
        return Err(MatError::TooLarge { what: "cells within cells", found, limit });
    }
    let shape = dataset.shape().map_err(failed)?;
    let count = shape.iter().try_fold(1u64, |p, &d| p.checked_mul(d)).ok_or_else(|| failed("sizes overflow"))?;
    reading.memory.check()?;
    let attributes = dataset.attrs().map_err(failed)?;
    let dims: Vec<usize> = shape.iter().rev().map(|&d| d as usize).collect();
    // An empty array is stored as its sizes.
    if attributes.contains_key("MATLAB_empty") {
        return Ok(MatValue::Numeric { dims: vec![0, 0], values: vec![], imaginary: None });
    }
    let dtype = dataset.dtype().map_err(failed)?;
    if matches!(
        dtype,
        DType::String | DType::Enum(_) | DType::Array(..) | DType::VariableLengthString | DType::Other(_)
    ) {
        return Ok(MatValue::Other("a type that is not read"));
    }
    let transient = reading_bytes(dataset, count)?;
    check_chunks(dataset, reading.file_bytes)?;
    reading.memory.take("a variable of the file", transient)?;
    let found = stored(dataset, dtype, (dims, count), &attributes, reading, depth);
    reading.memory.give_back(transient);
    found
}

/// The value of a dataset of a type that is read.
fn stored(
    dataset: &Dataset,
    dtype: DType,
    (dims, count): (Vec<usize>, u64),
    attributes: &HashMap<String, AttrValue>,
    reading: Reading,
    depth: usize,
) -> Result<MatValue, MatError> {
    match dtype {
        DType::ObjectReference => {
            let mut members = Vec::new();
            // A reference takes eight bytes in the file, and what it leads to is opened with all its attributes.
            reading.memory.take("references", count.saturating_mul(REFERENCE_BYTES))?;
            for object in dataset.dereference().map_err(failed)? {
                take_members::<MatValue>(reading.memory, 1)?;
                members.push(match object {
                    Object::Dataset(inner) => value(&inner, reading, depth + 1)?,
                    Object::Group(inner) => MatValue::Struct(fields(&inner, reading, depth + 1)?),
                    _ => MatValue::Other("object"),
                });
            }
            Ok(MatValue::Cell { dims, members })
        }
        DType::Compound(parts) if parts.len() == 2 => {
            reading.memory.take_values::<[f64; 4]>("complex numbers", count)?;
            let raw = dataset.read_raw().map_err(failed)?;
            // MATLAB runs on little-endian machines alone; a complex number is two of its reals without a gap.
            let numbers: Vec<f64> = match (&parts[0].1, &parts[1].1) {
                (DType::F64, DType::F64) => raw
                    .chunks_exact(8)
                    .map(|b| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]))
                    .collect(),
                (DType::F32, DType::F32) => {
                    raw.chunks_exact(4).map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))).collect()
                }
                _ => return Ok(MatValue::Other("a compound that is no complex number")),
            };
            if numbers.len() as u64 != 2 * count {
                return Err(failed(format!("{} reals for {count} complex numbers", numbers.len())));
            }
            let values = numbers.iter().step_by(2).copied().collect();
            let imaginary = numbers.iter().skip(1).step_by(2).copied().collect();
            Ok(MatValue::Numeric { dims, values, imaginary: Some(imaginary) })
        }
        DType::F32
        | DType::F64
        | DType::I8
        | DType::I16
        | DType::I32
        | DType::I64
        | DType::U8
        | DType::U16
        | DType::U32
        | DType::U64 => {
            reading.memory.take_values::<f64>("numbers of a variable", count)?;
            let values = dataset.read_f64().map_err(failed)?;
            if values.len() as u64 != count {
                return Err(failed(format!("{} numbers, the sizes ask for {count}", values.len())));
            }
            if text_attribute(attributes, "MATLAB_class").as_deref() == Some("char") {
                return Ok(MatValue::Text(values.iter().filter_map(|c| char::from_u32(*c as u32)).collect()));
            }
            Ok(MatValue::Numeric { dims, values, imaginary: None })
        }
        _ => Ok(MatValue::Other("a type that is not read")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::MemoryLimit;

    /// A chunk that says to be stored in more bytes than the file has, found by fuzzing: 40 kB took 2.5 GB.
    #[test]
    fn chunks_larger_than_the_file_are_refused() {
        const STORED: u32 = 0x9000_0000;
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/import/v73.mat");
        let mut bytes = std::fs::read(&path).unwrap();
        let file = File::open_streaming(&path).unwrap();
        let root = file.root();
        let datasets = root.datasets().unwrap();
        let chunk = datasets.iter().find_map(|name| root.dataset(name).ok()?.chunks().ok()?.into_iter().next());
        let size = chunk.expect("a chunked variable").storage_size as u32;
        // A key of the index: size, filters left out, place in the array.
        let key = [&size.to_le_bytes()[..], &[0; 12]].concat();
        let at = bytes.windows(key.len()).position(|w| w == key).expect("its key in the index");
        bytes[at..at + 4].copy_from_slice(&STORED.to_le_bytes());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("chunk.mat");
        std::fs::write(&path, bytes).unwrap();
        let found = read(&path, &MemoryLimit::body(1_000_000).begin());
        let Err(MatError::Damaged { what }) = found else { panic!("{found:?}") };
        assert!(what.contains(&STORED.to_string()), "{what}");
    }
}
