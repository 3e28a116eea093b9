//! Jumps of 2π that unwrapping left.

use crate::calibration::Observed;
use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::jumps::{VoxelJump, voxel_jumps};
use crate::diagnosis::location::Location;
use crate::diagnosis::scene::{Jump, Scene};
use crate::diagnosis::supposed::Supposed;
use crate::diagnosis::trace::Trace;
use crate::specimen::Specimen;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("wrap");
/// What a laboratory can do about it.
const REMEDY: &str = "Encode fewer millimetres of displacement per turn, or scan at smaller steps of drive.";
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry {
    name: NAME,
    remedy: REMEDY,
    origin: Origin::Artefact { find: all_in, in_words: "groups of voxels are a whole turn of phase off" },
};

/// Every group of voxels of a residual that is off by a constant.
fn all_in(observed: &Observed, residual: &Trace) -> Vec<Supposed> {
    let supposed = |jump: VoxelJump| {
        let VoxelJump { step, component, voxels, size_mm, location } = jump;
        let cause = Wrap { step, component, voxels: Arc::new(voxels), location };
        Supposed { cause: Arc::new(cause), values: vec![size_mm] }
    };
    voxel_jumps(observed, residual).into_iter().map(supposed).collect()
}

/// Connected voxels whose displacement is off by a constant.
pub struct Wrap {
    /// Which step.
    pub step: usize,
    /// Which component.
    pub component: usize,
    /// Places in the compared mask.
    pub voxels: Arc<Vec<u32>>,
    /// Where they lie.
    pub location: Location,
}

impl Cause for Wrap {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Acquisition
    }

    fn description(&self) -> String {
        let component = ["x", "y", "z"][self.component];
        format!("{} voxels of u_{component} at step {} are a whole turn of phase off", self.voxels.len(), self.step + 1)
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        vec![CauseParameter::new("jump_mm", 0.1, [-20.0, 20.0])]
    }

    fn variant(&self) -> [i64; 3] {
        [self.step as i64, self.component as i64, self.voxels.len() as i64]
    }

    fn is_artefact(&self) -> bool {
        true
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        scene.image.jumps.push(Jump {
            step: self.step,
            component: self.component,
            voxels: self.voxels.clone(),
            size_mm: values[0],
        });
    }

    fn location(&self, _: &[f64], _: &Specimen) -> Option<Location> {
        Some(self.location.clone())
    }

    fn changes_sample(&self) -> bool {
        false
    }
}
