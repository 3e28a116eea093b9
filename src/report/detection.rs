//! Probability of detection against size, one small plot per cause.

use super::axis::Axis;
use super::color::{MUTED, SERIES};
use super::frame::Frame;
use super::svg::{SMALL, Svg, TextStyle};
use crate::proof::{CauseOfSeveral, ExperimentKind, SeveralProof};

const COLUMNS: usize = 4;
const PLOT: [f64; 2] = [190.0, 120.0];
const CELL: [f64; 2] = [260.0, 205.0];
const TOP: f64 = 50.0;
const LEFT: f64 = 50.0;
/// Points of a drawn curve.
const POINTS: usize = 80;

/// For each hidden cause: found (above) and missed (below) against the size of its own effect, the fitted probability,
/// its lower 95 % bound, and the size found with 90 % probability with 95 % confidence.
pub fn detection_picture(proof: &SeveralProof) -> String {
    let causes: Vec<&CauseOfSeveral> = proof.causes.iter().filter(|c| c.num_hidden > 0).collect();
    let of = |cause: &CauseOfSeveral| -> Vec<(f64, bool)> {
        let several = proof.scored.iter().filter(|s| s.kind == ExperimentKind::Several);
        let hidden = several.flat_map(|s| &s.causes).filter(|c| c.cause == cause.cause);
        hidden.map(|c| (1e3 * c.own_effect_rms_mm, c.is_named)).filter(|c| c.0 > 0.0).collect()
    };
    let all = causes.iter().flat_map(|c| of(c)).map(|c| c.0);
    let Some(horizontal) = Axis::covering(all, true, 0.03) else {
        return Svg::placeholder("Probability of detection", "no cause was hidden");
    };
    let num_rows = causes.len().div_ceil(COLUMNS);
    let mut svg = Svg::new(LEFT + CELL[0] * COLUMNS as f64, TOP + CELL[1] * num_rows as f64);
    let title =
        "Probability of detection against the size of a cause's own effect (thin: exceeded with 95 % confidence)";
    svg.text([12.0, 24.0], title, &TextStyle::title());
    let (low, high) = (horizontal.low, horizontal.high);
    for (n, cause) in causes.into_iter().enumerate() {
        let area =
            [LEFT + CELL[0] * (n % COLUMNS) as f64, TOP + 24.0 + CELL[1] * (n / COLUMNS) as f64, PLOT[0], PLOT[1]];
        let frame = Frame { area, horizontal, vertical: Axis::linear(0.0, 1.0) };
        frame.draw_grid(&mut svg, 0, 5);
        frame.draw_bottom(&mut svg, "own effect, μm rms", 4);
        frame.draw_left(&mut svg, "", 5, 34.0);
        let mut label = cause.cause.name().to_string();
        if let Some(curve) = &cause.detection {
            let sizes: Vec<f64> = (0..=POINTS).map(|k| low * (high / low).powf(k as f64 / POINTS as f64)).collect();
            let drawn = |p: &dyn Fn(f64) -> f64| -> Vec<[f64; 2]> {
                sizes.iter().map(|s| frame.at([*s, p(1e-3 * s)])).collect()
            };
            svg.polyline(&drawn(&|a| curve.lower_bound(a)), SERIES[1], 0.8);
            svg.polyline(&drawn(&|a| curve.probability(a)), SERIES[1], 2.0);
            if let Some(size) = curve.a90_95_mm.map(|a| 1e3 * a).filter(|a| *a < high) {
                svg.line(frame.at([size, 0.0]), frame.at([size, 1.0]), MUTED, 1.0, "4 3");
                label += &format!(": a90/95 {size:.0} μm");
            }
        }
        svg.text([area[0], area[1] - 8.0], &label, &TextStyle::new(SMALL));
        for (size, is_found) in of(cause) {
            let color = SERIES[if is_found { 2 } else { 3 }];
            svg.circle(frame.at([size, if is_found { 0.97 } else { 0.03 }]), 2.2, color, "#ffffff", 0.4);
        }
    }
    svg.finish("Probability of detection against size")
}
