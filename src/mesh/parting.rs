//! A section whose cells part along a line.

use super::domain::COINCIDENT;
use super::section::{Section, cross, sub};

/// Parts the cells of a section along a line that their edges follow: points inside it are doubled, and the cells to
/// its left take the copies.
pub(super) fn part(section: &mut Section, [from, to]: [[f64; 2]; 2], scale_mm: f64) {
    let tolerance = COINCIDENT.sqrt() * scale_mm;
    let along = sub(to, from);
    let length = along[0].hypot(along[1]);
    let is_inside = |p: [f64; 2]| {
        let away = sub(p, from);
        let (across, place) = (cross(along, away) / length, (away[0] * along[0] + away[1] * along[1]) / length);
        across.abs() < tolerance && place > tolerance && place < length - tolerance
    };
    let mut copies: Vec<Option<u32>> = vec![None; section.points.len()];
    for n in 0..copies.len() {
        if is_inside(section.points[n]) {
            copies[n] = Some(section.points.len() as u32);
            section.points.push(section.points[n]);
        }
    }
    for cell in section.cells.chunks_mut(section.nodes_per_cell) {
        let corners = cell[..3].iter().map(|&n| section.points[n as usize]);
        let side: f64 = corners.map(|p| cross(along, sub(p, from))).sum();
        if side > 0.0 {
            for n in cell {
                *n = copies.get(*n as usize).copied().flatten().unwrap_or(*n);
            }
        }
    }
}
