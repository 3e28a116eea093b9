//! Materials, models and results for other programs: cards in the convention of each, whole input files, and files of
//! arrays and fields.
//!
//! * [`MaterialFormat`]: Abaqus, Ansys, CalculiX, COMSOL and FEBio, the laws that each has, and its constants from
//!   ours.
//! * [`material_card`]: the text that such a program reads.
//! * [`model_file()`]: a specimen's mesh, material, boundary conditions and drives as Abaqus, CalculiX and FEBio
//!   read them.
//! * [`Tree`]: results as named arrays with units and axes; [`mat_file()`], [`hdf5_file()`] and [`vtkhdf_file`] write
//!   results for MATLAB, Python and ParaView.
//!
//! `docs/export.md` derives the conversions.

#[cfg(feature = "matlab")]
mod array_format;
mod arrays;
#[cfg(feature = "matlab")]
mod arrays_error;
mod calibration_arrays;
mod card;
mod convention;
#[cfg(test)]
mod convention_tests;
mod error;
mod evaluation_arrays;
mod febio;
#[cfg(feature = "matlab")]
mod hdf5_file;
mod keywords;
mod label;
#[cfg(feature = "matlab")]
mod mat_file;
mod model;
mod model_file;
mod number;
mod programs;
mod recording_arrays;
mod recording_points;
#[cfg(feature = "matlab")]
mod solution_arrays;
mod voxel_arrays;
#[cfg(feature = "matlab")]
mod vtkhdf;

#[cfg(feature = "matlab")]
pub use array_format::{ArrayFormat, FieldFormat, RecordingFormat};
pub use arrays::{Array, Axis, Member, Tree, Values};
#[cfg(feature = "matlab")]
pub use arrays_error::ArraysError;
pub use calibration_arrays::calibration_arrays;
pub use card::{Origin, material_card};
pub use convention::{Constant, Convention, Converted, VolumetricLaw};
pub use error::ExportError;
pub use evaluation_arrays::evaluation_arrays;
#[cfg(feature = "matlab")]
pub use hdf5_file::hdf5_file;
#[cfg(feature = "matlab")]
pub use mat_file::mat_file;
pub use model::Model;
pub use model_file::{ModelFormat, model_file};
pub use programs::MaterialFormat;
pub use recording_arrays::{raw_recording_arrays, recording_arrays};
pub use recording_points::recording_points;
#[cfg(feature = "matlab")]
pub use solution_arrays::{FieldSeries, solution_arrays};
#[cfg(feature = "matlab")]
pub use vtkhdf::vtkhdf_file;
