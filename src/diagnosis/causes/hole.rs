//! A hole of another size or at another place than drawn.

use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::location::Location;
use crate::diagnosis::scene::Scene;
use crate::specimen::{HoleAxis, Specimen};
use std::sync::Arc;

const NAME: CauseName = CauseName::new("hole");
/// What a laboratory can do about it.
const REMEDY: &str = "Measure the holes as cast and give the specimen their places and diameters.";
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry { name: NAME, remedy: REMEDY, origin: Origin::Tested(all_of) };

/// Diameter and centre of one hole; of an ellipse or a slot both of its extents, which grow by the same.
pub struct HoleError {
    hole: usize,
    axis: HoleAxis,
    range_mm: f64,
}

/// One suspect per hole.
fn all_of(specimen: &Specimen) -> Vec<Arc<dyn Cause>> {
    (0..specimen.holes.len()).map(|hole| Arc::new(HoleError::of(specimen, hole)) as Arc<dyn Cause>).collect()
}

impl HoleError {
    /// Of hole `hole`.
    pub fn of(specimen: &Specimen, hole: usize) -> HoleError {
        let h = &specimen.holes[hole];
        HoleError { hole, axis: h.axis, range_mm: 0.3 * h.diameter_mm }
    }
}

impl Cause for HoleError {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Geometry
    }

    fn description(&self) -> String {
        format!("hole {} is not of the drawn size or at the drawn place", self.hole)
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        let range = [-self.range_mm, self.range_mm];
        let across = if self.axis == HoleAxis::Thickness { "z" } else { "y" };
        vec![
            CauseParameter::new("diameter_error_mm", 0.1, range),
            CauseParameter::new("center_error_x_mm", 0.1, range),
            CauseParameter::new(format!("center_error_{across}_mm"), 0.1, range),
        ]
    }

    fn variant(&self) -> [i64; 3] {
        [self.hole as i64, 0, 0]
    }

    fn max_suspects(&self) -> usize {
        2
    }

    fn is_idealised(&self) -> bool {
        true
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        if scene.holes.len() <= self.hole {
            scene.holes.resize(self.hole + 1, [0.0; 3]);
        }
        for n in 0..3 {
            scene.holes[self.hole][n] += values[n];
        }
    }

    fn location(&self, values: &[f64], specimen: &Specimen) -> Option<Location> {
        let h = specimen.holes.get(self.hole)?;
        let [a, b] = [h.center_mm[0] + values[1], h.center_mm[1] + values[2]];
        let [along, across] = h.wall().half_extents_mm().map(|half| 2.0 * half + values[0]);
        let (center_mm, extent_mm) = match self.axis {
            HoleAxis::Thickness => ([a, 0.0, b], [along, specimen.block.thickness_mm, across]),
            HoleAxis::Width => ([a, b, 0.0], [along, across, specimen.block.width_mm]),
        };
        Some(Location { region: format!("hole {}", self.hole), center_mm, extent_mm })
    }
}
