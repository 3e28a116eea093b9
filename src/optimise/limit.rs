//! A linear limit on unknowns.

/// Σ coefficient·x ≤ bound.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearLimit {
    /// (index of the unknown, coefficient); unknowns that are not named have none.
    pub coefficients: Vec<(usize, f64)>,
    /// Right side.
    pub bound: f64,
}

impl LinearLimit {
    /// `x[index]` ≤ bound.
    pub fn at_most(index: usize, bound: f64) -> LinearLimit {
        LinearLimit { coefficients: vec![(index, 1.0)], bound }
    }

    /// `x[index]` ≥ bound.
    pub fn at_least(index: usize, bound: f64) -> LinearLimit {
        LinearLimit { coefficients: vec![(index, -1.0)], bound: -bound }
    }

    /// The left side at `x`.
    pub fn value(&self, x: &[f64]) -> f64 {
        self.coefficients.iter().map(|&(i, c)| c * x[i]).sum()
    }

    /// The coefficient of largest magnitude; never zero, so that a limit can be divided by it.
    pub fn height(&self) -> f64 {
        self.coefficients.iter().fold(1e-300f64, |largest, (_, c)| largest.max(c.abs()))
    }
}
