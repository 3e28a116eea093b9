//! The specimen: what is cast, how it is held and how far it is pulled.
//!
//! Frame (reference): origin at the centre of the undeformed block; x along its length (the pull direction),
//! y along its thickness, z along its width. Lengths in mm.
//!
//! What is supported: a plain block, a wedge ([`Taper`]) or a dumb-bell ([`Outline`]), with holes that all share one
//! axis: circles, ellipses and slots ([`HoleShape`]), and round notches in free sides ([`Notch`]); in a double-lap test
//! further blocks beside it ([`Specimen::samples`]). The mesh is a section extruded along that axis, so holes of two
//! directions in one specimen are refused. Parsing and validation: [`Specimen::from_json`]. Limits of what can be made:
//! [`ManufacturingLimits`]. Drawings for the mould maker: [`to_svg`], [`to_dxf`], [`to_stl`], [`to_step`].

mod bounds;
#[cfg(feature = "solids")]
mod clearance;
mod drawing;
mod drawing_dxf;
mod drawing_holes;
mod drawing_labels;
mod drawing_sheet;
mod drawing_step;
#[cfg(feature = "triangles")]
mod drawing_stl;
mod drawing_svg;
mod drawing_table;
mod drives;
pub mod dumbbell;
mod ellipse;
mod file;
mod geometry;
mod hole_gap;
mod hole_likeness;
mod hole_motion;
mod hole_shape;
mod hole_wall;
pub(crate) mod json;
mod ligament;
mod limits;
mod limits_error;
mod notch;
mod read;
mod read_error;
mod samples;
#[cfg(test)]
pub(crate) mod sampling;
mod section_loop;
mod solid;
mod step_file;
mod taper;
#[cfg(test)]
mod taper_tests;
#[cfg(test)]
mod tests;
mod tolerances;

#[cfg(feature = "design")]
pub(crate) use file::Name;

pub use bounds::{
    MAX_DIAMETER_MM, MAX_HOLES, MAX_NAME_LENGTH, MAX_OTHER_SAMPLES, MAX_SAMPLES_IN_PARALLEL, MAX_SIZE_MM,
    MIN_DIAMETER_MM, MIN_SIZE_MM, SCHEMA,
};
pub use drawing_dxf::{to_dxf, to_dxf_with};
pub use drawing_step::{MOULD_WALL_MM, mould_to_step, to_step};
#[cfg(feature = "triangles")]
pub use drawing_stl::{DrawingError, to_stl};
pub use drawing_svg::{to_svg, to_svg_with};
pub use drives::{
    MAX_DRIVE_ANGLE_DEG, MAX_DRIVES, MAX_NOMINAL_STRETCH, MAX_PRECOMPRESSION, MAX_SHEAR_STRAIN, MIN_NOMINAL_STRETCH,
    PRECOMPRESSION_DIRECTION, farthest_from_zero, leads_on, way_across_plates,
};
pub use dumbbell::Dumbbell;
pub use geometry::MIRROR_TOLERANCE_MM;
pub use hole_shape::{HoleKind, HoleShape, MAX_HOLE_ANGLE_DEG, MAX_HOLE_ASPECT};
pub use hole_wall::HoleWall;
pub use json::JsonProblem;
pub use ligament::{Ligament, LigamentKind, SectionEdge};
pub use limits::{DiameterRange, LimitMargin, ManufacturingLimits, Symmetry, TestResponse};
pub use limits_error::LimitsError;
pub use notch::{MAX_NOTCH_INSET, MIN_NOTCH_DEPTH, Notch, NotchProblem, NotchRates};
pub use read::min_meshable_ligament_mm;
pub use read_error::SpecimenError;
pub use taper::{MAX_WEDGE_OF_LENGTH, MAX_WEDGE_OF_THICKNESS, Taper};
pub use tolerances::{HoleTolerances, Tolerances};

use serde::{Deserialize, Serialize};

/// How the specimen is held and moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = TestSchema))]
#[serde(rename_all = "snake_case")]
pub enum TestKind {
    /// Faces y = ±thickness/2 (of a wedge, those that slant) bonded to rigid plates; the one at +y moves by the drive
    /// along x, or at an angle from it towards z.
    DoubleLapShear,
    /// Faces x = ±length/2 bonded to rigid grips; the one at +x moves by the drive along x.
    Uniaxial,
}

/// The bounding block, mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = BlockSchema))]
#[serde(deny_unknown_fields)]
pub struct Block {
    /// Extent along x, mm.
    #[cfg_attr(feature = "schema", schema(value_type = file::ExtentMm))]
    pub length_mm: f64,
    /// Extent along y, mm; of a wedge that in the middle, at x = 0.
    #[cfg_attr(feature = "schema", schema(value_type = file::ExtentMm))]
    pub thickness_mm: f64,
    /// Extent along z, mm.
    #[cfg_attr(feature = "schema", schema(value_type = file::ExtentMm))]
    pub width_mm: f64,
    /// Thickness at x = +length/2 less that at x = −length/2, mm; 0 by default. Both bonded faces of a double-lap test
    /// slant alike, and so do the plates that hold them. Holes of a wedge run along the thickness.
    #[serde(default, skip_serializing_if = "is_even")]
    #[cfg_attr(feature = "schema", schema(value_type = file::WedgeMm))]
    pub wedge_mm: f64,
}

fn is_even(wedge_mm: &f64) -> bool {
    *wedge_mm == 0.0
}

/// The direction of a hole's axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = AxisSchema))]
#[serde(rename_all = "snake_case")]
pub enum HoleAxis {
    /// Along y, centred at (x, z).
    Thickness,
    /// Along z, centred at (x, y).
    Width,
}

