//! The materials at which designs are judged: the priors' central values and variants.

use super::study::MaterialPrior;
use crate::material::{Material, Parameter};

/// A material at which designs are judged, and its weight.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialSample {
    /// Index of the prior.
    pub prior: usize,
    /// Values.
    pub material: Material,
    /// Weight; all sum to one.
    pub weight: f64,
}

/// The priors' central values and, where a prior is uncertain, two more points: all |α| larger and |μ| smaller by the
/// relative standard deviation, and the reverse (weights ½, ¼, ¼: the three-point rule that has the prior's mean, and
/// half of its variance in α at either side).
pub fn sample_materials(priors: &[MaterialPrior]) -> Vec<MaterialSample> {
    let total: f64 = priors.iter().map(|p| p.weight).sum();
    let mut samples = Vec::new();
    for (index, prior) in priors.iter().enumerate() {
        let share = prior.weight / total;
        let certain = prior.relative_sd == 0.0;
        samples.push(MaterialSample {
            prior: index,
            material: prior.material.clone(),
            weight: if certain { share } else { 0.5 * share },
        });
        if !certain {
            for sign in [1.0, -1.0] {
                let mut material = prior.material.clone();
                for term in &mut material.terms {
                    term.alpha *= 1.0 + sign * prior.relative_sd;
                    term.mu_kpa *= 1.0 - sign * prior.relative_sd;
                }
                for parameter in prior.material.parameters() {
                    if let Parameter::Law(own) = parameter {
                        let sign = if own.is_modulus() { -sign } else { sign };
                        material.set(parameter, prior.material.value(parameter) * (1.0 + sign * prior.relative_sd));
                    }
                }
                samples.push(MaterialSample { prior: index, material, weight: 0.25 * share });
            }
        }
    }
    samples
}
