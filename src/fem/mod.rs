//! Finite-strain finite elements: the forward problem and its exact derivatives.
//!
//! Elements with quadratic displacement and discontinuous linear pressure ([`kernel`](self) describes the formulation),
//! mixed Newton iterations, sparse Cholesky factors, and derivatives with respect to material, shape and drive from the
//! factorised tangent.
//!
//! Four things build on each other. The *assembler* turns a state into residual and tangent. A *mesh model* is an
//! assembler with a linear system and solves by Newton's method. The [`ForwardModel`] is a mesh model that a coarse one
//! may guide. A [`Tangent`] is the factorised matrix of one equilibrium; every derivative is solved with one.

mod adjoint;
mod assembler;
mod change;
mod coarse_space;
mod condensation;
mod contact;
mod crew;
mod departures;
mod departures_on_mesh;
#[cfg(test)]
mod departures_tests;
mod derivatives;
mod direct;
mod dot;
mod element_data;
mod equilibrium;
mod error;
mod fibre_kernel;
mod fields;
mod forward_model;
mod fronts;
mod graph;
mod guide;
mod kernel;
mod kernels;
mod law_correction;
mod law_kernel;
mod levels;
#[cfg(test)]
mod levels_tests;
mod lifting;
mod linear;
mod linearisation;
mod mesh_model;
mod minimum_degree;
#[cfg(feature = "calibration")]
mod model_pool;
mod multifrontal;
#[cfg(feature = "metis")]
mod nested_dissection;
mod nesting;
mod newton;
mod options;
mod ordering;
mod patches;
mod path_end;
mod plates;
mod rates;
mod result;
mod rotation;
mod stages;
mod stiffness;
mod stiffness_kernel;
mod substitution;
mod tangent;
#[cfg(test)]
mod tangent_tests;
mod topology;
mod variation_kernel;
mod verification;

pub use change::{Change, ChangeSensitivity};
pub use contact::Contact;
#[cfg(feature = "calibration")]
pub(crate) use crew::side_by_side;
pub use departures::{Departures, FIRM_BOND_KPA_PER_MM, Fibre, Field, PlateMotion, VectorField};
pub use derivatives::{ParameterSensitivity, PathSensitivity};
#[cfg(feature = "calibration")]
pub(crate) use dot::dot;
pub use equilibrium::Equilibrium;
pub use error::{LinearError, PrepareError, SolveError, StepFailure};
pub use fields::QuadraturePoint;
pub use forward_model::ForwardModel;
pub use law_correction::LawCorrection;
#[cfg(feature = "calibration")]
pub(crate) use model_pool::ModelPool;
pub use nesting::Nesting;
pub use options::{SolveOptions, Statistics};
pub use path_end::{EndCause, PathEnd, Way};
pub use result::{SolveResult, SolveStep};
pub use rotation::turned_by;
pub use tangent::Tangent;
