//! Places labels at holes so that none covers a hole, a centre line or another label.

use super::drawing::{Anchor, CHARACTER_WIDTH, TEXT_HEIGHT, Text};

/// A label and, where it stands beside its hole, the line to it.
pub(super) struct Label {
    pub text: Text,
    pub leader: Option<([f64; 2], [f64; 2])>,
}

type Box2 = [[f64; 2]; 2];

/// Clearance around a label, paper mm.
const CLEARANCE: f64 = 0.6;

/// Places one label for each circle (centre, radius; paper mm), all within `bounds` and off the two centre lines
/// through `center`. In the hole where it fits, else beside it with a leader. Where neither is possible the label
/// shrinks into its own circle, as circles never overlap.
pub(super) fn place_labels(
    circles: &[([f64; 2], f64)],
    labels: &[String],
    bounds: Box2,
    center: [f64; 2],
) -> Vec<Label> {
    let mut taken: Vec<Box2> = Vec::new();
    let mut placed = Vec::with_capacity(labels.len());
    for (index, ((middle, radius), content)) in circles.iter().zip(labels).enumerate() {
        let width = CHARACTER_WIDTH * TEXT_HEIGHT * content.chars().count() as f64;
        let text_at = |at: [f64; 2], height: f64| Text {
            at,
            height,
            anchor: Anchor::Start,
            is_vertical: false,
            content: content.clone(),
        };
        let inside = text_at([middle[0] + CLEARANCE, middle[1] + CLEARANCE], TEXT_HEIGHT);
        if fits_in_circle(inside.bounds(), *middle, radius - CLEARANCE) && is_free(inside.bounds(), &taken) {
            taken.push(inside.bounds());
            placed.push(Label { text: inside, leader: None });
            continue;
        }
        let beside = candidates(*middle, *radius, width).map(|at| text_at(at, TEXT_HEIGHT)).find(|text| {
            let outer = grow(text.bounds(), CLEARANCE);
            let is_in_bounds = (0..2).all(|k| outer[0][k] >= bounds[0][k] && outer[1][k] <= bounds[1][k]);
            let is_off_centre_lines = (0..2).all(|k| outer[1][k] <= center[k] || outer[0][k] >= center[k]);
            // A centre mark reaches past its circle by as much as 1.2 mm.
            let is_off_circles = circles.iter().all(|(c, r)| distance_to_box(*c, outer) >= r + r.min(1.2));
            is_in_bounds && is_off_centre_lines && is_off_circles && is_free(outer, &taken)
        });
        let label = match beside {
            Some(text) => {
                let [low, high] = text.bounds();
                let end = [0, 1].map(|k| middle[k].clamp(low[k] - 0.3, high[k] + 0.3));
                let offset = [end[0] - middle[0], end[1] - middle[1]];
                let length = offset[0].hypot(offset[1]);
                let start = [0, 1].map(|k| middle[k] + radius * offset[k] / length.max(f64::MIN_POSITIVE));
                Label { text, leader: Some((start, end)) }
            }
            None => {
                // The number alone, in the quadrant between the centre marks: a box of twice the height's width
                // for two digits has its far corner at 2.4 heights.
                let height = (radius / 2.6).min(TEXT_HEIGHT);
                let gap = 0.1 * height;
                let mut text = text_at([middle[0] + gap, middle[1] + gap], height);
                text.content = (index + 1).to_string();
                Label { text, leader: None }
            }
        };
        taken.push(label.text.bounds());
        placed.push(label);
    }
    placed
}

/// Places for a label of `width` beside a circle, nearest first: sixteen directions, growing distance.
fn candidates(middle: [f64; 2], radius: f64, width: f64) -> impl Iterator<Item = [f64; 2]> {
    (0..8).flat_map(move |ring| {
        let distance = radius + radius.min(1.2) + 1.2 + 1.6 * ring as f64;
        (0..16).map(move |i| {
            let angle = std::f64::consts::TAU * (i as f64 + 2.0) / 16.0;
            let anchor = [middle[0] + distance * angle.cos(), middle[1] + distance * angle.sin()];
            // The corner of the box that is nearest to the hole is at the anchor.
            let x = anchor[0] - width * (0.5 - 0.5 * angle.cos().clamp(-0.7, 0.7) / 0.7);
            let y = anchor[1] - TEXT_HEIGHT * (0.5 - 0.5 * angle.sin().clamp(-0.7, 0.7) / 0.7);
            [x, y]
        })
    })
}

fn grow([low, high]: Box2, by: f64) -> Box2 {
    [low.map(|c| c - by), high.map(|c| c + by)]
}

fn is_free(a: Box2, taken: &[Box2]) -> bool {
    taken.iter().all(|b| (0..2).any(|k| a[1][k] <= b[0][k] || b[1][k] <= a[0][k]))
}

fn distance_to_box(p: [f64; 2], [low, high]: Box2) -> f64 {
    let d = [0, 1].map(|k| p[k] - p[k].clamp(low[k], high[k]));
    d[0].hypot(d[1])
}

fn fits_in_circle([low, high]: Box2, middle: [f64; 2], radius: f64) -> bool {
    let far = [0, 1].map(|k| (low[k] - middle[k]).abs().max((high[k] - middle[k]).abs()));
    far[0].hypot(far[1]) <= radius
}

/// Moves increasing positions apart to at least `spacing`, each group of crowded ones keeping its mean.
pub(super) fn spread(wanted: &[f64], spacing: f64) -> Vec<f64> {
    // With x_i = position − i·spacing the constraint is monotony: isotonic regression by pooling neighbours.
    let mut groups: Vec<(f64, usize)> = Vec::new();
    for (i, position) in wanted.iter().enumerate() {
        groups.push((position - i as f64 * spacing, 1));
        while groups.len() > 1 && groups[groups.len() - 1].0 < groups[groups.len() - 2].0 {
            if let (Some((b, n)), Some((a, m))) = (groups.pop(), groups.pop()) {
                groups.push(((a * m as f64 + b * n as f64) / (m + n) as f64, m + n));
            }
        }
    }
    let pooled = groups.into_iter().flat_map(|(value, count)| std::iter::repeat_n(value, count));
    pooled.enumerate().map(|(i, value)| value + i as f64 * spacing).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_keeps_order_spacing_and_means() {
        assert_eq!(spread(&[0.0, 10.0], 3.0), [0.0, 10.0]);
        assert_eq!(spread(&[4.0, 4.0], 2.0), [3.0, 5.0]);
        let placed = spread(&[0.0, 0.1, 0.2, 9.0, 9.1], 3.0);
        assert!(placed.windows(2).all(|pair| pair[1] - pair[0] >= 3.0 - 1e-12));
        assert!(spread(&[], 1.0).is_empty());
    }
}
