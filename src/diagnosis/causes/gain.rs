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

/// One axis alone, or all three.
fn suspects() -> Vec<Arc<dyn Cause>> {
    let axes: [&'static [usize]; 4] = [&[0, 1, 2], &[0], &[1], &[2]];
    axes.into_iter().map(|axes| Arc::new(Gain { axes }) as Arc<dyn Cause>).collect()
}

/// Gradients are calibrated to this part or better.
const BELIEVED: f64 = 0.05;

/// Recorded displacement = (1 + gain) × displacement, per axis.
pub struct Gain {
    /// The axes that are off.
    axes: &'static [usize],
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
        let of_axis = |a: &usize| {
            let name = format!("relative_gain_error_{}", ["x", "y", "z"][*a]);
            CauseParameter::new(name, 0.02, [-0.5, 0.5]).believed(BELIEVED).of_rig()
        };
        self.axes.iter().map(of_axis).collect()
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        for (&a, value) in self.axes.iter().zip(values) {
            scene.image.gain[a] += value;
        }
    }

    fn changes_sample(&self) -> bool {
        false
    }

    fn variant(&self) -> [i64; 3] {
        [0, 1, 2].map(|a| i64::from(self.axes.contains(&a)))
    }

    /// All axes and the best single one.
    fn max_suspects(&self) -> usize {
        2
    }

    fn is_several_in_one(&self) -> bool {
        self.axes.len() > 1
    }
}
