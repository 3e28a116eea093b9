//! The wall of a hole in its section: the one place that knows what holes of every kind look like.
//!
//! A wall is convex and symmetric about its centre and both of its axes. It is met by its signed distance, its reach in
//! a direction (the support function), its chords, and its points by a parameter that advances as finely as it curves.

use super::{Hole, HoleKind, ellipse};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// How finely the parameter of a slot advances on its straight lines, against its half circles: parts of equal steps
/// are twice as long where the wall is straight.
const STRAIGHT_RATE: f64 = 0.5;

/// What a wall is, with a ≥ b half of its extents along and across.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Circle,
    Ellipse,
    Slot,
}

/// The wall of a hole in section coordinates (x and z for holes along the thickness, x and y for holes along the
/// width), mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HoleWall {
    center: [f64; 2],
    /// Half of the extents along the hole and across it.
    half: [f64; 2],
    /// Unit vector along the hole.
    along: [f64; 2],
    angle_rad: f64,
    form: Form,
}

impl Hole {
    /// Its wall.
    pub fn wall(&self) -> HoleWall {
        let radius = 0.5 * self.diameter_mm;
        let circle = HoleWall {
            center: self.center_mm,
            half: [radius; 2],
            along: [1.0, 0.0],
            angle_rad: 0.0,
            form: Form::Circle,
        };
        let Some(shape) = self.shape else { return circle };
        let form = match shape.kind {
            HoleKind::Ellipse => Form::Ellipse,
            HoleKind::Slot => Form::Slot,
        };
        let angle_rad = shape.angle_deg.to_radians();
        HoleWall {
            half: [0.5 * shape.length_mm, radius],
            along: unit_vector(shape.angle_deg),
            angle_rad,
            form,
            ..circle
        }
    }
}

/// (cos, sin) of an angle, exact for quarter turns.
fn unit_vector(angle_deg: f64) -> [f64; 2] {
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    if (angle_deg / 90.0).fract() == 0.0 { [cos.round(), sin.round()] } else { [cos, sin] }
}

impl HoleWall {
    /// The centre, mm.
    pub fn center_mm(&self) -> [f64; 2] {
        self.center
    }

    /// The same wall about another centre.
    pub fn moved_to(self, center: [f64; 2]) -> HoleWall {
        HoleWall { center, ..self }
    }

    /// Half of the extents along the hole and across it, mm; both the radius of a circle.
    pub fn half_mm(&self) -> [f64; 2] {
        self.half
    }

    /// Unit vector along the hole; along x for a circle.
    pub fn along(&self) -> [f64; 2] {
        self.along
    }

    /// Whether it is a circle.
    pub fn is_circle(&self) -> bool {
        self.form == Form::Circle
    }

    /// Whether it is an ellipse.
    pub(super) fn is_ellipse(&self) -> bool {
        self.form == Form::Ellipse
    }

    /// Half of the straight line of a slot, mm; 0 for other walls.
    fn half_straight(&self) -> f64 {
        if self.form == Form::Slot { self.half[0] - self.half[1] } else { 0.0 }
    }

    /// A point in the hole's own frame: along and across, from its centre.
    pub fn local(&self, p: [f64; 2]) -> [f64; 2] {
        let d = [p[0] - self.center[0], p[1] - self.center[1]];
        let [cos, sin] = self.along;
        [d[0] * cos + d[1] * sin, d[1] * cos - d[0] * sin]
    }

    /// A vector of the hole's own frame in the section.
    pub fn turned(&self, q: [f64; 2]) -> [f64; 2] {
        let [cos, sin] = self.along;
        [q[0] * cos - q[1] * sin, q[0] * sin + q[1] * cos]
    }

    /// A point of the hole's own frame in the section.
    pub(super) fn section_point(&self, q: [f64; 2]) -> [f64; 2] {
        let d = self.turned(q);
        [self.center[0] + d[0], self.center[1] + d[1]]
    }

    /// Distance of a point from the wall, mm: positive in the material, negative in the hole. Exact.
    pub fn distance_mm(&self, p: [f64; 2]) -> f64 {
        let [a, b] = self.half;
        match self.form {
            Form::Circle => (p[0] - self.center[0]).hypot(p[1] - self.center[1]) - b,
            Form::Slot => {
                let [along, across] = self.local(p);
                (along.abs() - self.half_straight()).max(0.0).hypot(across) - b
            }
            Form::Ellipse => {
                let q = self.local(p);
                let foot = ellipse::nearest_point(self.half, q);
                let length = (q[0] - foot[0]).hypot(q[1] - foot[1]);
                if (q[0] / a).hypot(q[1] / b) < 1.0 { -length } else { length }
            }
        }
    }

