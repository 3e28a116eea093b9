//! Arrays as a MAT-file of version 7.3: HDF5 with MATLAB's conventions.
//!
//! MATLAB shows `displacement_mm(x, y, z, component, drive)`, indices from 1; trees are structs, lists of names cell
//! arrays. What is an attribute in plain HDF5 stands in the struct `about`, which has a text for every array: its unit,
//! its axes, what it is.

use super::arrays::{Array, Member, Tree, Values};
use super::arrays_error::ArraysError;
use hdf5_pure::mat::{MatBuilder, MatError, Options, StructWriter};

/// Name of the struct that tells what the arrays are.
const ABOUT: &str = "about";

/// The bytes of a file that holds `tree`. All versions of MATLAB since 7.3 (R2006b) read it.
///
/// # Errors
/// [`ArraysError`].
pub fn mat_file(tree: &Tree) -> Result<Vec<u8>, ArraysError> {
    check(tree)?;
    let failed = |e: MatError| ArraysError::Write { format: "MAT", reason: e.to_string() };
    let mut builder = MatBuilder::new(Options::default());
    for (name, member) in &tree.members {
        write(&mut builder, name, member).map_err(failed)?;
    }
    builder.struct_(ABOUT, |s| tell(s.builder(), tree)).map_err(failed)?;
    builder.finish().map_err(failed)
}

fn check(tree: &Tree) -> Result<(), ArraysError> {
    tree.members.iter().try_for_each(|(name, member)| match member {
        Member::Tree(inner) => check(inner),
        Member::Array(array) => array.check(name),
        Member::Text(_) | Member::Names(_) => Ok(()),
    })
}

fn write(builder: &mut MatBuilder, name: &str, member: &Member) -> Result<(), MatError> {
    match member {
        Member::Text(text) => builder.write_char(name, text).map(drop),
        Member::Names(names) => {
            let fill =
                |cell: &mut hdf5_pure::mat::CellWriter| names.iter().try_for_each(|n| cell.push_char(n).map(drop));
            builder.cell(name, &[names.len(), 1], fill).map(drop)
        }
        Member::Tree(tree) => {
            let fill =
                |inner: &mut StructWriter| tree.members.iter().try_for_each(|(n, m)| write(inner.builder(), n, m));
            builder.struct_(name, fill).map(drop)
        }
        Member::Array(array) => {
            let sizes = matlab_sizes(array);
            match &array.values {
                Values::Real(v) => builder.write_f64(name, &sizes, v),
                Values::Logical(v) => {
                    builder.write_logical(name, &sizes, &v.iter().map(|b| u8::from(*b)).collect::<Vec<_>>())
                }
                // MATLAB counts from 1.
                Values::Index(v) => builder.write_u32(name, &sizes, &v.iter().map(|n| n + 1).collect::<Vec<_>>()),
            }
            .map(drop)
        }
    }
}

/// The sizes as MATLAB has them: at least two, and no ones at the end beyond those.
fn matlab_sizes(array: &Array) -> Vec<usize> {
    let mut sizes: Vec<usize> = array.axes.iter().map(|(_, n)| *n).collect();
    while sizes.len() > 2 && sizes.last() == Some(&1) {
        sizes.pop();
    }
    sizes.resize(sizes.len().max(2), 1);
    sizes
}

/// A text for every array of `tree`, under its name.
fn tell(builder: &mut MatBuilder, tree: &Tree) -> Result<(), MatError> {
    tree.members.iter().try_for_each(|(name, member)| match member {
        Member::Tree(inner) => builder.struct_(name, |s| tell(s.builder(), inner)).map(drop),
        Member::Array(array) => builder.write_char(name, &in_words(array)).map(drop),
        Member::Text(_) | Member::Names(_) => Ok(()),
    })
}

/// Unit, axes and meaning of an array.
fn in_words(array: &Array) -> String {
    let axes: Vec<&str> = array.axes.iter().map(|(name, _)| *name).collect();
    let counted = if matches!(array.values, Values::Index(_)) { "; counted from 1" } else { "" };
    let unit = if array.unit == "1" { String::new() } else { format!(", {}", array.unit) };
    format!("({}){unit}: {}{counted}", axes.join(", "), array.about)
}

#[cfg(test)]
#[path = "mat_file_tests.rs"]
mod tests;
