//! Causes as they are reported: names, words, parameters with intervals, places.

use super::cause::{Category, CauseName};
use super::cause_fit::CauseFit;
use super::experiment::Experiment;
use super::interval::interval;
use super::load_effect::FittedEffect;
use super::location::Location;
use crate::calibration::{Observed, TWO_SIDED_95};

/// A parameter of a cause found: its name with the unit, its value and its 95 % interval (infinite where the data do
/// not bound it).
pub type FoundParameter = (String, f64, [f64; 2]);

/// One cause found.
#[derive(Clone)]
pub struct FoundCause {
    /// Name.
    pub name: CauseName,
    /// Kind.
    pub category: Category,
    /// In words.
    pub description: String,
    /// Parameters: name, value, 95 % interval.
    pub parameters: Vec<FoundParameter>,
    /// Where, if somewhere.
    pub location: Option<Location>,
    /// Fall of the deviance.
    pub evidence: f64,
    /// Displacement explained, mm rms.
    pub effect_rms_mm: f64,
    /// Of an alternative: further steps that would tell it apart, most telling first.
    pub experiments: Vec<Experiment>,
    /// What a laboratory can do about it, as a cause that the registry does not know says of itself.
    pub own_remedy: String,
    /// Where its parameters come from.
    pub(super) source: Source,
}

/// Where the parameters of a found cause come from.
#[derive(Clone, Copy)]
pub(super) enum Source {
    /// From the load curve: no later fit changes them.
    LoadCurve,
    /// From the cause at this place of the fit.
    Fit(usize),
    /// From the fitted material.
    Material(fn(&CauseFit) -> Vec<FoundParameter>),
}

impl FoundCause {
    /// The cause at place `index` of a fit.
    pub(super) fn of_fit(fitted: &CauseFit, index: usize, observed: &Observed) -> FoundCause {
        let supposed = &fitted.causes[index];
        let parameters = supposed
            .cause
            .parameters()
            .iter()
            .zip(supposed.values.iter().zip(fitted.sd_of(index)))
            .map(|(p, (value, sd))| {
                // Wider than the parameter's range, as of a patch's edge beyond the face's own: the data say nothing of
                // it.
                let sd = if TWO_SIDED_95 * sd > p.range[1] - p.range[0] { f64::INFINITY } else { *sd };
                (p.name.clone(), *value, interval(*value, sd))
            })
            .collect();
        FoundCause {
            name: supposed.cause.name(),
            category: supposed.cause.category(),
            description: supposed.cause.description(),
            parameters,
            location: supposed.cause.location(&supposed.values, &observed.specimen),
            evidence: 0.0,
            effect_rms_mm: 0.0,
            experiments: Vec::new(),
            own_remedy: supposed.cause.remedy(),
            source: Source::Fit(index),
        }
    }

    /// The causes of a load curve's effects. Effects of one name are one cause with the parameters of all of them.
    pub(super) fn of_load_curve(effects: &[FittedEffect]) -> Vec<FoundCause> {
        let mut causes: Vec<FoundCause> = Vec::new();
        for fitted in effects {
            let parameters = fitted.names.iter().zip(fitted.values.iter().zip(&fitted.sd)).map(|(n, (value, sd))| {
                let is_numbered = fitted.effect.max_count() > 1;
                let name = if is_numbered { format!("{n}_{}", fitted.ordinal + 1) } else { (*n).to_string() };
                (name, *value, interval(*value, *sd))
            });
            let name = fitted.effect.name();
            match causes.iter_mut().find(|c| c.name == name) {
                Some(c) => {
                    c.parameters.extend(parameters);
                    c.evidence += fitted.gained;
                }
                None => causes.push(FoundCause {
                    name,
                    category: fitted.effect.category(),
                    description: fitted.effect.description().into(),
                    parameters: parameters.collect(),
                    location: None,
                    evidence: fitted.gained,
                    effect_rms_mm: 0.0,
                    experiments: Vec::new(),
                    own_remedy: String::new(),
                    source: Source::LoadCurve,
                }),
            }
        }
        causes
    }

    /// The same with its evidence and the displacement that it explains, mm rms.
    pub(super) fn with_evidence(mut self, evidence: f64, effect_rms_mm: f64) -> FoundCause {
        (self.evidence, self.effect_rms_mm) = (evidence, effect_rms_mm);
        self
    }

    /// Whether a later fit may change it.
    pub(super) fn is_of_fit(&self) -> bool {
        matches!(self.source, Source::Fit(_))
    }

    /// Whether the load curve told of it.
    pub(super) fn is_of_load_curve(&self) -> bool {
        matches!(self.source, Source::LoadCurve)
    }

    /// Takes parameters and place from the last fit, all causes together. What the load curve told stays.
    pub(super) fn refresh(&mut self, fitted: &CauseFit, observed: &Observed) {
        match self.source {
            Source::LoadCurve => {}
            Source::Fit(index) => {
                let fresh = FoundCause::of_fit(fitted, index, observed);
                (self.parameters, self.location) = (fresh.parameters, fresh.location);
            }
            Source::Material(parameters) => self.parameters = parameters(fitted),
        }
    }
}
