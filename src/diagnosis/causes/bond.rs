//! The bonds give way.

use crate::diagnosis::candidate::Candidate;
use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::error::DiagnosisError;
use crate::diagnosis::scene::Scene;
use crate::diagnosis::score::ScoreTest;
use crate::diagnosis::search::Search;
use crate::diagnosis::trace::Trace;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("bond");
/// What a laboratory can do about it.
const REMEDY: &str = "Bond with a thinner or stiffer adhesive, or give the stiffness of the one in use.";
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry { name: NAME, remedy: REMEDY, origin: Origin::Searched(suspects) };

/// Compliance of the layers that bond the sample to its plates: each point of a bonded face lags behind its plate by
/// compliance × traction.
pub struct SoftBond {
    /// Start, fixed and moved face, mm/kPa.
    pub start_mm_per_kpa: [f64; 2],
}

/// The stiffest bond that is told from a firm one, mm/kPa: 20 kPa of traction slips 4 µm.
const FIRMEST: f64 = 2e-4;

/// Soft bonds as the maps of both faces tell them.
fn suspects(search: &mut Search) -> Result<Vec<Candidate>, DiagnosisError> {
    let whole_faces: Option<Vec<Trace>> =
        search.bond_maps()?.as_ref().map(|bonds| bonds.iter().map(|bond| bond.whole.clone()).collect());
    Ok(whole_faces.and_then(|directions| soft_bond(search.test, &directions)).into_iter().collect())
}

/// Soft bonds of the whole faces (`directions`: fixed, moved). Where the pair that explains most would have a negative
/// compliance, the face that alone explains more is taken.
fn soft_bond(test: &ScoreTest, directions: &[Trace]) -> Option<Candidate> {
    let both = test.test(directions);
    let (score, start) = if both.coefficients.iter().all(|c| *c > 0.0) {
        (both.explained, [both.coefficients[0], both.coefficients[1]])
    } else {
        let alone = [0, 1].map(|face| test.test(&directions[face..=face]));
        let explained = |face: usize| if alone[face].coefficients[0] > 0.0 { alone[face].explained } else { 0.0 };
        let face = usize::from(explained(1) > explained(0));
        let mut start = [0.0; 2];
        start[face] = alone[face].coefficients[0].max(0.0);
        (explained(face), start)
    };
    let cause = SoftBond { start_mm_per_kpa: start };
    (score > 0.0).then(|| Candidate { values: cause.start(), cause: Arc::new(cause), score })
}

impl Cause for SoftBond {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Boundary
    }

    fn description(&self) -> String {
        "the bonds of the plates are soft".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        // With this scale the differences for derivatives are a fifth of the firmest bond.
        ["fixed", "moved"]
            .map(|face| CauseParameter::new(format!("{face}_plate_mm_per_kpa"), 2e-3, [FIRMEST, 20.0]))
            .to_vec()
    }

    fn start(&self) -> Vec<f64> {
        self.start_mm_per_kpa.map(|c| c.max(FIRMEST)).to_vec()
    }

    fn is_idealised(&self) -> bool {
        true
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        for (sum, value) in scene.bond_mm_per_kpa.iter_mut().zip(values) {
            *sum += value;
        }
    }
}
