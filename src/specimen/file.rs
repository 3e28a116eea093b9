//! A specimen in a file (`specimen/1`): the fields of [`Specimen`] behind the tag that names the format.

use super::read::{
    MAX_DIAMETER_MM, MAX_DRIVES, MAX_HOLES, MAX_NAME_LENGTH, MAX_SAMPLES_IN_PARALLEL, MAX_SIZE_MM, MIN_DIAMETER_MM,
    MIN_SIZE_MM, SCHEMA,
};
use super::{Block, Hole, Outline, Specimen, TestKind};
use crate::field::schema::{
    integer_within, list_of, number, number_within, numbers, schema_of_file, schema_tag, schema_type, text,
};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

schema_tag!(SpecimenTag, SCHEMA);

schema_type! {
    /// An extent of a block, mm.
    pub(super) ExtentMm = number_within(MIN_SIZE_MM..=MAX_SIZE_MM);
    /// The diameter of a hole, mm.
    pub(super) DiameterMm = number_within(MIN_DIAMETER_MM..=MAX_DIAMETER_MM);
    /// A free name.
    pub(crate) Name = text(MAX_NAME_LENGTH);
    /// Holes, all with the same axis.
    Holes = list_of::<Hole>(0..=MAX_HOLES), of Hole;
    /// Drives, mm, positive and increasing.
    Drives = numbers(number(), 1..=MAX_DRIVES);
    /// How many identical samples share the load cell.
    SamplesInParallel = integer_within(1..=MAX_SAMPLES_IN_PARALLEL as usize);
}

/// A specimen (`specimen/1`).
#[derive(Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, expecting = "struct Specimen")]
#[schema(as = SpecimenSchema)]
pub(super) struct SpecimenFile {
    /// Always `specimen/1`.
    schema: SpecimenTag,
    /// Free name.
    #[schema(value_type = Name)]
    name: String,
    /// How it is held and moved.
    test: TestKind,
    /// Bounding block.
    block: Block,
    /// Outline in the (x, z) section; `block` by default.
    #[serde(default, skip_serializing_if = "is_block")]
    outline: Outline,
    /// Holes; all with the same axis.
    #[serde(default)]
    #[schema(value_type = Holes)]
    holes: Vec<Hole>,
    /// Drives at which the specimen is scanned, mm, increasing.
    #[schema(value_type = Drives)]
    drive_mm: Vec<f64>,
    /// How many identical samples share the load cell; 1 by default.
    #[serde(default = "single_sample")]
    #[schema(value_type = SamplesInParallel)]
    samples_in_parallel: u32,
}

fn is_block(outline: &Outline) -> bool {
    *outline == Outline::Block
}

fn single_sample() -> u32 {
    1
}

impl From<SpecimenFile> for Specimen {
    fn from(file: SpecimenFile) -> Specimen {
        let SpecimenFile { schema: SpecimenTag, name, test, block, outline, holes, drive_mm, samples_in_parallel } =
            file;
        Specimen { name, test, block, outline, holes, drive_mm, samples_in_parallel }
    }
}

impl From<Specimen> for SpecimenFile {
    fn from(specimen: Specimen) -> SpecimenFile {
        let Specimen { name, test, block, outline, holes, drive_mm, samples_in_parallel } = specimen;
        SpecimenFile { schema: SpecimenTag, name, test, block, outline, holes, drive_mm, samples_in_parallel }
    }
}

schema_of_file!(Specimen, SpecimenFile);

#[cfg(test)]
#[path = "file_tests.rs"]
mod tests;
