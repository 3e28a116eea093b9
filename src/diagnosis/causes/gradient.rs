//! A modulus that varies linearly across the sample.

use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::scene::Scene;
use crate::fem::Field;
use crate::specimen::Specimen;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("gradient");
/// What a laboratory can do about it.
const REMEDY: &str = "Cure and mix more evenly, or cut the sample from one place of the cast.";
/// Its line in the registry.
pub(super) const ENTRY: Entry =
    Entry { name: NAME, remedy: REMEDY, origin: Origin::Tested(|specimen| vec![Arc::new(Gradient::of(specimen))]) };

/// Stiffness × (1 + Σ gᵢ xᵢ / half extent).
pub struct Gradient {
    half: [f64; 3],
}

impl Gradient {
    /// Of a specimen's block.
    pub fn of(specimen: &Specimen) -> Gradient {
        let b = specimen.block;
        Gradient { half: [0.5 * b.length_mm, 0.5 * b.thickness_mm, 0.5 * b.width_mm] }
    }
}

impl Cause for Gradient {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Material
    }

    fn description(&self) -> String {
        "the modulus varies across the sample".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        ["x", "y", "z"]
            .map(|a| CauseParameter::new(format!("relative_change_center_to_face_{a}"), 0.1, [-0.9, 0.9]))
            .to_vec()
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        let rate = [0, 1, 2].map(|a| values[a] / self.half[a]);
        scene.stiffness.push(Field::new(move |x| 1.0 + (0..3).map(|a| rate[a] * x[a]).sum::<f64>()));
    }
}
