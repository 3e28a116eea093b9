//! The layout of a specimen's dimensioned drawing; `drawing_svg` and `drawing_dxf` write it.
//!
//! Front view (x, z) above, side view (x, y) below, x to the right in both. Holes appear with their outlines in the
//! view along their axis and as hidden lines in the other. Positions are ordinates from the block's centre lines; the
//! table repeats them and adds distances from the end at −x and from the negative side.

use super::drawing_labels::spread;
use super::drawing_sheet::{Anchor, CHARACTER_WIDTH, Drawing, Layer, Shape, TEXT_HEIGHT, format_mm};
use super::drawing_table::{ROW_HEIGHT, table_width};
use super::section_loop::{SectionCurve, outline};
use super::tolerances::dimension;
use super::{HoleAxis, Outline, Specimen, TestKind, Tolerances};

const MARGIN: f64 = 10.0;
/// Width of the title, mm.
const TITLE_WIDTH: f64 = 84.0;
const TITLE_HEIGHT: f64 = 40.0;
const LEFT_OF_VIEW: f64 = 17.0;
const RIGHT_OF_VIEW: f64 = 26.0;
const ABOVE_FRONT: f64 = 26.0;
const ABOVE_SIDE: f64 = 9.0;
const BELOW_SECTION: f64 = 27.0;
const BELOW_OTHER: f64 = 6.0;
/// More distinct ordinates than this are left to the table.
const MAX_ORDINATES: usize = 24;
/// Usual scales, largest first.
const SCALES: [f64; 14] = [50.0, 20.0, 10.0, 5.0, 4.0, 3.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01];

impl Drawing {
    /// Lays out the drawing of a specimen.
    pub(super) fn new(specimen: &Specimen, tolerances: &Tolerances) -> Drawing {
        let num_holes = specimen.holes.len();
        let rows_of = |height: f64| ((height - 2.0 * MARGIN - TITLE_HEIGHT - 16.0) / ROW_HEIGHT) as usize;
        let size = if num_holes <= rows_of(210.0) { [297.0, 210.0] } else { [420.0, 297.0] };
        let rows = rows_of(size[1]);
        let num_tables = num_holes.div_ceil(rows).max(1);
        let panel = num_tables as f64 * table_width(specimen, tolerances);

        let block = specimen.block;
        let [_, thickness_mm, _] = block.extents_mm();
        let is_front_section = specimen.extrusion_axis() == HoleAxis::Thickness;
        let below = |is_section: bool| if is_section { BELOW_SECTION } else { BELOW_OTHER };
        let (below_front, below_side) = (below(is_front_section), below(!is_front_section));
        let area = [size[0] - 2.0 * MARGIN - panel - 4.0, size[1] - 2.0 * MARGIN];
        let free =
            [area[0] - LEFT_OF_VIEW - RIGHT_OF_VIEW, area[1] - ABOVE_FRONT - below_front - ABOVE_SIDE - below_side];
        let fits = |s: f64| s * block.length_mm <= free[0] && s * (block.width_mm + thickness_mm) <= free[1];
        // A specimen larger than any usual scale allows is drawn to whatever scale fits.
        let largest = (free[0] / block.length_mm).min(free[1] / (block.width_mm + thickness_mm));
        let scale = SCALES.into_iter().find(|s| fits(*s)).unwrap_or(largest);

        let spare = free[1] - scale * (block.width_mm + thickness_mm);
        let x = MARGIN + LEFT_OF_VIEW + 0.5 * free[0];
        let front_top = size[1] - MARGIN - ABOVE_FRONT - 0.25 * spare;
        let front_center = [x, front_top - 0.5 * scale * block.width_mm];
        let side_top = front_top - scale * block.width_mm - below_front - 0.35 * spare - ABOVE_SIDE;
        let side_center = [x, side_top - 0.5 * scale * thickness_mm];

        let mut drawing = Drawing { entities: Vec::new(), size, scale, front_center };
        drawing.outline(specimen, front_center, side_center);
        let (section, other) = if is_front_section { (front_center, side_center) } else { (side_center, front_center) };
        drawing.section_view(specimen, section);
        drawing.ordinates(specimen, section);
        drawing.hidden_holes(specimen, other);
        drawing.overall_dimensions(specimen, tolerances, front_center, side_center);
        drawing.table(specimen, tolerances, rows, [size[0] - MARGIN - panel, size[1] - MARGIN]);
        drawing.title(specimen);
        drawing
    }