    /// Furthest extent from the centre in a direction, max over the wall of (p − c)·d, for a unit vector d, mm.
    pub fn reach_mm(&self, direction: [f64; 2]) -> f64 {
        let [a, b] = self.half;
        let [cos, sin] = self.along;
        let (u, v) = (direction[0] * cos + direction[1] * sin, direction[1] * cos - direction[0] * sin);
        match self.form {
            Form::Circle => b,
            Form::Slot => self.half_straight() * u.abs() + b,
            Form::Ellipse => (a * u).hypot(b * v),
        }
    }

    /// Distance from the centre to the wall along a unit vector, mm, to 1e-12 of it.
    pub fn ray_mm(&self, direction: [f64; 2]) -> f64 {
        let ([mut low, mut high], center) = ([self.half[1], self.half[0]], self.center);
        while high - low > 1e-12 * high {
            let middle = 0.5 * (low + high);
            let is_inside = self.distance_mm([0, 1].map(|c| center[c] + middle * direction[c])) < 0.0;
            *(if is_inside { &mut low } else { &mut high }) = middle;
        }
        0.5 * (low + high)
    }

    /// Half of the extents along the section's axes, mm.
    pub fn half_extents_mm(&self) -> [f64; 2] {
        [self.reach_mm([1.0, 0.0]), self.reach_mm([0.0, 1.0])]
    }

    /// The part of the line of constant first coordinate that lies in the hole, from low to high, mm; `None` where the
    /// line misses it.
    pub fn chord_mm(&self, x: f64) -> Option<[f64; 2]> {
        let dx = x - self.center[0];
        let ends = match self.form {
            Form::Circle => disc_chord(dx, self.half[1]),
            Form::Ellipse => self.ellipse_chord(dx),
            Form::Slot => self.slot_chord(dx),
        }?;
        Some(ends.map(|y| self.center[1] + y))
    }

    /// Of an ellipse, from its centre: the roots of A y² + 2 B y + C = 0.
    fn ellipse_chord(&self, dx: f64) -> Option<[f64; 2]> {
        let ([a, b], [cos, sin]) = (self.half, self.along);
        let (aa, bb) = (1.0 / (a * a), 1.0 / (b * b));
        let quadratic = sin * sin * aa + cos * cos * bb;
        let linear = dx * cos * sin * (aa - bb);
        let constant = dx * dx * (cos * cos * aa + sin * sin * bb) - 1.0;
        let discriminant = linear * linear - quadratic * constant;
        (discriminant > 0.0).then(|| [-1.0, 1.0].map(|s| (s * discriminant.sqrt() - linear) / quadratic))
    }

    /// Of a slot, from its centre: the hull of the chords of its end circles and of the band between them.
    fn slot_chord(&self, dx: f64) -> Option<[f64; 2]> {
        let (s, b, [cos, sin]) = (self.half_straight(), self.half[1], self.along);
        let of_end = |sign: f64| disc_chord(dx - sign * s * cos, b).map(|ends| ends.map(|y| y + sign * s * sin));
        // |dx cos + y sin| ≤ s and |y cos − dx sin| ≤ b.
        let band = intersection(strip(dx * cos, sin, s), strip(-dx * sin, cos, b));
        [of_end(-1.0), of_end(1.0), band].into_iter().flatten().reduce(|p, q| [p[0].min(q[0]), p[1].max(q[1])])
    }

    /// Area, mm²: π a b, or π b² + 4 (a − b) b of a slot.
    pub fn area_mm2(&self) -> f64 {
        let [a, b] = self.half;
        match self.form {
            Form::Circle | Form::Ellipse => PI * a * b,
            Form::Slot => PI * b * b + 4.0 * self.half_straight() * b,
        }
    }

    /// Circumference, mm.
    pub fn perimeter_mm(&self) -> f64 {
        match self.form {
            Form::Circle => TAU * self.half[1],
            Form::Ellipse => ellipse::perimeter(self.half),
            Form::Slot => TAU * self.half[1] + 4.0 * self.half_straight(),
        }
    }

    /// The radius of the circle of the same area, mm.
    pub fn mean_radius_mm(&self) -> f64 {
        if self.is_circle() { self.half[1] } else { (self.area_mm2() / PI).sqrt() }
    }

    /// Of a slot: the part of a quarter's parameter, π/2, over which its quarter circle runs. 1 for other walls.
    fn round_share(&self) -> f64 {
        FRAC_PI_2 / (FRAC_PI_2 + STRAIGHT_RATE * self.half_straight() / self.half[1])
    }

