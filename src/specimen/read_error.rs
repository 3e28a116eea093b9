//! What can be wrong with a specimen.

use super::{HoleAxis, JsonProblem, LigamentKind, NotchProblem};
use crate::field::{FieldError, FieldPath};

/// Why a specimen is refused. Every variant carries the value, the limit and what to change.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpecimenError {
    /// The text is not JSON, or a field is missing, unknown, doubled or of the wrong type.
    #[error("specimen JSON, {0}")]
    Json(JsonProblem),
    /// The schema is another one.
    #[error("schema is {found:?}; set it to {expected:?}")]
    WrongSchema {
        /// What the text says.
        found: String,
        /// What this version reads.
        expected: &'static str,
    },
    /// The name is too long or holds control characters.
    #[error("name has {length} characters, control characters: {has_control}; use 0 to {limit} printable characters")]
    BadName {
        /// Number of characters.
        length: usize,
        /// Whether a control character (line break, tab, …) is in it.
        has_control: bool,
        /// Most characters.
        limit: usize,
    },
    /// A number is NaN or infinite.
    #[error("{field} is {value}; give a finite number")]
    NotFinite {
        /// Path of the field.
        field: FieldPath,
        /// Its value.
        value: f64,
    },
    /// A length is outside the supported range (zero and negative lengths included).
    #[error("{field} is {value_mm} mm; choose a value from {min_mm} to {max_mm} mm")]
    SizeOutOfRange {
        /// Path of the field.
        field: FieldPath,
        /// Its value, mm.
        value_mm: f64,
        /// Smallest, mm.
        min_mm: f64,
        /// Largest, mm.
        max_mm: f64,
    },
    /// The angle of a hole is outside the supported range.
    #[error("{field} is {value_deg}°; choose an angle from -{limit_deg}° to {limit_deg}°")]
    AngleOutOfRange {
        /// Path of the field.
        field: FieldPath,
        /// Its value, degrees.
        value_deg: f64,
        /// Largest either way, degrees.
        limit_deg: f64,
    },
    /// More holes than supported.
    #[error("there are {count} holes; use at most {limit}")]
    TooManyHoles {
        /// How many.
        count: usize,
        /// Most.
        limit: usize,
    },
    /// Holes along different axes. The mesh is a section extruded along the holes.
    #[error(
        "holes[{hole}] runs along {axis:?} and holes[0] along {expected:?}; all holes of one specimen must share their axis, because the mesh is extruded along it"
    )]
    MixedHoleAxes {
        /// The first hole that differs.
        hole: usize,
        /// Its axis.
        axis: HoleAxis,
        /// The axis of the holes before it.
        expected: HoleAxis,
    },
    /// A hole that is said to be a notch is none.
    #[error("holes[{hole}] {problem}")]
    BadNotch {
        /// Which.
        hole: usize,
        /// What is wrong with it.
        problem: NotchProblem,
    },
    /// A hole reaches the outside of the outline.
    #[error(
        "no material between {between}: the hole reaches {excess_mm:.4} mm too far; move it inwards or make it smaller, at least {limit_mm:.4} mm of material must remain"
    )]
    HoleOutside {
        /// The hole and the side.
        between: LigamentKind,
        /// How far it reaches beyond the side, mm.
        excess_mm: f64,
        /// Thinnest ligament that can be meshed, mm.
        limit_mm: f64,
    },
    /// Two holes overlap or touch.
    #[error(
        "{between} overlap by {overlap_mm:.4} mm; move them apart or make them smaller, at least {limit_mm:.4} mm of material must remain"
    )]
    HolesOverlap {
        /// The two holes.
        between: LigamentKind,
        /// Depth of the overlap, mm; 0 where they touch.
        overlap_mm: f64,
        /// Thinnest ligament that can be meshed, mm.
        limit_mm: f64,
    },
    /// A ligament is too thin to mesh.
    #[error(
        "the ligament between {between} is {length_mm:.4} mm; it must be at least {limit_mm:.4} mm to be meshed (0.05 mm and 2 % of the hole's diameter): move the hole or make it smaller"
    )]
    LigamentTooThin {
        /// Between what.
        between: LigamentKind,
        /// Its thickness, mm.
        length_mm: f64,
        /// Thinnest that can be meshed, mm.
        limit_mm: f64,
    },
    /// No drive is given.
    #[error("drive_mm is empty; give 1 to {limit} drives, mm")]
    NoDrives {
        /// Most drives.
        limit: usize,
    },
    /// More drives than supported.
    #[error("drive_mm has {count} entries; give at most {limit}")]
    TooManyDrives {
        /// How many.
        count: usize,
        /// Most.
        limit: usize,
    },
    /// A drive is zero.
    #[error("drive_mm[{index}] is 0 mm; a drive moves a plate: give one above or below 0, or leave it out")]
    DriveZero {
        /// Which.
        index: usize,
    },
    /// A drive does not lead on from the one before.
    #[error(
        "drive_mm[{index}] is {value_mm} mm after {previous_mm} mm; the drives of a specimen lead away from rest in one direction: list them all positive and rising, or all negative and falling, each once, and give another direction a specimen of its own"
    )]
    DrivesNotLeadingOn {
        /// Which.
        index: usize,
        /// Its value, mm.
        value_mm: f64,
        /// The one before, mm.
        previous_mm: f64,
    },
    /// A bar is driven at an angle.
    #[error("drive_angle_deg is {value_deg}° in a uniaxial test; grips move along x: set it to 0 or leave it out")]
    AngleOfPull {
        /// The angle, degrees.
        value_deg: f64,
    },
    /// The plates are pressed together, or pulled apart, further than is supported.
    #[error(
        "precompression_mm is {value_mm}; choose at most {limit_mm:.4} mm either way, {part} times the thinnest sample's thickness"
    )]
    PrecompressionTooLarge {
        /// Its value, mm.
        value_mm: f64,
        /// Largest either way, mm.
        limit_mm: f64,
        /// The same as a part of the thickness.
        part: f64,
    },
    /// A bar is compressed across its pull.
    #[error("precompression_mm is {value_mm} in a uniaxial test, which has no plates: set it to 0 or leave it out")]
    PrecompressionOfPull {
        /// Its value, mm.
        value_mm: f64,
    },
    /// A dumb-bell is pushed together.
    #[error(
        "the drive is {drive_mm} mm; a dumb-bell bends as soon as it is pushed: give positive drives, or test a block"
    )]
    DumbbellCompressed {
        /// The largest drive, mm.
        drive_mm: f64,
    },
    /// A drive goes beyond the deformation that is supported.
    #[error(
        "drive_mm[{index}] is {value_mm} mm, a nominal {measure} of {deformation:.3}; the limit is {limit} at {limit_mm:.4} mm: drive less, or make the specimen {dimension}"
    )]
    DriveTooLarge {
        /// Which.
        index: usize,
        /// Its value, mm.
        value_mm: f64,
        /// `shear strain` or `stretch`.
        measure: &'static str,
        /// Nominal deformation that it means.
        deformation: f64,
        /// Supported nominal deformation that lies furthest in that direction.
        limit: f64,
        /// Supported drive of this specimen that lies furthest in that direction, mm.
        limit_mm: f64,
        /// `thicker` or `longer`.
        dimension: &'static str,
    },
    /// No or too many samples share the load cell.
    #[error("samples_in_parallel is {value}; choose 1 to {limit}")]
    SamplesOutOfRange {
        /// Its value.
        value: u32,
        /// Most.
        limit: u32,
    },
    /// More kinds of samples than supported.
    #[error("other_samples has {count} entries; use at most {limit}")]
    TooManyOtherSamples {
        /// How many.
        count: usize,
        /// Most.
        limit: usize,
    },
    /// Samples of different kinds are pulled side by side.
    #[error(
        "other_samples has {count} entries in a uniaxial test; only a double-lap shear test may hold unlike samples: leave \
         them out, or test them one after the other"
    )]
    OtherSamplesInTension {
        /// How many.
        count: usize,
    },
    /// Something is wrong with a further sample.
    #[error("other_samples[{index}]: {error}")]
    OtherSample {
        /// Which.
        index: usize,
        /// What is wrong.
        error: Box<SpecimenError>,
    },
    /// A wedge in a uniaxial test, whose grips hold the ends and whose section is even.
    #[error(
        "block.wedge_mm is {value_mm} mm; only a block between the plates of a double-lap shear test may be a wedge: set it to 0, or test to double_lap_shear"
    )]
    WedgeOfPull {
        /// The wedge, mm.
        value_mm: f64,
    },
    /// A wedge's mesh is extruded along its thickness, so its holes run along it.
    #[error(
        "holes[{hole}] runs along the width and block.wedge_mm is {value_mm} mm; in a wedge holes must run along the thickness, because the mesh is extruded along it: turn the hole, or set wedge_mm to 0"
    )]
    WedgeHoleAlongWidth {
        /// The first such hole.
        hole: usize,
        /// The wedge, mm.
        value_mm: f64,
    },
    /// A wedge that leaves too thin an end, or whose faces slant too much.
    #[error(
        "block.wedge_mm is {value_mm} mm; from -{limit_mm:.4} to {limit_mm:.4} mm are supported, at most the thickness, the length, and what leaves a thin end that can be made: make the wedge smaller, or the block thicker or longer"
    )]
    WedgeTooLarge {
        /// The wedge, mm.
        value_mm: f64,
        /// Largest either way, mm.
        limit_mm: f64,
    },
    /// The block is not the bounding box of the standard's dumb-bell.
    #[error(
        "{field} is {value_mm} mm; outline iso37_type4 has {standard_mm} mm there: set it, or leave out the outline"
    )]
    NotTheStandardsBlock {
        /// Path of the field.
        field: FieldPath,
        /// Its value, mm.
        value_mm: f64,
        /// The standard's, mm.
        standard_mm: f64,
    },
    /// A dimension of a dumb-bell does not go with its others.
    #[error(
        "{field} is {value_mm} mm; with the other dimensions of the dumb-bell it must be from {min_mm:.4} to {max_mm:.4} mm"
    )]
    DumbbellMisfit {
        /// Path of the field.
        field: FieldPath,
        /// Its value, mm.
        value_mm: f64,
        /// The smallest that goes with the others, mm.
        min_mm: f64,
        /// The largest, mm.
        max_mm: f64,
    },
    /// A dumb-bell cannot be bonded between plates.
    #[error("outline {outline} is tested in uniaxial tension only; set test to uniaxial, or leave out the outline")]
    DumbbellInShear {
        /// Its outline's name.
        outline: &'static str,
    },
    /// A dumb-bell's section is (x, z), so its holes run along the thickness.
    #[error(
        "holes[{hole}] runs along the width; in a dumb-bell holes must run along the thickness, because the mesh is extruded along it"
    )]
    DumbbellHoleAlongWidth {
        /// Which hole.
        hole: usize,
    },
}

