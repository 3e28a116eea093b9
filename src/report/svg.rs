//! A small canvas that writes SVG. Coordinates in px, y down.

use super::color::{INK, MUTED};
use crate::field::escape_xml;

/// Sans-serif fonts that are on most machines.
pub(super) const FONTS: &str =
    "Inter, 'Helvetica Neue', Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif";
/// Font size of tick labels and notes, px.
pub(super) const SMALL: f64 = 11.0;
/// Font size of axis labels, px.
pub(super) const NORMAL: f64 = 12.0;
/// Font size of titles, px.
pub(super) const TITLE: f64 = 13.0;

/// A picture in the making.
pub(super) struct Svg {
    width: f64,
    height: f64,
    body: String,
}

/// Where a text hangs on its point.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// How a text looks.
#[derive(Clone, Copy)]
pub(super) struct TextStyle {
    size: f64,
    anchor: Anchor,
    color: &'static str,
    is_bold: bool,
    is_vertical: bool,
}

impl TextStyle {
    /// Dark text of a size, starting at its point.
    pub(super) fn new(size: f64) -> Self {
        TextStyle { size, anchor: Anchor::Start, color: INK, is_bold: false, is_vertical: false }
    }

    /// Small grey text.
    pub(super) fn note() -> Self {
        TextStyle { color: MUTED, ..Self::new(SMALL) }
    }

    /// Bold title.
    pub(super) fn title() -> Self {
        TextStyle { is_bold: true, ..Self::new(TITLE) }
    }

    pub(super) fn anchor(self, anchor: Anchor) -> Self {
        TextStyle { anchor, ..self }
    }

    pub(super) fn middle(self) -> Self {
        self.anchor(Anchor::Middle)
    }

    pub(super) fn end(self) -> Self {
        self.anchor(Anchor::End)
    }

    pub(super) fn color(self, color: &'static str) -> Self {
        TextStyle { color, ..self }
    }

    pub(super) fn bold(self) -> Self {
        TextStyle { is_bold: true, ..self }
    }

    /// Turned by −90°, read from below.
    pub(super) fn vertical(self) -> Self {
        TextStyle { is_vertical: true, ..self }
    }
}

impl Svg {
    pub(super) fn new(width: f64, height: f64) -> Self {
        Svg { width, height, body: String::new() }
    }

    /// A picture that says why there is none.
    pub(super) fn placeholder(title: &str, reason: &str) -> String {
        let mut svg = Svg::new(420.0, 90.0);
        svg.stroked_rect([0.5, 0.5, 419.0, 89.0], "none", "#cccccc", 1.0);
        svg.text([210.0, 40.0], title, &TextStyle::title().middle());
        svg.text([210.0, 62.0], reason, &TextStyle::note().middle());
        svg.finish(title)
    }

    /// A straight line; `dash` in px, empty for a full line.
    pub(super) fn line(&mut self, a: [f64; 2], b: [f64; 2], color: &str, width: f64, dash: &str) {
        if !finite(&[a, b]) {
            return;
        }
        let dash = if dash.is_empty() { String::new() } else { format!(" stroke-dasharray=\"{dash}\"") };
        self.body.push_str(&format!(
            "<line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\" stroke=\"{color}\" stroke-width=\"{}\"{dash}/>\n",
            px(a[0]),
            px(a[1]),
            px(b[0]),
            px(b[1]),
            px(width)
        ));
    }

    /// Joined straight lines; points that are not finite break the line.
    pub(super) fn polyline(&mut self, points: &[[f64; 2]], color: &str, width: f64) {
        for run in points.split(|p| !finite(&[*p])).filter(|r| r.len() > 1) {
            self.body.push_str(&format!(
                "<path d=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"{}\" stroke-linejoin=\"round\"/>\n",
                path(run),
                px(width)
            ));
        }
    }

    /// A filled polygon; not drawn if a point is not finite. `edge` of the fill's own colour closes hairline seams.
    pub(super) fn polygon(&mut self, points: &[[f64; 2]], fill: &str, edge: &str, width: f64) {
        if finite(points) && points.len() > 2 {
            let stroke = if edge == "none" {
                String::new()
            } else {
                format!(" stroke=\"{edge}\" stroke-width=\"{}\" stroke-linejoin=\"round\"", px(width))
            };
            self.body.push_str(&format!("<path d=\"{}z\" fill=\"{fill}\"{stroke}/>\n", path(points)));
        }
    }

    /// A filled rectangle [x, y, width, height].
    pub(super) fn rect(&mut self, area: [f64; 4], fill: &str) {
        self.stroked_rect(area, fill, "none", 0.0);
    }

