//! The side of dumb-bells against dense sums, searches and differences.

use super::*;

fn standard() -> Profile {
    Profile::new(&ISO37_TYPE4, [ISO37_LENGTH_MM, ISO37_WIDTH_MM])
}

/// The standard's, a stocky one, one that hardly widens, and one whose sides rise by 60°.
fn profiles() -> Vec<(Dumbbell, [f64; 2])> {
    let of = |gauge_width_mm, gauge_length_mm, fillet_radius_mm, length_mm, width_mm| {
        let dumbbell = Dumbbell { gauge_width_mm, gauge_length_mm, fillet_radius_mm };
        (dumbbell, [length_mm, width_mm])
    };
    let all = vec![
        (ISO37_TYPE4, [ISO37_LENGTH_MM, ISO37_WIDTH_MM]),
        of(5.0, 4.0, 8.0, 40.0, 12.0),
        of(11.7, 9.0, 5.0, 40.0, 12.0),
        of(4.0, 10.0, 4.0, 40.0, 12.0),
    ];
    assert!(all.iter().all(|(dumbbell, whole)| dumbbell.misfits(*whole).is_empty()));
    all
}

#[test]
fn profile_is_continuous_with_continuous_slope() {
    for (dumbbell, whole) in profiles() {
        let profile = Profile::new(&dumbbell, whole);
        // Step of the one-sided differences; the slope error is of the order step / radius × (1/cos θ)³ ≤ 8.
        let h = 1e-6;
        for x in profile.knots_mm() {
            let [before, at, after] = [x - h, x, x + h].map(|x| profile.half_width_mm(x));
            assert!(((at - before) / h - (after - at) / h).abs() < 1e-5, "kink at {x} of {dumbbell:?}");
        }
        assert!((profile.half_width_mm(-0.5) - 0.5 * dumbbell.gauge_width_mm).abs() < 1e-14);
        assert!((profile.half_width_mm(-0.5 * whole[0]) - 0.5 * whole[1]).abs() < 1e-14);
    }
    let [_, middle, _] = standard().knots_mm();
    // R sin θ with cos θ = 2/3 is √5.
    assert!((middle - 6.0 - 5f64.sqrt()).abs() < 1e-14);
    assert!((standard().half_width_mm(middle) - 2.0).abs() < 1e-14);
}

#[test]
fn area_equals_the_integral_of_the_profile() {
    let n = 200_000;
    for (dumbbell, whole) in profiles() {
        let profile = Profile::new(&dumbbell, whole);
        let step = whole[0] / n as f64;
        let at = |i: usize| profile.half_width_mm(-0.5 * whole[0] + (i as f64 + 0.5) * step);
        let sum: f64 = (0..n).map(|i| 2.0 * at(i) * step).sum();
        // Midpoint rule on a C1 profile: error of the order step².
        assert!((sum - profile.area_mm2()).abs() < 1e-6);
        let [start, middle, _] = profile.knots_mm();
        let fine = (middle - start) / n as f64;
        let rises = |i: usize| profile.half_width_mm(start + (i as f64 + 0.5) * fine) - 0.5 * dumbbell.gauge_width_mm;
        let curved: f64 = (0..n).map(|i| rises(i) * fine).sum();
        assert!((curved - profile.curved_area_mm2()).abs() < 1e-6, "{curved}");
    }
    assert!((standard().area_mm2() - 4.0 * (40.5 - 2.0 * 5f64.sqrt())).abs() < 1e-12);
}

#[test]
fn distance_to_the_side_equals_a_dense_search() {
    for (dumbbell, whole) in profiles() {
        let profile = Profile::new(&dumbbell, whole);
        let half = 0.5 * whole[0];
        let steps = (half * 2e4) as usize;
        let point_at = |i: usize| {
            let x = -half + i as f64 * 1e-4;
            [x, profile.half_width_mm(x)]
        };
        let side: Vec<[f64; 2]> = (0..=steps).map(point_at).collect();
        let high = 0.5 * whole[1];
        for [x, z] in [[0.0, 0.0], [0.4, 0.13], [-0.5, 0.4], [0.55, -0.33], [0.8, 0.66], [-0.9, -0.66], [0.4, 1.1]] {
            let p = [x * half, z * high];
            let brute = side.iter().map(|q| distance(p, *q)).fold(f64::INFINITY, f64::min);
            let (exact, direction) = profile.distance_to_upper_side(p);
            // Dense points are 1e-4 apart, up to twice that along the side: the search exceeds the distance by at most
            // (1e-4)²/distance.
            assert!((exact.abs() - brute).abs() < 1e-6, "{p:?}: {exact} against {brute}");
            assert_eq!(exact > 0.0, p[1] < profile.half_width_mm(p[0]));
            let foot = [p[0] + exact.abs() * direction[0], p[1] + exact.abs() * direction[1]];
            assert!((foot[1] - profile.half_width_mm(foot[0])).abs() < 1e-9);
        }
    }
}

