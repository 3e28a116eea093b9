//! The displacement encoding is off by a factor.

use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::scene::Scene;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("gain");
/// What a laboratory can do about it.
const REMEDY: &str = "Calibrate the encoding gradients with a phantom that is moved by a known distance.";
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry { name: NAME, remedy: REMEDY, origin: Origin::Tested(|_| suspects()) };

/// One for each axis: a factor that all share is found as that along the drive, beside which the components across it
/// are small; free on all axes at once it would take up what others leave across the drive.
fn suspects() -> Vec<Arc<dyn Cause>> {
    (0..3).map(|axis| Arc::new(Gain { axis }) as Arc<dyn Cause>).collect()
}

/// Gradients are calibrated to this part or better.
const BELIEVED: f64 = 0.05;

/// Recorded displacement = (1 + gain) × displacement, along one axis.
pub struct Gain {
    /// The axis that is off.
    axis: usize,
}

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
        let name = format!("relative_gain_error_{}", ["x", "y", "z"][self.axis]);
        vec![CauseParameter::new(name, 0.02, [-0.5, 0.5]).believed(BELIEVED).of_rig()]
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        scene.image.gain[self.axis] += values[0];
    }

    fn changes_sample(&self) -> bool {
        false
    }

    fn variant(&self) -> [i64; 3] {
        [0, 1, 2].map(|a| i64::from(a == self.axis))
    }

    fn max_suspects(&self) -> usize {
        3
    }
}
