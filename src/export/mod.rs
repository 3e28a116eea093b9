//! Materials and models for other programs: cards in the convention of each, and whole input files.
//!
//! * [`MaterialFormat`]: the conventions of Abaqus, Ansys, CalculiX, COMSOL and FEBio, and their constants from ours.
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

pub use card::{Origin, material_card};
pub use convention::{Constant, Convention, MaterialFormat, VolumetricLaw};
pub use error::ExportError;
pub use model::Model;
pub use model_file::{ModelFormat, model_file};
