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
    Entry { name: NAME, remedy: REMEDY, origin: Origin::Tested(|_| vec![Arc::new(Swelling)]) };

/// Uniform swelling by a volume ratio.
pub struct Swelling;

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
        vec![CauseParameter::new("log_volume_ratio", 0.02, [-0.3, 0.3])]
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        scene.log_growth += values[0];
    }
}
