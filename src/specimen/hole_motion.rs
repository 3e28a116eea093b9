//! How a hole's wall moves as its extents or its angle change, as a field around it.
//!
//! On the wall each field is a derivative of the wall's points (mm per mm or per degree). Off it the fields continue
//! smoothly outwards (of a slot continuously), which is all that a mesh asks for that follows the wall.

use super::HoleWall;

/// A slot with a straight line shorter than this part of its width has no use for it: it is a circle.
const LEAST_STRAIGHT: f64 = 1e-9;

impl HoleWall {
    /// As the extent across grows and the length stays: of a circle, outwards; of an ellipse x = a cos t, y = b sin t
    /// the derivative at fixed t; of a slot the ends come nearer as their radii grow.
    pub fn motion_with_width(&self, p: [f64; 2]) -> [f64; 2] {
        if self.is_circle() {
            return self.outward(self.center_mm(), p).map(|c| 0.5 * c);
        }
        if self.is_ellipse() {
            return self.turned([0.0, 0.5 * self.anomaly(p)[1]]);
        }
        let ([share, foot], out) = self.on_middle_line(p);
        let outward = self.outward(self.section_point([foot, 0.0]), p);
        let inward = self.turned([-0.5 * share, 0.0]);
        [0, 1].map(|c| inward[c] + 0.5 * if out > 0.0 { outward[c] } else { 0.0 })
    }

    /// As the length grows and the extent across stays: of an ellipse the derivative at fixed t; of a slot the ends
    /// move apart and the straight lines stretch. A circle has no length: zero.
    pub fn motion_with_length(&self, p: [f64; 2]) -> [f64; 2] {
        if self.is_circle() {
            return [0.0; 2];
        }
        let share = if self.is_ellipse() { self.anomaly(p)[0] } else { self.on_middle_line(p).0[0] };
        self.turned([0.5 * share, 0.0])
    }

    /// As the angle grows, per degree: a turn about the centre. Zero for a circle.
    pub fn motion_with_angle(&self, p: [f64; 2]) -> [f64; 2] {
        if self.is_circle() {
            return [0.0; 2];
        }
        let center = self.center_mm();
        [-(p[1] - center[1]), p[0] - center[0]].map(|c| c.to_radians())
    }

    /// Unit vector from `from` to `p`; zero where they are the same.
    fn outward(&self, from: [f64; 2], p: [f64; 2]) -> [f64; 2] {
        let d = [p[0] - from[0], p[1] - from[1]];
        let length = d[0].hypot(d[1]);
        if length > 0.0 { d.map(|c| c / length) } else { [0.0; 2] }
    }

    /// (cos t, sin t) of the ellipse of the same axes through `p`.
    fn anomaly(&self, p: [f64; 2]) -> [f64; 2] {
        let ([along, across], [a, b]) = (self.local(p), self.half_mm());
        self.outward([0.0; 2], [along / a, across / b])
    }

    /// The nearest point of a slot's middle line, as a part of its half (−1 to 1) and from the centre, mm; and the
    /// distance of `p` from it.
    fn on_middle_line(&self, p: [f64; 2]) -> ([f64; 2], f64) {
        let ([along, across], [a, b]) = (self.local(p), self.half_mm());
        let half = a - b;
        let foot = along.clamp(-half, half);
        let share = if half > LEAST_STRAIGHT * b { foot / half } else { (along / b).clamp(-1.0, 1.0) };
        ([share, foot], (along - foot).hypot(across))
    }
}
