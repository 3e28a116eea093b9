//! A stiff or soft place inside the sample.

use super::{Category, Cause, CauseParameter, Location};
use crate::diagnosis::scene::Scene;
use crate::fem::Field;
use crate::specimen::Specimen;

/// Width of the inclusion's edge, mm. Wider ones take the stiffness factor of stiff balls too large and their radius too small, at
/// twice the width by a tenth of ln f; the field's points in an element are some three times as far apart.
const EDGE_MM: f64 = 0.25;

/// A ball whose stiffness is the surroundings' times a factor.
pub struct Inclusion {
    /// Where the search for it starts: centre, mm.
    pub center_mm: [f64; 3],
    /// Radius at the start, mm.
    pub radius_mm: f64,
    /// ln of the factor at the start.
    pub log_factor: f64,
    /// Half extents of the block, mm.
    pub half_mm: [f64; 3],
}

impl Cause for Inclusion {
    fn name(&self) -> &'static str {
        "inclusion"
    }

    fn category(&self) -> Category {
        Category::Material
    }

    fn description(&self) -> String {
        "a place in the sample is stiffer or softer than the rest".into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        let mut all = vec![CauseParameter::new("log_stiffness_factor", 0.3, [-4.0, 4.0])];
        for (a, half) in ["x", "y", "z"].iter().zip(self.half_mm) {
            all.push(CauseParameter::new(format!("center_{a}_mm"), 0.5, [-half, half]));
        }
        let largest = self.half_mm.iter().fold(0.0f64, |s, h| s.max(*h));
        all.push(CauseParameter::new("radius_mm", 0.5, [0.7, largest]));
        all
    }

    fn start(&self) -> Vec<f64> {
        let c = self.center_mm;
        vec![self.log_factor, c[0], c[1], c[2], self.radius_mm]
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        scene.stiffness.push(ball(values, EDGE_MM));
    }

    fn apply_wider(&self, values: &[f64], scene: &mut Scene) -> bool {
        scene.stiffness.push(ball(values, 2.0 * EDGE_MM));
        true
    }

    fn location(&self, values: &[f64], _: &Specimen) -> Option<Location> {
        let d = 2.0 * values[4];
        let region = if values[0] > 0.0 { "stiff inclusion" } else { "soft inclusion" };
        Some(Location { region: region.into(), center_mm: [values[1], values[2], values[3]], extent_mm: [d; 3] })
    }
}

/// The stiffness factor of a ball whose edge is `edge_mm` wide.
fn ball(values: &[f64], edge_mm: f64) -> Field {
    let (log_factor, center, radius) = (values[0], [values[1], values[2], values[3]], values[4]);
    Field::new(move |x| {
        let r = (0..3).map(|a| (x[a] - center[a]).powi(2)).sum::<f64>().sqrt();
        (log_factor / (1.0 + ((r - radius) / (0.5 * edge_mm)).clamp(-50.0, 50.0).exp())).exp()
    })
}
