//! The moved plate turns as it moves.

use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter, Course};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::location::Location;
use crate::diagnosis::scene::Scene;
use crate::specimen::Specimen;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("tilt");
/// What a laboratory can do about it.
const REMEDY: &str = "Guide the moved plate stiffly, or measure its rotation by marks on it.";
/// Its line in the registry.
pub(super) const ENTRY: Entry =
    Entry { name: NAME, remedy: REMEDY, origin: Origin::Tested(|specimen| vec![Arc::new(Tilt::of(specimen))]) };

/// Rotation of the moved plate about its centre, in proportion to the drive.
pub struct Tilt {
    largest_drive_mm: f64,
}

impl Tilt {
    /// Angles are stated at the specimen's largest drive.
    pub fn of(specimen: &Specimen) -> Tilt {
        Tilt { largest_drive_mm: specimen.largest_drive_mm().abs().max(1e-9) }
    }
}

impl Cause for Tilt {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Boundary
    }

    fn description(&self) -> String {
        "the moved plate turns as it moves".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        ["x", "y", "z"]
            .map(|a| CauseParameter::new(format!("degrees_at_full_drive_about_{a}"), 0.5, [-20.0, 20.0]))
            .to_vec()
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        for a in 0..3 {
            scene.plates[1].rotation_rad_per_mm[a] += values[a].to_radians() / self.largest_drive_mm;
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