    /// A rectangle with an outline.
    pub(super) fn stroked_rect(&mut self, [x, y, w, h]: [f64; 4], fill: &str, stroke: &str, width: f64) {
        if !finite(&[[x, y], [w, h]]) || w < 0.0 || h < 0.0 {
            return;
        }
        let stroke = if stroke == "none" {
            String::new()
        } else {
            format!(" stroke=\"{stroke}\" stroke-width=\"{}\"", px(width))
        };
        self.body.push_str(&format!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"{fill}\"{stroke}/>\n",
            px(x),
            px(y),
            px(w),
            px(h)
        ));
    }

    /// A disc with an outline.
    pub(super) fn circle(&mut self, center: [f64; 2], radius: f64, fill: &str, stroke: &str, width: f64) {
        if finite(&[center]) {
            self.body.push_str(&format!(
                "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{fill}\" stroke=\"{stroke}\" stroke-width=\"{}\"/>\n",
                px(center[0]),
                px(center[1]),
                px(radius),
                px(width)
            ));
        }
    }

    /// A text with its base line at a point.
    pub(super) fn text(&mut self, at: [f64; 2], content: &str, style: &TextStyle) {
        if !finite(&[at]) || content.is_empty() {
            return;
        }
        let [x, y] = at.map(px);
        let anchor = match style.anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        let weight = if style.is_bold { " font-weight=\"600\"" } else { "" };
        let turn = if style.is_vertical { format!(" transform=\"rotate(-90 {x} {y})\"") } else { String::new() };
        self.body.push_str(&format!(
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\" fill=\"{}\"{anchor}{weight}{turn}>{}</text>\n",
            px(style.size),
            style.color,
            escape_xml(content)
        ));
    }

    /// Coloured cells: `color_of(i, j)` for column i from the left and row j from the top, None for nothing. Cells of
    /// one colour become one path, so that large maps stay small files.
    ///
    /// Print smooths the edges of abutting cells, which leaves white hairlines. A copy below, whose cells reach half a
    /// cell under their right and lower neighbours, closes them.
    pub(super) fn cells(
        &mut self,
        [x, y, width, height]: [f64; 4],
        [columns, rows]: [usize; 2],
        color_of: impl Fn(usize, usize) -> Option<String>,
    ) {
        if columns == 0 || rows == 0 || !finite(&[[x, y], [width, height]]) {
            return;
        }
        let colors: Vec<Option<String>> = (0..columns * rows).map(|c| color_of(c % columns, c / columns)).collect();
        let is_filled = |i: usize, j: usize| i < columns && j < rows && colors[i + columns * j].is_some();
        let mut layers = [std::collections::BTreeMap::<&str, String>::new(), std::collections::BTreeMap::new()];
        for j in 0..rows {
            let mut i = 0;
            while i < columns {
                let color = &colors[i + columns * j];
                let start = i;
                while i < columns && colors[i + columns * j] == *color {
                    i += 1;
                }
                if let Some(color) = color {
                    let n = i - start;
                    let right = if is_filled(i, j) { ".5" } else { "" };
                    // The reach below includes the corner under the right neighbour.
                    let last = if right.is_empty() { i } else { i + 1 };
                    let down = if (start..last).all(|c| is_filled(c, j + 1)) { ".5" } else { "" };
                    if !(right.is_empty() && down.is_empty()) {
                        let under = format!("M{start} {j}h{n}{right}v1{down}h-{n}{right}z");
                        layers[0].entry(color).or_default().push_str(&under);
                    }
                    layers[1].entry(color).or_default().push_str(&format!("M{start} {j}h{n}v1h-{n}z"));
                }
            }
        }
        self.body.push_str(&format!(
            "<g transform=\"translate({} {}) scale({:.6} {:.6})\" shape-rendering=\"crispEdges\">\n",
            px(x),
            px(y),
            width / columns as f64,
            height / rows as f64
        ));
        for (color, d) in layers.into_iter().flatten() {
            self.body.push_str(&format!("<path d=\"{d}\" fill=\"{color}\"/>\n"));
        }
        self.body.push_str("</g>\n");
    }

    /// Opens a group of facets; [`Self::close_group`] ends it. What all facets share is written once.
    pub(super) fn open_facets(&mut self) {
        self.body.push_str("<g stroke-width=\"0.6\" stroke-linejoin=\"round\">\n");
    }

    /// A facet within [`Self::open_facets`], to 1/10 px. The stroke in the fill's colour closes the hairline gaps that
    /// smoothing leaves between facets.
    pub(super) fn facet(&mut self, points: &[[f64; 2]], color: &str) {
        if finite(points) && points.len() > 2 {
            let tenths = |v: f64| px((10.0 * v).round() / 10.0);
            let d: Vec<String> = points.iter().map(|p| format!("{} {}", tenths(p[0]), tenths(p[1]))).collect();
            self.body.push_str(&format!("<path d=\"M{}z\" fill=\"{color}\" stroke=\"{color}\"/>\n", d.join(" ")));
        }
    }

    /// Opens a group that is partly see-through; [`Self::close_group`] ends it.
    pub(super) fn open_translucent(&mut self, opacity: f64) {
        self.body.push_str(&format!("<g opacity=\"{}\">\n", px(opacity)));
    }

    pub(super) fn close_group(&mut self) {
        self.body.push_str("</g>\n");
    }

    /// The finished file; `description` is read aloud by screen readers.
    pub(super) fn finish(self, description: &str) -> String {
        let (w, h) = (px(self.width), px(self.height));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" role=\"img\" \
             font-family=\"{FONTS}\">\n<title>{}</title>\n<rect width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n{}</svg>\n",
            escape_xml(description),
            self.body
        )
    }
}

