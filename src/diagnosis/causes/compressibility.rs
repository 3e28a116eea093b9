//! The material is compressible, far from a rubber.

use crate::diagnosis::cause::{Category, CauseName};
use crate::diagnosis::cause_fit::CauseFit;
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::error::DiagnosisError;
use crate::diagnosis::evidence::{EVIDENCE, SMALLEST_SHARE, penalty};
use crate::diagnosis::fit::fit;
use crate::diagnosis::found::{FoundCause, FoundParameter, Source};
use crate::diagnosis::inference::{Inference, KNOWN_LOG_SD};
use crate::diagnosis::interval::log_interval;
use crate::diagnosis::material_cause::{MaterialCase, MaterialCause, MaterialFinding, Recheck};
use crate::diagnosis::prior::{BulkPrior, FitSettings, shear_modulus};

const NAME: CauseName = CauseName::new("compressibility");
/// What a laboratory can do about it.
const REMEDY: &str = "Determine the bulk modulus on its own, or let it be fitted.";
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry { name: NAME, remedy: REMEDY, origin: Origin::Material(&Compressibility) };

/// κ is looked at where the data pull it below the believed one by this many standard deviations of ln κ.
const PULL_OF_BULK: f64 = 1.5;
/// Standard deviation of ln κ where κ is as good as free.
const FREE_LOG_SD: f64 = 3.0;

/// κ far below the believed one.
pub struct Compressibility;

/// κ over the shear modulus, with its interval.
fn bulk_ratio(fitted: &CauseFit) -> Vec<FoundParameter> {
    let bulk_kpa = fitted.material.bulk_kpa;
    let ratio = bulk_kpa / shear_modulus(&fitted.material);
    // κ, the first parameter, is fitted by its logarithm.
    vec![("bulk_over_shear_modulus".into(), ratio, log_interval(ratio, bulk_kpa, fitted.sd[0]))]
}

impl Compressibility {
    /// The fit without causes where κ is known as well as `bulk` says.
    fn fit_with(inference: &mut Inference, case: &MaterialCase, bulk: BulkPrior) -> Result<CauseFit, DiagnosisError> {
        let settings = FitSettings { bulk, ..inference.settings };
        let mut start = case.nominal.material.clone();
        if bulk.log_sd < inference.settings.bulk.log_sd {
            start.bulk_kpa = bulk.center_kpa;
        }
        let Inference { laboratory, metric, is_cancelled, .. } = inference;
        fit(laboratory, metric, case.measured, &start, &[], &settings, *is_cancelled)
    }
}

impl MaterialCause for Compressibility {
    fn name(&self) -> CauseName {
        NAME
    }

    /// Where the data pull κ far below that of a rubber, a fit with κ as believed is compared with one with κ free.
    fn look(&self, inference: &mut Inference, case: &MaterialCase) -> Result<Option<MaterialFinding>, DiagnosisError> {
        let believed = inference.settings.bulk;
        if (believed.center_kpa / case.nominal.material.bulk_kpa).ln() < PULL_OF_BULK * believed.log_sd {
            return Ok(None);
        }
        let stiff = match Self::fit_with(inference, case, BulkPrior { log_sd: KNOWN_LOG_SD, ..believed }) {
            Ok(stiff) => stiff,
            Err(error) if (inference.is_cancelled)() => return Err(error),
            Err(_) => return Ok(None),
        };
        let free = Self::fit_with(inference, case, BulkPrior { log_sd: FREE_LOG_SD, ..believed })?;
        let evidence = stiff.deviance - free.deviance - penalty(&inference.metric, 1);
        let is_needed = evidence > EVIDENCE;
        if !is_needed {
            return Ok(None);
        }
        inference.nominal_bulk.log_sd = KNOWN_LOG_SD;
        inference.settings.bulk = BulkPrior { center_kpa: free.material.bulk_kpa, log_sd: FREE_LOG_SD };
        let found = FoundCause {
            name: NAME,
            category: Category::Material,
            description: "the material is compressible, far from a rubber".into(),
            parameters: bulk_ratio(&free),
            location: None,
            evidence,
            effect_rms_mm: free.prediction.trace.plus(-1.0, &stiff.prediction.trace).rms_mm(),
            experiments: Vec::new(),
            own_remedy: String::new(),
            source: Source::Material(bulk_ratio),
        };
        Ok(Some(MaterialFinding { found, nominal: Some(stiff), current: free }))
    }

    /// What pulled κ before the other causes were known may be one of them: the fit is repeated with κ as believed.
    fn look_again(&self, inference: &mut Inference, case: &MaterialCase) -> Result<Recheck, DiagnosisError> {
        (inference.progress)("testing whether the material is compressible beside the other causes");
        let free_bulk = inference.settings.bulk;
        inference.settings.bulk = inference.believed_bulk;
        let mut start = case.current.material.clone();
        start.bulk_kpa = inference.believed_bulk.center_kpa;
        let believed = inference.fit(case.measured, &start, &case.current.causes)?;
        let gain = believed.deviance - case.current.deviance - penalty(&inference.metric, 1);
        if gain < EVIDENCE.max(SMALLEST_SHARE * (case.nominal.deviance - believed.deviance)) {
            return Ok(Recheck::NotNeeded(Box::new(believed)));
        }
        inference.settings.bulk = free_bulk;
        Ok(Recheck::Needed(Some(gain)))
    }
}