    /// How many more parts than a circle the wall needs all around, so that each turns the tangent by about as much.
    pub fn parts_factor(&self) -> f64 {
        match self.form {
            Form::Circle => 1.0,
            Form::Ellipse => 0.5 * (1.0 + self.half[0] / self.half[1]),
            Form::Slot => 1.0 / self.round_share(),
        }
    }

    /// The point of the wall with a parameter, radians. It runs once around counter-clockwise in 2π and has the polar
    /// angle's value at the ends of the hole's axes: of a circle the polar angle, of an ellipse the eccentric anomaly
    /// (both plus the hole's angle), of a slot the angle on its half circles and the length on its straight lines, in
    /// proportion.
    pub fn point_at(&self, parameter: f64) -> [f64; 2] {
        let [a, b] = self.half;
        if self.is_circle() {
            return [self.center[0] + b * parameter.cos(), self.center[1] + b * parameter.sin()];
        }
        let t = parameter - self.angle_rad;
        if self.form == Form::Ellipse {
            return self.section_point([a * t.cos(), b * t.sin()]);
        }
        // Fold into the first quarter, by what is symmetric to the last bit.
        let turned = t - TAU * (t / TAU).round();
        let from_axis = turned.abs().min(PI);
        let is_second = from_axis > FRAC_PI_2;
        let within = if is_second { PI - from_axis } else { from_axis } / self.round_share();
        let s = self.half_straight();
        let [along, across] = if within <= FRAC_PI_2 {
            [s + b * within.cos(), b * within.sin()]
        } else {
            [s - (within - FRAC_PI_2) * b / STRAIGHT_RATE, b]
        };
        self.section_point([if is_second { -along } else { along }, if turned < 0.0 { -across } else { across }])
    }

    /// The parameter of the point of the wall that is nearest to `p`, in (−π, π] (plus the hole's angle).
    pub fn parameter_of(&self, p: [f64; 2]) -> f64 {
        let [a, b] = self.half;
        match self.form {
            Form::Circle => (p[1] - self.center[1]).atan2(p[0] - self.center[0]),
            Form::Ellipse => {
                let [along, across] = ellipse::nearest_point(self.half, self.local(p));
                self.angle_rad + (across / b).atan2(along / a)
            }
            Form::Slot => {
                let ([along, across], s) = (self.local(p), self.half_straight());
                let within = if along.abs() > s {
                    across.abs().atan2(along.abs() - s)
                } else {
                    FRAC_PI_2 + (s - along.abs()) * STRAIGHT_RATE / b
                };
                let folded = within * self.round_share();
                let upper = if along < 0.0 { PI - folded } else { folded };
                self.angle_rad + if across < 0.0 { -upper } else { upper }
            }
        }
    }

    /// How fast the point of the wall moves with its parameter, mm/rad.
    pub fn speed_at(&self, parameter: f64) -> f64 {
        let ([a, b], t) = (self.half, parameter - self.angle_rad);
        match self.form {
            Form::Circle => b,
            Form::Ellipse => (a * t.sin()).hypot(b * t.cos()),
            Form::Slot => {
                let half_turn = t.rem_euclid(PI);
                let within = half_turn.min(PI - half_turn) / self.round_share();
                b / self.round_share() / if within <= FRAC_PI_2 { 1.0 } else { STRAIGHT_RATE }
            }
        }
    }

    /// Parameters at which the curvature jumps, where a curve of low order through three points should not pass: the
    /// ends of a slot's straight lines.
    pub fn breaks(&self) -> Vec<f64> {
        if self.half_straight() <= 0.0 {
            return Vec::new();
        }
        let within = FRAC_PI_2 * self.round_share();
        [within, PI - within, PI + within, TAU - within].map(|t| self.angle_rad + t).to_vec()
    }
}

/// The chord of a disc about the origin at a distance from its centre.
fn disc_chord(dx: f64, radius: f64) -> Option<[f64; 2]> {
    if dx.abs() >= radius {
        return None;
    }
    let chord = (radius * radius - dx * dx).sqrt();
    Some([-chord, chord])
}

/// All y with |offset + y slope| ≤ half; `None` where there is none.
fn strip(offset: f64, slope: f64, half: f64) -> Option<[f64; 2]> {
    if slope.abs() < f64::EPSILON {
        return (offset.abs() <= half).then_some([f64::NEG_INFINITY, f64::INFINITY]);
    }
    let (p, q) = ((-half - offset) / slope, (half - offset) / slope);
    Some([p.min(q), p.max(q)])
}

fn intersection(p: Option<[f64; 2]>, q: Option<[f64; 2]>) -> Option<[f64; 2]> {
    let ends = [p?[0].max(q?[0]), p?[1].min(q?[1])];
    (ends[0] < ends[1]).then_some(ends)
}

#[cfg(test)]
#[path = "hole_wall_tests.rs"]
mod tests;
