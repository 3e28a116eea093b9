//! Settings of the analysis of load curves, the levels that it decides by, and why it may have no result.

use super::load_curve::LoadCurveError;
use super::verdict::Hypothesis;
use crate::homogeneous::CurveFitError;

/// BIC must fall by at least this (odds of about 150 to 1).
pub const MIN_DELTA_BIC: f64 = 10.0;
/// Two causes whose BIC differ by less cannot be told apart.
pub const AMBIGUOUS_BIC: f64 = 6.0;
/// Level of the F-test, shared among the hypotheses of a stage.
pub const F_TEST_LEVEL: f64 = 0.01;
/// The causes explain the mismatch where they take away at least this part of its structured variance.
pub const EXPLAINED_PART: f64 = 0.9;

/// Settings of [`super::analyse_load_curve`].
#[derive(Clone, Debug, PartialEq)]
pub struct LoadCurveOptions {
    /// Most Ogden terms.
    pub max_terms: usize,
    /// Most relaxations, at most 4.
    pub max_relaxations: usize,
    /// Standard deviation of a stress reading, kPa; estimated where not known.
    pub noise_sd_kpa: Option<f64>,
    /// Structured misfit below this part of the curves' root mean square is no mismatch: digitisation, thinning.
    pub floor: f64,
    /// Which hypotheses are tried.
    pub hypotheses: Vec<Hypothesis>,
}

impl Default for LoadCurveOptions {
    fn default() -> Self {
        LoadCurveOptions {
            max_terms: 3,
            max_relaxations: 3,
            noise_sd_kpa: None,
            floor: 0.01,
            hypotheses: Hypothesis::ALL.to_vec(),
        }
    }
}

/// Why load curves could not be analysed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LoadCurveAnalysisError {
    /// A curve is not usable.
    #[error(transparent)]
    Curve(#[from] LoadCurveError),
    /// No elastic material comes near the curves.
    #[error(transparent)]
    Elastic(#[from] CurveFitError),
    /// Nothing to fit.
    #[error("{num_fitted} samples are fitted; at least {needed} are needed (the others are kept back)")]
    TooFewData {
        /// Samples to fit.
        num_fitted: usize,
        /// Least number.
        needed: usize,
    },
    /// A setting is out of its range.
    #[error("{name} is {value}; {requirement}")]
    Setting {
        /// Which one.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is needed.
        requirement: &'static str,
    },
    /// The caller asked to stop.
    #[error("cancelled after {stages} stages")]
    Cancelled {
        /// Stages done.
        stages: usize,
    },
}
