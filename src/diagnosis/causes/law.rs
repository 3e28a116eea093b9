//! The material's law is no sum of Ogden terms.

use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::scene::Scene;
use crate::fem::LawCorrection;
use crate::specimen::{Specimen, TestKind};
use std::sync::Arc;

const NAME: CauseName = CauseName::new("law");
/// What a laboratory can do about it.
const REMEDY: &str = "Nothing is wrong with the experiment: fit another law, or add the correction that the report shows as \
    curves; it holds for the stretches that the recording has seen.";
/// Its line in the registry.
pub(super) const ENTRY: Entry =
    Entry { name: NAME, remedy: REMEDY, origin: Origin::Tested(|specimen| vec![Arc::new(Law::of(specimen))]) };

/// A change of a coefficient that is plain to see, kPa: a hundredth of it is a hundredth of a soft rubber's modulus.
const SCALE_KPA: f64 = 5.0;
/// Largest coefficient, kPa.
const LARGEST_KPA: f64 = 500.0;
/// The least reach of the correction.
const LEAST_REACH: f64 = 0.05;

/// A smooth correction of the energy beside the Ogden terms ([`LawCorrection`]), with the reach of the states that the
/// largest drive brings about.
pub struct Law {
    reach: f64,
}

impl Law {
    /// Of a specimen: the reach is (x + y)/2 of the homogeneous state at its largest drive.
    pub fn of(specimen: &Specimen) -> Law {
        let drive_mm = specimen.largest_drive_mm();
        let reach = match specimen.test {
            // In simple shear γ both invariants are 3 + γ².
            TestKind::DoubleLapShear => (drive_mm / specimen.block.thickness_mm).powi(2),
            TestKind::Uniaxial => {
                let stretch = 1.0 + drive_mm / specimen.block.length_mm;
                let (first, second) = (stretch.powi(2) + 2.0 / stretch, 2.0 * stretch + stretch.powi(-2));
                0.5 * (first + second) - 3.0
            }
        };
        Law { reach: reach.max(LEAST_REACH) }
    }
}

impl Cause for Law {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Material
    }

    fn description(&self) -> String {
        "the material's law is no sum of Ogden terms".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        ["stiffening_kpa", "further_stiffening_kpa", "mode_kpa", "further_mode_kpa"]
            .map(|name| CauseParameter::new(name, SCALE_KPA, [-LARGEST_KPA, LARGEST_KPA]))
            .to_vec()
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        let own = LawCorrection { reach: self.reach, coefficients_kpa: [values[0], values[1], values[2], values[3]] };
        scene.law = Some(scene.law.map_or(own, |other| other.plus(&own)));
    }

    /// Four coefficients follow a law that has its own form to some percent.
    fn is_idealised(&self) -> bool {
        true
    }
}
