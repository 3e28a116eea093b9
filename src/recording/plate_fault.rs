//! What is wrong with displacements, as the motion of the plates shows it.

/// What is wrong with displacements whose plates do not move as the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PlateFault {
    /// A thousandth of what they should be.
    #[error("the displacements seem to be in metres; store them in mm (on import: --unit m)")]
    Metres,
    /// A thousand times what they should be.
    #[error("the displacements seem to be in micrometres; store them in mm (on import: --unit um)")]
    Micrometres,
    /// The plate moves backwards.
    #[error(
        "the sign of the x component seems to be flipped; x points in the direction of the drive (on import: --axes, such as -y,z,-x)"
    )]
    Sign,
    /// Another component than x follows the drive.
    #[error(
        "component {component} follows the drive, where x should: the components seem to be permuted; store them as x, y, z (on import: --components)"
    )]
    Permuted {
        /// `y` or `z`.
        component: char,
    },
}
