//! Places labels at holes so that none covers a hole, a centre line or another label.

use super::HoleWall;
use super::drawing_sheet::{Anchor, CHARACTER_WIDTH, TEXT_HEIGHT, Text};

/// A label and, where it stands beside its hole, the line to it.
pub(super) struct Label {
    pub text: Text,
    pub leader: Option<([f64; 2], [f64; 2])>,
}

type Box2 = [[f64; 2]; 2];

/// Height of a number that stands alone where there is little room, paper mm.
const SMALL_HEIGHT: f64 = 1.8;
/// Clearance around a label, paper mm.
const CLEARANCE: f64 = 0.6;

/// What the labels placed so far cover.
#[derive(Default)]
struct Taken {
    boxes: Vec<Box2>,
    leaders: Vec<([f64; 2], [f64; 2])>,
}

impl Taken {
    fn is_free(&self, a: Box2) -> bool {
        self.boxes.iter().all(|b| (0..2).any(|k| a[1][k] <= b[0][k] || b[1][k] <= a[0][k]))
            && self.leaders.iter().all(|leader| !crosses(*leader, a))
    }

    fn put(&mut self, label: Label) -> Label {
        self.boxes.push(label.text.bounds());
        self.leaders.extend(label.leader);
        label
    }
}

/// Places one label for each hole (its wall in paper mm), all within `bounds` and off the two centre lines
/// through `center`. Each label is its hole's number and `details`, in the hole where that fits, else beside it with
/// a leader that crosses nothing. Where neither is possible the number stands alone; as a last resort it shrinks
/// into its own hole, as holes never overlap.
pub(super) fn place_labels(walls: &[HoleWall], details: &[String], bounds: Box2, center: [f64; 2]) -> Vec<Label> {
    let mut taken = Taken::default();
    let mut placed = Vec::with_capacity(details.len());
    for (index, detail) in details.iter().enumerate() {
        let number = (index + 1).to_string();
        let full = format!("{number} {detail}");
        let label = [(&full, TEXT_HEIGHT), (&number, TEXT_HEIGHT), (&number, SMALL_HEIGHT)]
            .into_iter()
            .find_map(|(content, height)| place_one(walls, index, content, height, bounds, center, &taken))
            .unwrap_or_else(|| {
                // In the quadrant between the centre marks: the far corner of two digits is at 1.8 heights.
                let (middle, [_, inner]) = (walls[index].center_mm(), walls[index].half_mm());
                let height = (inner / 2.0).min(SMALL_HEIGHT);
                let at = middle.map(|c| c + 0.1 * height);
                Label { text: text_at(at, height, &number), leader: None }
            });
        placed.push(taken.put(label));
    }
    placed
}

fn text_at(at: [f64; 2], height: f64, content: &str) -> Text {
    Text { at, height, anchor: Anchor::Start, is_vertical: false, content: content.into() }
}

/// A free place for a label in or beside its hole.
fn place_one(
    walls: &[HoleWall],
    index: usize,
    content: &str,
    height: f64,
    bounds: Box2,
    center: [f64; 2],
    taken: &Taken,
) -> Option<Label> {
    let own = &walls[index];
    let (middle, [radius, _]) = (own.center_mm(), own.half_mm());
    let inside = text_at(middle.map(|c| c + 1.5 * CLEARANCE), height, content);
    if fits_in(own, inside.bounds()) && taken.is_free(inside.bounds()) {
        return Some(Label { text: inside, leader: None });
    }
    let width = CHARACTER_WIDTH * height * content.chars().count() as f64;
    candidates(middle, radius, width, height).find_map(|at| {
        let text = text_at(at, height, content);
        let outer = grow(text.bounds(), CLEARANCE);
        let is_in_bounds = (0..2).all(|k| outer[0][k] >= bounds[0][k] && outer[1][k] <= bounds[1][k]);
        let is_off_centre_lines = (0..2).all(|k| outer[1][k] <= center[k] || outer[0][k] >= center[k]);
        // A centre mark reaches past its hole by as much as 1.2 mm.
        let is_off_holes = walls.iter().all(|wall| gap_to_box(wall, outer) >= wall.half_mm()[0].min(1.2));
        if !(is_in_bounds && is_off_centre_lines && is_off_holes && taken.is_free(outer)) {
            return None;
        }
        let [low, high] = text.bounds();
        let end = [0, 1].map(|k| middle[k].clamp(low[k] - 0.3, high[k] + 0.3));
        let offset = [end[0] - middle[0], end[1] - middle[1]];
        let length = offset[0].hypot(offset[1]).max(f64::MIN_POSITIVE);
        let reach = own.ray_mm(offset.map(|c| c / length));
        let start = [0, 1].map(|k| middle[k] + reach * offset[k] / length);
        let others = walls.iter().enumerate().filter(|(other, _)| *other != index);
        let is_clear = others.into_iter().all(|(_, wall)| gap_to_segment(wall, (start, end)) > 0.3)
            && taken.boxes.iter().all(|b| !crosses((start, end), *b));
        is_clear.then_some(Label { text, leader: Some((start, end)) })
    })
}

