//! 95 % intervals of Gaussian estimates.

use crate::calibration::TWO_SIDED_95;

/// The interval of an estimate that is Gaussian itself.
pub(super) fn interval(value: f64, sd: f64) -> [f64; 2] {
    [value - TWO_SIDED_95 * sd, value + TWO_SIDED_95 * sd]
}

/// The interval of `value`, a number in proportion to a `fitted` one whose logarithm is Gaussian; `sd` is that of
/// `fitted`.
pub(super) fn log_interval(value: f64, fitted: f64, sd: f64) -> [f64; 2] {
    let spread = (TWO_SIDED_95 * sd / fitted).exp();
    [value / spread, value * spread]
}
