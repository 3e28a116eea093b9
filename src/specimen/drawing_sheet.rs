//! A drawing as lines, arcs and texts on a sheet of paper, and the dimensions made of them.

/// What an entity belongs to; the layer names of the DXF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Layer {
    Outline,
    Holes,
    Centre,
    Dimensions,
    /// Frame, table and title: on the sheet only, not in the DXF.
    Sheet,
}

/// Which point of a text stands where it is put.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// A shape, paper mm, origin at the sheet's lower left corner, second coordinate up.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    Line([f64; 2], [f64; 2]),
    Circle([f64; 2], f64),
    /// Centre, half of the extents along its length and across it, angle of its length in degrees, counter-clockwise.
    Ellipse([f64; 2], [f64; 2], f64),
    /// Centre, radius, start and end in degrees, counter-clockwise.
    Arc([f64; 2], f64, f64, f64),
    Text(Text),
}

/// A line of text on its baseline. Vertical text reads upwards.
#[derive(Clone, Debug)]
pub(super) struct Text {
    pub at: [f64; 2],
    pub height: f64,
    pub anchor: Anchor,
    pub is_vertical: bool,
    pub content: String,
}

/// Height of texts, paper mm.
pub(super) const TEXT_HEIGHT: f64 = 2.5;
/// Mean width of a character over the height given for the text, sans-serif, on the generous side.
pub(super) const CHARACTER_WIDTH: f64 = 0.64;

impl Text {
    /// Bounding box (min, max), paper mm.
    pub(super) fn bounds(&self) -> [[f64; 2]; 2] {
        let width = CHARACTER_WIDTH * self.height * self.content.chars().count() as f64;
        let start = match self.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => -0.5 * width,
            Anchor::End => -width,
        };
        let [x, y] = self.at;
        if self.is_vertical {
            [[x - self.height, y + start], [x, y + start + width]]
        } else {
            [[x + start, y], [x + start + width, y + self.height]]
        }
    }
}

/// A shape on its layer.
#[derive(Clone, Debug)]
pub(super) struct Entity {
    pub layer: Layer,
    pub is_hidden: bool,
    pub shape: Shape,
}

/// A drawing on a sheet.
#[derive(Clone, Debug)]
pub(super) struct Drawing {
    pub entities: Vec<Entity>,
    /// Sheet, paper mm.
    pub size: [f64; 2],
    /// Paper mm per specimen mm.
    pub scale: f64,
    /// Centre of the front view, paper mm.
    pub front_center: [f64; 2],
}

impl Drawing {
    /// Adds a visible shape.
    pub(super) fn push(&mut self, layer: Layer, shape: Shape) {
        self.entities.push(Entity { layer, is_hidden: false, shape });
    }

    /// Adds a line.
    pub(super) fn line(&mut self, layer: Layer, from: [f64; 2], to: [f64; 2]) {
        self.push(layer, Shape::Line(from, to));
    }

    /// Adds a line of text.
    pub(super) fn text(
        &mut self,
        layer: Layer,
        at: [f64; 2],
        height: f64,
        anchor: Anchor,
        is_vertical: bool,
        content: String,
    ) {
        self.push(layer, Shape::Text(Text { at, height, anchor, is_vertical, content }));
    }

    /// Adds a rectangle with two opposite corners.
    pub(super) fn rectangle(&mut self, layer: Layer, [x0, y0]: [f64; 2], [x1, y1]: [f64; 2]) {
        let corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
        for (i, corner) in corners.into_iter().enumerate() {
            self.line(layer, corner, corners[(i + 1) % 4]);
        }
    }

    /// A horizontal dimension between two points, its line at height `y`.
    pub(super) fn dimension_x(&mut self, ends: [[f64; 2]; 2], y: f64, content: String) {
        for [x, from] in ends {
            self.line(Layer::Dimensions, [x, from + 1.0], [x, y + 1.5]);
            self.line(Layer::Dimensions, [x - 1.0, y - 1.0], [x + 1.0, y + 1.0]);
        }
        self.line(Layer::Dimensions, [ends[0][0], y], [ends[1][0], y]);
        let middle = 0.5 * (ends[0][0] + ends[1][0]);
        self.text(Layer::Dimensions, [middle, y + 1.0], TEXT_HEIGHT, Anchor::Middle, false, content);
    }

    /// The vertical overall dimension at the left of a view with half extents `half`.
    pub(super) fn dimension_y(&mut self, center: [f64; 2], half: [f64; 2], content: String) {
        self.dimension_of_end(center, half, -1.0, content);
    }

    /// The same of the end at the left (`side` −1) or at the right (1).
    pub(super) fn dimension_of_end(&mut self, center: [f64; 2], half: [f64; 2], side: f64, content: String) {
        let edge = center[0] + side * half[0];
        let x = edge + side * 9.0;
        for y in [center[1] - half[1], center[1] + half[1]] {
            self.line(Layer::Dimensions, [edge + side, y], [x + side * 1.5, y]);
            self.line(Layer::Dimensions, [x - 1.0, y - 1.0], [x + 1.0, y + 1.0]);
        }
        self.line(Layer::Dimensions, [x, center[1] - half[1]], [x, center[1] + half[1]]);
        self.text(Layer::Dimensions, [x - 1.5, center[1]], TEXT_HEIGHT, Anchor::Middle, true, content);
    }
}

/// An angle with up to one decimal, without trailing zeros.
pub(super) fn format_deg(value: f64) -> String {
    let text = format!("{value:.1}");
    let text = text.strip_suffix(".0").unwrap_or(&text);
    if text == "-0" { "0".into() } else { text.into() }
}

/// A length with up to three decimals, without trailing zeros.
pub(super) fn format_mm(value: f64) -> String {
    let text = format!("{value:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        assert_eq!(format_mm(4.2333), "4.233");
        assert_eq!(format_mm(-0.0001), "0");
        assert_eq!(format_mm(100.0), "100");
        assert_eq!(format_mm(-25.4), "-25.4");
    }
}
