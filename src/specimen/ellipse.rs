//! Closed forms of an ellipse in its own frame, semi-axes a (along the first coordinate) ≥ b > 0.

/// Steps after which Newton's method for the nearest point has long converged: it is monotone, and gains at least half
/// a digit per step far from the root.
const MAX_STEPS: usize = 200;
/// Points nearer to the long axis than this part of the short semi-axis are on it: squares of such numbers underflow.
const ON_AXIS: f64 = 1e-20;
/// Steps of the arithmetic–geometric mean, which doubles its digits in each.
const MEAN_STEPS: i32 = 12;

/// The point of the ellipse that is nearest to `p`.
///
/// In the first quadrant it is (a² p₀/(s + a²), b² p₁/(s + b²)) with s the largest root of
/// (a p₀/(s + a²))² + (b p₁/(s + b²))² = 1, which is convex and falls for s > −b²: Newton's method from its left is
/// monotone. Source: D. Eberly, Distance from a Point to an Ellipse, an Ellipsoid, or a Hyperellipsoid (2013).
pub(super) fn nearest_point([a, b]: [f64; 2], p: [f64; 2]) -> [f64; 2] {
    let y = p.map(f64::abs);
    let first_quadrant = if y[1] > ON_AXIS * b {
        if y[0] > 0.0 { nearest_of_quadrant([a, b], y) } else { [0.0, b] }
    } else {
        // On the long axis: beyond the centre of curvature of the tip the tip is nearest.
        let (along, focal) = (a * y[0], a * a - b * b);
        if along < focal {
            let cosine = along / focal;
            [a * cosine, b * (1.0 - cosine * cosine).max(0.0).sqrt()]
        } else {
            [a, 0.0]
        }
    };
    [first_quadrant[0].copysign(p[0]), first_quadrant[1].copysign(p[1])]
}

fn nearest_of_quadrant([a, b]: [f64; 2], y: [f64; 2]) -> [f64; 2] {
    // With s = b² (t − 1): near the long axis t is tiny, and t − 1 would lose it.
    let ratio = (a / b) * (a / b);
    let z = [y[0] / a, y[1] / b];
    let (n0, n1, apart) = (ratio * z[0], z[1], ratio - 1.0);
    let excess = |t: f64| (n0 / (t + apart)).powi(2) + (n1 / t).powi(2) - 1.0;
    let slope = |t: f64| -2.0 * (n0 * n0 / (t + apart).powi(3) + n1 * n1 / t.powi(3));
    // Here the excess is positive: the second term alone is 1.
    let mut t = n1;
    for _ in 0..MAX_STEPS {
        let next = t - excess(t) / slope(t);
        if !(next > t) {
            break;
        }
        t = next;
    }
    [ratio * y[0] / (t + apart), y[1] / t]
}

/// Circumference, 4 a E(√(1 − b²/a²)), by the arithmetic–geometric mean: 2π (a² − Σ 2ⁿ⁻¹ cₙ²)/M(a, b) with
/// c₀² = a² − b² and cₙ₊₁ = (aₙ − bₙ)/2. Source: Abramowitz and Stegun, 17.6.
pub(super) fn perimeter([a, b]: [f64; 2]) -> f64 {
    let (mut mean, mut geometric) = (a, b);
    let mut sum = 0.5 * (a * a - b * b);
    for n in 1..=MEAN_STEPS {
        let c = 0.5 * (mean - geometric);
        (mean, geometric) = (0.5 * (mean + geometric), (mean * geometric).sqrt());
        sum += 2f64.powi(n - 1) * c * c;
    }
    std::f64::consts::TAU * (a * a - sum) / mean
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::{PI, TAU};

    #[test]
    fn perimeters() {
        // A circle, and the value of 4 E(√3/2) × 2 = 9.688448220547675 (a = 2, b = 1), to rounding.
        assert!((perimeter([3.0, 3.0]) - 6.0 * PI).abs() < 1e-13);
        assert!((perimeter([2.0, 1.0]) - 9.688_448_220_547_675).abs() < 1e-13);
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn nearest_points_are_nearest(b in 0.05..3.0f64, aspect in 1.0..5.0f64, x in -8.0..8.0f64, y in -8.0..8.0f64) {
            let a = aspect * b;
            let found = nearest_point([a, b], [x, y]);
            // On the ellipse, to rounding of the last division.
            prop_assert!(((found[0] / a).hypot(found[1] / b) - 1.0).abs() < 1e-9);
            let own = (found[0] - x).hypot(found[1] - y);
            const POINTS: usize = 4000;
            let at = |i: usize| TAU * i as f64 / POINTS as f64;
            let brute = (0..POINTS).map(|i| (a * at(i).cos() - x).hypot(b * at(i).sin() - y)).fold(f64::INFINITY, f64::min);
            // Points are at most 2π a/4000 apart: the search is above the distance by no more than half of that.
            prop_assert!(own <= brute + 1e-9 && brute <= own + PI * a / POINTS as f64, "{own} {brute}");
        }
    }

    #[test]
    fn points_on_the_axes() {
        assert_eq!(nearest_point([4.0, 1.0], [0.0, 0.0]), [0.0, 1.0]);
        assert_eq!(nearest_point([4.0, 1.0], [9.0, 0.0]), [4.0, 0.0]);
        assert_eq!(nearest_point([4.0, 1.0], [0.0, -3.0]), [0.0, -1.0]);
        // A hair off the long axis is the axis, in and beyond the tip's centre of curvature.
        for (x, hair) in [(9.0, 1e-17), (3.0, 1e-17), (9.0, 1e-19), (3.0, 1e-150)] {
            let (near, on) = (nearest_point([4.0, 1.0], [x, hair]), nearest_point([4.0, 1.0], [x, 0.0]));
            // Newton's steps end where rounding ends them.
            assert!((near[0] - on[0]).abs() < 1e-9 && (near[1] - on[1]).abs() < 1e-9, "{x} {hair}: {near:?} {on:?}");
        }
        // Inside the tip's centre of curvature (a² − b²)/a = 3.75 a side is nearest.
        assert!(nearest_point([4.0, 1.0], [3.0, 0.0])[1] > 0.5);
    }
}
