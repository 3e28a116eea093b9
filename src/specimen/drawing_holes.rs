//! The holes on a drawing: outlines, centre marks and labels in the view along them, hidden lines in the other.

use super::drawing_labels::place_labels;
use super::drawing_sheet::{Drawing, Entity, Layer, Shape, format_deg, format_mm};
use super::{Hole, HoleKind, HoleShape, HoleWall, Specimen};

impl Drawing {
    /// Outlines, centre marks and labels of the holes.
    pub(super) fn section_view(&mut self, specimen: &Specimen, center: [f64; 2]) {
        let [hx, hb] = specimen.section_size().map(|extent| 0.5 * self.scale * extent);
        self.line(Layer::Centre, [center[0] - hx - 3.0, center[1]], [center[0] + hx + 3.0, center[1]]);
        self.line(Layer::Centre, [center[0], center[1] - hb - 3.0], [center[0], center[1] + hb + 3.0]);
        let walls: Vec<HoleWall> = specimen
            .holes
            .iter()
            .map(|hole| {
                let on_sheet = self.on_sheet(hole, center);
                self.hole_outline(&on_sheet);
                on_sheet.wall()
            })
            .collect();
        let details: Vec<String> = specimen.holes.iter().map(size_in_words).collect();
        let bounds = [[center[0] - hx, center[1] - hb], [center[0] + hx, center[1] + hb]];
        for label in place_labels(&walls, &details, bounds, center) {
            if let Some((from, to)) = label.leader {
                self.line(Layer::Dimensions, from, to);
            }
            self.push(Layer::Dimensions, Shape::Text(label.text));
        }
    }

    /// A hole in paper mm, in a view with this centre.
    fn on_sheet(&self, hole: &Hole, center: [f64; 2]) -> Hole {
        let s = self.scale;
        Hole {
            center_mm: [0, 1].map(|c| center[c] + s * hole.center_mm[c]),
            diameter_mm: s * hole.diameter_mm,
            shape: hole.shape.map(|shape| HoleShape { length_mm: s * shape.length_mm, ..shape }),
            ..*hole
        }
    }

    /// The outline and the centre marks of a hole in paper mm.
    fn hole_outline(&mut self, hole: &Hole) {
        let wall = hole.wall();
        let (center, [a, b]) = (hole.center_mm, wall.half_mm());
        match hole.shape.map(|shape| (shape.kind, shape.angle_deg)) {
            // The outline shows it.
            None if hole.is_notch => {}
            None => self.push(Layer::Holes, Shape::Circle(center, b)),
            Some((HoleKind::Ellipse, angle)) => self.push(Layer::Holes, Shape::Ellipse(center, [a, b], angle)),
            Some((HoleKind::Slot, angle)) => {
                for (side, from) in [(1.0, angle - 90.0), (-1.0, angle + 90.0)] {
                    let corner = |across: f64| wall.section_point([side * (a - b), across]);
                    self.push(Layer::Holes, Shape::Arc(corner(0.0), b, from, from + 180.0));
                    // Each line once: from this end to the other on the side that is its own.
                    self.line(Layer::Holes, corner(side * b), wall.section_point([-side * (a - b), side * b]));
                }
            }
        }
        for (direction, half) in [([1.0, 0.0], a), ([0.0, 1.0], b)] {
            let reach = wall.turned(direction).map(|c| c * (half + half.min(1.2)));
            let [from, to] = [-1.0, 1.0].map(|s| [0, 1].map(|c| center[c] + s * reach[c]));
            self.line(Layer::Centre, from, to);
        }
    }

    /// The holes as hidden lines in the view across their axis.
    pub(super) fn hidden_holes(&mut self, specimen: &Specimen, center: [f64; 2]) {
        let (scale, half_middle) = (self.scale, 0.5 * self.scale * specimen.extrusion_mm());
        let half_at = |x: f64| specimen.block.taper().raised([(x - center[0]) / scale, half_middle, 0.0])[1];
        for hole in &specimen.holes {
            let x = center[0] + self.scale * hole.center_mm[0];
            let reach = self.scale * hole.wall().half_extents_mm()[0];
            let end = 0.5 * self.scale * specimen.block.length_mm;
            for wall in [x - reach, x + reach].into_iter().filter(|wall| (wall - center[0]).abs() < end) {
                let half = half_at(wall);
                let shape = Shape::Line([wall, center[1] - half], [wall, center[1] + half]);
                self.entities.push(Entity { layer: Layer::Holes, is_hidden: true, shape });
            }
            let half = half_at(x);
            self.line(Layer::Centre, [x, center[1] - half - 1.5], [x, center[1] + half + 1.5]);
        }
    }
}

/// What a hole's label says of it; what kind it is the drawing shows and the table says.
fn size_in_words(hole: &Hole) -> String {
    match hole.shape {
        None if hole.is_notch => format!("R{}", format_mm(0.5 * hole.diameter_mm)),
        None => format!("⌀{}", format_mm(hole.diameter_mm)),
        Some(HoleShape { length_mm, angle_deg, .. }) => {
            let [length, width] = [length_mm, hole.diameter_mm].map(format_mm);
            format!("{length}×{width}, {}°", format_deg(angle_deg))
        }
    }
}
