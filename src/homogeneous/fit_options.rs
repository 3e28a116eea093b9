//! Settings of fits to curves, and why there may be none.

use super::curve::CurveError;
use super::deformation::Deformation;
use crate::material::LawKind;

/// Settings of [`super::fit_terms`], [`super::fit_law`] and [`super::fit_curves`].
#[derive(Clone, Debug, PartialEq)]
pub struct CurveFitOptions {
    /// A law in the first invariant in the place of Ogden's terms.
    pub law: Option<LawKind>,
    /// Fits with 1 to this many of Ogden's terms.
    pub max_terms: usize,
    /// Whether the first term is a neo-Hookean one, α = 2 held.
    pub neo_hookean: bool,
    /// κ, kPa: held where given; without it the incompressible limit is fitted.
    pub bulk_kpa: Option<f64>,
    /// Smallest distance η of two exponents.
    pub min_alpha_gap: f64,
    /// Range of the exponents.
    pub alpha_range: [f64; 2],
    /// States beyond the data in which a material with negative products μα, or a law in the first invariant, must be
    /// stable too: those that will be predicted.
    pub also_stable_at: Vec<Deformation>,
    /// Starts that are refined per number of terms.
    pub num_starts: usize,
}

impl Default for CurveFitOptions {
    fn default() -> Self {
        CurveFitOptions {
            law: None,
            max_terms: 3,
            neo_hookean: false,
            bulk_kpa: None,
            min_alpha_gap: 1.0,
            alpha_range: [-20.0, 20.0],
            also_stable_at: Vec::new(),
            num_starts: 6,
        }
    }
}

/// Why curves could not be fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CurveFitError {
    /// A curve is not usable.
    #[error(transparent)]
    Curve(#[from] CurveError),
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
    /// More unknowns than data.
    #[error("{num_terms} terms need more than {num_data} data points; ask for fewer terms")]
    TooFewData {
        /// Terms.
        num_terms: usize,
        /// Data points.
        num_data: usize,
    },
    /// More unknowns of a law in the first invariant than data.
    #[error("the law of {law} has {num_parameters} parameters and needs more than the {num_data} data points")]
    TooFewForLaw {
        /// The law.
        law: &'static str,
        /// Its parameters.
        num_parameters: usize,
        /// Data points.
        num_data: usize,
    },
    /// No start of a law in the first invariant led anywhere.
    #[error(
        "no material with the law of {law} was found that is stable in every state of these curves and of those kept \
         back; check the stresses' signs and units, or ask for another law"
    )]
    NoLawFit {
        /// The law.
        law: &'static str,
    },
    /// No start led anywhere.
    #[error(
        "no stable material with {num_terms} terms was found for these curves; check the stresses' signs and units, or ask \
         for another number of terms"
    )]
    NoFit {
        /// Terms.
        num_terms: usize,
    },
}