impl HoleAxis {
    /// The axis as JSON writes it.
    pub fn name(self) -> &'static str {
        match self {
            HoleAxis::Thickness => "thickness",
            HoleAxis::Width => "width",
        }
    }

    /// Extents of a block across the axis, mm: along x, and along z for the thickness, y for the width.
    pub fn section_of(self, block: &Block) -> [f64; 2] {
        match self {
            HoleAxis::Thickness => [block.length_mm, block.width_mm],
            HoleAxis::Width => [block.length_mm, block.thickness_mm],
        }
    }
}

/// A hole through the whole block: a circle, or an ellipse or a slot; or a notch in one of its sides.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = HoleSchema))]
#[serde(deny_unknown_fields)]
pub struct Hole {
    /// Direction of the axis.
    pub axis: HoleAxis,
    /// Centre, mm: (x, z) for `thickness`, (x, y) for `width`.
    #[cfg_attr(feature = "schema", schema(min_items = 2, max_items = 2))]
    pub center_mm: [f64; 2],
    /// Diameter, mm; of an ellipse or a slot the extent across it.
    #[cfg_attr(feature = "schema", schema(value_type = file::DiameterMm))]
    pub diameter_mm: f64,
    /// Its outline where that is not a circle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = Option<HoleShape>, nullable = false))]
    pub shape: Option<HoleShape>,
    /// Whether the hole is a notch: round, with its centre near a free side of a block, which cuts it open. `false` by
    /// default.
    #[serde(default, skip_serializing_if = "is_whole")]
    pub is_notch: bool,
}

fn is_whole(is_notch: &bool) -> bool {
    !*is_notch
}

impl Hole {
    /// A circular hole.
    pub fn circle(axis: HoleAxis, center_mm: [f64; 2], diameter_mm: f64) -> Hole {
        Hole { axis, center_mm, diameter_mm, shape: None, is_notch: false }
    }

    /// Extent along the hole, mm; the diameter of a circle.
    pub fn length_mm(&self) -> f64 {
        self.shape.map_or(self.diameter_mm, |shape| shape.length_mm)
    }

    /// The hole with its wall about `by_mm`/2 further out all around: both extents grow by `by_mm`.
    pub fn grown(self, by_mm: f64) -> Hole {
        let shape = self.shape.map(|shape| HoleShape { length_mm: shape.length_mm + by_mm, ..shape });
        Hole { diameter_mm: self.diameter_mm + by_mm, shape, ..self }
    }
}

/// The outline in the (x, z) section, extruded along the thickness.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = OutlineSchema))]
pub enum Outline {
    /// The plain block.
    #[default]
    #[serde(rename = "block")]
    Block,
    /// ISO 37 type 4 dumb-bell.
    #[serde(rename = "iso37_type4")]
    Iso37Type4,
    /// A dumb-bell with a gauge of its own.
    #[serde(rename = "dumbbell")]
    Dumbbell(Dumbbell),
}

impl Outline {
    /// The outline as JSON writes it.
    pub fn name(self) -> &'static str {
        match self {
            Outline::Block => "block",
            Outline::Iso37Type4 => "iso37_type4",
            Outline::Dumbbell(_) => "dumbbell",
        }
    }

    /// The gauge and arcs of a dumb-bell; `None` of a block.
    pub fn dumbbell(&self) -> Option<Dumbbell> {
        match self {
            Outline::Block => None,
            Outline::Iso37Type4 => Some(dumbbell::ISO37_TYPE4),
            Outline::Dumbbell(dumbbell) => Some(*dumbbell),
        }
    }

    /// The gauge of a dumb-bell of free gauge, to be changed; a standard's and a block have none.
    pub fn free_gauge_mut(&mut self) -> Option<&mut Dumbbell> {
        match self {
            Outline::Dumbbell(dumbbell) => Some(dumbbell),
            Outline::Block | Outline::Iso37Type4 => None,
        }
    }
}

/// A sample that shares plates' drive and load cell with another one, and is a block of its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = SampleSchema))]
#[serde(deny_unknown_fields)]
pub struct Sample {
    /// Bounding block.
    pub block: Block,
    /// Holes; all with the same axis.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(value_type = file::Holes))]
    pub holes: Vec<Hole>,
}

/// A specimen; in JSON `specimen/1`, with the tag `schema` before its fields.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "file::SpecimenFile", into = "file::SpecimenFile")]
pub struct Specimen {
    /// Free name.
    pub name: String,
    /// How it is held and moved.
    pub test: TestKind,
    /// Bounding block.
    pub block: Block,
    /// Outline in the (x, z) section.
    pub outline: Outline,
    /// Holes; all with the same axis.
    pub holes: Vec<Hole>,
    /// Drives at which the specimen is scanned, mm: all positive or all negative, away from rest. Negative ones push
    /// the grips together, or shear the other way.
    pub drive_mm: Vec<f64>,
    /// Angle of the drive from x towards z, in the plane of the plates of a double-lap test, degrees; 0 in a uniaxial
    /// one.
    pub drive_angle_deg: f64,
    /// How far the plates of a double-lap test are pressed together before they are driven, and stay so, mm; negative
    /// ones are pulled apart. Displacements count from the sample before that.
    pub precompression_mm: f64,
    /// How many samples like this one share the load cell.
    pub samples_in_parallel: u32,
    /// Further samples that share drive and load cell, in a double-lap test: blocks of their own size, with holes of
    /// their own. The forces of all samples add.
    pub other_samples: Vec<Sample>,
}
