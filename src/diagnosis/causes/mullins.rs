//! The material softens with its largest load.

use crate::diagnosis::cause::{Category, CauseName};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::load_effect::{EffectParameter, ForceChange, LoadEffect, LoadReadings};
use crate::homogeneous::erf;

const NAME: CauseName = CauseName::new("mullins");
/// What a laboratory can do about it.
const REMEDY: &str = "Stretch the sample several times beyond the largest drive before the test.";
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry { name: NAME, remedy: REMEDY, origin: Origin::LoadCurve(&Mullins) };

/// Ogden and Roxburgh's softening, η = 1 − ρ erf((W_max − W)/m), with the work W of the whole sample: ρ, and m as a
/// part of the largest work.
#[derive(Debug)]
pub struct Mullins;

impl LoadEffect for Mullins {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Material
    }

    fn description(&self) -> &'static str {
        "the material softens with its largest load"
    }

    fn parameters(&self, _duration_s: f64) -> Vec<EffectParameter> {
        let widths = [0.01f64.ln(), 3f64.ln()];
        vec![
            EffectParameter { name: "rho", limits: Some([0.0, 0.95]), largest_step: 0.3, is_logarithm: false },
            EffectParameter {
                name: "m_over_largest_work",
                limits: Some(widths),
                largest_step: 0.7,
                is_logarithm: true,
            },
        ]
    }

    fn starts(&self) -> Vec<Vec<f64>> {
        vec![vec![0.1, 0.1f64.ln()], vec![0.1, 0.5f64.ln()]]
    }

    fn act(&self, values: &[f64], readings: &LoadReadings, change: &mut ForceChange) {
        let (rho, width) = (values[0], values[1].exp() * readings.largest_work);
        let mut largest = 0.0f64;
        for (factor, work) in change.factor.iter_mut().zip(&readings.work) {
            largest = largest.max(*work);
            *factor *= 1.0 - rho * erf((largest - work) / width);
        }
    }
}
