//! The image lies elsewhere than its header says.

use crate::calibration::Observed;
use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::scene::Scene;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("registration");
/// What a laboratory can do about it.
const REMEDY: &str = "Fix the rig's angle in the scanner, or read its pose from a scout scan of marks on the plates.";
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry {
    name: NAME,
    remedy: REMEDY,
    origin: Origin::Tested(|_| vec![Arc::new(Registration { is_of_set_up: false, has_shift: true })]),
};
/// Its line in the registry as a part of the set-up.
pub(super) const OF_SET_UP: Entry = Entry {
    name: NAME,
    remedy: REMEDY,
    origin: Origin::SetUp { parts: |observed| vec![Arc::new(Registration::of_set_up(observed))], special_cases: &[] },
};

/// The rig is believed to lie in the scanner to about this, mm.
const BELIEVED_MM: f64 = 0.3;
/// The rig is believed to be turned in the scanner by about this at most, degrees.
const BELIEVED_DEGREES: f64 = 2.0;

/// Shift and rotation of the image against the specimen's frame.
pub struct Registration {
    /// Whether it is held by what a laboratory believes of its rig.
    is_of_set_up: bool,
    /// Whether it shifts as well as turns.
    has_shift: bool,
}

impl Registration {
    /// As a part of the set-up. A shifted image of a solid block is that of a block whose faces are shifted, which
    /// layers and geometry are: only holes tell a shift.
    fn of_set_up(observed: &Observed) -> Registration {
        Registration { is_of_set_up: true, has_shift: !observed.specimen.holes.is_empty() }
    }
}

impl Cause for Registration {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Acquisition
    }

    fn description(&self) -> String {
        "the image is shifted or turned against the specimen's frame".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        let shifts = ["x", "y", "z"].map(|a| CauseParameter::new(format!("shift_{a}_mm"), 0.2, [-5.0, 5.0]));
        // The rig stays in the scanner as samples are changed; where a sample lies in its rig is its own.
        let turn = |a| CauseParameter::new(format!("rotation_{a}_degrees"), 0.5, [-20.0, 20.0]).of_rig();
        let turns = ["x", "y", "z"].map(turn);
        let mut all: Vec<CauseParameter> = Vec::new();
        if self.has_shift {
            all.extend(shifts.map(|p| if self.is_of_set_up { p.believed(BELIEVED_MM) } else { p }));
        }
        all.extend(turns.map(|p| if self.is_of_set_up { p.believed(BELIEVED_DEGREES) } else { p }));
        all
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        let (shifts, turns) = values.split_at(if self.has_shift { 3 } else { 0 });
        for (at, shift) in scene.image.pose.shift_mm.iter_mut().zip(shifts) {
            *at += shift;
        }
        for (at, turn) in scene.image.pose.rotation_rad.iter_mut().zip(turns) {
            *at += turn.to_radians();
        }
    }

    fn changes_sample(&self) -> bool {
        false
    }

    fn is_of_set_up(&self) -> bool {
        self.is_of_set_up
    }
}
