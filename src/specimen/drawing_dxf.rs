//! The dimensioned drawing as DXF (R12, ASCII) for cutting and for CAD.

use super::drawing_sheet::{Anchor, Drawing, Layer, Shape};
use super::{Specimen, Tolerances};
use std::f64::consts::{PI, TAU};
use std::fmt::Write;

/// Largest distance between an ellipse and its chords, mm at full size.
const CHORD_ERROR_MM: f64 = 0.002;

/// The specimen's two views and their dimensions as plain entities (LINE, CIRCLE, ARC, TEXT) in mm, full size,
/// the front view's centre at the origin. Layers: OUTLINE, HOLES, CENTRE, DIMENSIONS. R12 knows no ellipse: one is a
/// closed POLYLINE of chords within 0.002 mm. The specimen should be valid.
pub fn to_dxf(specimen: &Specimen) -> String {
    to_dxf_with(specimen, &Tolerances::default())
}

/// As [`to_dxf`], overall dimensions with their tolerances.
pub fn to_dxf_with(specimen: &Specimen, tolerances: &Tolerances) -> String {
    let drawing = Drawing::new(specimen, tolerances);
    let scale = drawing.scale;
    let place = |p: [f64; 2]| [0, 1].map(|k| (p[k] - drawing.front_center[k]) / scale);
    let mut dxf = Groups(String::new());
    dxf.group(999, &format!("lambdak specimen: {} (mm)", ascii(&specimen.name)));
    let [low, high] = [place([0.0, 0.0]), place(drawing.size)];
    dxf.group(0, "SECTION");
    dxf.group(2, "HEADER");
    dxf.group(9, "$ACADVER");
    dxf.group(1, "AC1009");
    for (name, p) in [("$EXTMIN", low), ("$EXTMAX", high)] {
        dxf.group(9, name);
        dxf.point(0, p);
    }
    dxf.group(0, "ENDSEC");
    tables(&mut dxf);
    dxf.group(0, "SECTION");
    dxf.group(2, "ENTITIES");
    for entity in &drawing.entities {
        let layer = match entity.layer {
            Layer::Outline => "OUTLINE",
            Layer::Holes => "HOLES",
            Layer::Centre => "CENTRE",
            Layer::Dimensions => "DIMENSIONS",
            Layer::Sheet => continue,
        };
        let kind = match &entity.shape {
            Shape::Line(..) => "LINE",
            Shape::Circle(..) => "CIRCLE",
            Shape::Ellipse(..) => "POLYLINE",
            Shape::Arc(..) => "ARC",
            Shape::Text(..) => "TEXT",
        };
        dxf.group(0, kind);
        dxf.group(8, layer);
        if entity.is_hidden {
            dxf.group(6, "HIDDEN");
        }
        match &entity.shape {
            Shape::Line(a, b) => {
                dxf.point(0, place(*a));
                dxf.point(1, place(*b));
            }
            Shape::Circle(c, radius) => {
                dxf.point(0, place(*c));
                dxf.number(40, radius / scale);
            }
            Shape::Ellipse(c, half, angle) => {
                // Vertices follow, and are there in this plane.
                dxf.group(66, "1");
                dxf.point(0, [0.0; 2]);
                dxf.group(70, "1");
                for p in ellipse_points(*c, *half, *angle, scale) {
                    dxf.group(0, "VERTEX");
                    dxf.group(8, layer);
                    dxf.point(0, place(p));
                }
                dxf.group(0, "SEQEND");
                dxf.group(8, layer);
            }
            Shape::Arc(c, radius, from, to) => {
                dxf.point(0, place(*c));
                dxf.number(40, radius / scale);
                dxf.number(50, *from);
                dxf.number(51, *to);
            }
            Shape::Text(text) => {
                let justification = match text.anchor {
                    Anchor::Start => 0,
                    Anchor::Middle => 1,
                    Anchor::End => 2,
                };
                dxf.point(0, place(text.at));
                dxf.number(40, text.height / scale);
                dxf.group(1, &ascii(&text.content));
                dxf.number(50, if text.is_vertical { 90.0 } else { 0.0 });
                dxf.group(72, &justification.to_string());
                if justification != 0 {
                    dxf.point(1, place(text.at));
                }
            }
        }
    }
    dxf.group(0, "ENDSEC");
    dxf.group(0, "EOF");
    dxf.0
}

