//! The block is not the one of the drawing.

use super::layer::bonded_axis;
use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::location::Location;
use crate::diagnosis::scene::Scene;
use crate::specimen::{Outline, Specimen};
use std::sync::Arc;

const NAME: CauseName = CauseName::new("outline");
/// What a laboratory can do about it.
const REMEDY: &str =
    "Measure the block as cast (length, width, thickness, slant of its faces) and give the specimen those sizes.";
/// Its line in the registry.
pub(super) const ENTRY: Entry =
    Entry { name: NAME, remedy: REMEDY, origin: Origin::Tested(|specimen| suspects(specimen, FaceForm::Plane)) };
/// Its line in the registry as a part of the set-up.
pub(super) const OF_SET_UP: Entry = Entry {
    name: NAME,
    remedy: REMEDY,
    origin: Origin::SetUp {
        parts: |observed| suspects(&observed.specimen, FaceForm::SecondDegree),
        special_cases: &[],
    },
};

/// A dumb-bell is punched, and keeps the outline of its punch.
fn suspects(specimen: &Specimen, form: FaceForm) -> Vec<Arc<dyn Cause>> {
    match specimen.outline {
        Outline::Block => vec![Arc::new(Block::of(specimen, form))],
        Outline::Iso37Type4 | Outline::Dumbbell(_) => Vec::new(),
    }
}

/// A free face is believed to be where the drawing has it to about this, mm.
const BELIEVED_MM: f64 = 0.3;
/// It is believed to bow by about this, mm: what is cut or cast gives way and shrinks.
const BELIEVED_BOW_MM: f64 = 0.2;

/// What a free face may be in place of the drawn one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaceForm {
    /// A plane: length or width, slanted ends, a wedge.
    Plane,
    /// A surface of second degree: also ends that bow in or out.
    SecondDegree,
}

impl FaceForm {
    /// How many terms its polynomial has.
    fn num_terms(self) -> usize {
        match self {
            FaceForm::Plane => 3,
            FaceForm::SecondDegree => 6,
        }
    }
}

/// Each free face of the block is a surface of its own.
pub struct Block {
    /// The axes across the free faces.
    axes: [usize; 2],
    /// What the faces are.
    form: FaceForm,
}

impl Block {
    /// The free faces of a specimen.
    pub fn of(specimen: &Specimen, form: FaceForm) -> Block {
        Block { axes: [[1, 2], [0, 2], [0, 1]][bonded_axis(specimen)], form }
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
        "the block is not the one of the drawing: its free faces lie elsewhere, slant or bow".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        let mut all = Vec::new();
        for axis in self.axes {
            let [a, b] = [["y", "z"], ["x", "z"], ["x", "y"]][axis];
            for side in ["low", "high"] {
                let face = format!("{side}_{}", ["x", "y", "z"][axis]);
                for plane in ["".into(), format!("_slope_{a}"), format!("_slope_{b}")] {
                    let name = format!("{face}{plane}_mm");
                    all.push(CauseParameter::new(name, 0.1, [-3.0, 3.0]).believed(BELIEVED_MM));
                }
                if self.form == FaceForm::Plane {
                    continue;
                }
                for bow in [format!("{a}{a}"), format!("{a}{b}"), format!("{b}{b}")] {
                    let name = format!("{face}_bow_{bow}_mm");
                    all.push(CauseParameter::new(name, 0.1, [-2.0, 2.0]).believed(BELIEVED_BOW_MM));
                }
            }
        }
        all
    }

    fn is_idealised(&self) -> bool {
        self.form == FaceForm::SecondDegree
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        for (n, surface) in values.chunks(self.form.num_terms()).enumerate() {
            let face = &mut scene.shape.faces_mm[self.axes[n / 2]][n % 2];
            for (offset, value) in face.iter_mut().zip(surface) {
                *offset += value;
            }
        }
    }

    fn location(&self, values: &[f64], specimen: &Specimen) -> Option<Location> {
        let size = |n: &usize| values[self.form.num_terms() * n].abs();
        let face = (0..4).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(0);
        Some(Location::of_face(specimen, self.axes[face / 2], face % 2, "free face"))
    }

    fn follows_mesh_errors(&self) -> bool {
        true
    }

    fn is_of_set_up(&self) -> bool {
        self.form == FaceForm::SecondDegree
    }
}
