//! The material needs a further Ogden term.

use crate::diagnosis::cause::{Category, CauseName};
use crate::diagnosis::cause_fit::CauseFit;
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::error::DiagnosisError;
use crate::diagnosis::found::{FoundCause, FoundParameter, Source};
use crate::diagnosis::further_term::further_term;
use crate::diagnosis::inference::Inference;
use crate::diagnosis::interval::interval;
use crate::diagnosis::material_cause::{MaterialCase, MaterialCause, MaterialFinding};

const NAME: CauseName = CauseName::new("terms");
/// What a laboratory can do about it.
const REMEDY: &str = "Nothing is wrong with the experiment: use the material with the further term.";
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry { name: NAME, remedy: REMEDY, origin: Origin::Material(&Terms) };

/// Parameters of an Ogden term: μ and α.
const PER_TERM: usize = 2;

/// More Ogden terms than believed. Where no material is believed, the nominal model has as many as the data call for.
pub struct Terms;

/// μ and α of the last term.
fn last_term(fitted: &CauseFit) -> Vec<FoundParameter> {
    let parameters = fitted.material.parameters();
    let first = parameters.len().saturating_sub(PER_TERM);
    parameters[first..]
        .iter()
        .zip(&fitted.sd[first..])
        .map(|(p, sd)| {
            let value = fitted.material.value(*p);
            (p.name(), value, interval(value, *sd))
        })
        .collect()
}

impl MaterialCause for Terms {
    fn name(&self) -> CauseName {
        NAME
    }

    fn look(&self, inference: &mut Inference, case: &MaterialCase) -> Result<Option<MaterialFinding>, DiagnosisError> {
        if !case.is_believed {
            return Ok(None);
        }
        let Some((richer, evidence)) = further_term(inference, case.measured, case.current)? else { return Ok(None) };
        let found = FoundCause {
            name: NAME,
            category: Category::Material,
            description: "the material needs a further Ogden term".into(),
            parameters: last_term(&richer),
            location: None,
            evidence,
            effect_rms_mm: richer.prediction.trace.plus(-1.0, &case.current.prediction.trace).rms_mm(),
            experiments: Vec::new(),
            own_remedy: String::new(),
            source: Source::Material(last_term),
        };
        Ok(Some(MaterialFinding { found, nominal: None, current: richer }))
    }
}
