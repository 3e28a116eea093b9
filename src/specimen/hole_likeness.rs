//! Mirror images of holes, and how far two holes are from being the same.

use super::Hole;

impl Hole {
    /// The hole in a section that is mirrored where a sign is negative (x, then the other axis).
    pub fn mirrored(self, signs: [f64; 2]) -> Hole {
        let center_mm = [signs[0] * self.center_mm[0], signs[1] * self.center_mm[1]];
        Hole { center_mm, shape: self.shape.map(|shape| shape.mirrored(signs)), ..self }
    }

    /// How far another hole is from being this one, mm: the distance of the centres and the differences of the extents,
    /// and where both are longer than wide how far apart that puts their ends or outlines. Zero for the same hole at
    /// half a turn, and for a circle and an ellipse as long as wide.
    pub fn difference_mm(&self, other: &Hole) -> f64 {
        let apart = (self.center_mm[0] - other.center_mm[0]).hypot(self.center_mm[1] - other.center_mm[1]);
        let across = (self.diameter_mm - other.diameter_mm).abs();
        let (Some(own), Some(others)) = (self.shape, other.shape) else {
            return apart + across + (self.length_mm() - other.length_mm()).abs();
        };
        let elongation = 0.5 * (own.length_mm - self.diameter_mm).min(others.length_mm - other.diameter_mm);
        let turn = (own.angle_deg - others.angle_deg).to_radians().sin().abs();
        let kind = if own.kind == others.kind { 0.0 } else { 1.0 };
        apart + across + (own.length_mm - others.length_mm).abs() + elongation * (turn + kind)
    }
}
