//! Dumb-bells: a narrow gauge between wide ends, joined by arcs of one radius.
//!
//! With half-widths w (gauge) and e (ends), half of the gauge's length g and the radius R, the half-width h(x) is w up
//! to |x| = g, rises to e by two tangent arcs of radius R, each through the angle θ with cos θ = 1 − (e − w)/(2R) and
//! a = R sin θ long in x, and stays e up to the ends. The outline is C¹. Length and width of the block are those of the
//! whole dumb-bell.
//!
//! The dumb-bell of ISO 37, type 4 (w = 1, e = 3, g = 6, R = 3, all mm; from the standard's table of dimensions), is
//! [`ISO37_TYPE4`].

use serde::{Deserialize, Serialize};

/// Overall length of the standard's dumb-bell, mm.
pub const ISO37_LENGTH_MM: f64 = 35.0;
/// Width of its ends, mm.
pub const ISO37_WIDTH_MM: f64 = 6.0;
/// Its thickness, mm.
pub const ISO37_THICKNESS_MM: f64 = 2.0;
/// Its gauge and arcs.
pub const ISO37_TYPE4: Dumbbell = Dumbbell { gauge_width_mm: 2.0, gauge_length_mm: 12.0, fillet_radius_mm: 3.0 };

/// The narrowest gauge as a part of the width: elements of narrower ones are slivers, or too many.
pub const MIN_GAUGE_RATIO: f64 = 0.125;
/// The shortest gauge as a part of its width.
pub const MIN_GAUGE_ASPECT: f64 = 0.1;
/// The least by which the ends are wider than the gauge, mm: less is a block.
pub const MIN_WIDENING_MM: f64 = 0.1;
/// The shortest straight part of an end, as a part of the width: what a grip holds.
pub const MIN_TAB_RATIO: f64 = 0.1;
/// Rounding by which a dimension may miss its limit, relative to the limit.
const ROUNDING: f64 = 1e-9;

/// The gauge of a dumb-bell and the arcs at its ends; length and width of the whole are those of the block.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = DumbbellSchema))]
#[serde(deny_unknown_fields)]
pub struct Dumbbell {
    /// Width of the gauge, mm: at least an eighth of the block's width, and 0.1 mm less than it at most.
    #[cfg_attr(feature = "schema", schema(value_type = super::file::ExtentMm))]
    pub gauge_width_mm: f64,
    /// Length of the gauge between the arcs, mm: at least a tenth of its width.
    #[cfg_attr(feature = "schema", schema(value_type = super::file::ExtentMm))]
    pub gauge_length_mm: f64,
    /// Radius of both arcs between gauge and end, mm: at least half of what the ends are wider than the gauge, so that
    /// the sides rise by at most 60°.
    #[cfg_attr(feature = "schema", schema(value_type = super::file::FilletMm))]
    pub fillet_radius_mm: f64,
}

/// A dimension of a dumb-bell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DumbbellDimension {
    /// Width of the gauge.
    GaugeWidth,
    /// Length of the gauge.
    GaugeLength,
    /// Radius of the arcs.
    FilletRadius,
    /// Width of the ends: that of the block.
    Width,
    /// Length of the block.
    Length,
}

impl DumbbellDimension {
    /// Its name in JSON, with its unit.
    pub fn name(self) -> &'static str {
        match self {
            DumbbellDimension::GaugeWidth => "gauge_width_mm",
            DumbbellDimension::GaugeLength => "gauge_length_mm",
            DumbbellDimension::FilletRadius => "fillet_radius_mm",
            DumbbellDimension::Width => "width_mm",
            DumbbellDimension::Length => "length_mm",
        }
    }
}

/// A dimension that does not go with the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DumbbellMisfit {
    /// Which.
    pub dimension: DumbbellDimension,
    /// Its value, mm.
    pub value_mm: f64,
    /// The smallest that goes with the others, mm.
    pub min_mm: f64,
    /// The largest, mm; infinite where there is none.
    pub max_mm: f64,
}

impl Dumbbell {
    /// Which dimensions do not go with the others and with length and width of the whole; empty for a dumb-bell that
    /// can be drawn.
    pub fn misfits(&self, whole_mm: [f64; 2]) -> Vec<DumbbellMisfit> {
        let is_kept = |(_, value, min, max): &(_, f64, f64, f64)| {
            *value >= min * (1.0 - ROUNDING) && *value <= max * (1.0 + ROUNDING)
        };
        let misfit = |(dimension, value_mm, min_mm, max_mm)| DumbbellMisfit { dimension, value_mm, min_mm, max_mm };
        self.limits(whole_mm).into_iter().filter(|limit| !is_kept(limit)).map(misfit).collect()
    }

    /// How far each dimension is from the limits that the others set, mm; negative where it does not go with them.
    pub fn slacks_mm(&self, whole_mm: [f64; 2]) -> Vec<f64> {
        let both = self.limits(whole_mm).map(|(_, value, min, max)| [value - min, max - value]);
        both.into_iter().flatten().filter(|slack| *slack < f64::INFINITY).collect()
    }

