//! The moved plate sits out of place.

use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter, Course};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::location::Location;
use crate::diagnosis::scene::Scene;
use crate::specimen::Specimen;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("mount");
/// What a laboratory can do about it.
const REMEDY: &str = "Scan once more after the sample was clamped, and use that scan as the reference.";
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry { name: NAME, remedy: REMEDY, origin: Origin::Tested(|_| vec![Arc::new(Mount)]) };

/// Translation of the moved plate across the drive (along y the gap) and rotation about its centre, alike at every
/// step: it settled between the reference scan and the first step.
pub struct Mount;

impl Cause for Mount {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Boundary
    }

    fn description(&self) -> String {
        "the moved plate sits out of place, alike at every step (gap, sideways, turned)".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        let shifts = ["y", "z"].map(|a| CauseParameter::new(format!("{a}_mm"), 0.1, [-5.0, 5.0]));
        let turns = ["x", "y", "z"].map(|a| CauseParameter::new(format!("degrees_about_{a}"), 0.5, [-20.0, 20.0]));
        shifts.into_iter().chain(turns).collect()
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        let plate = &mut scene.plates[1];
        plate.translation_mm[1] += values[0];
        plate.translation_mm[2] += values[1];
        for a in 0..3 {
            plate.rotation_rad[a] += values[2 + a].to_radians();
        }
    }

    fn location(&self, _: &[f64], specimen: &Specimen) -> Option<Location> {
        Some(Location::of_moved_plate(specimen))
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
