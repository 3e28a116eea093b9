//! The block is not the one of the drawing.

use super::layer::bonded_axis;
use crate::calibration::Observed;
use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::location::Location;
use crate::diagnosis::scene::Scene;
use crate::specimen::{Outline, Specimen};
use std::sync::Arc;

const NAME: CauseName = CauseName::new("geometry");
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry { name: NAME, origin: Origin::SetUp(suspects) };

/// A dumb-bell keeps its standard outline.
fn suspects(observed: &Observed) -> Vec<Arc<dyn Cause>> {
    match observed.specimen.outline {
        Outline::Block => vec![Arc::new(Block::of(&observed.specimen))],
        Outline::Iso37Type4 => Vec::new(),
    }
}

/// A free face is believed to be where the drawing has it to about this, mm.
const BELIEVED_MM: f64 = 0.3;
/// Terms of a plane: 1 and the two axes of the face.
const PLANE_TERMS: usize = 3;

/// Each free face of the block is a plane of its own: length or width, slanted ends, a wedge.
pub struct Block {
    /// The axes across the free faces.
    axes: [usize; 2],
}

impl Block {
    /// The free faces of a specimen.
    pub fn of(specimen: &Specimen) -> Block {
        Block { axes: [[1, 2], [0, 2], [0, 1]][bonded_axis(specimen)] }
    }
}

impl Cause for Block {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Geometry
    }

    fn description(&self) -> String {
        "the block is not the one of the drawing: its free faces lie elsewhere or slant".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        let mut all = Vec::new();
        for axis in self.axes {
            let [a, b] = [["y", "z"], ["x", "z"], ["x", "y"]][axis];
            for side in ["low", "high"] {
                let face = format!("{side}_{}", ["x", "y", "z"][axis]);
                for name in [format!("{face}_mm"), format!("{face}_slope_{a}_mm"), format!("{face}_slope_{b}_mm")] {
                    all.push(CauseParameter::new(name, 0.1, [-3.0, 3.0]).believed(BELIEVED_MM));
                }
            }
        }
        all
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        for (n, plane) in values.chunks(PLANE_TERMS).enumerate() {
            let face = &mut scene.shape.faces_mm[self.axes[n / 2]][n % 2];
            for (offset, value) in face.iter_mut().zip(plane) {
                *offset += value;
            }
        }
    }

    fn location(&self, values: &[f64], specimen: &Specimen) -> Option<Location> {
        let size = |n: &usize| values[PLANE_TERMS * n].abs();
        let face = (0..4).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(0);
        Some(Location::of_face(specimen, self.axes[face / 2], face % 2, "free face"))
    }

    fn is_of_set_up(&self) -> bool {
        true
    }
}
