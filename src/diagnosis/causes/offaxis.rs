//! The moved plate leaves its axis.

use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter, Course};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::location::Location;
use crate::diagnosis::scene::Scene;
use crate::specimen::Specimen;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("offaxis");
/// What a laboratory can do about it.
const REMEDY: &str = "Guide the moved plate so that the gap stays, or measure how it moves across the drive.";
/// Its line in the registry.
pub(super) const ENTRY: Entry =
    Entry { name: NAME, remedy: REMEDY, origin: Origin::Tested(|specimen| vec![Arc::new(OffAxis::of(specimen))]) };

/// Translation of the moved plate across the drive, in proportion to it: along y (the gap changes) and z.
pub struct OffAxis {
    largest_drive_mm: f64,
}

impl OffAxis {
    /// Translations are stated at the specimen's largest drive.
    pub fn of(specimen: &Specimen) -> OffAxis {
        OffAxis { largest_drive_mm: specimen.largest_drive_mm().abs().max(1e-9) }
    }
}

impl Cause for OffAxis {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Boundary
    }

    fn description(&self) -> String {
        "the moved plate leaves its axis (the gap changes, or it drifts sideways)".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        ["y", "z"].map(|a| CauseParameter::new(format!("{a}_mm_at_full_drive"), 0.1, [-5.0, 5.0])).to_vec()
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        for (axis, value) in [1, 2].into_iter().zip(values) {
            scene.plates[1].translation_per_mm[axis] += value / self.largest_drive_mm;
        }
    }

    fn location(&self, _: &[f64], specimen: &Specimen) -> Option<Location> {
        Some(Location::of_moved_plate(specimen))
    }

    fn course(&self) -> Course {
        Course::InProportion
    }

    fn moves_only_plates(&self) -> bool {
        true
    }
}
