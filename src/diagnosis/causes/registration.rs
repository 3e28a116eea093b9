//! The image lies elsewhere than its header says.

use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::scene::Scene;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("registration");
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry { name: NAME, origin: Origin::Tested(|_| vec![Arc::new(Registration)]) };

/// Shift and rotation of the image against the specimen's frame.
pub struct Registration;

impl Cause for Registration {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Acquisition
    }

    fn description(&self) -> String {
        "the image is shifted or turned against the specimen's frame".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        let shifts = ["x", "y", "z"].map(|a| CauseParameter::new(format!("shift_{a}_mm"), 0.2, [-5.0, 5.0]));
        let turns = ["x", "y", "z"].map(|a| CauseParameter::new(format!("rotation_{a}_degrees"), 0.5, [-20.0, 20.0]));
        shifts.into_iter().chain(turns).collect()
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        for a in 0..3 {
            scene.image.shift_mm[a] += values[a];
            scene.image.rotation_rad[a] += values[3 + a].to_radians();
        }
    }

    fn changes_sample(&self) -> bool {
        false
    }
}