/// Places for a label of `width` beside a circle, nearest first: sixteen directions, growing distance.
fn candidates(middle: [f64; 2], radius: f64, width: f64, height: f64) -> impl Iterator<Item = [f64; 2]> {
    (0..6).flat_map(move |ring| {
        let distance = radius + radius.min(1.2) + 1.2 + 1.6 * ring as f64;
        (0..16).map(move |i| {
            let angle = std::f64::consts::TAU * (i as f64 + 2.0) / 16.0;
            let anchor = [middle[0] + distance * angle.cos(), middle[1] + distance * angle.sin()];
            // The corner of the box that is nearest to the hole is at the anchor.
            let x = anchor[0] - width * (0.5 - 0.5 * angle.cos().clamp(-0.7, 0.7) / 0.7);
            let y = anchor[1] - height * (0.5 - 0.5 * angle.sin().clamp(-0.7, 0.7) / 0.7);
            [x, y]
        })
    })
}

fn grow([low, high]: Box2, by: f64) -> Box2 {
    [low.map(|c| c - by), high.map(|c| c + by)]
}

/// Whether a segment meets a box.
fn crosses((from, to): ([f64; 2], [f64; 2]), [low, high]: Box2) -> bool {
    // Clip the segment's parameter to the slab of each axis.
    let (mut start, mut end) = (0.0f64, 1.0f64);
    for k in 0..2 {
        let step = to[k] - from[k];
        let (a, b) = (low[k] - from[k], high[k] - from[k]);
        if step.abs() < 1e-12 {
            if a > 0.0 || b < 0.0 {
                return false;
            }
        } else {
            start = start.max((a / step).min(b / step));
            end = end.min((a / step).max(b / step));
        }
    }
    start <= end
}

fn distance_to_segment(p: [f64; 2], (from, to): ([f64; 2], [f64; 2])) -> f64 {
    let d = [to[0] - from[0], to[1] - from[1]];
    let length2 = (d[0] * d[0] + d[1] * d[1]).max(f64::MIN_POSITIVE);
    let t = (((p[0] - from[0]) * d[0] + (p[1] - from[1]) * d[1]) / length2).clamp(0.0, 1.0);
    (p[0] - from[0] - t * d[0]).hypot(p[1] - from[1] - t * d[1])
}

fn distance_to_box(p: [f64; 2], [low, high]: Box2) -> f64 {
    let d = [0, 1].map(|k| p[k] - p[k].clamp(low[k], high[k]));
    d[0].hypot(d[1])
}

/// Distance of a box from a hole, no more than the true one: exact for a circle, else by points of the box's sides.
fn gap_to_box(wall: &HoleWall, [low, high]: Box2) -> f64 {
    if wall.is_circle() {
        return distance_to_box(wall.center_mm(), [low, high]) - wall.half_mm()[1];
    }
    if distance_to_box(wall.center_mm(), [low, high]) <= 0.0 {
        return -wall.half_mm()[1];
    }
    let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
    (0..4).map(|i| gap_to_segment(wall, (corners[i], corners[(i + 1) % 4]))).fold(f64::INFINITY, f64::min)
}

/// The same of a segment.
fn gap_to_segment(wall: &HoleWall, (from, to): ([f64; 2], [f64; 2])) -> f64 {
    if wall.is_circle() {
        return distance_to_segment(wall.center_mm(), (from, to)) - wall.half_mm()[1];
    }
    const PARTS: usize = 32;
    let at = |i: usize| [0, 1].map(|k| from[k] + (to[k] - from[k]) * i as f64 / PARTS as f64);
    let nearest = (0..=PARTS).map(|i| wall.distance_mm(at(i))).fold(f64::INFINITY, f64::min);
    // Between two points the segment comes nearer by no more than half of their distance.
    nearest - 0.5 * (to[0] - from[0]).hypot(to[1] - from[1]) / PARTS as f64
}

/// Whether a box lies in a hole with clearance all around: its corners do, as holes are convex.
fn fits_in(wall: &HoleWall, [low, high]: Box2) -> bool {
    let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
    corners.iter().all(|p| wall.distance_mm(*p) <= -CLEARANCE)
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
    fn segments_and_boxes() {
        let unit = [[0.0, 0.0], [1.0, 1.0]];
        assert!(crosses(([-1.0, 0.5], [2.0, 0.5]), unit));
        assert!(crosses(([0.2, 0.2], [0.3, 0.3]), unit));
        assert!(!crosses(([-1.0, 0.5], [0.5, 2.5]), unit));
        assert!(!crosses(([2.0, -1.0], [2.0, 2.0]), unit));
        assert_eq!(distance_to_segment([0.0, 1.0], ([-1.0, 0.0], [1.0, 0.0])), 1.0);
        assert_eq!(distance_to_segment([4.0, 4.0], ([0.0, 0.0], [1.0, 0.0])), 5.0);
    }

    #[test]
    fn spread_keeps_order_spacing_and_means() {
        assert_eq!(spread(&[0.0, 10.0], 3.0), [0.0, 10.0]);
        assert_eq!(spread(&[4.0, 4.0], 2.0), [3.0, 5.0]);
        let placed = spread(&[0.0, 0.1, 0.2, 9.0, 9.1], 3.0);
        assert!(placed.windows(2).all(|pair| pair[1] - pair[0] >= 3.0 - 1e-12));
        assert!(spread(&[], 1.0).is_empty());
    }
}