/// Points of an ellipse of the sheet, so close that chords between them stay within the chord error at full size.
fn ellipse_points(center: [f64; 2], half: [f64; 2], angle_deg: f64, scale: f64) -> Vec<[f64; 2]> {
    // The ellipse is a circle of radius a, shortened: chords stray by at most a (1 − cos(step/2)).
    let half_step = (1.0 - CHORD_ERROR_MM * scale / half[0]).clamp(0.0, 1.0).acos();
    let count = ((PI / half_step).ceil() as usize).clamp(24, 4000);
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    let at = |i: usize| {
        let (t_sin, t_cos) = (TAU * i as f64 / count as f64).sin_cos();
        let (along, across) = (half[0] * t_cos, half[1] * t_sin);
        [center[0] + along * cos - across * sin, center[1] + along * sin + across * cos]
    };
    (0..count).map(at).collect()
}

/// Line types and layers.
fn tables(dxf: &mut Groups) {
    dxf.group(0, "SECTION");
    dxf.group(2, "TABLES");
    dxf.group(0, "TABLE");
    dxf.group(2, "LTYPE");
    let types: [(&str, &str, &[f64]); 3] = [
        ("CONTINUOUS", "Solid", &[]),
        ("HIDDEN", "Dashes", &[1.0, -0.5]),
        ("CENTER", "Long and short dashes", &[3.0, -0.5, 0.5, -0.5]),
    ];
    dxf.group(70, &types.len().to_string());
    for (name, description, dashes) in types {
        dxf.group(0, "LTYPE");
        dxf.group(2, name);
        dxf.group(70, "0");
        dxf.group(3, description);
        dxf.group(72, "65");
        dxf.group(73, &dashes.len().to_string());
        dxf.number(40, dashes.iter().map(|dash| dash.abs()).sum());
        for dash in dashes {
            dxf.number(49, *dash);
        }
    }
    dxf.group(0, "ENDTAB");
    dxf.group(0, "TABLE");
    dxf.group(2, "LAYER");
    let layers = [
        ("OUTLINE", 7, "CONTINUOUS"),
        ("HOLES", 7, "CONTINUOUS"),
        ("CENTRE", 8, "CENTER"),
        ("DIMENSIONS", 5, "CONTINUOUS"),
    ];
    dxf.group(70, &layers.len().to_string());
    for (name, colour, line_type) in layers {
        dxf.group(0, "LAYER");
        dxf.group(2, name);
        dxf.group(70, "0");
        dxf.group(62, &colour.to_string());
        dxf.group(6, line_type);
    }
    dxf.group(0, "ENDTAB");
    dxf.group(0, "ENDSEC");
}

/// Group codes and values, a line each.
struct Groups(String);

impl Groups {
    fn group(&mut self, code: u32, value: &str) {
        // Writing to a string does not fail, so the result carries nothing.
        let _ = writeln!(self.0, "{code}\n{value}");
    }

    fn number(&mut self, code: u32, value: f64) {
        // Nine decimals of a mm: a hole's centre is read back to rounding.
        self.group(code, &format!("{value:.9}"));
    }

    /// A point in codes 10, 20, 30 (`which` 0) or 11, 21, 31 (`which` 1).
    fn point(&mut self, which: u32, p: [f64; 2]) {
        self.number(10 + which, p[0]);
        self.number(20 + which, p[1]);
        self.number(30 + which, 0.0);
    }
}