impl SpecimenError {
    /// The same as an error of a field, with a pointer into the specimen.
    pub fn field_error(&self) -> FieldError {
        use SpecimenError as E;
        let of_hole = |hole: usize| FieldPath::of("holes").index(hole);
        let of_drive = |index: usize| FieldPath::of("drive_mm").index(index).pointer();
        match self {
            E::Json(problem) => FieldError::new("", "", "JSON of a specimen").remedy(problem.to_string()),
            E::WrongSchema { found, expected } => {
                FieldError::new("/schema", format!("{found:?}"), format!("{expected:?}"))
            }
            E::BadName { length, has_control, limit } => {
                let value = format!("a text of {length} characters, control characters: {has_control}");
                FieldError::new("/name", value, format!("0 to {limit} printable characters"))
            }
            E::NotFinite { field, value } => FieldError::new(field.pointer(), value, "a finite number"),
            E::SizeOutOfRange { field, value_mm, min_mm, max_mm } => {
                FieldError::new(field.pointer(), value_mm, format!("from {min_mm} to {max_mm} mm"))
            }
            E::AngleOutOfRange { field, value_deg, limit_deg } => {
                FieldError::new(field.pointer(), value_deg, format!("from -{limit_deg} to {limit_deg} degrees"))
            }
            E::TooManyHoles { count, limit } => {
                FieldError::new("/holes", format!("a list of {count}"), format!("at most {limit} holes"))
            }
            E::MixedHoleAxes { hole, axis, expected } => {
                let pointer = of_hole(*hole).name("axis").pointer();
                FieldError::new(pointer, axis.name(), format!("{}, as for the holes before it", expected.name()))
                    .remedy("the mesh is extruded along the holes, so all holes of one specimen share their axis")
            }
            E::BadNotch { hole, problem } => {
                let allowed = "a round hole with its centre near a free side of a block";
                FieldError::new(of_hole(*hole).pointer(), format!("a notch that {problem}"), allowed)
            }
            E::HoleOutside { between, excess_mm, limit_mm } => {
                let value = format!("a hole that reaches {excess_mm:.4} mm too far");
                let allowed = format!("at least {limit_mm:.4} mm inside ({between})");
                FieldError::new(of_hole(between.first_hole()).pointer(), value, allowed)
                    .remedy("move the hole inwards or make it smaller")
            }
            E::HolesOverlap { between, overlap_mm, limit_mm } => {
                let value = format!("a hole that overlaps another by {overlap_mm:.4} mm");
                let allowed = format!("at least {limit_mm:.4} mm away ({between})");
                FieldError::new(of_hole(between.first_hole()).pointer(), value, allowed)
                    .remedy("move the holes apart or make them smaller")
            }
            E::LigamentTooThin { between, length_mm, limit_mm } => {
                let value = format!("a hole with a ligament of {length_mm:.4} mm");
                let allowed = format!("at least {limit_mm:.4} mm away ({between})");
                FieldError::new(of_hole(between.first_hole()).pointer(), value, allowed)
                    .remedy("move the hole or make it smaller")
            }
            E::NoDrives { limit } => FieldError::new("/drive_mm", "[]", format!("a list of 1 to {limit} drives, mm")),
            E::TooManyDrives { count, limit } => {
                FieldError::new("/drive_mm", format!("a list of {count}"), format!("a list of at most {limit} drives"))
            }
            E::DriveZero { index } => FieldError::new(of_drive(*index), 0, "above or below 0 mm"),
            E::DrivesNotLeadingOn { index, value_mm, previous_mm } => {
                let beyond = if *previous_mm < 0.0 { "below" } else { "above" };
                FieldError::new(of_drive(*index), value_mm, format!("{beyond} the {previous_mm} mm before it"))
                    .remedy("list the drives all positive and rising, or all negative and falling, each once")
            }
            E::AngleOfPull { value_deg } => FieldError::new("/drive_angle_deg", value_deg, "0 in a uniaxial test")
                .remedy("grips move along x; leave the angle out"),
            E::PrecompressionTooLarge { value_mm, limit_mm, part } => {
                let allowed =
                    format!("from -{limit_mm:.4} to {limit_mm:.4} mm, {part} times the thinnest sample's thickness");
                FieldError::new("/precompression_mm", value_mm, allowed)
                    .remedy("press the plates together less, or make the sample thicker")
            }
            E::PrecompressionOfPull { value_mm } => {
                FieldError::new("/precompression_mm", value_mm, "0 in a uniaxial test")
                    .remedy("a bar has grips and no plates; leave the precompression out")
            }
            E::DumbbellCompressed { drive_mm } => FieldError::new("/drive_mm", drive_mm, "above 0 mm for a dumb-bell")
                .remedy("a dumb-bell bends as soon as it is pushed; pull it, or test a block"),
            E::DriveTooLarge { index, value_mm, measure, limit, limit_mm, dimension, .. } => {
                let allowed = format!(
                    "{} {limit_mm:.4} mm, a nominal {measure} of {limit}",
                    if *limit_mm < 0.0 { "at least" } else { "at most" }
                );
                FieldError::new(of_drive(*index), value_mm, allowed)
                    .remedy(format!("drive less, or make the specimen {dimension}"))
            }
            E::SamplesOutOfRange { value, limit } => {
                FieldError::new("/samples_in_parallel", value, format!("from 1 to {limit}"))
            }
            E::TooManyOtherSamples { count, limit } => {
                FieldError::new("/other_samples", format!("a list of {count}"), format!("at most {limit} samples"))
            }
            E::OtherSamplesInTension { count } => {
                FieldError::new("/other_samples", format!("a list of {count}"), "left out in a uniaxial test")
                    .remedy("only a double-lap shear test may hold unlike samples; test them one after the other")
            }
            E::OtherSample { index, error } => error.field_error().below(&format!("/other_samples/{index}")),
            E::WedgeOfPull { value_mm } => FieldError::new("/block/wedge_mm", value_mm, "0 in a uniaxial test")
                .remedy("only a block between the plates of a double-lap shear test may be a wedge"),
            E::WedgeHoleAlongWidth { hole, .. } => {
                let pointer = of_hole(*hole).name("axis").pointer();
                FieldError::new(pointer, HoleAxis::Width.name(), "thickness in a wedge")
                    .remedy("the mesh of a wedge is extruded along its thickness: turn the hole, or set wedge_mm to 0")
            }
            E::WedgeTooLarge { value_mm, limit_mm } => {
                let allowed = format!("from -{limit_mm:.4} to {limit_mm:.4} mm");
                FieldError::new("/block/wedge_mm", value_mm, allowed)
                    .remedy("make the wedge smaller, or the block thicker or longer")
            }
            E::NotTheStandardsBlock { field, value_mm, standard_mm } => {
                FieldError::new(field.pointer(), value_mm, format!("{standard_mm} mm, as the standard has it"))
                    .remedy("set it, or leave out the outline")
            }
            E::DumbbellMisfit { field, value_mm, min_mm, max_mm } => {
                FieldError::new(field.pointer(), value_mm, format!("from {min_mm:.4} to {max_mm:.4} mm"))
                    .remedy("gauge, arcs and straight ends must have room in the block: change it, or the others")
            }
            E::DumbbellInShear { outline } => FieldError::new("/outline", outline, "block in a shear test")
                .remedy("set test to uniaxial, or leave out the outline"),
            E::DumbbellHoleAlongWidth { hole } => {
                let pointer = of_hole(*hole).name("axis").pointer();
                FieldError::new(pointer, HoleAxis::Width.name(), "thickness in a dumb-bell")
                    .remedy("the mesh of a dumb-bell is extruded along its thickness")
            }
        }
    }
}
