//! The drive's zero is off.

use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter, Course};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::scene::Scene;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("slack");
/// What a laboratory can do about it.
const REMEDY: &str = "Take up the play before the first drive, and set zero where the force begins to rise.";
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry { name: NAME, remedy: REMEDY, origin: Origin::Tested(|_| vec![Arc::new(Slack)]) };

/// Real drive = commanded drive − slack, at every step: play in the load train, or a start that was not at rest.
pub struct Slack;

impl Cause for Slack {
    fn name(&self) -> CauseName {
        NAME
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

    fn needs_several_drives(&self) -> bool {
        true
    }

    fn course(&self) -> Course {
        Course::Alike
    }

    fn moves_only_plates(&self) -> bool {
        true
    }
}
