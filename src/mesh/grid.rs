//! Structured grids of quadrilaterals, collected into a section.

use super::domain::{COINCIDENT, Domain};
use super::error::MeshError;
use super::grading::{divide, with_middles};
use super::options::MeshOptions;
use super::section::{PointMerger, Section};

/// Number of parts for a length, refused if absurd.
pub(super) fn count(length: f64, options: &MeshOptions) -> Result<usize, MeshError> {
    let n = (length / options.section_size_mm).round();
    if n > options.max_elements as f64 {
        return Err(MeshError::TooManyElements { elements: n as usize, limit: options.max_elements });
    }
    Ok((n as usize).max(1))
}

/// Refuses a section whose extrusion would have more elements than allowed.
pub(super) fn limit_cells(cells: usize, options: &MeshOptions) -> Result<(), MeshError> {
    if cells.saturating_mul(options.levels.div_ceil(2)) > options.max_elements {
        return Err(MeshError::TooManyElements { elements: cells, limit: options.max_elements });
    }
    Ok(())
}

/// `low` to `high` in `n` graded parts, with middles.
pub(super) fn line(low: f64, high: f64, n: usize, start: f64, end: f64) -> Vec<f64> {
    with_middles(&divide(n, start, end)).iter().map(|u| low + (high - low) * u).collect()
}

/// Positions with middles, and one more part up to `end` where they do not reach it; `on_both_sides` from −`end` as
/// well.
pub(super) fn layered(mut positions: Vec<f64>, end: f64, on_both_sides: bool) -> Vec<f64> {
    let last = positions.last().copied().unwrap_or(end);
    if end - last > COINCIDENT * end {
        let layer = [0.5 * (last + end), end];
        if on_both_sides {
            positions.splice(0..0, layer.map(|p| -p).into_iter().rev());
        }
        positions.extend(layer);
    }
    positions
}

/// Collects grids into a section.
pub(super) struct Builder {
    merger: PointMerger,
    cells: Vec<u32>,
}

impl Builder {
    /// Of nothing yet, merging points within `domain`'s tolerance.
    pub fn new(domain: &Domain) -> Self {
        Builder { merger: PointMerger::new(domain), cells: Vec::new() }
    }

    /// A grid of `ni` × `nj` points (odd numbers; every other one is a middle). The first direction turned
    /// counter-clockwise gives the second.
    pub fn grid(&mut self, ni: usize, nj: usize, point: impl Fn(usize, usize) -> [f64; 2]) {
        let mut indices = Vec::with_capacity(ni * nj);
        for j in 0..nj {
            for i in 0..ni {
                indices.push(self.merger.insert(point(i, j)));
            }
        }
        for j in (0..nj - 1).step_by(2) {
            for i in (0..ni - 1).step_by(2) {
                for b in 0..3 {
                    for a in 0..3 {
                        self.cells.push(indices[i + a + ni * (j + b)]);
                    }
                }
            }
        }
    }

    /// The section of all grids.
    pub fn finish(self) -> Section {
        Section { nodes_per_cell: 9, points: self.merger.points, cells: self.cells }
    }
}
