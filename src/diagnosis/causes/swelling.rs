//! Residual swelling or shrinkage between the plates.

use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::scene::Scene;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("swelling");
/// What a laboratory can do about it.
const REMEDY: &str = "Weigh the sample before and after the scan, and keep it from drying or taking up liquid.";
/// Its line in the registry.
pub(super) const ENTRY: Entry =
    Entry { name: NAME, remedy: REMEDY, origin: Origin::Tested(|_| vec![Arc::new(Swelling { is_of_set_up: false })]) };
/// Its line in the registry as a part of the set-up.
pub(super) const OF_SET_UP: Entry = Entry {
    name: NAME,
    remedy: REMEDY,
    origin: Origin::SetUp { parts: |_| vec![Arc::new(Swelling { is_of_set_up: true })], special_cases: &[] },
};

/// A sample is believed to keep its volume between mould and scan to about this: 1 % in length.
const BELIEVED_LOG_RATIO: f64 = 0.03;

/// Uniform swelling by a volume ratio.
pub struct Swelling {
    /// Whether it is held by what a laboratory believes of its sample.
    is_of_set_up: bool,
}

impl Cause for Swelling {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Material
    }

    fn description(&self) -> String {
        "the sample has swollen (or shrunk) since it was measured and bonded".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        let ratio = CauseParameter::new("log_volume_ratio", 0.02, [-0.3, 0.3]);
        vec![if self.is_of_set_up { ratio.believed(BELIEVED_LOG_RATIO) } else { ratio }]
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        scene.log_growth += values[0];
    }
    fn is_of_set_up(&self) -> bool {
        self.is_of_set_up
    }
}