/// The text in ASCII with DXF's control codes for the signs that it knows.
fn ascii(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '⌀' => out.push_str("%%c"),
            '±' => out.push_str("%%p"),
            '×' => out.push('x'),
            '°' => out.push_str("%%d"),
            c if c.is_ascii() && !c.is_ascii_control() => out.push(c),
            _ => out.push('?'),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::specimen::HoleAxis;
    use crate::specimen::sampling::{dumbbell_with_hole, valid_specimen};
    use proptest::prelude::*;

    /// Entities as lists of (code, value), the kind first.
    fn entities(dxf: &str) -> Vec<Vec<(u32, String)>> {
        let lines: Vec<&str> = dxf.lines().collect();
        assert_eq!(lines.len() % 2, 0);
        let pairs = lines.chunks(2).map(|pair| (pair[0].parse::<u32>().unwrap(), pair[1].to_string()));
        let mut found: Vec<Vec<(u32, String)>> = Vec::new();
        for pair in pairs.skip_while(|(code, value)| !(*code == 2 && value == "ENTITIES")).skip(1) {
            if pair.0 == 0 {
                found.push(Vec::new());
            }
            found.last_mut().unwrap().push(pair);
        }
        found
    }

    fn number(entity: &[(u32, String)], code: u32) -> f64 {
        entity.iter().find(|pair| pair.0 == code).unwrap().1.parse().unwrap()
    }

    fn is(entity: &[(u32, String)], kind: &str, layer: &str) -> bool {
        entity[0].1 == kind && entity.iter().any(|pair| pair.0 == 8 && pair.1 == layer)
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 32, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn holes_are_full_size_circles(specimen in valid_specimen()) {
            let dxf = to_dxf(&specimen);
            prop_assert!(dxf.is_ascii());
            let found = entities(&dxf);
            let circles: Vec<_> = found.iter().filter(|e| is(e, "CIRCLE", "HOLES")).collect();
            let round: Vec<_> = specimen.holes.iter().filter(|hole| hole.shape.is_none()).collect();
            prop_assert_eq!(circles.len(), round.len());
            for (circle, hole) in circles.iter().zip(round) {
                // Nine decimals are written.
                prop_assert!((number(circle, 40) - 0.5 * hole.diameter_mm).abs() < 1e-8);
                prop_assert!((number(circle, 10) - hole.center_mm[0]).abs() < 1e-8);
                if hole.axis == HoleAxis::Thickness {
                    prop_assert!((number(circle, 20) - hole.center_mm[1]).abs() < 1e-8);
                }
            }
        }

        /// Every vertex of an ellipse and every end of a slot's arcs and lines lies on the wall.
        #[test]
        fn other_holes_are_full_size(specimen in valid_specimen()) {
            let on_wall = |p: [f64; 2]| specimen.holes.iter().any(|hole| hole.wall().distance_mm(p).abs() < 1e-7);
            let is_seen_in_front = specimen.extrusion_axis() == HoleAxis::Thickness;
            for entity in entities(&to_dxf(&specimen)).iter().filter(|_| is_seen_in_front) {
                if is(entity, "VERTEX", "HOLES") {
                    prop_assert!(on_wall([number(entity, 10), number(entity, 20)]));
                } else if is(entity, "ARC", "HOLES") {
                    for angle in [number(entity, 50), number(entity, 51)].map(f64::to_radians) {
                        let radius = number(entity, 40);
                        let p = [number(entity, 10) + radius * angle.cos(), number(entity, 20) + radius * angle.sin()];
                        prop_assert!(on_wall(p), "{p:?}");
                    }
                }
            }
        }

        #[test]
        fn a_dumbbells_outline_joins_end_to_end(specimen in dumbbell_with_hole()) {
            prop_assume!(specimen.validate().is_ok());
            let mut ends: Vec<[f64; 2]> = Vec::new();
            for entity in entities(&to_dxf(&specimen)) {
                if is(&entity, "LINE", "OUTLINE") {
                    ends.extend([[number(&entity, 10), number(&entity, 20)], [number(&entity, 11), number(&entity, 21)]]);
                } else if is(&entity, "ARC", "OUTLINE") {
                    let radius = number(&entity, 40);
                    for code in [50, 51] {
                        let (sin, cos) = number(&entity, code).to_radians().sin_cos();
                        ends.push([number(&entity, 10) + radius * cos, number(&entity, 20) + radius * sin]);
                    }
                }
            }
            // 8 lines and 8 arcs of the front view, 4 lines of the side view.
            prop_assert_eq!(ends.len(), 2 * 20);
            for end in &ends {
                let met = ends.iter().filter(|e| (e[0] - end[0]).hypot(e[1] - end[1]) < 1e-6).count();
                prop_assert_eq!(met, 2, "loose end at {:?}", end);
            }
        }
    }
}
