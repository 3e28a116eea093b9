//! A background phase that has nothing to do with the drive.

use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter, Course};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::scene::Scene;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("background");
/// What a laboratory can do about it.
const REMEDY: &str = "Unwrap and reference the phase anew; scan a resting sample and subtract what is left.";
/// Its line in the registry.
pub(super) const ENTRY: Entry =
    Entry { name: NAME, remedy: REMEDY, origin: Origin::Tested(|_| vec![Arc::new(Background)]) };

/// A polynomial of second degree in the position, added to each component at every drive.
pub struct Background;

const TERMS: [&str; 10] = ["1", "x", "y", "z", "xx", "yy", "zz", "xy", "yz", "zx"];

impl Cause for Background {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Acquisition
    }

    fn description(&self) -> String {
        "a smooth background phase is left in the displacement".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        ["u_x", "u_y", "u_z"]
            .iter()
            .flat_map(|u| TERMS.map(|t| CauseParameter::new(format!("{u}_{t}_mm"), 0.05, [-5.0, 5.0])))
            .collect()
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        for (n, value) in values.iter().enumerate() {
            scene.image.background_mm[n / TERMS.len()][n % TERMS.len()] += value;
        }
    }

    fn changes_sample(&self) -> bool {
        false
    }

    fn course(&self) -> Course {
        Course::Alike
    }

    fn is_sponge(&self) -> bool {
        true
    }
}
