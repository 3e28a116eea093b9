//! What a cause in the material's own law is: a change of its parameters' number or of what is known of them
//! beforehand.

use super::cause::CauseName;
use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::found::FoundCause;
use super::inference::Inference;
use super::trace::Trace;

/// What a material cause looks at.
pub(super) struct MaterialCase<'c> {
    /// What was recorded, as the mesh of the diagnosis would have shown it.
    pub(super) measured: &'c Trace,
    /// The nominal model's fit.
    pub(super) nominal: &'c CauseFit,
    /// The fit with what was found so far.
    pub(super) current: &'c CauseFit,
    /// Whether a material is believed, so that its number of terms is stated.
    pub(super) is_believed: bool,
}

/// What a material cause found.
pub(super) struct MaterialFinding {
    /// The cause.
    pub(super) found: FoundCause,
    /// The nominal model's fit where the cause changes what the nominal material is.
    pub(super) nominal: Option<CauseFit>,
    /// The fit with the cause.
    pub(super) current: CauseFit,
}

/// What a material cause is worth once other causes are in the fit.
pub(super) enum Recheck {
    /// It still is needed, with this evidence where it was weighed anew.
    Needed(Option<f64>),
    /// It was another cause's effect: the fit without it.
    NotNeeded(Box<CauseFit>),
}

/// A cause in the material's own law.
pub(super) trait MaterialCause: Sync {
    /// Its name in results.
    fn name(&self) -> CauseName;

    /// Looks whether the recording calls for it, before other causes are tested; priors of `inference` change where it
    /// does.
    ///
    /// # Errors
    /// [`DiagnosisError`]: no equilibrium, or the work was cancelled.
    fn look(&self, inference: &mut Inference, case: &MaterialCase) -> Result<Option<MaterialFinding>, DiagnosisError>;

    /// Looks again once other causes are in the fit.
    ///
    /// # Errors
    /// As [`Self::look`].
    fn look_again(&self, _inference: &mut Inference, _case: &MaterialCase) -> Result<Recheck, DiagnosisError> {
        Ok(Recheck::Needed(None))
    }
}
