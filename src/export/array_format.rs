//! The files in which results are written as arrays and fields.

use super::arrays::Tree;
use super::arrays_error::ArraysError;
use super::hdf5_file::hdf5_file;
use super::mat_file::mat_file;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A file of arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ArrayFormat {
    /// MATLAB, version 7.3.
    Mat,
    /// HDF5.
    Hdf5,
}

impl ArrayFormat {
    /// All formats.
    pub const ALL: [ArrayFormat; 2] = [ArrayFormat::Mat, ArrayFormat::Hdf5];

    /// Name of a file of this format.
    pub fn file_name(self, stem: &str) -> String {
        match self {
            ArrayFormat::Mat => format!("{stem}.mat"),
            ArrayFormat::Hdf5 => format!("{stem}.h5"),
        }
    }

    /// The bytes of a file that holds `tree`.
    ///
    /// # Errors
    /// [`ArraysError`].
    pub fn write(self, tree: &Tree) -> Result<Vec<u8>, ArraysError> {
        match self {
            ArrayFormat::Mat => mat_file(tree),
            ArrayFormat::Hdf5 => hdf5_file(tree),
        }
    }
}

/// A file of arrays, or of fields on a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FieldFormat {
    /// MATLAB, version 7.3.
    Mat,
    /// HDF5.
    Hdf5,
    /// VTKHDF: all drives in one file for ParaView.
    Vtkhdf,
}

impl FieldFormat {
    /// The same among the formats of arrays.
    pub fn of_arrays(self) -> Option<ArrayFormat> {
        match self {
            FieldFormat::Mat => Some(ArrayFormat::Mat),
            FieldFormat::Hdf5 => Some(ArrayFormat::Hdf5),
            FieldFormat::Vtkhdf => None,
        }
    }
}

/// A file of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum RecordingFormat {
    /// MATLAB, version 7.3.
    Mat,
    /// HDF5.
    Hdf5,
    /// Tables of points, one per drive, that an import reads again; of displacements alone.
    Points,
}

impl RecordingFormat {
    /// All formats.
    pub const ALL: [RecordingFormat; 3] = [RecordingFormat::Mat, RecordingFormat::Hdf5, RecordingFormat::Points];

    /// The same among the formats of arrays.
    pub fn of_arrays(self) -> Option<ArrayFormat> {
        match self {
            RecordingFormat::Mat => Some(ArrayFormat::Mat),
            RecordingFormat::Hdf5 => Some(ArrayFormat::Hdf5),
            RecordingFormat::Points => None,
        }
    }
}