    /// Each dimension with the smallest and the largest that go with the others, mm.
    fn limits(&self, whole_mm: [f64; 2]) -> [(DumbbellDimension, f64, f64, f64); 4] {
        use DumbbellDimension as D;
        let [length_mm, width_mm] = whole_mm;
        let profile = Profile::new(self, whole_mm);
        let shortest_mm = 2.0 * profile.knots_mm()[2] + 2.0 * MIN_TAB_RATIO * width_mm;
        let rise_mm = 0.5 * (width_mm - self.gauge_width_mm);
        // Four arcs that are as long in x as the whole: 16 a² = 16 (R − rise/4) rise.
        let flattest_mm = length_mm.powi(2) / (16.0 * rise_mm) + 0.25 * rise_mm;
        [
            (D::GaugeWidth, self.gauge_width_mm, MIN_GAUGE_RATIO * width_mm, width_mm - MIN_WIDENING_MM),
            (D::GaugeLength, self.gauge_length_mm, MIN_GAUGE_ASPECT * self.gauge_width_mm, f64::INFINITY),
            (D::FilletRadius, self.fillet_radius_mm, rise_mm, flattest_mm),
            (D::Length, length_mm, shortest_mm, f64::INFINITY),
        ]
    }
}

/// The side of a dumb-bell as a curve: h(x) and what follows from it. Lengths in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// w.
    half_gauge: f64,
    /// e.
    half_end: f64,
    /// g.
    gauge_end: f64,
    /// R.
    radius: f64,
    /// a.
    arc_length_x: f64,
    /// Half of the whole length.
    half_length: f64,
}

/// One arc of the outline in the quarter x > 0, z > 0; the others are its mirror images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlineArc {
    /// Centre (x, z), mm.
    pub center_mm: [f64; 2],
    /// Where the arc begins, nearer to the gauge, mm.
    pub start_mm: [f64; 2],
    /// Where it ends, mm.
    pub end_mm: [f64; 2],
}

impl Profile {
    /// The side of a dumb-bell with this length and width of the whole, mm. Of dimensions that do not go together
    /// ([`Dumbbell::misfits`]) it is no curve, but every function of it still returns.
    pub fn new(dumbbell: &Dumbbell, [length_mm, width_mm]: [f64; 2]) -> Profile {
        let (half_gauge, half_end) = (0.5 * dumbbell.gauge_width_mm, 0.5 * width_mm);
        let radius = dumbbell.fillet_radius_mm;
        let cosine = 1.0 - (half_end - half_gauge) / (2.0 * radius);
        Profile {
            half_gauge,
            half_end,
            gauge_end: 0.5 * dumbbell.gauge_length_mm,
            radius,
            arc_length_x: radius * (1.0 - cosine * cosine).max(0.0).sqrt(),
            half_length: 0.5 * length_mm,
        }
    }

    /// R, mm.
    pub fn radius_mm(&self) -> f64 {
        self.radius
    }

    /// e/w: how much wider the ends are than the gauge.
    pub fn widening(&self) -> f64 {
        self.half_end / self.half_gauge
    }

    /// Positions x > 0 at which the side changes its curve, mm: g, g + a and g + 2a.
    pub fn knots_mm(&self) -> [f64; 3] {
        let (start, arc) = (self.gauge_end, self.arc_length_x);
        [start, start + arc, start + 2.0 * arc]
    }

    /// h at `x_mm`, mm. Beyond the ends it continues as the ends' half-width.
    pub fn half_width_mm(&self, x_mm: f64) -> f64 {
        let (radius, arc) = (self.radius, self.arc_length_x);
        let from_gauge = x_mm.abs() - self.gauge_end;
        if from_gauge <= 0.0 {
            self.half_gauge
        } else if from_gauge <= arc {
            self.half_gauge + radius - (radius * radius - from_gauge * from_gauge).sqrt()
        } else if from_gauge < 2.0 * arc {
            let to_end = 2.0 * arc - from_gauge;
            self.half_end - radius + (radius * radius - to_end * to_end).sqrt()
        } else {
            self.half_end
        }
    }

    /// How the side's point at `x_mm` moves as a dimension grows by a millimetre: outwards along x, and away from the
    /// middle line. Gauge, arcs and ends each stretch in themselves, so that a point at a knot stays at it and a point
    /// of the side stays on the side to first order.
    pub fn rate(&self, x_mm: f64, dimension: DumbbellDimension) -> [f64; 2] {
        let half_of = |of: DumbbellDimension| if dimension == of { 0.5 } else { 0.0 };
        let d_gauge = half_of(DumbbellDimension::GaugeWidth);
        let d_start = half_of(DumbbellDimension::GaugeLength);
        let d_radius = 2.0 * half_of(DumbbellDimension::FilletRadius);
        let d_end = half_of(DumbbellDimension::Width);
        let d_length = half_of(DumbbellDimension::Length);
        let (radius, arc) = (self.radius, self.arc_length_x);
        // a² = R² − q² with q = R − (e − w)/2.
        let adjacent = radius - 0.5 * (self.half_end - self.half_gauge);
        let d_arc = (radius * d_radius - adjacent * (d_radius - 0.5 * (d_end - d_gauge))) / arc;
        let [start, middle, end] = self.knots_mm();
        let x = x_mm.abs();
        // R − √(R² − s²), where s is a part of the arc.
        let d_sagitta = |part: f64| {
            let (s, d_s) = (part * arc, part * d_arc);
            d_radius - (radius * d_radius - s * d_s) / (radius * radius - s * s).sqrt()
        };
        if x <= start {
            [d_start * x / start, d_gauge]
        } else if x <= middle {
            let part = (x - start) / arc;
            [d_start + part * d_arc, d_gauge + d_sagitta(part)]
        } else if x < end {
            let part = (end - x) / arc;
            [d_start + (2.0 - part) * d_arc, d_end - d_sagitta(part)]
        } else {
            let part = (x - end) / (self.half_length - end);
            [(1.0 - part) * (d_start + 2.0 * d_arc) + part * d_length, d_end]
        }
    }

