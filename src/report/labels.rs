//! Labels beside points, placed so that they cover neither each other nor the points.

use super::svg::{Anchor, SMALL};
use super::text::text_width;

/// Boxes that are taken: [left, top, right, bottom], px.
pub(super) struct LabelPlacer {
    area: [f64; 4],
    taken: Vec<[f64; 4]>,
}

impl LabelPlacer {
    /// Labels stay within `area` ([left, top, right, bottom]).
    pub(super) fn new(area: [f64; 4]) -> Self {
        LabelPlacer { area, taken: Vec::new() }
    }

    /// Marks a disc as taken.
    pub(super) fn occupy(&mut self, [x, y]: [f64; 2], radius: f64) {
        self.taken.push([x - radius, y - radius, x + radius, y + radius]);
    }

    /// A free place for a label at a point: base-line point and anchor. None where all places near are taken.
    pub(super) fn place(&mut self, [x, y]: [f64; 2], label: &str, gap: f64) -> Option<([f64; 2], Anchor)> {
        let (w, h) = (text_width(label, SMALL), SMALL);
        for distance in [gap, gap + 6.0, gap + 13.0] {
            let d = 0.75 * distance;
            // Right, left, above, below, then the diagonals: centre of the label's near edge.
            let places = [
                (x + distance, y, Anchor::Start),
                (x + d, y - d - 2.0, Anchor::Start),
                (x + d, y + d + 2.0, Anchor::Start),
                (x, y - distance - 0.5 * h, Anchor::Middle),
                (x, y + distance + 0.5 * h, Anchor::Middle),
                (x - distance, y, Anchor::End),
                (x - d, y - d - 2.0, Anchor::End),
                (x - d, y + d + 2.0, Anchor::End),
            ];
            for (px, py, anchor) in places {
                let left = match anchor {
                    Anchor::Start => px,
                    Anchor::Middle => px - 0.5 * w,
                    Anchor::End => px - w,
                };
                let area = [left, py - 0.5 * h, left + w, py + 0.5 * h];
                let is_inside = area[0] >= self.area[0]
                    && area[1] >= self.area[1]
                    && area[2] <= self.area[2]
                    && area[3] <= self.area[3];
                if is_inside && !self.taken.iter().any(|t| overlap(t, &area)) {
                    self.taken.push(area);
                    return Some(([px, py + 0.35 * SMALL], anchor));
                }
            }
        }
        None
    }
}

fn overlap(a: &[f64; 4], b: &[f64; 4]) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_do_not_overlap() {
        let mut placer = LabelPlacer::new([0.0, 0.0, 200.0, 200.0]);
        placer.occupy([100.0, 100.0], 4.0);
        let mut found = 0;
        for _ in 0..40 {
            found += usize::from(placer.place([100.0, 100.0], "12", 7.0).is_some());
        }
        assert!((4..40).contains(&found));
        for (i, a) in placer.taken.iter().enumerate() {
            assert!(placer.taken[..i].iter().all(|b| !overlap(a, b)));
        }
    }
}
