//! What an analysis of load curves says.

use crate::homogeneous::{CurveMatch, Interval, OgdenTerms, ShearTerm, fitted_material};
use crate::material::{Material, MaterialError};
use serde::{Deserialize, Serialize};

/// How the search for what a model leaves out ended, be it of load curves or of a whole recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The model meets the data up to noise and to what the numerics leave.
    NoMismatch,
    /// The named causes explain the mismatch.
    Explained,
    /// Other causes would explain it as well: the data cannot tell them apart.
    ExplainedAmbiguously,
    /// Something is left that no cause explains.
    Unexplained,
}

/// A hypothesis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Hypothesis {
    /// Finite viscoelasticity (Prony series).
    Relaxation,
    /// Softening after the first loading (Ogden–Roxburgh).
    Mullins,
    /// One more Ogden term.
    Terms,
    /// Friction between a compressed cylinder and its platens (barrelling).
    Barrelling,
    /// A constant error of the load cell.
    Offset,
    /// Load cells or areas that differ between curves.
    Gain,
    /// Friction in the load train.
    Friction,
}

impl Hypothesis {
    /// All of them, in the order in which they are tried.
    pub const ALL: [Hypothesis; 7] = [
        Hypothesis::Relaxation,
        Hypothesis::Mullins,
        Hypothesis::Terms,
        Hypothesis::Barrelling,
        Hypothesis::Offset,
        Hypothesis::Gain,
        Hypothesis::Friction,
    ];

    /// The cause's name in results.
    pub fn name(self) -> &'static str {
        match self {
            Hypothesis::Relaxation => "relaxation",
            Hypothesis::Mullins => "mullins",
            Hypothesis::Terms => "terms",
            Hypothesis::Barrelling => "barrelling",
            Hypothesis::Offset => "cell_offset",
            Hypothesis::Gain => "cell_gain",
            Hypothesis::Friction => "cell_friction",
        }
    }

    /// `material`, `boundary` or `load`.
    pub fn category(self) -> &'static str {
        match self {
            Hypothesis::Relaxation | Hypothesis::Mullins | Hypothesis::Terms => "material",
            Hypothesis::Barrelling => "boundary",
            Hypothesis::Offset | Hypothesis::Gain | Hypothesis::Friction => "load",
        }
    }
}

/// A parameter of a cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CauseParameter {
    /// `g_1`, `tau_1_s`, `r`, `m_kpa`, `beta`, `bonding`, `friction_kpa`, `offset_kpa`, `gain_2`, …
    pub name: String,
    /// Best value.
    pub value: f64,
    /// 95 % interval; none where the data do not determine it.
    pub interval_95: Option<[f64; 2]>,
}

/// A named cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CurveCause {
    /// [`Hypothesis::name`].
    pub name: String,
    /// [`Hypothesis::category`].
    pub category: String,
    /// The model that was fitted, in words.
    pub model: String,
    /// Its parameters.
    pub parameters: Vec<CauseParameter>,
    /// By how much BIC rises without it.
    pub delta_bic: f64,
    /// Hypotheses that would take its place about as well (BIC within 6).
    pub ambiguous_with: Vec<String>,
}

/// The evidence for one hypothesis at one stage of the search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct HypothesisEvidence {
    /// Stage, from 1: what was tried on top of what the stages before took.
    pub stage: usize,
    /// [`Hypothesis::name`].
    pub name: String,
    /// BIC without it − BIC with it: positive speaks for it.
    pub delta_bic: f64,
    /// F statistic and its probability without a real improvement.
    pub f_value: f64,
    /// See `f_value`.
    pub f_probability: f64,
    /// Σ (residual / weight)² with it.
    pub sum_of_squares: f64,
    /// Whether this stage took it.
    pub is_taken: bool,
}

/// A material estimate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CurveMaterial {
    /// `mu_1` (kPa), `alpha_1`, …
    pub parameters: Vec<CauseParameter>,
    /// ½ Σ μα, kPa.
    pub initial_shear_modulus_kpa: Interval,
}

impl CurveMaterial {
    /// The estimate as a material ([`fitted_material`]).
    ///
    /// # Errors
    /// As [`fitted_material`].
    pub fn material(&self) -> Result<Material, MaterialError> {
        let term = |p: &[CauseParameter]| ShearTerm { modulus_kpa: p[0].value * p[1].value, alpha: p[1].value };
        let terms: Vec<ShearTerm> = self.parameters.chunks_exact(2).map(term).collect();
        fitted_material(&OgdenTerms::free(&terms), None)
    }
}

/// A number without and with the named causes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct BeforeAfter {
    /// The model without causes.
    pub before: f64,
    /// With the named causes.
    pub after: f64,
}

/// A curve's match without and with the physics.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct MatchBeforeAfter {
    /// Elastic material alone.
    pub before: CurveMatch,
    /// With the named causes.
    pub after: CurveMatch,
}

/// The result of [`super::analyse_load_curve`] (`load_curve_diagnosis/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LoadCurveVerdict {
    /// Always `load_curve_diagnosis/1`.
    pub schema: String,
    /// The answer.
    pub verdict: Verdict,
    /// One sentence that says it.
    pub summary: String,
    /// Causes, strongest evidence first.
    pub causes: Vec<CurveCause>,
    /// All that was tried, stage after stage, best first.
    pub hypotheses: Vec<HypothesisEvidence>,
    /// The material when nothing but elasticity is assumed.
    pub naive_material: CurveMaterial,
    /// The material with the causes modelled (its equilibrium response where there is relaxation).
    pub material: CurveMaterial,
    /// Standard deviation of a reading, kPa.
    pub noise_sd_kpa: f64,
    /// Whether it was estimated from the scatter of neighbouring residuals.
    pub is_noise_estimated: bool,
    /// Σ (residual / noise)² per datum left.
    pub chi2_per_datum: BeforeAfter,
    /// Correlation of neighbouring residuals; near 0 where nothing structured is left.
    pub residual_correlation: BeforeAfter,
    /// Part of the structured misfit that the causes take away.
    pub explained_fraction: f64,
    /// The fitted parts.
    pub fitted: Vec<MatchBeforeAfter>,
    /// The parts kept back: predictions.
    pub kept_back: Vec<MatchBeforeAfter>,
    /// Measured and modelled stresses, for pictures.
    #[serde(skip)]
    pub traces: Vec<CurveTrace>,
}

/// Measured and modelled stresses of one curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CurveTrace {
    /// The curve's name.
    pub name: String,
    /// Times, s; may be empty.
    pub time_s: Vec<f64>,
    /// Stretch or shear.
    pub drive: Vec<f64>,
    /// Measured, kPa.
    pub measured_kpa: Vec<f64>,
    /// Elastic material alone, kPa.
    pub before_kpa: Vec<f64>,
    /// With the causes, kPa.
    pub after_kpa: Vec<f64>,
    /// Samples that were fitted; the others are predictions.
    pub num_fitted: usize,
}
