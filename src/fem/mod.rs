//! Finite-strain finite elements: the forward problem and its exact derivatives.
//!
//! Elements with quadratic displacement and discontinuous linear pressure ([`kernel`](self) describes the formulation),
//! mixed Newton iterations, sparse Cholesky factors, and derivatives with respect to material, shape and drive from the
//! factorised tangent.

mod adjoint;
mod departures;
mod derivatives;
mod element_data;
mod error;
mod fibre_kernel;
mod fields;
mod kernel;
mod linear;
mod model;
mod nested;
mod newton;
mod ordering;
mod result;
mod stages;
mod topology;
mod verification;

pub use departures::{DepartureSensitivity, Departures, FIRM_BOND_KPA_PER_MM, Fibre, Field, PlateMotion};
pub use derivatives::{ParameterSensitivity, PathSensitivity};
pub use error::{SolveError, StepFailure};
pub use fields::QuadraturePoint;
pub use linear::LinearError;
pub use model::{ForwardModel, Statistics};
pub use nested::PrepareError;
pub use newton::{Equilibrium, SolveOptions};
pub use result::{SolveResult, SolveStep};
