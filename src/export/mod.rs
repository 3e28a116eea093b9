//! Materials and models for other programs: cards in the convention of each, and whole input files.
//!
//! * [`MaterialFormat`]: Abaqus, Ansys, CalculiX, COMSOL and FEBio, the laws that each has, and its constants from
//!   ours.
//! * [`material_card`]: the text that such a program reads.
//! * [`model_file()`]: a specimen's mesh, material, boundary conditions and drives as Abaqus, CalculiX and FEBio
//!   read them.
//!
//! `docs/export.md` derives the conversions.

mod card;
mod convention;
#[cfg(test)]
mod convention_tests;
mod error;
mod febio;
mod keywords;
mod label;
mod model;
mod model_file;
mod number;
mod programs;

pub use card::{Origin, material_card};
pub use convention::{Constant, Convention, Converted, VolumetricLaw};
pub use error::ExportError;
pub use model::Model;
pub use model_file::{ModelFormat, model_file};
pub use programs::MaterialFormat;
