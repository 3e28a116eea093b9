//! The load cell's zero.

use super::{Category, Cause, CauseParameter, Location};
use crate::diagnosis::scene::Scene;
use crate::specimen::Specimen;

/// A constant added to every force.
pub struct CellOffset;

impl Cause for CellOffset {
    fn name(&self) -> &'static str {
        "cell"
    }

    fn category(&self) -> Category {
        Category::Load
    }

    fn description(&self) -> String {
        "the load cell does not read zero at rest".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        vec![CauseParameter::new("offset_n", 0.1, [-1e3, 1e3])]
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        scene.force_offset_n += values[0];
    }

    fn location(&self, _: &[f64], _: &Specimen) -> Option<Location> {
        None
    }
}
