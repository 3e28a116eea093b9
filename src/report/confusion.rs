//! What was hidden against what was named first.

use super::color::{AXIS, MUTED};
use super::svg::{SMALL, Svg, TextStyle};
use crate::proof::Proof;

const CELL: f64 = 30.0;
const LEFT: f64 = 170.0;
const TOP: f64 = 150.0;

/// A matrix: rows are hidden causes, columns what was named first; numbers of recordings.
pub fn confusion_picture(proof: &Proof) -> String {
    let rows: Vec<(String, &Vec<(String, usize)>)> = proof
        .known
        .iter()
        .map(|k| (k.cause.name().to_string(), &k.first_named))
        .chain(proof.unknown.iter().map(|k| (format!("{} (unknown)", k.cause.name()), &k.first_named)))
        .collect();
    let mut columns: Vec<String> = proof.known.iter().map(|k| k.cause.name().to_string()).collect();
    columns.retain(|c| c != "none");
    for (_, named) in &rows {
        for (name, _) in named.iter() {
            if !columns.contains(name) {
                columns.push(name.clone());
            }
        }
    }
    let (width, height) = (LEFT + CELL * columns.len() as f64 + 20.0, TOP + CELL * rows.len() as f64 + 20.0);
    let mut svg = Svg::new(width, height);
    svg.text([12.0, 24.0], "Hidden cause (rows), first named (columns), number of recordings", &TextStyle::title());
    let small = TextStyle::new(SMALL);
    for (j, name) in columns.iter().enumerate() {
        let x = LEFT + CELL * (j as f64 + 0.6);
        svg.text([x, TOP - 8.0], name, &small.vertical());
    }
    for (i, (row, named)) in rows.iter().enumerate() {
        let y = TOP + CELL * i as f64;
        let total: usize = named.iter().map(|(_, n)| n).sum();
        svg.text([12.0, y + 0.65 * CELL], row, &small);
        for (j, name) in columns.iter().enumerate() {
            let count = named.iter().find(|(n, _)| n == name).map_or(0, |(_, n)| *n);
            let x = LEFT + CELL * j as f64;
            let share = count as f64 / total.max(1) as f64;
            let is_same = row == name
                || row == "none" && name == "(none)"
                || row.ends_with("(unknown)") && name == "(unexplained)";
            let hue = if is_same { [38.0, 120.0, 80.0] } else { [190.0, 70.0, 40.0] };
            let shade = hue.map(|h: f64| (255.0 - share * (255.0 - h)).round() as u8);
            let fill = format!("#{:02x}{:02x}{:02x}", shade[0], shade[1], shade[2]);
            svg.stroked_rect([x, y, CELL - 1.0, CELL - 1.0], &fill, if is_same { AXIS } else { MUTED }, 0.5);
            if count > 0 {
                svg.text([x + 0.3 * CELL, y + 0.65 * CELL], &count.to_string(), &small);
            }
        }
    }
    svg.finish("What was hidden against what was named first")
}
