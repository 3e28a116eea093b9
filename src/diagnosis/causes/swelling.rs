//! Residual swelling or shrinkage between the plates.

use super::{Category, Cause, CauseParameter, Location};
use crate::diagnosis::scene::Scene;
use crate::specimen::Specimen;

/// Uniform swelling by a volume ratio.
pub struct Swelling;

impl Cause for Swelling {
    fn name(&self) -> &'static str {
        "swelling"
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

    fn location(&self, _: &[f64], _: &Specimen) -> Option<Location> {
        None
    }
}
