//! The material between two holes at its thinnest.
//!
//! The signed distance of two convex sets is the largest gap between parallel lines that part them, max over unit
//! vectors n of (c₂ − c₁)·n − h₁(n) − h₂(n) with h the reach of each: positive where they are apart, and less the depth
//! of the overlap where they are not. Every n gives a lower bound, so that a search over n never tells more material
//! than there is.

use super::HoleWall;
use std::f64::consts::TAU;

/// Directions that are looked at between walls of which one is an ellipse.
const DIRECTIONS: usize = 96;
/// Steps of the golden section from there: 2 × 2π/96 × 0.618⁴⁴ is 1e-10 rad.
const SECTIONS: usize = 44;
const GOLDEN: f64 = 0.618_033_988_749_894_9;

impl HoleWall {
    /// Thickness of the material between this wall and another, mm (negative where they overlap: less the depth), and
    /// the unit vector along which it is measured, towards the other. Exact for circles and slots; where one is an
    /// ellipse never above the exact one, and below it by rounding alone.
    pub fn gap_mm(&self, other: &HoleWall) -> (f64, [f64; 2]) {
        let (from, to) = (self.center_mm(), other.center_mm());
        let offset = [to[0] - from[0], to[1] - from[1]];
        let distance = offset[0].hypot(offset[1]);
        let direct = if distance > 0.0 { offset.map(|c| c / distance) } else { [1.0, 0.0] };
        if self.is_circle() && other.is_circle() {
            return (distance - (self.half_mm()[1] + other.half_mm()[1]), direct);
        }
        let gap = |n: [f64; 2]| offset[0] * n[0] + offset[1] * n[1] - self.reach_mm(n) - other.reach_mm(n);
        let mut best = (gap(direct), direct);
        let mut consider = |n: [f64; 2]| {
            let value = gap(n);
            if value > best.0 {
                best = (value, n);
            }
        };
        self.directions_to(other, offset).into_iter().for_each(&mut consider);
        if self.is_ellipse() || other.is_ellipse() {
            let at = |i: usize| TAU * i as f64 / DIRECTIONS as f64;
            let of = |angle: f64| gap([angle.cos(), angle.sin()]);
            let values: Vec<f64> = (0..DIRECTIONS).map(|i| of(at(i))).collect();
            for i in 0..DIRECTIONS {
                let (before, after) = (values[(i + DIRECTIONS - 1) % DIRECTIONS], values[(i + 1) % DIRECTIONS]);
                if values[i] >= before && values[i] >= after {
                    let step = TAU / DIRECTIONS as f64;
                    let angle = largest_between(&of, at(i) - step, at(i) + step);
                    consider([angle.cos(), angle.sin()]);
                }
            }
        }
        best
    }

    /// Directions in which the gap between walls of discs and segments can be largest: across each segment, and between
    /// the ends of both.
    fn directions_to(&self, other: &HoleWall, offset: [f64; 2]) -> Vec<[f64; 2]> {
        let mut directions = Vec::new();
        for [cos, sin] in [self.along(), other.along()] {
            directions.extend([[-sin, cos], [sin, -cos]]);
        }
        let end = |wall: &HoleWall, sign: f64| wall.along().map(|c| sign * (wall.half_mm()[0] - wall.half_mm()[1]) * c);
        for (i, j) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            let (p, q) = (end(self, i), end(other, j));
            let between = [offset[0] + q[0] - p[0], offset[1] + q[1] - p[1]];
            let length = between[0].hypot(between[1]);
            if length > 0.0 {
                directions.push(between.map(|c| c / length));
            }
        }
        directions
    }
}

/// Where a function with one maximum between two angles is largest.
pub(super) fn largest_between(value: &impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    for _ in 0..SECTIONS {
        let (p, q) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        if value(p) >= value(q) { high = q } else { low = p }
    }
    0.5 * (low + high)
}
