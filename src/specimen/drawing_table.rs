//! The table of holes on a drawing.

use super::drawing_sheet::{Anchor, Drawing, Layer, TEXT_HEIGHT, format_deg, format_mm};
use super::{Hole, HoleAxis, Specimen};

pub(super) const ROW_HEIGHT: f64 = 4.0;
/// Of holes that are all circles: number, two coordinates, two distances, diameter.
const WIDTHS_OF_CIRCLES: [f64; 6] = [9.0, 15.0, 15.0, 15.0, 15.0, 15.0];
/// Of others: number, two coordinates, two distances, outline, width, length, angle.
const WIDTHS_OF_OUTLINES: [f64; 9] = [9.0, 15.0, 15.0, 15.0, 15.0, 13.0, 13.0, 13.0, 13.0];

/// Widths of the columns of a specimen's table.
fn column_widths(specimen: &Specimen) -> &'static [f64] {
    let has_circles_only = specimen.holes.iter().all(|hole| hole.shape.is_none());
    if has_circles_only { &WIDTHS_OF_CIRCLES } else { &WIDTHS_OF_OUTLINES }
}

/// Width of a specimen's table, mm.
pub(super) fn table_width(specimen: &Specimen) -> f64 {
    column_widths(specimen).iter().sum()
}

impl Drawing {
    /// The table of holes; `rows` per table, tables side by side from `top_left`.
    pub(super) fn table(&mut self, specimen: &Specimen, rows: usize, top_left: [f64; 2]) {
        if specimen.holes.is_empty() {
            return;
        }
        let widths = column_widths(specimen);
        let b = if specimen.extrusion_axis() == HoleAxis::Thickness { "z" } else { "y" };
        let of_size: &[&str] =
            if widths.len() == WIDTHS_OF_CIRCLES.len() { &["⌀"] } else { &["outline", "width", "length", "angle"] };
        let from_side = format!("from -{b}");
        let header: Vec<String> =
            ["hole", "x", b, "from -x", &from_side].iter().chain(of_size).map(|t| (*t).to_string()).collect();
        let [length, lateral] = specimen.section_size();
        for (table, holes) in specimen.holes.chunks(rows).enumerate() {
            let left = top_left[0] + table as f64 * table_width(specimen);
            let mut y = top_left[1] - 6.0;
            self.table_row(left, y, &header, widths);
            let right = left + table_width(specimen) - 2.0;
            self.line(Layer::Sheet, [left, y - 1.2], [right, y - 1.2]);
            for (i, hole) in holes.iter().enumerate() {
                y -= ROW_HEIGHT + if i == 0 { 1.0 } else { 0.0 };
                let [x, b] = hole.center_mm;
                let mut row = vec![(table * rows + i + 1).to_string()];
                row.extend([x, b, 0.5 * length + x, 0.5 * lateral + b].map(format_mm));
                if widths.len() == WIDTHS_OF_CIRCLES.len() {
                    row.push(format_mm(hole.diameter_mm));
                } else {
                    row.extend(outline_cells(hole));
                }
                self.table_row(left, y, &row, widths);
            }
        }
    }

    fn table_row(&mut self, left: f64, y: f64, cells: &[String], widths: &[f64]) {
        let mut right = left;
        for (cell, width) in cells.iter().zip(widths) {
            right += width;
            self.text(Layer::Sheet, [right - 2.0, y], TEXT_HEIGHT, Anchor::End, false, cell.clone());
        }
    }
}

/// Outline, extent across, extent along and angle of a hole.
fn outline_cells(hole: &Hole) -> [String; 4] {
    let width = format_mm(hole.diameter_mm);
    match hole.shape {
        None => ["round".into(), width, String::new(), String::new()],
        Some(shape) => {
            let angle = format!("{}°", format_deg(shape.angle_deg));
            [shape.kind.name().into(), width, format_mm(shape.length_mm), angle]
        }
    }
}
