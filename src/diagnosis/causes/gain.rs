//! The displacement encoding is off by a factor.

use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::scene::Scene;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("gain");
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry { name: NAME, origin: Origin::Tested(|_| vec![Arc::new(Gain)]) };

/// Gradients are calibrated to this part or better.
const BELIEVED: f64 = 0.05;

/// Recorded displacement = (1 + gain) × displacement, per axis.
pub struct Gain;

impl Cause for Gain {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Acquisition
    }

    fn description(&self) -> String {
        "the encoding gradient is off by a factor".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        ["x", "y", "z"]
            .map(|a| CauseParameter::new(format!("relative_gain_error_{a}"), 0.02, [-0.5, 0.5]).believed(BELIEVED))
            .to_vec()
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        for a in 0..3 {
            scene.image.gain[a] += values[a];
        }
    }

    fn changes_sample(&self) -> bool {
        false
    }
}