    fn outline(&mut self, specimen: &Specimen, front: [f64; 2], side: [f64; 2]) {
        let s = self.scale;
        let [hx, hy, hz] =
            [specimen.block.length_mm, specimen.block.thickness_mm, specimen.block.width_mm].map(|c| 0.5 * s * c);
        let is_front_section = specimen.extrusion_axis() == HoleAxis::Thickness;
        let (section, (other, half)) =
            if is_front_section { (front, (side, [hx, hy])) } else { (side, (front, [hx, hz])) };
        if specimen.block.taper().is_even() {
            self.rectangle(Layer::Outline, [0, 1].map(|c| other[c] - half[c]), [0, 1].map(|c| other[c] + half[c]));
        } else {
            self.wedge_outline(specimen, side);
        }
        self.section_outline(specimen, section);
        let Some(profile) = specimen.profile() else { return };
        let narrow = profile.arcs()[0].start_mm;
        let at = |x: f64, z: f64| [front[0] + s * x, front[1] + s * z];
        // The gauge's length, between the view and the overall dimension.
        let above = front[1] + hz + 5.0;
        let ends = [at(-narrow[0], narrow[1]), at(narrow[0], narrow[1])];
        self.dimension_x([ends[0], ends[1]], above, format_mm(2.0 * narrow[0]));
    }

    /// The four sides of a wedge seen along z.
    fn wedge_outline(&mut self, specimen: &Specimen, [x, y]: [f64; 2]) {
        let half_mm = 0.5 * specimen.block.length_mm;
        let at =
            |end_mm: f64, side: f64| [x + self.scale * end_mm, y + side * self.scale * specimen.half_gap_mm(end_mm)];
        let corners = [at(-half_mm, -1.0), at(half_mm, -1.0), at(half_mm, 1.0), at(-half_mm, 1.0)];
        for (i, corner) in corners.into_iter().enumerate() {
            self.line(Layer::Outline, corner, corners[(i + 1) % 4]);
        }
    }

    /// The outline of the section, as lines and arcs.
    fn section_outline(&mut self, specimen: &Specimen, center: [f64; 2]) {
        let s = self.scale;
        let at = |p: [f64; 2]| [center[0] + s * p[0], center[1] + s * p[1]];
        let pieces = outline(specimen);
        for (i, piece) in pieces.iter().enumerate() {
            let (start, end) = (piece.start_mm, pieces[(i + 1) % pieces.len()].start_mm);
            match piece.curve {
                SectionCurve::Line => self.line(Layer::Outline, at(start), at(end)),
                SectionCurve::Conic { conic, is_counterclockwise } => {
                    let c = conic.center_mm;
                    let angle_of = |p: [f64; 2]| (p[1] - c[1]).atan2(p[0] - c[0]).to_degrees().rem_euclid(360.0);
                    let (from, to) = if is_counterclockwise { (start, end) } else { (end, start) };
                    // Of an outline all conics are circles.
                    let shape = Shape::Arc(at(c), s * conic.half_mm[0], angle_of(from), angle_of(to));
                    self.push(Layer::Outline, shape);
                }
            }
        }
    }

