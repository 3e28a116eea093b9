//! MATLAB data files: versions 5 to 7.2, and 7.3, which is HDF5.
//!
//! Read are numeric, logical and character arrays, cells and structures. The version 5 reader is our own: the crates at
//! hand read no cells, in which MR-u laboratories keep their fields, or bound no decompression.

mod v5;
#[cfg(feature = "matlab")]
mod v73;
#[cfg(not(feature = "matlab"))]
#[path = "no_v73.rs"]
mod v73;

use crate::file::{MemoryError, ReadingMemory};
use std::path::Path;

/// Nesting of cells and structures.
const MAX_DEPTH: usize = 16;

/// A value in a file. Arrays are in MATLAB's order, first index fastest.
#[derive(Clone, Debug, PartialEq)]
pub enum MatValue {
    /// Numbers, with their imaginary part where they are complex.
    Numeric {
        /// Sizes.
        dims: Vec<usize>,
        /// Real parts.
        values: Vec<f64>,
        /// Imaginary parts.
        imaginary: Option<Vec<f64>>,
    },
    /// A cell array.
    Cell {
        /// Sizes.
        dims: Vec<usize>,
        /// Members.
        members: Vec<MatValue>,
    },
    /// A single structure: names and values.
    Struct(Vec<(String, MatValue)>),
    /// Text.
    Text(String),
    /// What is not read: sparse matrices, objects, function handles, arrays of structures.
    Other(&'static str),
}

/// Why a file was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MatError {
    /// The file cannot be opened.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// Neither version 5 nor 7.3.
    #[error("not a MATLAB file of version 5 or 7.3 (version 4 is not read: save it with -v7)")]
    NotMat,
    /// Version 7.3, without whose reader the library was built.
    #[error(
        "a MATLAB file of version 7.3, which lambdak was built without: turn on its feature `matlab`, or save the file with -v7"
    )]
    NoHdf5,
    /// Cut short or inconsistent.
    #[error("the file is damaged: {what}")]
    Damaged {
        /// What does not fit.
        what: String,
    },
    /// It would take more memory than reading may.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// More than allowed.
    #[error("{what}: {found} (limit: {limit})")]
    TooLarge {
        /// What there is too much of.
        what: &'static str,
        /// How much.
        found: u64,
        /// The limit.
        limit: u64,
    },
}

/// The variables of a file, in its order. What they hold is taken from `memory`, and with it what reading them needs.
///
/// # Errors
/// [`MatError`].
pub fn read_mat(path: &Path, memory: &ReadingMemory) -> Result<Vec<(String, MatValue)>, MatError> {
    use std::io::{Read, Seek, SeekFrom};
    let mut file = crate::file::open_regular(path).map_err(crate::file::ReadError::into_io)?;
    let mut header = [0u8; 128];
    if file.read_exact(&mut header).is_err() {
        return Err(MatError::NotMat);
    }
    // 7.3 carries the text header of version 5 in front of HDF5; files from other tools are plain HDF5.
    let is_hdf5 = header.starts_with(b"\x89HDF\r\n\x1a\n") || header.starts_with(b"MATLAB 7.3");
    if is_hdf5 {
        return v73::read(path, memory);
    }
    file.seek(SeekFrom::Start(128))?;
    v5::read(&header, std::io::BufReader::new(file), memory)
}

impl MatValue {
    /// The members of a cell, or none.
    pub fn members(&self) -> Option<&[MatValue]> {
        match self {
            MatValue::Cell { members, .. } => Some(members),
            _ => None,
        }
    }

    /// Sizes and real numbers of a numeric array, or none.
    pub fn numbers(&self) -> Option<(&[usize], &[f64])> {
        match self {
            MatValue::Numeric { dims, values, .. } => Some((dims, values)),
            _ => None,
        }
    }
}

/// Takes the memory of a list of `count` members beside their own content.
fn take_members<T>(memory: &ReadingMemory, count: usize) -> Result<(), MemoryError> {
    // A list that grows holds its old place beside the new one.
    memory.take_values::<[T; 2]>("a list of variables", count as u64)
}

/// Product of sizes; none where it overflows.
fn product(dims: &[usize]) -> Option<usize> {
    dims.iter().try_fold(1usize, |p, &d| p.checked_mul(d))
}

#[cfg(test)]
#[path = "mat_tests.rs"]
mod tests;
