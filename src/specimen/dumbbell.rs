//! The ISO 37 type 4 dumb-bell: dimensions and outline.
//!
//! The half-width is 1 mm up to |x| = 6, then rises to 3 mm by two tangent arcs of radius 3, each through the
//! angle θ with cos θ = 2/3 and 3 sin θ = √5 mm long in x, then stays 3 mm up to the ends. The outline is C¹.
//! Source: ISO 37, table of dumb-bell dimensions, type 4.

/// Overall length, mm.
pub const LENGTH_MM: f64 = 35.0;
/// Width of the ends, mm.
pub const END_WIDTH_MM: f64 = 6.0;
/// Length of the narrow portion, mm.
pub const NARROW_LENGTH_MM: f64 = 12.0;
/// Width of the narrow portion, mm.
pub const NARROW_WIDTH_MM: f64 = 2.0;
/// Radius of both transition arcs, mm.
pub const TRANSITION_RADIUS_MM: f64 = 3.0;
/// Thickness, mm.
pub const THICKNESS_MM: f64 = 2.0;

const HALF_NARROW: f64 = 0.5 * NARROW_WIDTH_MM;
const HALF_END: f64 = 0.5 * END_WIDTH_MM;
const NARROW_END_X: f64 = 0.5 * NARROW_LENGTH_MM;

/// Length in x of one transition arc, mm: R sin θ with R cos θ = R − (rise of one arc).
pub fn arc_length_x_mm() -> f64 {
    let adjacent = TRANSITION_RADIUS_MM - 0.5 * (HALF_END - HALF_NARROW);
    (TRANSITION_RADIUS_MM * TRANSITION_RADIUS_MM - adjacent * adjacent).sqrt()
}

/// Half-width at `x_mm`, mm. Beyond the ends it continues as the ends' half-width.
pub fn half_width_mm(x_mm: f64) -> f64 {
    let radius = TRANSITION_RADIUS_MM;
    let arc = arc_length_x_mm();
    let from_narrow = x_mm.abs() - NARROW_END_X;
    if from_narrow <= 0.0 {
        HALF_NARROW
    } else if from_narrow <= arc {
        HALF_NARROW + radius - (radius * radius - from_narrow * from_narrow).sqrt()
    } else if from_narrow < 2.0 * arc {
        let to_end = 2.0 * arc - from_narrow;
        HALF_END - radius + (radius * radius - to_end * to_end).sqrt()
    } else {
        HALF_END
    }
}

/// Area of the whole outline, mm². The areas under the two arcs of a transition add up to their length times
/// the mean half-width, because one is the other turned by half a turn.
pub fn area_mm2() -> f64 {
    let arc = arc_length_x_mm();
    let quarter = NARROW_END_X * HALF_NARROW
        + 2.0 * arc * 0.5 * (HALF_NARROW + HALF_END)
        + (0.5 * LENGTH_MM - NARROW_END_X - 2.0 * arc) * HALF_END;
    4.0 * quarter
}

/// One arc of the outline in the quarter x > 0, z > 0; the others are its mirror images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlineArc {
    /// Centre (x, z), mm.
    pub center_mm: [f64; 2],
    /// Where the arc begins, nearer to the narrow portion, mm.
    pub start_mm: [f64; 2],
    /// Where it ends, mm.
    pub end_mm: [f64; 2],
}

/// The two transition arcs of the quarter x > 0, z > 0, from the narrow portion outwards.
pub fn arcs() -> [OutlineArc; 2] {
    let arc = arc_length_x_mm();
    let start = [NARROW_END_X, HALF_NARROW];
    let middle = [NARROW_END_X + arc, 0.5 * (HALF_NARROW + HALF_END)];
    let end = [NARROW_END_X + 2.0 * arc, HALF_END];
    let radius = TRANSITION_RADIUS_MM;
    [
        OutlineArc { center_mm: [NARROW_END_X, HALF_NARROW + radius], start_mm: start, end_mm: middle },
        OutlineArc { center_mm: [end[0], HALF_END - radius], start_mm: middle, end_mm: end },
    ]
}

