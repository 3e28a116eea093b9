//! The table of holes on a drawing.

use super::drawing_sheet::{Anchor, Drawing, Layer, TEXT_HEIGHT, format_deg, format_mm};
use super::{Hole, HoleAxis, HoleTolerances, Specimen, Tolerances};

pub(super) const ROW_HEIGHT: f64 = 4.0;
/// Widths of columns, mm: of numbers, of coordinates and circles' diameters, of what outlines have, of tolerances.
const NUMBER: f64 = 9.0;
const LENGTH: f64 = 15.0;
const OF_OUTLINE: f64 = 13.0;
const TOLERANCE: f64 = 10.0;

/// What a column says of a hole with its tolerances.
type Cell = Box<dyn Fn(&Hole, &HoleTolerances) -> String>;

/// A column behind that of the numbers.
struct TableColumn {
    header: String,
    width: f64,
    cell: Cell,
}

impl TableColumn {
    fn new(header: &str, width: f64, cell: impl Fn(&Hole, &HoleTolerances) -> String + 'static) -> TableColumn {
        TableColumn { header: header.into(), width, cell: Box::new(cell) }
    }

    fn tolerance(of: fn(&HoleTolerances) -> Option<f64>) -> TableColumn {
        TableColumn::new("±", TOLERANCE, move |_, t| of(t).map_or(String::new(), format_mm))
    }
}

/// The columns of a specimen's table. Where holes have tolerances, these stand in place of the distances from the ends,
/// which the overall dimensions tell.
fn columns(specimen: &Specimen, tolerances: &Tolerances) -> Vec<TableColumn> {
    let lateral = if specimen.extrusion_axis() == HoleAxis::Thickness { "z" } else { "y" };
    let has_tolerances = !tolerances.holes.is_empty();
    let has_circles_only = specimen.holes.iter().all(|hole| hole.shape.is_none());
    let [half_length, half_lateral] = specimen.section_size().map(|extent| 0.5 * extent);
    let mut all = Vec::new();
    let mut add = |column: TableColumn, tolerance: fn(&HoleTolerances) -> Option<f64>| {
        all.push(column);
        if has_tolerances {
            all.push(TableColumn::tolerance(tolerance));
        }
    };
    add(TableColumn::new("x", LENGTH, |h, _| format_mm(h.center_mm[0])), |t| t.center_mm[0]);
    add(TableColumn::new(lateral, LENGTH, |h, _| format_mm(h.center_mm[1])), |t| t.center_mm[1]);
    if has_circles_only {
        add(TableColumn::new("⌀", LENGTH, |h, _| format_mm(h.diameter_mm)), |t| t.diameter_mm);
    } else {
        add(TableColumn::new("width", OF_OUTLINE, |h, _| format_mm(h.diameter_mm)), |t| t.diameter_mm);
        let length = |h: &Hole, _: &HoleTolerances| h.shape.map_or(String::new(), |s| format_mm(s.length_mm));
        add(TableColumn::new("length", OF_OUTLINE, length), |t| t.length_mm);
        let kind = |h: &Hole, _: &HoleTolerances| h.shape.map_or("round", |s| s.kind.name()).to_string();
        let angle =
            |h: &Hole, _: &HoleTolerances| h.shape.map_or(String::new(), |s| format!("{}°", format_deg(s.angle_deg)));
        let place = all.iter().position(|c| c.header == "width").unwrap_or(all.len());
        all.insert(place, TableColumn::new("outline", OF_OUTLINE, kind));
        all.push(TableColumn::new("angle", OF_OUTLINE, angle));
    }
    if !has_tolerances {
        let from_end = TableColumn::new("from -x", LENGTH, move |h, _| format_mm(half_length + h.center_mm[0]));
        let from_side = move |h: &Hole, _: &HoleTolerances| format_mm(half_lateral + h.center_mm[1]);
        all.splice(2..2, [from_end, TableColumn::new(&format!("from -{lateral}"), LENGTH, from_side)]);
    }
    all
}

/// Width of a specimen's table, mm.
pub(super) fn table_width(specimen: &Specimen, tolerances: &Tolerances) -> f64 {
    NUMBER + columns(specimen, tolerances).iter().map(|c| c.width).sum::<f64>()
}

impl Drawing {
    /// The table of holes; `rows` per table, tables side by side from `top_left`.
    pub(super) fn table(&mut self, specimen: &Specimen, tolerances: &Tolerances, rows: usize, top_left: [f64; 2]) {
        if specimen.holes.is_empty() {
            return;
        }
        let columns = columns(specimen, tolerances);
        let table_width = table_width(specimen, tolerances);
        let widths: Vec<f64> = std::iter::once(NUMBER).chain(columns.iter().map(|c| c.width)).collect();
        let header: Vec<String> =
            std::iter::once("hole".to_string()).chain(columns.iter().map(|c| c.header.clone())).collect();
        for (table, holes) in specimen.holes.chunks(rows).enumerate() {
            let left = top_left[0] + table as f64 * table_width;
            let mut y = top_left[1] - 6.0;
            self.table_row(left, y, &header, &widths);
            let right = left + table_width - 2.0;
            self.line(Layer::Sheet, [left, y - 1.2], [right, y - 1.2]);
            for (i, hole) in holes.iter().enumerate() {
                y -= ROW_HEIGHT + if i == 0 { 1.0 } else { 0.0 };
                let place = table * rows + i;
                let own = tolerances.holes.get(place).copied().unwrap_or_default();
                let cells = columns.iter().map(|c| (c.cell)(hole, &own));
                let row: Vec<String> = std::iter::once((place + 1).to_string()).chain(cells).collect();
                self.table_row(left, y, &row, &widths);
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