    /// Ordinates from the centre lines: x below the view, the lateral coordinate at its right.
    fn ordinates(&mut self, specimen: &Specimen, center: [f64; 2]) {
        if specimen.holes.is_empty() {
            return;
        }
        let half = specimen.section_size().map(|extent| 0.5 * self.scale * extent);
        let spacing = TEXT_HEIGHT + 1.0;
        for k in 0..2 {
            let mut values: Vec<f64> = specimen.holes.iter().map(|hole| hole.center_mm[k]).chain([0.0]).collect();
            values.sort_by(f64::total_cmp);
            values.dedup_by(|a, b| (*a - *b).abs() < 5e-4);
            // Beyond the view's own extent only as far as its margins are free on both sides.
            let room = 2.0 * half[k] + if k == 0 { 30.0 } else { 12.0 };
            if values.len() > MAX_ORDINATES || values.len() as f64 * spacing > room {
                continue;
            }
            let wanted: Vec<f64> = values.iter().map(|value| center[k] + self.scale * value).collect();
            let placed = spread(&wanted, spacing);
            let sign = if k == 0 { -1.0 } else { 1.0 };
            let across = 1 - k;
            let start = center[across] + sign * half[across];
            for ((value, from), to) in values.iter().zip(wanted).zip(placed) {
                let point = |along: f64, offset: f64| {
                    let away = start + sign * offset;
                    if k == 0 { [along, away] } else { [away, along] }
                };
                self.line(Layer::Dimensions, point(from, 3.5), point(from, 5.0));
                self.line(Layer::Dimensions, point(from, 5.0), point(to, 9.0));
                self.line(Layer::Dimensions, point(to, 9.0), point(to, 11.0));
                let anchor = if k == 0 { Anchor::End } else { Anchor::Start };
                let baseline = to + if k == 0 { 0.4 } else { -0.4 } * TEXT_HEIGHT;
                let at = point(baseline, 11.8);
                self.text(Layer::Dimensions, at, TEXT_HEIGHT, anchor, k == 0, format_mm(*value));
            }
        }
    }

    fn overall_dimensions(&mut self, specimen: &Specimen, tolerances: &Tolerances, front: [f64; 2], side: [f64; 2]) {
        let [of_length, of_thickness, of_width] = tolerances.block_mm;
        let [hx, hy, hz] = specimen.block.extents_mm().map(|c| 0.5 * self.scale * c);
        let top = front[1] + hz;
        let ends = [[front[0] - hx, top], [front[0] + hx, top]];
        self.dimension_x(ends, top + 12.0, dimension(specimen.block.length_mm, of_length));
        self.dimension_y(front, [hx, hz], dimension(specimen.block.width_mm, of_width));
        if specimen.block.taper().is_even() {
            self.dimension_y(side, [hx, hy], dimension(specimen.block.thickness_mm, of_thickness));
        } else {
            for (sign, thickness_mm) in [-1.0, 1.0].into_iter().zip(specimen.block.end_thicknesses_mm()) {
                let half = [hx, 0.5 * self.scale * thickness_mm];
                self.dimension_of_end(side, half, sign, dimension(thickness_mm, of_thickness));
            }
        }
        let title_x = front[0] - hx;
        let front_title = format!("Front view (x, z){}", outline_in_words(specimen.outline));
        self.text(Layer::Dimensions, [title_x, top + 20.0], TEXT_HEIGHT, Anchor::Start, false, front_title);
        let side_title = "Side view (x, y)".to_string();
        let at = [title_x, side[1] + hy + 4.5];
        self.text(Layer::Dimensions, at, TEXT_HEIGHT, Anchor::Start, false, side_title);
    }

