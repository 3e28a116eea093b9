//! Arrays as a plain HDF5 file.
//!
//! Dimensions stand in the order of the axes and the last index is the fastest in the file, so that h5py shows
//! `displacement_mm[x, y, z, component, drive]`. Attributes of every dataset: `unit`, `axes`, `description`.

use super::arrays::{Array, Member, Tree, Values};
use super::arrays_error::ArraysError;
use hdf5_pure::{AttrValue, DatasetBuilder, FileBuilder, FinishedGroup, GroupBuilder, LibVer};

/// The bytes of a file that holds `tree`. All versions of HDF5 since 1.8 read it.
///
/// # Errors
/// [`ArraysError`].
pub fn hdf5_file(tree: &Tree) -> Result<Vec<u8>, ArraysError> {
    let mut file = FileBuilder::new();
    file.with_libver_bounds(LibVer::Earliest, LibVer::V18);
    for (name, member) in &tree.members {
        match member {
            Member::Tree(inner) => {
                let group = group(file.create_group(name), inner)?;
                file.add_group(group);
            }
            member => dataset(file.create_dataset(name), name, member)?,
        }
    }
    file.finish().map_err(|e| ArraysError::Write { format: "HDF5", reason: e.to_string() })
}

fn group(mut builder: GroupBuilder, tree: &Tree) -> Result<FinishedGroup, ArraysError> {
    for (name, member) in &tree.members {
        match member {
            Member::Tree(inner) => {
                let inner = group(builder.create_group(name), inner)?;
                builder.add_group(inner);
            }
            member => dataset(builder.create_dataset(name), name, member)?,
        }
    }
    Ok(builder.finish())
}

fn dataset(dataset: &mut DatasetBuilder, name: &str, member: &Member) -> Result<(), ArraysError> {
    let failed = |e: hdf5_pure::FormatError| ArraysError::Write { format: "HDF5", reason: e.to_string() };
    match member {
        Member::Array(array) => fill(dataset, name, array),
        Member::Text(text) => {
            dataset.with_strings(&[text]).map_err(failed)?.with_shape(&[]);
            Ok(())
        }
        Member::Names(names) => {
            let all: Vec<&str> = names.iter().map(String::as_str).collect();
            dataset.with_strings(&all).map_err(failed)?;
            Ok(())
        }
        // Groups are made by their parents.
        Member::Tree(_) => Ok(()),
    }
}

fn fill(dataset: &mut DatasetBuilder, name: &str, array: &Array) -> Result<(), ArraysError> {
    array.check(name)?;
    let sizes: Vec<usize> = array.axes.iter().map(|(_, n)| *n).collect();
    match &array.values {
        Values::Real(v) => dataset.with_f64_data(&last_fastest(v, &sizes)),
        Values::Logical(v) => {
            dataset.with_u8_data(&last_fastest(v, &sizes).into_iter().map(u8::from).collect::<Vec<_>>())
        }
        Values::Index(v) => dataset.with_u32_data(&last_fastest(v, &sizes)),
    };
    let shape: Vec<u64> = sizes.iter().map(|&n| n as u64).collect();
    dataset.with_shape(&shape);
    dataset.set_attr("unit", AttrValue::VarLenString(array.unit.into()));
    dataset.set_attr("description", AttrValue::VarLenString(array.about.clone()));
    if !array.axes.is_empty() {
        let names = array.axes.iter().map(|(name, _)| (*name).to_string()).collect();
        dataset.set_attr("axes", AttrValue::VarLenStringArray(names));
    }
    Ok(())
}

/// Numbers whose first index is fastest, reordered so that the last one is.
fn last_fastest<T: Copy>(values: &[T], sizes: &[usize]) -> Vec<T> {
    if sizes.len() < 2 {
        return values.to_vec();
    }
    // How far apart neighbours along each axis lie in `values`.
    let strides: Vec<usize> = (0..sizes.len()).map(|axis| sizes[..axis].iter().product()).collect();
    let mut index = vec![0; sizes.len()];
    let mut from = 0;
    let mut ordered = Vec::with_capacity(values.len());
    for _ in 0..values.len() {
        ordered.push(values[from]);
        for axis in (0..sizes.len()).rev() {
            index[axis] += 1;
            from += strides[axis];
            if index[axis] < sizes[axis] {
                break;
            }
            from -= strides[axis] * sizes[axis];
            index[axis] = 0;
        }
    }
    ordered
}

#[cfg(test)]
#[path = "hdf5_file_tests.rs"]
pub(super) mod tests;
