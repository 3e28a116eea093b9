//! 95 % intervals of Gaussian estimates.

/// Half width of a 95 % interval in standard deviations.
pub(super) const HALF_WIDTH: f64 = 1.96;

/// The interval of an estimate that is Gaussian itself.
pub(super) fn interval(value: f64, sd: f64) -> [f64; 2] {
    [value - HALF_WIDTH * sd, value + HALF_WIDTH * sd]
}

/// The interval of `value`, a number in proportion to a `fitted` one whose logarithm is Gaussian; `sd` is that of
/// `fitted`.
pub(super) fn log_interval(value: f64, fitted: f64, sd: f64) -> [f64; 2] {
    let spread = (HALF_WIDTH * sd / fitted).exp();
    [value / spread, value * spread]
}
