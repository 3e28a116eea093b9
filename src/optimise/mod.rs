//! Least squares, quadratic programmes with linear limits, and a search that needs no derivatives. The room knows
//! nothing of materials, meshes or data.
//!
//! * [`descend()`]: the loop of every nonlinear fit. What is fitted is a [`LeastSquares`] problem; how steps are
//!   shortened and when the loop ends are its [`Rules`].
//! * [`Secant`]: what the second derivatives of the residuals add to the matrix of such a fit.
//! * [`minimise`]: a fit whose residuals and Jacobian are at hand, with linear limits on its parameters.
//! * [`limited_step()`]: the least of a quadratic model within linear limits, to rounding.
//! * [`QuadraticProgramme`]: any convex quadratic programme with linear limits, by an interior-point method (Clarabel).
//! * [`Evolution`]: covariance matrix adaptation, for objectives that are known by their order alone.
//! * [`covariance()`]: what a Jacobian says of the parameters.
//!
//! Quadratic programmes are solved in two ways. A fit to curves takes thousands of steps in a dozen unknowns from a
//! feasible rest: an active set is exact there and costs next to nothing. The steps of calibrations and searches have
//! limits whose rooms differ by decades, or no feasible rest to begin from: these go to the interior point.

mod active_set;
mod covariance;
mod descend;
#[cfg(feature = "calibration")]
mod evolution;
mod limit;
#[cfg(feature = "calibration")]
mod limited_step;
#[cfg(feature = "calibration")]
mod quadratic;
mod residuals;
mod rules;
#[cfg(feature = "calibration")]
mod secant;

pub use covariance::covariance;
pub use descend::{Descent, End, LeastSquares, Step, descend};
#[cfg(feature = "calibration")]
pub use evolution::Evolution;
pub use limit::LinearLimit;
#[cfg(feature = "calibration")]
pub use limited_step::{NoStep, limited_step};
#[cfg(feature = "calibration")]
pub use quadratic::{Precision, QuadraticProgramme, QuadraticSolution, SolverStatus};
pub use residuals::{Evaluation, LeastSquaresOptions, Minimum, minimise};
pub use rules::{Damping, Raise, Rules, Shortening, Stop};
#[cfg(feature = "calibration")]
pub use secant::{OnTheWay, Secant};
