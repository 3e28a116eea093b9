//! Balls from which fits of inclusions start.

use super::division::Division;
use super::score::Prepared;

/// Radii of the balls that are tried, as parts of the sample's smallest extent.
const BALL_RADII: [f64; 3] = [0.25, 0.35, 0.5];
/// Points per edge of a box that say which part of it lies in a ball.
const POINTS_PER_EDGE: usize = 3;
/// Most stiff and most soft balls from which a fit may start; each explains at least this part of what the best does.
const MAX_STARTS: usize = 4;
const LEAST_OF_BEST: f64 = 0.3;
/// Factors of a ball at the start, ln.
const LARGEST_START: f64 = 1.8;

/// A ball whose stiffness differs from that of its surroundings, as first order tells it.
#[derive(Clone, Debug)]
pub struct Ball {
    /// Fall of the deviance to first order.
    pub explained: f64,
    /// Centre, mm.
    pub center_mm: [f64; 3],
    /// Radius, mm.
    pub radius_mm: f64,
    /// ln of the stiffness factor.
    pub log_factor: f64,
    /// Half extents of the block, mm.
    pub half_mm: [f64; 3],
}

/// Parts that a ball meets, each with the part of it that lies in the ball.
fn parts_in_ball(division: &Division, center_mm: [f64; 3], radius_mm: f64) -> Vec<(usize, f64)> {
    let size = [0, 1, 2].map(|a| 2.0 * division.half_mm[a] / division.counts[a] as f64);
    let range = [0, 1, 2].map(|a| {
        let low = ((center_mm[a] - radius_mm + division.half_mm[a]) / size[a]).floor().max(0.0) as usize;
        let high = ((center_mm[a] + radius_mm + division.half_mm[a]) / size[a]).ceil().max(0.0) as usize;
        low..high.min(division.counts[a])
    });
    let mut found = Vec::new();
    let points = POINTS_PER_EDGE.pow(3);
    for k in range[2].clone() {
        for j in range[1].clone() {
            for i in range[0].clone() {
                let inside = (0..points)
                    .filter(|p| {
                        let n =
                            [p % POINTS_PER_EDGE, p / POINTS_PER_EDGE % POINTS_PER_EDGE, p / POINTS_PER_EDGE.pow(2)];
                        let square: f64 = (0..3)
                            .map(|a| {
                                let part = (n[a] as f64 + 0.5) / POINTS_PER_EDGE as f64;
                                let x = ([i, j, k][a] as f64 + part) * size[a] - division.half_mm[a];
                                (x - center_mm[a]).powi(2)
                            })
                            .sum();
                        square < radius_mm * radius_mm
                    })
                    .count();
                if inside > 0 {
                    found.push((i + division.counts[0] * (j + division.counts[1] * k), inside as f64 / points as f64));
                }
            }
        }
    }
    found
}

/// Balls by what they explain to first order, the modulus of each box changed in proportion to its part in the ball.
///
/// The result holds the best first; balls of one sign are apart from each other by more than a radius.
pub(super) fn best_balls(division: &Division, prepared: &Prepared) -> Vec<Ball> {
    let half = division.half_mm;
    let smallest = half.iter().fold(f64::INFINITY, |s, h| s.min(2.0 * h));
    let mut all: Vec<Ball> = Vec::new();
    for radius in BALL_RADII.map(|part| part * smallest) {
        let steps = half.map(|h| (4.0 * h / radius).ceil() as usize);
        let at = |a: usize, i: usize| half[a] * ((2 * i + 1) as f64 / steps[a] as f64 - 1.0);
        for k in 0..steps[2] {
            for j in 0..steps[1] {
                for i in 0..steps[0] {
                    let center_mm = [at(0, i), at(1, j), at(2, k)];
                    let members = parts_in_ball(division, center_mm, radius);
                    let (explained, coefficient) = prepared.of_weighted(&members);
                    let log_factor = log_factor_of_ball(coefficient);
                    all.push(Ball { explained, center_mm, radius_mm: radius, log_factor, half_mm: half });
                }
            }
        }
    }
    all.sort_by(|a, b| b.explained.total_cmp(&a.explained));
    let mut chosen: Vec<Ball> = Vec::new();
    for ball in all {
        let is_new = chosen.iter().all(|o| {
            let distance: f64 = (0..3).map(|a| (o.center_mm[a] - ball.center_mm[a]).powi(2)).sum::<f64>().sqrt();
            distance > o.radius_mm.max(ball.radius_mm) || o.log_factor * ball.log_factor < 0.0
        });
        let best = chosen.first().map_or(0.0, |c| c.explained);
        let alike = chosen.iter().filter(|o| o.log_factor * ball.log_factor > 0.0).count();
        if ball.explained > 0.0 && ball.explained >= LEAST_OF_BEST * best && is_new && alike < MAX_STARTS {
            chosen.push(ball);
        }
    }
    chosen
}

/// ln of the stiffness factor f of a ball whose first-order change is `change`: a ball of an incompressible solid takes
/// 5/(3 + 2 f) of the strain around it (Eshelby 1957), so that its effect is 5 (f − 1)/(3 + 2 f) and no more than 5/2.
pub(super) fn log_factor_of_ball(change: f64) -> f64 {
    let change = change.clamp(-1.6, 2.4);
    ((5.0 + 3.0 * change) / (5.0 - 2.0 * change)).ln().clamp(-LARGEST_START, LARGEST_START)
}

/// The first-order change of a ball with this ln of its stiffness factor: the inverse of [`log_factor_of_ball`] within
/// its limits.
pub(super) fn change_of_ball(log_factor: f64) -> f64 {
    let f = log_factor.exp();
    5.0 * (f - 1.0) / (3.0 + 2.0 * f)
}
