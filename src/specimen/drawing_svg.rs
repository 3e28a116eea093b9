//! The dimensioned drawing as SVG, for reading and printing.

use super::drawing_sheet::{Anchor, Drawing, Layer, Shape};
use super::{Specimen, Tolerances};
use crate::field::escape_xml;
use std::fmt::Write;

/// A dimensioned drawing of the specimen: front view (x, z), side view (x, y), every hole with its place and
/// diameter, overall dimensions, a table of holes, name, units and scale. A sheet of A4 (A3 for many holes),
/// printed true to the stated scale. The specimen should be valid.
pub fn to_svg(specimen: &Specimen) -> String {
    to_svg_with(specimen, &Tolerances::default())
}

/// As [`to_svg`], dimensions with their tolerances.
pub fn to_svg_with(specimen: &Specimen, tolerances: &Tolerances) -> String {
    let drawing = Drawing::new(specimen, tolerances);
    let [width, height] = drawing.size;
    let mut svg = format!(
        concat!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}mm\" height=\"{h}mm\" viewBox=\"0 0 {w} {h}\">\n",
            "<title>{name}</title>\n",
            "<style>\n",
            "line,circle,ellipse,path{{fill:none;stroke:#111;stroke-linecap:round}}\n",
            ".outline{{stroke-width:.5}} .holes{{stroke-width:.5}} .hidden{{stroke-width:.3;stroke-dasharray:1.6 1}}\n",
            ".centre{{stroke:#777;stroke-width:.15;stroke-dasharray:4 1 1 1}}\n",
            ".dimensions{{stroke:#335;stroke-width:.18}} .sheet{{stroke-width:.25}}\n",
            "text{{font-family:Helvetica,Arial,'DejaVu Sans',sans-serif;fill:#111}}\n",
            "</style>\n",
            "<rect width=\"{w}\" height=\"{h}\" fill=\"#fff\"/>\n"
        ),
        w = width,
        h = height,
        name = escape_xml(&specimen.name)
    );
    for entity in &drawing.entities {
        let class = match (entity.is_hidden, entity.layer) {
            (true, _) => "hidden",
            (_, Layer::Outline) => "outline",
            (_, Layer::Holes) => "holes",
            (_, Layer::Centre) => "centre",
            (_, Layer::Dimensions) => "dimensions",
            (_, Layer::Sheet) => "sheet",
        };
        // Writing to a string does not fail, so the result carries nothing.
        let _ = match &entity.shape {
            Shape::Line(a, b) => writeln!(
                svg,
                "<line class=\"{class}\" x1=\"{:.3}\" y1=\"{:.3}\" x2=\"{:.3}\" y2=\"{:.3}\"/>",
                a[0],
                height - a[1],
                b[0],
                height - b[1]
            ),
            Shape::Circle(c, radius) => writeln!(
                svg,
                "<circle class=\"{class}\" cx=\"{:.3}\" cy=\"{:.3}\" r=\"{radius:.3}\"/>",
                c[0],
                height - c[1]
            ),
            // Angles are counter-clockwise on paper, and clockwise in SVG, whose second axis points down.
            Shape::Ellipse(c, half, angle) => {
                let [x, y] = [c[0], height - c[1]];
                writeln!(
                    svg,
                    "<ellipse class=\"{class}\" cx=\"{x:.3}\" cy=\"{y:.3}\" rx=\"{:.3}\" ry=\"{:.3}\" \
                     transform=\"rotate({:.3} {x:.3} {y:.3})\"/>",
                    half[0], half[1], -angle
                )
            }
            Shape::Arc(c, radius, from, to) => {
                let point = |degrees: f64| {
                    let angle = degrees.to_radians();
                    [c[0] + radius * angle.cos(), height - c[1] - radius * angle.sin()]
                };
                let (a, b) = (point(*from), point(*to));
                // Counter-clockwise on paper is sweep 0, as SVG's second axis points down. Arcs here span at most half
                // a turn.
                writeln!(
                    svg,
                    "<path class=\"{class}\" d=\"M{:.3} {:.3}A{radius:.3} {radius:.3} 0 0 0 {:.3} {:.3}\"/>",
                    a[0], a[1], b[0], b[1]
                )
            }
            Shape::Text(text) => {
                let anchor = match text.anchor {
                    Anchor::Start => "start",
                    Anchor::Middle => "middle",
                    Anchor::End => "end",
                };
                let [x, y] = [text.at[0], height - text.at[1]];
                let turn =
                    if text.is_vertical { format!(" transform=\"rotate(-90 {x:.3} {y:.3})\"") } else { String::new() };
                // Digits and capitals are about 0.72 of the font size high; `height` is a little above that.
                writeln!(
                    svg,
                    "<text x=\"{x:.3}\" y=\"{y:.3}\" font-size=\"{:.3}\" text-anchor=\"{anchor}\"{turn}>{}</text>",
                    1.15 * text.height,
                    escape_xml(&text.content)
                )
            }
        };
    }
    svg.push_str("</svg>\n");
    svg
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::specimen::HoleKind;
    use crate::specimen::sampling::valid_specimen;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 32, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn shows_every_hole_and_escapes_the_name(specimen in valid_specimen()) {
            let specimen = Specimen { name: "a<b> & \"c\"".into(), ..specimen };
            let svg = to_svg(&specimen);
            let count = |kind: Option<HoleKind>| {
                specimen.holes.iter().filter(|h| h.shape.map(|shape| shape.kind) == kind).count()
            };
            prop_assert_eq!(svg.matches("<circle").count(), count(None));
            prop_assert_eq!(svg.matches("<ellipse").count(), count(Some(HoleKind::Ellipse)));
            // Two half circles of each slot.
            prop_assert_eq!(svg.matches("<path").count(), 2 * count(Some(HoleKind::Slot)));
            prop_assert!(svg.contains("<title>a&lt;b&gt; &amp; &quot;c&quot;</title>"));
            prop_assert!(!svg.contains("NaN") && !svg.contains("inf"));
        }
    }
}
