//! Settings of a fit: iterations, what is held, what is known beforehand.

use super::error::CalibrationError;
use crate::fem::SolveOptions;

/// What is known of κ, which nearly incompressible materials hardly show.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Bulk {
    /// Nothing: κ is fitted.
    #[default]
    Free,
    /// ln κ is Gaussian: the prior of `bulk_log_prior_sd` in an evaluation.
    LogPrior {
        /// Centre, kPa.
        center_kpa: f64,
        /// Standard deviation of ln κ.
        log_sd: f64,
    },
    /// κ stays as in the start.
    Held,
}

/// Parameters that a fit leaves as they are, by their place in κ, μ₁, α₁, μ₂, …
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Held(u32);

impl Held {
    /// Also the parameter at `index`; none beyond the 31st.
    pub fn with(self, index: usize) -> Held {
        Held(self.0 | 1u32.checked_shl(index as u32).unwrap_or(0))
    }

    /// Whether the parameter at `index` is held.
    pub fn contains(self, index: usize) -> bool {
        self.0 & 1u32.checked_shl(index as u32).unwrap_or(0) != 0
    }

    /// How many are held.
    pub fn count(self) -> usize {
        self.0.count_ones() as usize
    }
}

/// Settings of [`super::fit()`].
#[derive(Clone, Copy, Debug)]
pub struct FitOptions {
    /// Levenberg–Marquardt iterations, rejected ones included.
    pub max_iterations: usize,
    /// An objective that another start is known to lead to: a fit that would not come below it in its iterations is
    /// given up ([`crate::optimise::Stop::to_beat`]).
    pub to_beat: Option<f64>,
    /// Converged when the optimum of the linear model is nearer than this, in standard deviations of the worst
    /// combination of parameters.
    pub tolerance: f64,
    /// Smallest distance η of two exponents. The paper's is 1.
    pub min_alpha_gap: f64,
    /// κ.
    pub bulk: Bulk,
    /// Further parameters that stay as in the start.
    pub held: Held,
    /// The equilibria.
    pub solve: SolveOptions,
}

impl Default for FitOptions {
    fn default() -> Self {
        FitOptions {
            max_iterations: 25,
            to_beat: None,
            tolerance: 0.02,
            min_alpha_gap: 1.0,
            bulk: Bulk::Free,
            held: Held::default(),
            solve: SolveOptions::trial(),
        }
    }
}

/// Checks what the types do not.
///
/// # Errors
/// [`CalibrationError::InvalidValue`].
pub(super) fn check_options(options: &FitOptions) -> Result<(), CalibrationError> {
    let positive = |name, value: f64| {
        let requirement = "positive and finite";
        if value > 0.0 && value.is_finite() {
            Ok(())
        } else {
            Err(CalibrationError::InvalidValue { name, value, requirement })
        }
    };
    positive("tolerance", options.tolerance)?;
    if !(options.min_alpha_gap >= 0.0 && options.min_alpha_gap.is_finite()) {
        return Err(CalibrationError::InvalidValue {
            name: "min_alpha_gap",
            value: options.min_alpha_gap,
            requirement: "finite and not negative",
        });
    }
    if let Bulk::LogPrior { center_kpa, log_sd } = options.bulk {
        positive("the prior's centre of kappa", center_kpa)?;
        positive("the prior's standard deviation of ln kappa", log_sd)?;
    }
    Ok(())
}
