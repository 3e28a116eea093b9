//! The plates do not move as they were told.

use super::{compliance, mount, offaxis, slack, tilt};
use crate::calibration::Observed;
use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::location::Location;
use crate::diagnosis::scene::Scene;
use crate::specimen::Specimen;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("travel");
/// What a laboratory can do about it.
const REMEDY: &str =
    "Measure the plates' motion at every drive, by marks on them in the image or by a gauge at the sample.";
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry {
    name: NAME,
    remedy: REMEDY,
    origin: Origin::SetUp {
        parts: |observed| vec![Arc::new(Travel::of(observed))],
        special_cases: &[
            tilt::ENTRY.name,
            offaxis::ENTRY.name,
            mount::ENTRY.name,
            compliance::ENTRY.name,
            slack::ENTRY.name,
        ],
    },
};

/// A plate is believed to be where it was told to be to about this, mm.
const BELIEVED_MM: f64 = 0.3;
/// A plate is believed to be turned by about this at most, degrees.
const BELIEVED_DEGREES: f64 = 2.0;
/// Drives nearer to rest than this have no motion in proportion to them, mm.
const AT_REST_MM: f64 = 1e-6;

/// Rigid motions of both plates with values of their own at every step: neither alike at all drives nor in proportion
/// to them. Parameters of a step: translation (mm) and rotation about the centre of its face (degrees) of the fixed
/// plate, then of the moved one.
pub struct Travel {
    drives_mm: Vec<f64>,
    /// Whether the plates may turn too.
    turns: bool,
}

impl Travel {
    /// The travel at the drives of a recording.
    pub fn of(observed: &Observed) -> Travel {
        Travel { drives_mm: observed.steps.iter().map(|s| s.drive_mm).collect(), turns: true }
    }

    /// The same without rotations: how far the plates went, and where zero is.
    pub fn shifts_of(observed: &Observed) -> Travel {
        Travel { turns: false, ..Travel::of(observed) }
    }
}

impl Cause for Travel {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Boundary
    }

    fn description(&self) -> String {
        "the plates do not move as they were told (each drive its own shifts and turns)".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        let mut all = Vec::new();
        for step in 0..self.drives_mm.len() {
            for plate in ["fixed", "moved"] {
                for axis in ["x", "y", "z"] {
                    let name = format!("step_{}_{plate}_{axis}_mm", step + 1);
                    all.push(CauseParameter::new(name, 0.1, [-5.0, 5.0]).believed(BELIEVED_MM).of_step(step));
                }
                for axis in ["x", "y", "z"].iter().filter(|_| self.turns) {
                    let name = format!("step_{}_{plate}_degrees_about_{axis}", step + 1);
                    all.push(CauseParameter::new(name, 0.5, [-20.0, 20.0]).believed(BELIEVED_DEGREES).of_step(step));
                }
            }
        }
        all
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        let of_plate = if self.turns { 6 } else { 3 };
        for ((step, drive_mm), own) in self.drives_mm.iter().enumerate().zip(values.chunks(2 * of_plate)) {
            for (motion, values) in scene.plates_at_mut(step).iter_mut().zip(own.chunks(of_plate)) {
                for a in 0..3 {
                    let (shift, turn) = (values[a], values.get(3 + a).map_or(0.0, |degrees| degrees.to_radians()));
                    // In proportion to the drive, so that a solve from rest comes there by and by.
                    if drive_mm.abs() > AT_REST_MM {
                        motion.translation_per_mm[a] += shift / drive_mm;
                        motion.rotation_rad_per_mm[a] += turn / drive_mm;
                    } else {
                        motion.translation_mm[a] += shift;
                        motion.rotation_rad[a] += turn;
                    }
                }
            }
        }
    }

    fn location(&self, _: &[f64], specimen: &Specimen) -> Option<Location> {
        Some(Location::of_moved_plate(specimen))
    }

    fn moves_only_plates(&self) -> bool {
        true
    }

    fn is_of_set_up(&self) -> bool {
        true
    }
}
