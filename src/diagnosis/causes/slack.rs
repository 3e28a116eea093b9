//! The drive's zero is off.

use super::{Category, Cause, CauseParameter, Course, Location};
use crate::diagnosis::scene::Scene;
use crate::specimen::Specimen;

/// Real drive = commanded drive − slack, at every step: play in the load train, or a start that was not at rest.
pub struct Slack;

impl Cause for Slack {
    fn name(&self) -> &'static str {
        "slack"
    }

    fn category(&self) -> Category {
        Category::Load
    }

    fn description(&self) -> String {
        "the drive's zero is off: slack in the load train".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        vec![CauseParameter::new("slack_mm", 0.05, [-5.0, 5.0])]
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        scene.plates[1].translation_mm[0] -= values[0];
    }

    fn location(&self, _: &[f64], _: &Specimen) -> Option<Location> {
        None
    }

    fn needs_several_drives(&self) -> bool {
        true
    }

    fn course(&self) -> Course {
        Course::Alike
    }
}