    /// Area of the whole outline, mm². The areas under the two arcs of a transition add up to their length times the
    /// mean half-width, because one is the other turned by half a turn.
    pub fn area_mm2(&self) -> f64 {
        let quarter = self.gauge_end * self.half_gauge
            + 2.0 * self.arc_length_x * 0.5 * (self.half_gauge + self.half_end)
            + (self.half_length - self.gauge_end - 2.0 * self.arc_length_x) * self.half_end;
        4.0 * quarter
    }

    /// Area between one arc and the straight side that it leaves, mm²: what of the outline is curved.
    pub fn curved_area_mm2(&self) -> f64 {
        let (radius, arc) = (self.radius, self.arc_length_x);
        let adjacent = (radius * radius - arc * arc).max(0.0).sqrt();
        radius * arc - 0.5 * (arc * adjacent + radius * radius * (arc / radius).asin())
    }

    /// The two arcs of the quarter x > 0, z > 0, from the gauge outwards.
    pub fn arcs(&self) -> [OutlineArc; 2] {
        let [first, second, third] = self.knots_mm();
        let start = [first, self.half_gauge];
        let middle = [second, 0.5 * (self.half_gauge + self.half_end)];
        let end = [third, self.half_end];
        [
            OutlineArc { center_mm: [first, self.half_gauge + self.radius], start_mm: start, end_mm: middle },
            OutlineArc { center_mm: [third, self.half_end - self.radius], start_mm: middle, end_mm: end },
        ]
    }

    /// Length over which the gauge's strain, taken as uniform, would give the whole elongation, mm:
    /// ∫ (gauge width / width) dx, the estimate for equal force in every section.
    pub fn effective_length_mm(&self) -> f64 {
        // Midpoint rule over a transition: 200 intervals give 1e-6 relative, far below what the estimate is worth.
        const INTERVALS: usize = 200;
        let (start, arc) = (self.gauge_end, self.arc_length_x);
        let step = 2.0 * arc / INTERVALS as f64;
        let transition: f64 =
            (0..INTERVALS).map(|i| step * self.half_gauge / self.half_width_mm(start + (i as f64 + 0.5) * step)).sum();
        let end = (self.half_length - start - 2.0 * arc) * self.half_gauge / self.half_end;
        2.0 * (start + transition + end)
    }

    /// Signed distance from a point of the section to the side z > 0, and the unit vector from the point towards its
    /// nearest point of that side. Positive inside. mm.
    pub(crate) fn distance_to_upper_side(&self, point: [f64; 2]) -> (f64, [f64; 2]) {
        // The side is symmetric in x: work at |x|, and turn the direction back at the end.
        let sign = if point[0] < 0.0 { -1.0 } else { 1.0 };
        let p = [point[0].abs(), point[1]];
        let [rise, settle] = self.arcs();
        let mut nearest = [p[0].min(self.gauge_end), self.half_gauge];
        let mut consider = |candidate: [f64; 2]| {
            if distance(p, candidate) < distance(p, nearest) {
                nearest = candidate;
            }
        };
        consider([p[0].min(self.half_length).max(settle.end_mm[0]), self.half_end]);
        for arc in [rise, settle] {
            consider(arc.start_mm);
            consider(arc.end_mm);
            let offset = [p[0] - arc.center_mm[0], p[1] - arc.center_mm[1]];
            let norm = offset[0].hypot(offset[1]);
            if norm > 0.0 {
                let scale = self.radius / norm;
                let foot = [arc.center_mm[0] + scale * offset[0], arc.center_mm[1] + scale * offset[1]];
                let is_in_x = foot[0] >= arc.start_mm[0] && foot[0] <= arc.end_mm[0];
                let is_in_z = foot[1] >= arc.start_mm[1] && foot[1] <= arc.end_mm[1];
                if is_in_x && is_in_z {
                    consider(foot);
                }
            }
        }
        let length = distance(p, nearest);
        let direction =
            if length > 0.0 { [sign * (nearest[0] - p[0]) / length, (nearest[1] - p[1]) / length] } else { [0.0, 1.0] };
        let is_inside = p[1] < self.half_width_mm(p[0]);
        (if is_inside { length } else { -length }, direction)
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
#[path = "dumbbell_tests.rs"]
mod tests;
