//! A regular division of the block into boxes.

use crate::specimen::Specimen;

/// A regular division of the block.
#[derive(Clone, Copy, Debug)]
pub struct Division {
    /// Numbers of parts along x, y, z.
    pub counts: [usize; 3],
    /// Half extents of the block, mm.
    pub half_mm: [f64; 3],
}

impl Division {
    /// Of a specimen's block.
    pub(super) fn of(specimen: &Specimen, counts: [usize; 3]) -> Division {
        let b = specimen.block;
        Division { counts, half_mm: [0.5 * b.length_mm, 0.5 * b.thickness_mm, 0.5 * b.width_mm] }
    }

    /// Number of parts.
    pub fn num_parts(&self) -> usize {
        self.counts.iter().product()
    }

    /// The part that holds a position.
    pub fn part_of(&self, x: [f64; 3]) -> usize {
        let n = [0, 1, 2].map(|a| {
            let t = (0.5 * (x[a] / self.half_mm[a] + 1.0) * self.counts[a] as f64).floor().max(0.0);
            (t as usize).min(self.counts[a] - 1)
        });
        n[0] + self.counts[0] * (n[1] + self.counts[1] * n[2])
    }

    /// Low and high edges (mm) of parts `first` to `last` along axis `a`.
    pub(super) fn edges(&self, a: usize, first: usize, last: usize) -> [f64; 2] {
        let width = 2.0 * self.half_mm[a] / self.counts[a] as f64;
        [first as f64 * width - self.half_mm[a], (last + 1) as f64 * width - self.half_mm[a]]
    }
}
