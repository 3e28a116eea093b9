//! Which components of a displacement across the drive are mistaken for others.

use std::fmt::{Display, Formatter};

/// What seems to be wrong with the components across the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ComponentFault {
    /// What is stored as y is z, and the other way round.
    pub is_exchanged: bool,
    /// The sign of what is y is flipped.
    pub is_y_flipped: bool,
    /// The sign of what is z is flipped.
    pub is_z_flipped: bool,
}

impl ComponentFault {
    /// All that are told from each other.
    pub(super) const ALL: [ComponentFault; 7] = [
        ComponentFault { is_exchanged: false, is_y_flipped: true, is_z_flipped: false },
        ComponentFault { is_exchanged: false, is_y_flipped: false, is_z_flipped: true },
        ComponentFault { is_exchanged: false, is_y_flipped: true, is_z_flipped: true },
        ComponentFault { is_exchanged: true, is_y_flipped: false, is_z_flipped: false },
        ComponentFault { is_exchanged: true, is_y_flipped: true, is_z_flipped: false },
        ComponentFault { is_exchanged: true, is_y_flipped: false, is_z_flipped: true },
        ComponentFault { is_exchanged: true, is_y_flipped: true, is_z_flipped: true },
    ];

    /// The displacement (or a row of its gradient for each component) as it should be stored.
    pub(super) fn mended<T: Copy + std::ops::Neg<Output = T>>(self, [x, y, z]: [T; 3]) -> [T; 3] {
        let (y, z) = if self.is_exchanged { (z, y) } else { (y, z) };
        [x, if self.is_y_flipped { -y } else { y }, if self.is_z_flipped { -z } else { z }]
    }
}

impl Display for ComponentFault {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        if self.is_exchanged {
            f.write_str("the y and z components seem to be exchanged with each other")?;
        }
        let flipped = match (self.is_y_flipped, self.is_z_flipped) {
            (true, true) => "the signs of y and z",
            (true, false) => "the sign of y",
            (false, true) => "the sign of z",
            (false, false) => return Ok(()),
        };
        write!(f, "{}{flipped} flipped", if self.is_exchanged { ", with " } else { "displacements seem to have " })
    }
}