    fn title(&mut self, specimen: &Specimen) {
        let [width, _] = self.size;
        let left = width - MARGIN - TITLE_WIDTH;
        self.rectangle(Layer::Sheet, [5.0, 5.0], [width - 5.0, self.size[1] - 5.0]);
        self.line(Layer::Sheet, [left - 2.0, 5.0], [left - 2.0, 5.0 + TITLE_HEIGHT]);
        self.line(Layer::Sheet, [left - 2.0, 5.0 + TITLE_HEIGHT], [width - 5.0, 5.0 + TITLE_HEIGHT]);
        let mut y = 5.0 + TITLE_HEIGHT - 6.5;
        // Names have wide letters: a little more room than for numbers.
        let per_line = (TITLE_WIDTH / (3.6 * CHARACTER_WIDTH)) as usize;
        for line in wrap(&specimen.name, per_line, 2) {
            self.text(Layer::Sheet, [left + 1.0, y], 3.5, Anchor::Start, false, line);
            y -= 5.0;
        }
        let block = specimen.block;
        let [length, thickness, breadth] = [block.length_mm, block.thickness_mm, block.width_mm].map(format_mm);
        let faces = match specimen.test {
            TestKind::DoubleLapShear => {
                let faces = match block.taper().is_even() {
                    true => format!("Double-lap shear, faces y = ±{} bonded", format_mm(0.5 * block.thickness_mm)),
                    false => "Double-lap shear, slanted faces bonded".to_string(),
                };
                let faces = match specimen.is_driven_along_x() {
                    true => faces,
                    false => format!("{faces}, moved {}° from x to z", format_mm(specimen.drive_angle_deg)),
                };
                match specimen.plates_before_drive() {
                    None => faces,
                    Some((way, by_mm)) => format!("{faces}, {way} by {}", format_mm(by_mm)),
                }
            }
            TestKind::Uniaxial => format!("Uniaxial, faces x = ±{} bonded", format_mm(0.5 * block.length_mm)),
        };
        let ratio = if self.scale >= 1.0 {
            format!("{}:1", format_mm(self.scale))
        } else {
            format!("1:{}", format_mm(1.0 / self.scale))
        };
        let sheet = if self.size[0] > 300.0 { "A3" } else { "A4" };
        for line in [
            match block.taper().is_even() {
                true => format!("Block {length} × {thickness} × {breadth} (x, y, z)"),
                false => {
                    let [from, to] = block.end_thicknesses_mm().map(format_mm);
                    format!("Wedge {length} × {from} to {to} × {breadth} (x, y, z)")
                }
            },
            faces,
            format!("Samples of this kind in one test: {}", specimen.samples_in_parallel),
            format!("Dimensions in mm. Scale {ratio} on {sheet}."),
        ]
        .into_iter()
        .chain(angles_line(specimen))
        {
            self.text(Layer::Sheet, [left + 1.0, y], TEXT_HEIGHT, Anchor::Start, false, line);
            y -= 4.6;
        }
    }
}

/// What of an outline the views' dimensions do not tell.
fn outline_in_words(outline: Outline) -> String {
    let kind = match outline {
        Outline::Block => return String::new(),
        Outline::Iso37Type4 => "ISO 37 type 4: narrow portion",
        Outline::Dumbbell(_) => "dumb-bell: gauge",
    };
    let [width, radius] =
        outline.dumbbell().map_or([0.0; 2], |d| [d.gauge_width_mm, d.fillet_radius_mm]).map(format_mm);
    format!(", {kind} {width} wide, radii R{radius}")
}

/// How angles of holes count, where there are any.
fn angles_line(specimen: &Specimen) -> Option<String> {
    let axis = if specimen.extrusion_axis() == HoleAxis::Thickness { "z" } else { "y" };
    let has_angles = specimen.holes.iter().any(|hole| hole.shape.is_some());
    has_angles.then(|| format!("Angles of holes in degrees, from +x towards +{axis}."))
}

