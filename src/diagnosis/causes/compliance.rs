//! The load train gives: the plate moves less than the actuator was told.

use super::{Category, Cause, CauseParameter, Course, Location};
use crate::diagnosis::scene::Scene;
use crate::specimen::Specimen;

/// Real drive = commanded drive − compliance × force.
pub struct Compliance;

impl Cause for Compliance {
    fn name(&self) -> &'static str {
        "compliance"
    }

    fn category(&self) -> Category {
        Category::Load
    }

    fn description(&self) -> String {
        "the load train gives: the real drive is not the commanded one".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        vec![CauseParameter::new("mm_per_n", 0.01, [-0.5, 2.0])]
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        scene.compliance_mm_per_n -= values[0];
    }

    fn location(&self, _: &[f64], _: &Specimen) -> Option<Location> {
        None
    }

    fn course(&self) -> Course {
        Course::InProportion
    }
}