/// Length over which the narrow portion's strain, taken as uniform, would give the whole elongation, mm:
/// ∫ (narrow width / width) dx, the estimate for equal force in every section.
pub fn effective_length_mm() -> f64 {
    // Midpoint rule over a transition: 200 intervals give 1e-6 relative, far below what the estimate is worth.
    const INTERVALS: usize = 200;
    let arc = arc_length_x_mm();
    let step = 2.0 * arc / INTERVALS as f64;
    let transition: f64 =
        (0..INTERVALS).map(|i| step * HALF_NARROW / half_width_mm(NARROW_END_X + (i as f64 + 0.5) * step)).sum();
    let end = (0.5 * LENGTH_MM - NARROW_END_X - 2.0 * arc) * HALF_NARROW / HALF_END;
    2.0 * (NARROW_END_X + transition + end)
}

/// Signed distance from a point of the section to the side z > 0 of the outline, and the unit vector from the
/// point towards its nearest point of that side. Positive inside. mm.
pub(crate) fn distance_to_upper_side(point: [f64; 2]) -> (f64, [f64; 2]) {
    // The side is symmetric in x: work at |x|, and turn the direction back at the end.
    let sign = if point[0] < 0.0 { -1.0 } else { 1.0 };
    let p = [point[0].abs(), point[1]];
    let [rise, settle] = arcs();
    let mut nearest = [p[0].clamp(0.0, NARROW_END_X), HALF_NARROW];
    let mut consider = |candidate: [f64; 2]| {
        if distance(p, candidate) < distance(p, nearest) {
            nearest = candidate;
        }
    };
    consider([p[0].clamp(settle.end_mm[0], 0.5 * LENGTH_MM), HALF_END]);
    for arc in [rise, settle] {
        consider(arc.start_mm);
        consider(arc.end_mm);
        let offset = [p[0] - arc.center_mm[0], p[1] - arc.center_mm[1]];
        let norm = offset[0].hypot(offset[1]);
        if norm > 0.0 {
            let scale = TRANSITION_RADIUS_MM / norm;
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
    let is_inside = p[1] < half_width_mm(p[0]);
    (if is_inside { length } else { -length }, direction)
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profile_is_continuous_with_continuous_slope() {
        assert!((arc_length_x_mm() - 5f64.sqrt()).abs() < 1e-14);
        let arc = arc_length_x_mm();
        // Step of the one-sided differences; the slope error is of the order step / radius.
        let h = 1e-6;
        for x in [6.0, 6.0 + arc, 6.0 + 2.0 * arc] {
            let (before, at, after) = (half_width_mm(x - h), half_width_mm(x), half_width_mm(x + h));
            assert!(((at - before) / h - (after - at) / h).abs() < 1e-5, "kink at {x}");
        }
        assert!((half_width_mm(6.0 + arc) - 2.0).abs() < 1e-14);
        assert_eq!(half_width_mm(-0.5), 1.0);
        assert_eq!(half_width_mm(-17.0), 3.0);
    }

    #[test]
    fn area_equals_the_integral_of_the_profile() {
        let n = 200_000;
        let step = LENGTH_MM / n as f64;
        let sum: f64 = (0..n).map(|i| 2.0 * half_width_mm(-0.5 * LENGTH_MM + (i as f64 + 0.5) * step) * step).sum();
        // Midpoint rule on a C1 profile: error of the order step².
        assert!((sum - area_mm2()).abs() < 1e-6);
        assert!((area_mm2() - 4.0 * (40.5 - 2.0 * 5f64.sqrt())).abs() < 1e-12);
    }

    #[test]
    fn distance_to_the_side_equals_a_dense_search() {
        let side: Vec<[f64; 2]> = (0..=350_000)
            .map(|i| {
                let x = -17.5 + i as f64 * 1e-4;
                [x, half_width_mm(x)]
            })
            .collect();
        for p in [[0.0, 0.0], [7.0, 0.4], [-8.5, 1.2], [9.5, -1.0], [14.0, 2.0], [-16.0, -2.0], [6.5, 3.5], [8.0, 2.6]]
        {
            let brute = side.iter().map(|q| distance(p, *q)).fold(f64::INFINITY, f64::min);
            let (exact, direction) = distance_to_upper_side(p);
            // Dense points are 1e-4 apart: the search exceeds the distance by at most (1e-4)²/distance.
            assert!((exact.abs() - brute).abs() < 1e-6, "{p:?}: {exact} against {brute}");
            assert_eq!(exact > 0.0, p[1] < half_width_mm(p[0]));
            let foot = [p[0] + exact.abs() * direction[0], p[1] + exact.abs() * direction[1]];
            assert!((foot[1] - half_width_mm(foot[0])).abs() < 1e-9);
        }
    }
}
