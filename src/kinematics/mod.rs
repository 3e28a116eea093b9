//! Kinematics of one point: from the deformation gradient F to its volume ratio, its principal stretches and the pair
//! (λ, k) of stretch amplitude and deformation mode.
//!
//! Tensors are `[[f64; 3]; 3]`, row first. For F the row is the current and the column the reference direction.

mod decomposition;
mod stretches;

pub use decomposition::{
    Decomposition, MODE_TOLERANCE, compose, decompose, mode_exponent_derivatives, mode_exponents,
    stretch_amplitude_and_mode,
};
pub use stretches::{determinant, inverse, isochoric_principal_stretches, principal_stretches};

/// A second-order tensor, `[row][column]`.
pub type Tensor = [[f64; 3]; 3];

/// The identity.
pub const IDENTITY: Tensor = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
