//! A specimen in a file (`specimen/1`): the fields of [`Specimen`] behind the tag that names the format.

use super::bounds::SCHEMA;
#[cfg(feature = "schema")]
use super::bounds::{
    MAX_DIAMETER_MM, MAX_HOLES, MAX_NAME_LENGTH, MAX_OTHER_SAMPLES, MAX_SAMPLES_IN_PARALLEL, MAX_SIZE_MM,
    MIN_DIAMETER_MM, MIN_FILLET_MM, MIN_SIZE_MM,
};
#[cfg(feature = "schema")]
use super::drives::{MAX_DRIVE_ANGLE_DEG, MAX_DRIVES};
use super::{Block, Hole, Outline, Sample, Specimen, TestKind};
use crate::field::file_tag;
#[cfg(feature = "schema")]
use crate::field::schema::{
    integer_within, list_of, number, number_within, numbers, schema_of_file, schema_type, text,
};
use serde::{Deserialize, Serialize};

file_tag!(SpecimenTag, SCHEMA);

#[cfg(feature = "schema")]
schema_type! {
    /// An extent of a block, mm.
    pub(super) ExtentMm = number_within(MIN_SIZE_MM..=MAX_SIZE_MM);
    /// By how much a wedge is thicker at one end than at the other, mm.
    pub(super) WedgeMm = number_within(-MAX_SIZE_MM..=MAX_SIZE_MM);
    /// The diameter of a hole, mm.
    pub(super) DiameterMm = number_within(MIN_DIAMETER_MM..=MAX_DIAMETER_MM);
    /// The radius of a dumb-bell's arcs, mm.
    pub(super) FilletMm = number_within(MIN_FILLET_MM..=MAX_SIZE_MM);
    /// A free name.
    pub(crate) Name = text(MAX_NAME_LENGTH);
    /// Holes, all with the same axis.
    pub(super) Holes = list_of::<Hole>(0..=MAX_HOLES), of Hole;
    /// Drives, mm: all positive and rising, or all negative and falling.
    Drives = numbers(number(), 1..=MAX_DRIVES);
    /// Angle of the drive, degrees.
    DriveAngle = number_within(-MAX_DRIVE_ANGLE_DEG..=MAX_DRIVE_ANGLE_DEG);
    /// How far the plates are pressed together, mm; less than a part of the thickness either way.
    Precompression = number();
    /// Further samples of a double-lap test that share drive and load cell.
    OtherSamples = list_of::<Sample>(0..=MAX_OTHER_SAMPLES), of Sample;
    /// How many identical samples share the load cell.
    SamplesInParallel = integer_within(1..=MAX_SAMPLES_IN_PARALLEL as usize);
}

/// A specimen (`specimen/1`).
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = SpecimenSchema))]
#[serde(deny_unknown_fields, expecting = "struct Specimen")]
pub(super) struct SpecimenFile {
    /// Always `specimen/1`.
    schema: SpecimenTag,
    /// Free name.
    #[cfg_attr(feature = "schema", schema(value_type = Name))]
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
    #[cfg_attr(feature = "schema", schema(value_type = Holes))]
    holes: Vec<Hole>,
    /// Drives at which the specimen is scanned, mm: all positive and rising, or all negative and falling. Negative ones
    /// push the grips of a uniaxial test together, or shear the other way.
    #[cfg_attr(feature = "schema", schema(value_type = Drives))]
    drive_mm: Vec<f64>,
    /// Angle of the drive from x towards z, in the plane of the plates of a double-lap test, degrees; 0 by default.
    /// Forces are along the drive.
    #[serde(default, skip_serializing_if = "is_along_x")]
    #[cfg_attr(feature = "schema", schema(value_type = DriveAngle))]
    drive_angle_deg: f64,
    /// How far the plates of a double-lap test are pressed together before they are driven, and stay so, mm; negative
    /// ones are pulled apart; 0 by default. Displacements count from the sample before that.
    #[serde(default, skip_serializing_if = "is_uncompressed")]
    #[cfg_attr(feature = "schema", schema(value_type = Precompression))]
    precompression_mm: f64,
    /// How many identical samples share the load cell; 1 by default.
    #[serde(default = "single_sample")]
    #[cfg_attr(feature = "schema", schema(value_type = SamplesInParallel))]
    samples_in_parallel: u32,
    /// Further samples of a double-lap test that share drive and load cell and are blocks of their own; their forces
    /// add to the first one's. None by default.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[cfg_attr(feature = "schema", schema(value_type = OtherSamples))]
    other_samples: Vec<Sample>,
}

fn is_block(outline: &Outline) -> bool {
    *outline == Outline::Block
}

fn is_uncompressed(precompression_mm: &f64) -> bool {
    *precompression_mm == 0.0
}

fn is_along_x(angle_deg: &f64) -> bool {
    *angle_deg == 0.0
}

fn single_sample() -> u32 {
    1
}

impl From<SpecimenFile> for Specimen {
    fn from(file: SpecimenFile) -> Specimen {
        Specimen {
            name: file.name,
            test: file.test,
            block: file.block,
            outline: file.outline,
            holes: file.holes,
            drive_mm: file.drive_mm,
            drive_angle_deg: file.drive_angle_deg,
            precompression_mm: file.precompression_mm,
            samples_in_parallel: file.samples_in_parallel,
            other_samples: file.other_samples,
        }
    }
}

impl From<Specimen> for SpecimenFile {
    fn from(specimen: Specimen) -> SpecimenFile {
        SpecimenFile {
            schema: SpecimenTag,
            name: specimen.name,
            test: specimen.test,
            block: specimen.block,
            outline: specimen.outline,
            holes: specimen.holes,
            drive_mm: specimen.drive_mm,
            drive_angle_deg: specimen.drive_angle_deg,
            precompression_mm: specimen.precompression_mm,
            samples_in_parallel: specimen.samples_in_parallel,
            other_samples: specimen.other_samples,
        }
    }
}

#[cfg(feature = "schema")]
schema_of_file!(Specimen, SpecimenFile);

#[cfg(test)]
#[path = "file_tests.rs"]
mod tests;
