//! Results of exports.

use crate::export::{Constant, MaterialFormat, ModelFormat, VolumetricLaw};
use serde::Serialize;
use utoipa::ToSchema;

/// The card of one program.
#[derive(Serialize, ToSchema)]
pub(super) struct Card {
    pub(super) format: MaterialFormat,
    /// The program, as it is called.
    pub(super) program: &'static str,
    pub(super) file: &'static str,
    /// Its constants.
    pub(super) constants: Vec<Constant>,
    pub(super) energy: &'static str,
    /// Its volumetric energy.
    pub(super) volumetric_law: VolumetricLaw,
    pub(super) manual: &'static str,
}

/// Result (`export-model/1`).
#[derive(Serialize, ToSchema)]
pub(super) struct ExportModelResult<'a> {
    pub(super) schema: &'static str,
    pub(super) version: &'static str,
    pub(super) input_hash: &'a str,
    /// Name of the specimen.
    pub(super) name: &'a str,
    /// Elements of the mesh.
    pub(super) num_elements: usize,
    /// Mirror planes in use (y, z).
    pub(super) mirror: [bool; 2],
    /// What reactions are multiplied by to give the forces of the whole test.
    pub(super) reaction_multiplier: f64,
    pub(super) drive_mm: &'a [f64],
    /// The files.
    pub(super) files: Vec<ModelFile>,
}

/// A file for a program.
#[derive(Serialize, ToSchema)]
pub(super) struct ModelFile {
    pub(super) format: ModelFormat,
    /// Its name.
    pub(super) file: &'static str,
}
