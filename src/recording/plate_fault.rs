//! What is wrong with displacements, as the motion of the plates shows it.

use std::fmt::{Display, Formatter};

/// A unit of length that displacements seem to be in, where they should be in millimetres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MistakenUnit {
    /// Displacements are a thousandth of what they should be.
    Metres,
    /// Displacements are a tenth of what they should be.
    Centimetres,
    /// Displacements are a thousand times what they should be.
    Micrometres,
}

impl MistakenUnit {
    /// All of them, from the most likely one.
    pub(super) const ALL: [MistakenUnit; 3] =
        [MistakenUnit::Micrometres, MistakenUnit::Metres, MistakenUnit::Centimetres];

    /// Millimetres in one of this unit.
    pub(super) fn in_mm(self) -> f64 {
        match self {
            MistakenUnit::Metres => 1e3,
            MistakenUnit::Centimetres => 10.0,
            MistakenUnit::Micrometres => 1e-3,
        }
    }
}

impl Display for MistakenUnit {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            MistakenUnit::Metres => "metres; store them in mm (on import: --unit m)",
            MistakenUnit::Centimetres => "centimetres; store them in mm",
            MistakenUnit::Micrometres => "micrometres; store them in mm (on import: --unit um)",
        })
    }
}

/// What is wrong with displacements whose plates do not move as the drive.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlateFault {
    /// Another unit than the millimetre.
    #[error("the displacements seem to be in {0}")]
    Unit(MistakenUnit),
    /// The plate moves backwards.
    #[error(
        "the sign of the x component seems to be flipped; x points in the direction of a positive drive (on import: --axes, such as -y,z,-x)"
    )]
    Sign,
    /// Another component than x follows the drive.
    #[error(
        "component {component} follows the drive, where x should: the components seem to be permuted; store them as x, y, z (on import: --components){}",
        .unit.map_or(String::new(), |unit| format!("; they seem to be in {unit}"))
    )]
    Permuted {
        /// `y` or `z`.
        component: char,
        /// The unit, where that is wrong, too.
        unit: Option<MistakenUnit>,
    },
    /// The plate moves in another direction than the specimen's drive, at an angle from x.
    #[error(
        "the plate moves at {found_deg:.0}° from x towards z, and the specimen's drive_angle_deg is {told_deg}°: correct the angle, or the order and signs of the components (on import: --components, --axes)"
    )]
    Direction {
        /// Angle of the plate's motion in the plane of the plates, degrees.
        found_deg: f64,
        /// The specimen's, degrees.
        told_deg: f64,
    },
    /// A component moves much further than what drives the plate.
    #[error(
        "component {component} moves {times:.1} times as far as the drive, which no mount does: correct the drive, the displacement per phase or the unit"
    )]
    TooFar {
        /// `x`, `y` or `z`.
        component: char,
        /// Its motion over the drive.
        times: f64,
    },
}
