//! Settings of a whole calibration.

use super::contours::ContourOptions;
use super::options::FitOptions;
use super::target::Objective;
use super::terms::{DECREMENT_THRESHOLD, Rule};
use crate::material::LawKind;

/// Discretisation errors of data are taken to be this multiple of our own, to one standard deviation. Ours at the
/// standard size is about that of the usual synthetic recordings (0.004 to 0.012 mm rms at 70 % shear).
pub const DISCRETISATION_FACTOR: f64 = 2.0;

/// How many terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TermCount {
    /// As many as the deciding rule keeps.
    Auto {
        /// At most.
        max: usize,
    },
    /// This many.
    Fixed(usize),
}

/// Settings of [`super::calibrate()`].
#[derive(Clone, Copy, Debug)]
pub struct CalibrateOptions {
    /// Number of terms.
    pub terms: TermCount,
    /// A law in the first invariant in the place of Ogden's terms, whose number is then not chosen.
    pub law: Option<LawKind>,
    /// Which rule decides.
    pub rule: Rule,
    /// Threshold of the paper's decrement.
    pub decrement_threshold: f64,
    /// What is minimised.
    pub objective: Objective,
    /// The fits.
    pub fit: FitOptions,
    /// Element size relative to standard.
    pub mesh_factor: f64,
    /// Fit on a coarser mesh too and widen the intervals by what the difference promises.
    pub has_mesh_allowance: bool,
    /// Standard deviation of discretisation errors, the data's included, over the estimated error of our own mesh.
    pub discretisation_factor: f64,
    /// Starts of every number of terms.
    pub num_starts: usize,
    /// Whether they are all tried. If not, the first that leads to an optimum which is as good as the linear model
    /// promised of the likeliest start is the last, and of one term the first that leads to an optimum: where an answer
    /// has to come soon.
    pub tries_all_starts: bool,
    /// A further term is not fitted where the linear model promises less than this decrease of the objective. Zero fits
    /// every term, to show what it does.
    pub least_promise: f64,
    /// Profile likelihoods of all parameters.
    pub has_profiles: bool,
    /// Contours around the estimate.
    pub contours: Option<ContourOptions>,
}

impl Default for CalibrateOptions {
    fn default() -> Self {
        CalibrateOptions {
            terms: TermCount::Auto { max: 3 },
            law: None,
            rule: Rule::Bic,
            decrement_threshold: DECREMENT_THRESHOLD,
            objective: Objective::Weighted,
            fit: FitOptions { max_iterations: 40, ..FitOptions::default() },
            mesh_factor: 1.0,
            has_mesh_allowance: true,
            discretisation_factor: DISCRETISATION_FACTOR,
            num_starts: 3,
            tries_all_starts: true,
            least_promise: 0.0,
            has_profiles: false,
            contours: None,
        }
    }
}