/// Breaks a text into at most `max_lines` lines of `per_line` characters; what is left over becomes an ellipsis.
fn wrap(text: &str, per_line: usize, max_lines: usize) -> Vec<String> {
    let characters: Vec<char> = text.chars().collect();
    let mut lines = Vec::new();
    let mut rest = &characters[..];
    while !rest.is_empty() && lines.len() < max_lines {
        if rest.len() <= per_line {
            lines.push(rest.iter().collect());
            break;
        }
        if lines.len() + 1 == max_lines {
            lines.push(rest[..per_line - 1].iter().chain(['…'].iter()).collect());
            break;
        }
        let space = rest[..=per_line].iter().rposition(|c| *c == ' ').filter(|at| *at > 0);
        let cut = space.unwrap_or(per_line);
        lines.push(rest[..cut].iter().collect());
        rest = &rest[if space.is_some() { cut + 1 } else { cut }..];
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::specimen::HoleTolerances;
    use crate::specimen::drawing_sheet::Text;
    use crate::specimen::sampling::{dumbbell_with_hole, valid_specimen, valid_wedge};
    use proptest::prelude::*;

    fn texts(drawing: &Drawing) -> Vec<&Text> {
        let texts = drawing.entities.iter();
        texts.filter_map(|entity| if let Shape::Text(text) = &entity.shape { Some(text) } else { None }).collect()
    }

    fn check_texts(drawing: &Drawing) -> Result<(), String> {
        let texts = texts(drawing);
        for (i, a) in texts.iter().enumerate() {
            let [a0, a1] = a.bounds();
            if a0[0] < 4.0 || a0[1] < 4.0 || a1[0] > drawing.size[0] - 4.0 || a1[1] > drawing.size[1] - 4.0 {
                return Err(format!("{:?} leaves the sheet", a.content));
            }
            for b in &texts[i + 1..] {
                let [b0, b1] = b.bounds();
                let is_apart = a1[0] <= b0[0] || b1[0] <= a0[0] || a1[1] <= b0[1] || b1[1] <= a0[1];
                if !is_apart {
                    return Err(format!("{:?} and {:?} overlap", a.content, b.content));
                }
            }
        }
        Ok(())
    }

    #[test]
    fn long_names_are_wrapped_and_cut() {
        assert_eq!(wrap("one two three", 7, 2), ["one two", "three"].map(String::from).to_vec());
        assert_eq!(wrap(&"x".repeat(30), 10, 2), ["x".repeat(10), format!("{}…", "x".repeat(9))]);
        assert!(wrap("", 10, 2).is_empty());
    }

    /// Every dimension to 0.05 mm.
    fn toleranced(specimen: &Specimen) -> Tolerances {
        let hole = HoleTolerances { center_mm: [Some(0.05); 2], diameter_mm: Some(0.05), length_mm: Some(0.05) };
        Tolerances { block_mm: [Some(0.05); 3], holes: vec![hole; specimen.holes.len()] }
    }

    /// The published specimen's drawing tells the tolerances of its block beside its dimensions, those of its holes in
    /// the table.
    #[test]
    fn tolerances_are_drawn() {
        let specimen = Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).unwrap();
        let drawing = Drawing::new(&specimen, &toleranced(&specimen));
        let has = |text: &str| texts(&drawing).iter().filter(|t| t.content == text).count();
        assert_eq!(["25.4 ±0.05", "6.4 ±0.05", "19.1 ±0.05", "±", "0.05"].map(has), [1, 1, 1, 3, 6]);
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 128, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn texts_do_not_overlap(specimen in valid_specimen()) {
            prop_assert_eq!(check_texts(&Drawing::new(&specimen, &Tolerances::default())), Ok(()));
        }

        #[test]
        fn texts_do_not_overlap_with_tolerances(specimen in valid_specimen()) {
            prop_assert_eq!(check_texts(&Drawing::new(&specimen, &toleranced(&specimen))), Ok(()));
        }

        #[test]
        fn texts_do_not_overlap_in_wedges(specimen in valid_wedge()) {
            prop_assert_eq!(specimen.validate(), Ok(()));
            prop_assert_eq!(check_texts(&Drawing::new(&specimen, &Tolerances::default())), Ok(()));
        }

        #[test]
        fn texts_do_not_overlap_in_dumbbells(specimen in dumbbell_with_hole()) {
            prop_assume!(specimen.validate().is_ok());
            prop_assert_eq!(check_texts(&Drawing::new(&specimen, &Tolerances::default())), Ok(()));
        }
    }
}
