//! Jumps of 2π that unwrapping left.

use super::{Category, Cause, CauseParameter, Location};
use crate::diagnosis::scene::{Jump, Scene};
use crate::specimen::Specimen;
use std::sync::Arc;

/// Connected voxels whose displacement is off by a constant.
pub struct Wrap {
    /// Which step.
    pub step: usize,
    /// Which component.
    pub component: usize,
    /// Places in the compared mask.
    pub voxels: Arc<Vec<u32>>,
    /// Jump at the start, mm.
    pub size_mm: f64,
    /// Where they lie.
    pub location: Location,
}

impl Cause for Wrap {
    fn name(&self) -> &'static str {
        "wrap"
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
}