/// A point that moves as the rates say stays on the side of the changed dumb-bell to second order, and one at a knot
/// stays at it.
#[test]
fn rates_are_derivatives_of_the_side() {
    use DumbbellDimension as D;
    for (dumbbell, whole) in profiles() {
        let profile = Profile::new(&dumbbell, whole);
        for dimension in [D::GaugeWidth, D::GaugeLength, D::FilletRadius, D::Width, D::Length] {
            let changed = |by: f64| {
                let (mut d, mut b) = (dumbbell, whole);
                match dimension {
                    D::GaugeWidth => d.gauge_width_mm += by,
                    D::GaugeLength => d.gauge_length_mm += by,
                    D::FilletRadius => d.fillet_radius_mm += by,
                    D::Width => b[1] += by,
                    D::Length => b[0] += by,
                }
                Profile::new(&d, b)
            };
            let h = 1e-4;
            for share in [0.0, 0.1, 0.31, 0.36, 0.42, 0.5, 0.6, 0.75, 1.0] {
                let x = share * 0.5 * whole[0];
                let [along, across] = profile.rate(-x, dimension);
                let off = |by: f64| changed(by).half_width_mm(x + by * along) - profile.half_width_mm(x) - by * across;
                // The odd part is O(h³) where the rate is right; a wrong rate leaves O(h).
                let odd = 0.5 * (off(h) - off(-h)) / h;
                assert!(odd.abs() < 1e-6, "{dimension:?} at {x} of {dumbbell:?}: {odd:e}");
            }
            for (n, knot) in profile.knots_mm().into_iter().enumerate() {
                let slope = (changed(h).knots_mm()[n] - changed(-h).knots_mm()[n]) / (2.0 * h);
                assert!((slope - profile.rate(knot, dimension)[0]).abs() < 1e-5, "{dimension:?}, knot {n}");
            }
        }
    }
}

#[test]
fn dimensions_that_do_not_go_together_are_told() {
    use DumbbellDimension as D;
    let fits = (Dumbbell { gauge_width_mm: 6.0, gauge_length_mm: 10.0, fillet_radius_mm: 5.0 }, [40.0, 12.0]);
    let told = |change: &dyn Fn(&mut Dumbbell, &mut [f64; 2])| {
        let (mut dumbbell, mut whole) = fits;
        change(&mut dumbbell, &mut whole);
        dumbbell.misfits(whole).into_iter().map(|m| m.dimension).collect::<Vec<_>>()
    };
    assert_eq!(told(&|_, _| {}), []);
    assert_eq!(told(&|d, _| d.gauge_width_mm = 11.95), [D::GaugeWidth]);
    assert_eq!(told(&|d, _| d.gauge_width_mm = f64::NAN)[0], D::GaugeWidth);
    assert_eq!(told(&|d, _| d.gauge_length_mm = 30.0), [D::Length]);
    assert_eq!(told(&|d, _| d.gauge_length_mm = 0.5), [D::GaugeLength]);
    assert_eq!(told(&|d, _| d.fillet_radius_mm = 2.9), [D::FilletRadius]);
    // Flat beyond what the digits of its arc's length tell.
    assert_eq!(told(&|d, _| d.fillet_radius_mm = 1e300), [D::FilletRadius]);
    assert_eq!(told(&|_, b| b[0] = 20.0), [D::Length]);
    // The narrowest gauge of all needs a radius that goes with it.
    assert_eq!(told(&|d, _| (d.gauge_width_mm, d.fillet_radius_mm) = (1.5, 5.25)), []);
    assert_eq!(told(&|d, _| (d.gauge_width_mm, d.fillet_radius_mm) = (1.4, 6.0)), [D::GaugeWidth]);
}
