//! Causes as they are reported: names, words, parameters with intervals, places.

use super::causes::{Category, Location};
use super::experiment::Experiment;
use super::fit::{Fitted, shear_modulus};
use super::load_history::{FittedEffect, LoadEffect};
use crate::calibration::Observed;

/// One cause found.
#[derive(Clone)]
pub struct FoundCause {
    /// Name.
    pub name: &'static str,
    /// Kind.
    pub category: Category,
    /// In words.
    pub description: String,
    /// Parameters: name, value, 95 % interval.
    pub parameters: Vec<(String, f64, [f64; 2])>,
    /// Where, if somewhere.
    pub location: Option<Location>,
    /// Fall of the deviance.
    pub evidence: f64,
    /// Displacement explained, mm rms.
    pub effect_rms_mm: f64,
    /// Of an alternative: further steps that would tell it apart, most telling first.
    pub experiments: Vec<Experiment>,
}

impl FoundCause {
    /// Takes parameters and place from the last fit, all causes together. What the load curve told stays.
    pub(super) fn refresh(&mut self, fitted: &Fitted, observed: &Observed) {
        if let Some(index) = fitted.causes.iter().position(|c| c.cause.description() == self.description) {
            let fresh = found_cause(fitted, index, observed, 0.0, 0.0);
            (self.parameters, self.location) = (fresh.parameters, fresh.location);
        } else if self.name == "compressibility" {
            self.parameters = vec![bulk_ratio(fitted)];
        } else if self.name == "terms" {
            for (name, value, interval) in &mut self.parameters {
                let known = fitted.material.parameters().into_iter().zip(&fitted.sd).find(|(p, _)| p.name() == *name);
                if let Some((p, sd)) = known {
                    *value = fitted.material.value(p);
                    *interval = [*value - 1.96 * sd, *value + 1.96 * sd];
                }
            }
        }
    }
}

/// κ over the shear modulus, with its interval.
fn bulk_ratio(fitted: &Fitted) -> (String, f64, [f64; 2]) {
    let ratio = fitted.material.bulk_kpa / shear_modulus(&fitted.material);
    // κ is fitted by its logarithm.
    let spread = (1.96 * fitted.sd[0] / fitted.material.bulk_kpa).exp();
    ("bulk_over_shear_modulus".into(), ratio, [ratio / spread, ratio * spread])
}

pub(super) fn found_cause(
    fitted: &Fitted,
    index: usize,
    observed: &Observed,
    evidence: f64,
    effect_rms_mm: f64,
) -> FoundCause {
    let supposed = &fitted.causes[index];
    let parameters = supposed
        .cause
        .parameters()
        .iter()
        .zip(supposed.values.iter().zip(fitted.sd_of(index)))
        .map(|(p, (value, sd))| {
            // Wider than what the parameter can be, as of a patch's edge beyond the face's own: the data say nothing of it.
            let sd = if 1.96 * sd > p.range[1] - p.range[0] { f64::INFINITY } else { *sd };
            (p.name.clone(), *value, [value - 1.96 * sd, value + 1.96 * sd])
        })
        .collect();
    FoundCause {
        name: supposed.cause.name(),
        category: supposed.cause.category(),
        description: supposed.cause.description(),
        parameters,
        location: supposed.cause.location(&supposed.values, &observed.specimen),
        evidence,
        effect_rms_mm,
        experiments: Vec::new(),
    }
}

/// The cause that κ was far below the believed one.
pub(super) fn compressible(free: &Fitted, stiff: &Fitted, evidence: f64) -> FoundCause {
    FoundCause {
        name: "compressibility",
        category: Category::Material,
        description: "the material is compressible, far from a rubber".into(),
        parameters: vec![bulk_ratio(free)],
        location: None,
        evidence,
        effect_rms_mm: free.prediction.trace.plus(-1.0, &stiff.prediction.trace).rms_mm(),
        experiments: Vec::new(),
    }
}

/// The cause that the material has more Ogden terms than believed.
pub(super) fn terms(richer: &Fitted, before: &Fitted, evidence: f64) -> FoundCause {
    let parameters = richer
        .material
        .parameters()
        .into_iter()
        .zip(&richer.sd)
        .filter(|(p, _)| !before.material.parameters().contains(p))
        .map(|(p, sd)| {
            let value = richer.material.value(p);
            (p.name(), value, [value - 1.96 * sd, value + 1.96 * sd])
        })
        .collect();
    FoundCause {
        name: "terms",
        category: Category::Material,
        description: "the material needs a further Ogden term".into(),
        parameters,
        location: None,
        evidence,
        effect_rms_mm: richer.prediction.trace.plus(-1.0, &before.prediction.trace).rms_mm(),
        experiments: Vec::new(),
    }
}

/// Causes of a load curve's effects; relaxations are one.
pub(super) fn load_causes(effects: &[FittedEffect]) -> Vec<FoundCause> {
    let mut causes: Vec<FoundCause> = Vec::new();
    for e in effects {
        let (name, category, description, names): (_, _, &str, &[&str]) = match e.effect {
            LoadEffect::Relaxation => {
                ("relaxation", Category::Material, "the material relaxes under load", &["g", "tau_s"])
            }
            LoadEffect::Mullins => (
                "mullins",
                Category::Material,
                "the material softens with its largest load",
                &["rho", "m_over_largest_work"],
            ),
            LoadEffect::Offset => ("cell", Category::Load, "the load cell does not read zero at rest", &["offset_n"]),
            LoadEffect::Friction => {
                ("cell", Category::Load, "friction adds to the force in the direction of motion", &["friction_n"])
            }
        };
        let count = effects.iter().take_while(|o| !std::ptr::eq(*o, e)).filter(|o| o.effect == e.effect).count();
        let parameters = names.iter().zip(e.values.iter().zip(&e.sd)).map(|(n, (value, sd))| {
            let name = if e.effect == LoadEffect::Relaxation { format!("{n}_{}", count + 1) } else { (*n).to_string() };
            (name, *value, [value - 1.96 * sd, value + 1.96 * sd])
        });
        match causes.iter_mut().find(|c| c.name == name) {
            Some(c) => {
                c.parameters.extend(parameters);
                c.evidence += e.gained;
            }
            None => causes.push(FoundCause {
                name,
                category,
                description: description.into(),
                parameters: parameters.collect(),
                location: None,
                evidence: e.gained,
                effect_rms_mm: 0.0,
                experiments: Vec::new(),
            }),
        }
    }
    causes
}
