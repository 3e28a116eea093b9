//! Which components of a displacement have the wrong sign.

use std::fmt::{Display, Formatter};

/// Components across the drive whose sign seems to be flipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FlippedComponents {
    /// The y component.
    Y,
    /// The z component.
    Z,
    /// Both.
    YAndZ,
}

impl FlippedComponents {
    /// All that are told from each other.
    pub(super) const ALL: [FlippedComponents; 3] =
        [FlippedComponents::Y, FlippedComponents::Z, FlippedComponents::YAndZ];

    /// Factors of x, y and z.
    pub(super) fn signs(self) -> [f64; 3] {
        match self {
            FlippedComponents::Y => [1.0, -1.0, 1.0],
            FlippedComponents::Z => [1.0, 1.0, -1.0],
            FlippedComponents::YAndZ => [1.0, -1.0, -1.0],
        }
    }
}

impl Display for FlippedComponents {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            FlippedComponents::Y => "the sign of the y component seems to be flipped",
            FlippedComponents::Z => "the sign of the z component seems to be flipped",
            FlippedComponents::YAndZ => "the signs of the y and z components seem to be flipped",
        })
    }
}
