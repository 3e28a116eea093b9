//! Layers at the bonded faces that do not deform.

use crate::calibration::Observed;
use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::location::Location;
use crate::diagnosis::scene::Scene;
use crate::mesh::{FACE_TERMS, face_term_degree, face_term_name};
use crate::specimen::{Outline, Specimen, TestKind};
use std::sync::Arc;

const NAME: CauseName = CauseName::new("layer");
/// What a laboratory can do about it.
const REMEDY: &str = "Map where the sheared zone begins at the bonded faces, by a scan with finer voxels across them or by a \
    cut sample, and keep glue and skin thin and even.";
/// Its line in the registry.
pub(super) const ENTRY: Entry =
    Entry { name: NAME, remedy: REMEDY, origin: Origin::SetUp { parts: suspects, special_cases: &[] } };

/// A dumb-bell's grips hold it along its tabs: it has no faces of which a layer could be told.
fn suspects(observed: &Observed) -> Vec<Arc<dyn Cause>> {
    match observed.specimen.outline {
        Outline::Block => vec![Arc::new(Layer::of(&observed.specimen))],
        Outline::Iso37Type4 | Outline::Dumbbell(_) => Vec::new(),
    }
}

/// A layer is believed to be thinner than a millimetre.
const BELIEVED_DEPTH_MM: f64 = 0.5;
/// Its depth is believed to vary by about this over half the face.
const BELIEVED_SLOPE_MM: f64 = 0.3;

/// Terms of third and fourth degree are believed to be smaller: what is spread by hand is smooth.
const BELIEVED_RIPPLE_MM: f64 = 0.15;

/// At each bonded face a layer that moves with the plate: glue, a skin, or a foot of the sample that hardly shears. The
/// depth of each is a polynomial of fourth degree over the face (in Legendre's, so that the first term is the mean),
/// alike at all drives.
pub struct Layer {
    /// The axis across the bonded faces.
    axis: usize,
}

impl Layer {
    /// The layers of a specimen.
    pub fn of(specimen: &Specimen) -> Layer {
        Layer { axis: bonded_axis(specimen) }
    }
}

/// The axis across the bonded faces.
pub(super) fn bonded_axis(specimen: &Specimen) -> usize {
    match specimen.test {
        TestKind::DoubleLapShear => 1,
        TestKind::Uniaxial => 0,
    }
}

impl Cause for Layer {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Boundary
    }

    fn description(&self) -> String {
        "layers at the bonded faces move with the plates and do not deform".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        let axes = [["y", "z"], ["x", "z"], ["x", "y"]][self.axis];
        let mut all = Vec::new();
        for plate in ["fixed", "moved"] {
            for term in 0..FACE_TERMS {
                let sd = match face_term_degree(term) {
                    0 => BELIEVED_DEPTH_MM,
                    1 | 2 => BELIEVED_SLOPE_MM,
                    _ => BELIEVED_RIPPLE_MM,
                };
                let separator = if term == 0 { "" } else { "_" };
                let name = format!("{plate}_depth{separator}{}_mm", face_term_name(term, axes));
                all.push(CauseParameter::new(name, 0.1, [-2.0, 3.0]).believed(sd));
            }
        }
        all
    }

    fn is_idealised(&self) -> bool {
        true
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        for (side, depth) in values.chunks(FACE_TERMS).enumerate() {
            let inwards = [1.0, -1.0][side];
            for (offset, depth) in scene.shape.faces_mm[self.axis][side].iter_mut().zip(depth) {
                *offset += inwards * depth;
            }
        }
    }

    fn location(&self, values: &[f64], specimen: &Specimen) -> Option<Location> {
        let face = usize::from(values[FACE_TERMS].abs() > values[0].abs());
        Some(Location::of_face(specimen, self.axis, face, "layer at the bonded face"))
    }

    fn is_of_set_up(&self) -> bool {
        true
    }
}
