//! The load train gives: the plate moves less than the actuator was told.

use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter, Course};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::scene::Scene;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("compliance");
/// What a laboratory can do about it.
const REMEDY: &str = "Measure the plates' travel at the sample, not at the drive, or stiffen the load train.";
/// Its line in the registry.
pub(super) const ENTRY: Entry =
    Entry { name: NAME, remedy: REMEDY, origin: Origin::Tested(|_| vec![Arc::new(Compliance)]) };

/// Real drive = commanded drive − compliance × force.
pub struct Compliance;

impl Cause for Compliance {
    fn name(&self) -> CauseName {
        NAME
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

    fn course(&self) -> Course {
        Course::InProportion
    }

    fn moves_only_plates(&self) -> bool {
        true
    }
}