fn finite(points: &[[f64; 2]]) -> bool {
    points.iter().flatten().all(|c| c.is_finite())
}

fn path(points: &[[f64; 2]]) -> String {
    let mut d = String::new();
    for (i, p) in points.iter().enumerate() {
        d.push(if i == 0 { 'M' } else { 'L' });
        d.push_str(&px(p[0]));
        d.push(' ');
        d.push_str(&px(p[1]));
    }
    d
}

/// A coordinate to 1/100 px without trailing zeros.
pub(super) fn px(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;

    #[test]
    fn text_is_escaped() {
        let mut svg = Svg::new(10.0, 10.0);
        svg.text([1.0, 1.0], "a<b & \"c\" 'd' \u{1}>", &TextStyle::note());
        let text = svg.finish("</svg><script>");
        assert_well_formed(&text);
        assert!(text.contains("a&lt;b &amp; &quot;c&quot; &#39;d&#39; &gt;"));
        assert!(!text.contains("<script"));
    }

    #[test]
    fn what_is_not_finite_is_not_drawn() {
        let mut svg = Svg::new(10.0, 10.0);
        let nan = f64::NAN;
        svg.line([nan, 0.0], [1.0, 1.0], INK, 1.0, "");
        svg.polyline(&[[0.0, 0.0], [1.0, nan], [2.0, 2.0], [3.0, 3.0]], INK, 1.0);
        svg.polygon(&[[0.0, nan], [1.0, 1.0], [2.0, 2.0]], INK, "none", 0.0);
        svg.rect([0.0, 0.0, f64::INFINITY, 1.0], INK);
        svg.circle([nan, nan], 1.0, INK, INK, 1.0);
        let text = svg.finish("x");
        assert_well_formed(&text);
        assert!(!text.contains("NaN") && !text.contains("inf"));
        assert_eq!(text.matches("<path").count(), 1);
    }

    #[test]
    fn runs_of_one_colour_are_merged() {
        let mut svg = Svg::new(10.0, 10.0);
        svg.cells([0.0, 0.0, 10.0, 10.0], [4, 2], |i, j| (j == 0 || i > 1).then(|| "#123456".to_string()));
        let text = svg.finish("x");
        assert!(text.contains("d=\"M0 0h4v1h-4zM2 1h2v1h-2z\""));
    }

    /// The copy below never reaches into an empty cell.
    #[test]
    fn cells_do_not_reach_into_holes() {
        let color = || Some("#123456".to_string());
        let draw = |hole: [usize; 2]| {
            let mut svg = Svg::new(10.0, 10.0);
            svg.cells([0.0, 0.0, 10.0, 10.0], [2, 2], |i, j| {
                if [i, j] == hole {
                    None
                } else if [i, j] == [0, 0] {
                    color()
                } else {
                    Some("#654321".into())
                }
            });
            svg.finish("x")
        };
        assert!(draw([9, 9]).contains("d=\"M0 0h1.5v1.5h-1.5z\""));
        assert!(draw([1, 1]).contains("d=\"M0 0h1.5v1h-1.5z\""));
        assert!(draw([1, 0]).contains("d=\"M0 0h1v1.5h-1z\""));
        assert!(draw([0, 1]).contains("d=\"M0 0h1.5v1h-1.5z\""));
    }
}
