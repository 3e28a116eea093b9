//! What was hidden against what was named first.

use super::color::{AXIS, MUTED};
use super::svg::{SMALL, Svg, TextStyle};
use crate::diagnosis::CauseName;
use crate::proof::{CauseSummary, FirstNamed, Proof};

const CELL: f64 = 30.0;
const LEFT: f64 = 170.0;
const TOP: f64 = 150.0;

/// A row of the matrix: what was hidden, and how often each cause was named first.
struct Row<'a> {
    label: String,
    /// What should be named first.
    right: FirstNamed,
    first_named: &'a [(FirstNamed, usize)],
}

impl Row<'_> {
    fn known(summary: &CauseSummary) -> Row<'_> {
        let right = summary.cause.diagnosed().map_or(FirstNamed::Nothing, named);
        Row { label: summary.cause.name().into(), right, first_named: &summary.first_named }
    }

    fn unknown(summary: &CauseSummary) -> Row<'_> {
        let label = format!("{} (unknown)", summary.cause.name());
        Row { label, right: FirstNamed::Unexplained, first_named: &summary.first_named }
    }
}

fn named(cause: CauseName) -> FirstNamed {
    FirstNamed::Cause(cause.as_str().into())
}

/// A matrix: rows are hidden causes, columns what was named first; numbers of recordings.
pub fn confusion_picture(proof: &Proof) -> String {
    let rows: Vec<Row> = proof.known.iter().map(Row::known).chain(proof.unknown.iter().map(Row::unknown)).collect();
    let mut columns: Vec<FirstNamed> = proof.known.iter().filter_map(|k| k.cause.diagnosed()).map(named).collect();
    for (first, _) in rows.iter().flat_map(|row| row.first_named) {
        if !columns.contains(first) {
            columns.push(first.clone());
        }
    }
    let (width, height) = (LEFT + CELL * columns.len() as f64 + 20.0, TOP + CELL * rows.len() as f64 + 20.0);
    let mut svg = Svg::new(width, height);
    svg.text([12.0, 24.0], "Hidden cause (rows), first named (columns), number of recordings", &TextStyle::title());
    let small = TextStyle::new(SMALL);
    for (j, name) in columns.iter().enumerate() {
        let x = LEFT + CELL * (j as f64 + 0.6);
        svg.text([x, TOP - 8.0], &name.to_string(), &small.vertical());
    }
    for (i, row) in rows.iter().enumerate() {
        let y = TOP + CELL * i as f64;
        let total: usize = row.first_named.iter().map(|(_, n)| n).sum();
        svg.text([12.0, y + 0.65 * CELL], &row.label, &small);
        for (j, name) in columns.iter().enumerate() {
            let count = row.first_named.iter().find(|(n, _)| n == name).map_or(0, |(_, n)| *n);
            let x = LEFT + CELL * j as f64;
            let share = count as f64 / total.max(1) as f64;
            let is_right = row.right == *name;
            let hue = if is_right { [38.0, 120.0, 80.0] } else { [190.0, 70.0, 40.0] };
            let shade = hue.map(|h: f64| (255.0 - share * (255.0 - h)).round() as u8);
            let fill = format!("#{:02x}{:02x}{:02x}", shade[0], shade[1], shade[2]);
            svg.stroked_rect([x, y, CELL - 1.0, CELL - 1.0], &fill, if is_right { AXIS } else { MUTED }, 0.5);
            if count > 0 {
                svg.text([x + 0.3 * CELL, y + 0.65 * CELL], &count.to_string(), &small);
            }
        }
    }
    svg.finish("What was hidden against what was named first")
}
