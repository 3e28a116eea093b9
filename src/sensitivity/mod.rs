//! How much a deformation tells about a material: pointwise and integrated sensitivities, Fisher information.

mod pointwise;

pub use pointwise::{PointwiseSensitivity, alpha_sensitivity, mu_sensitivity};
