//! The bonds give way.

use super::{Category, Cause, CauseParameter, Location};
use crate::diagnosis::scene::Scene;
use crate::specimen::Specimen;

/// Compliance of the layers that bond the sample to its plates: each point of a bonded face lags behind its plate by
/// compliance × traction.
pub struct SoftBond {
    /// Start, fixed and moved face, mm/kPa.
    pub start_mm_per_kpa: [f64; 2],
}

/// The stiffest bond that is told from a firm one, mm/kPa: 20 kPa of traction slips 4 µm.
const FIRMEST: f64 = 2e-4;

impl Cause for SoftBond {
    fn name(&self) -> &'static str {
        "bond"
    }

    fn category(&self) -> Category {
        Category::Boundary
    }

    fn description(&self) -> String {
        "the bonds of the plates are soft".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        // Differences for derivatives are a fifth of the firmest bond.
        ["fixed", "moved"]
            .map(|face| CauseParameter::new(format!("{face}_plate_mm_per_kpa"), 2e-3, [FIRMEST, 20.0]))
            .to_vec()
    }

    fn start(&self) -> Vec<f64> {
        self.start_mm_per_kpa.map(|c| c.max(FIRMEST)).to_vec()
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        for (sum, value) in scene.bond_mm_per_kpa.iter_mut().zip(values) {
            *sum += value;
        }
    }

    fn location(&self, _: &[f64], _: &Specimen) -> Option<Location> {
        None
    }
}
