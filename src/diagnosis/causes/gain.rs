//! The displacement encoding is off by a factor.

use super::{Category, Cause, CauseParameter, Location};
use crate::diagnosis::scene::Scene;
use crate::specimen::Specimen;

/// Recorded displacement = (1 + gain) × displacement, per axis.
pub struct Gain;

impl Cause for Gain {
    fn name(&self) -> &'static str {
        "gain"
    }

    fn category(&self) -> Category {
        Category::Acquisition
    }

    fn description(&self) -> String {
        "the encoding gradient is off by a factor".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        ["x", "y", "z"].map(|a| CauseParameter::new(format!("relative_gain_error_{a}"), 0.02, [-0.5, 0.5])).to_vec()
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        for a in 0..3 {
            scene.image.gain[a] += values[a];
        }
    }

    fn location(&self, _: &[f64], _: &Specimen) -> Option<Location> {
        None
    }
}
