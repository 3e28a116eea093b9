//! The outline of a hole that is not a circle: an ellipse or a slot with an angle.

#[cfg(feature = "schema")]
use crate::field::schema::{number_within, schema_type};
use serde::{Deserialize, Serialize};

/// The longest a hole may be, in multiples of its extent across. Longer ones are cuts rather than holes: their tips are
/// too sharp for a mould and for elements around them.
pub const MAX_HOLE_ASPECT: f64 = 5.0;
/// Largest angle of a hole, degrees, either way. Half a turn is the whole range of a hole that looks alike after it.
pub const MAX_HOLE_ANGLE_DEG: f64 = 180.0;

#[cfg(feature = "schema")]
schema_type! {
    /// An angle of a hole, degrees.
    AngleDeg = number_within(-MAX_HOLE_ANGLE_DEG..=MAX_HOLE_ANGLE_DEG);
}

/// What an outline that is not a circle looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = HoleKindSchema))]
#[serde(rename_all = "snake_case")]
pub enum HoleKind {
    /// (ξ/a)² + (η/b)² = 1.
    Ellipse,
    /// Two half circles of radius b joined by straight lines (a stadium): all points at the distance b from the segment
    /// |ξ| ≤ a − b, η = 0.
    Slot,
}

impl HoleKind {
    /// The kind as JSON writes it.
    pub fn name(self) -> &'static str {
        match self {
            HoleKind::Ellipse => "ellipse",
            HoleKind::Slot => "slot",
        }
    }
}

/// The outline of a hole that is not a circle, in its own frame: ξ along the hole, η across it, both from its centre.
///
/// With a = `length_mm`/2 and b = `diameter_mm`/2 of the hole, ξ = (x − x₀) cos φ + (y − y₀) sin φ and η = (y − y₀) cos
/// φ − (x − x₀) sin φ, where (x, y) are the coordinates of the section (z in place of y for holes along the thickness),
/// (x₀, y₀) is the hole's centre and φ is `angle_deg`. Where a = b the outline is the circle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = HoleShapeSchema))]
#[serde(deny_unknown_fields)]
pub struct HoleShape {
    /// What it looks like.
    pub kind: HoleKind,
    /// Extent along the hole, mm: at least its `diameter_mm`, which is then the extent across it, and at most five
    /// times as much.
    #[cfg_attr(feature = "schema", schema(value_type = super::file::DiameterMm))]
    pub length_mm: f64,
    /// Angle from x to the hole's length, towards the section's other axis (z for holes along the thickness, y for
    /// holes along the width), degrees; 0 by default.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(value_type = AngleDeg))]
    pub angle_deg: f64,
}

impl HoleShape {
    /// The shape in a section that is mirrored where a sign is negative (x, then the other axis).
    pub fn mirrored(self, signs: [f64; 2]) -> HoleShape {
        if signs[0] * signs[1] > 0.0 { self } else { HoleShape { angle_deg: -self.angle_deg, ..self } }
    }
}

#[cfg(test)]
#[path = "hole_shape_tests.rs"]
mod tests;
