//! The material relaxes under load.

use crate::diagnosis::cause::{Category, CauseName};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::load_effect::{EffectParameter, ForceChange, LoadEffect, LoadReadings};

const NAME: CauseName = CauseName::new("relaxation");
/// What a laboratory can do about it.
const REMEDY: &str = "Wait at every drive until the force is steady, or state when the scans were made.";
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry { name: NAME, remedy: REMEDY, origin: Origin::LoadCurve(&Relaxation) };

/// Times from which a fit starts, s.
const START_TIMES_S: [f64; 4] = [2.0, 8.0, 30.0, 100.0];

/// One term of a Prony series: strength g and time τ (s). Up to three of them make the cause.
#[derive(Debug)]
pub struct Relaxation;

impl LoadEffect for Relaxation {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Material
    }

    fn description(&self) -> &'static str {
        "the material relaxes under load"
    }

    fn parameters(&self, duration_s: f64) -> Vec<EffectParameter> {
        // A relaxation longer than half the record is not told from elasticity.
        let times = [0.2f64.ln(), (0.5 * duration_s.max(2.0)).ln()];
        vec![
            EffectParameter { name: "g", limits: Some([0.0, 10.0]), largest_step: 0.5, is_logarithm: false },
            EffectParameter { name: "tau_s", limits: Some(times), largest_step: 0.7, is_logarithm: true },
        ]
    }

    fn starts(&self) -> Vec<Vec<f64>> {
        START_TIMES_S.iter().map(|t| vec![0.05, t.ln()]).collect()
    }

    fn max_count(&self) -> usize {
        3
    }

    fn act(&self, values: &[f64], _: &LoadReadings, change: &mut ForceChange) {
        change.relaxations.push((values[0], values[1].exp()));
    }
}
