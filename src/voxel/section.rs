//! The specimen's section as the voxels see it: slices at constant x are unions of intervals.
//!
//! Every specimen is a section extruded along y (or along z, for holes along the width), and x lies in the section. At
//! constant x the material along the other section axis is the outline's interval less the chords of the holes, and
//! that along the extrusion an interval, which in a wedge changes with x: all in closed form. Areas, volumes and
//! averages over cut voxels need only a rule along x.

use super::VoxelGrid;
use crate::specimen::{HoleAxis, HoleWall, Specimen, Taper};

/// How a rectangle of the section lies to the material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Overlap {
    /// All material.
    Full,
    /// Partly material, or undecided by the cheap test.
    Cut,
    /// No material.
    None,
}

/// A specimen's section with its extrusion.
pub(super) struct Section<'a> {
    specimen: &'a Specimen,
    /// Axis (1 or 2) that lies in the section besides x.
    pub across: usize,
    /// Axis of extrusion (2 or 1).
    pub along: usize,
    /// Half extents of the box around the block, mm.
    pub half: [f64; 3],
    /// How the extent along y goes along x.
    taper: Taper,
}

impl<'a> Section<'a> {
    pub fn new(specimen: &'a Specimen) -> Self {
        let is_along_width = specimen.holes.first().is_some_and(|h| h.axis == HoleAxis::Width);
        let (across, along) = if is_along_width { (1, 2) } else { (2, 1) };
        let half = specimen.block.extents_mm().map(|e| 0.5 * e);
        Section { specimen, across, along, half, taper: specimen.block.taper() }
    }

    /// Whether a voxel with these bounds, cut to the box, meets a slanted face of a wedge.
    pub fn is_slanted(&self, x: [f64; 2], along: [f64; 2]) -> bool {
        if self.taper.is_even() {
            return false;
        }
        let farthest = along[0].abs().max(along[1].abs());
        x.iter().any(|&x| farthest > self.specimen.half_gap_mm(x))
    }

    /// What of [x₀, x₁] has any of [low, high] along the extrusion in a wedge.
    pub fn x_within_gap(&self, x: [f64; 2], [low, high]: [f64; 2]) -> [f64; 2] {
        let (nearest, middle) = (low.max(-high), self.specimen.half_gap_mm(0.0));
        if nearest <= 0.0 {
            return x;
        }
        let face = (nearest / middle - 1.0) / self.taper.slope_per_mm();
        if self.taper.slope_per_mm() > 0.0 { [x[0].max(face), x[1]] } else { [x[0], x[1].min(face)] }
    }

    /// What of [low, high] along the extrusion is in a wedge at x; low ≥ high where nothing is.
    pub fn within_gap(&self, x: f64, [low, high]: [f64; 2]) -> [f64; 2] {
        let half = self.specimen.half_gap_mm(x);
        [low.max(-half), high.min(half)]
    }

    /// Half extent of the outline across the section at x, mm.
    fn half_across(&self, x: f64) -> f64 {
        if self.across == 2 { self.specimen.half_width_mm(x) } else { self.half[1] }
    }

    /// Material along the `across` axis at x, cut to [low, high]: disjoint intervals in increasing order.
    pub fn slice(&self, x: f64, low: f64, high: f64, intervals: &mut Vec<[f64; 2]>) {
        intervals.clear();
        let outline = self.half_across(x);
        let (low, high) = (low.max(-outline), high.min(outline));
        if x.abs() > self.half[0] || low >= high {
            return;
        }
        intervals.push([low, high]);
        for hole in &self.specimen.holes {
            let Some([from, to]) = hole.wall().chord_mm(x) else { continue };
            let mut n = 0;
            while n < intervals.len() {
                let [a, b] = intervals[n];
                if to <= a || from >= b {
                    n += 1;
                    continue;
                }
                intervals.remove(n);
                if to < b {
                    intervals.insert(n, [to, b]);
                }
                if from > a {
                    intervals.insert(n, [a, from]);
                    n += 1;
                }
                if to < b {
                    n += 1;
                }
            }
        }
    }

    /// How the rectangle [x₀, x₁] × [b₀, b₁] (inside the block) lies to the material.
    pub fn overlap(&self, x: [f64; 2], b: [f64; 2]) -> Overlap {
        if x[0] >= x[1] || b[0] >= b[1] {
            return Overlap::None;
        }
        // The outlines widen from the middle to the ends: the narrowest place is the one nearest to x = 0.
        let nearest_x = if x[0] > 0.0 { x[0] } else { x[1].min(0.0) };
        let mut overlap = if b[0].abs().max(b[1].abs()) <= self.half_across(nearest_x) + 1e-12 {
            Overlap::Full
        } else {
            Overlap::Cut
        };
        for hole in &self.specimen.holes {
            match of_hole(&hole.wall(), x, b) {
                Overlap::None => return Overlap::None,
                Overlap::Cut => overlap = Overlap::Cut,
                Overlap::Full => {}
            }
        }
        overlap
    }

    /// As [`Self::overlap`], of a voxel of `grid`: on a face that is seen edge-on in the section, a straight line
    /// without holes, it is all material between its ends.
    pub fn overlap_on(&self, grid: &VoxelGrid, x: [f64; 2], b: [f64; 2]) -> Overlap {
        match grid.normal_axis() {
            Some(axis) if axis == self.across => {
                if x[0] < x[1] {
                    Overlap::Full
                } else {
                    Overlap::None
                }
            }
            _ => self.overlap(x, b),
        }
    }

    /// Material volume in a voxel that a slanted face cuts, mm³: as [`Self::area`]. On a face that is seen edge-on in
    /// the section, a length of `edge_on_mm` across counts for the straight line.
    pub fn volume(&self, x: [f64; 2], b: [f64; 2], along: [f64; 2], edge_on_mm: Option<f64>, num_slices: usize) -> f64 {
        let x = self.x_within_gap(x, along);
        let width = (x[1] - x[0]).max(0.0) / num_slices as f64;
        let mut intervals = Vec::new();
        let mut volume = 0.0;
        for n in 0..num_slices {
            let at = x[0] + (n as f64 + 0.5) * width;
            let [low, high] = self.within_gap(at, along);
            self.slice(at, b[0], b[1], &mut intervals);
            let across = edge_on_mm.unwrap_or_else(|| intervals.iter().map(|[low, high]| high - low).sum());
            volume += width * across * (high - low).max(0.0);
        }
        volume
    }

    /// Material area in the rectangle, mm²: closed form along `across`, midpoint rule with `num_slices` along x.
    pub fn area(&self, x: [f64; 2], b: [f64; 2], num_slices: usize) -> f64 {
        let width = (x[1] - x[0]) / num_slices as f64;
        let mut intervals = Vec::new();
        let mut area = 0.0;
        for n in 0..num_slices {
            self.slice(x[0] + (n as f64 + 0.5) * width, b[0], b[1], &mut intervals);
            area += width * intervals.iter().map(|[low, high]| high - low).sum::<f64>();
        }
        area
    }
}

/// How a rectangle lies to a hole: exact for a circle; for other walls `Full` only where it is certain.
fn of_hole(wall: &HoleWall, x: [f64; 2], b: [f64; 2]) -> Overlap {
    let [c, d] = wall.center_mm();
    if wall.is_circle() {
        let radius = wall.half_mm()[1];
        let near = [c.clamp(x[0], x[1]) - c, d.clamp(b[0], b[1]) - d];
        let far = [(x[0] - c).abs().max((x[1] - c).abs()), (b[0] - d).abs().max((b[1] - d).abs())];
        return if far[0].hypot(far[1]) <= radius {
            Overlap::None
        } else if near[0].hypot(near[1]) < radius {
            Overlap::Cut
        } else {
            Overlap::Full
        };
    }
    // A hole is convex: what has its corners in it lies in it.
    let corners = [[x[0], b[0]], [x[1], b[0]], [x[0], b[1]], [x[1], b[1]]];
    if corners.iter().all(|p| wall.distance_mm(*p) <= 0.0) {
        return Overlap::None;
    }
    let middle = [0.5 * (x[0] + x[1]), 0.5 * (b[0] + b[1])];
    let half_diagonal = 0.5 * (x[1] - x[0]).hypot(b[1] - b[0]);
    if wall.distance_mm(middle) >= half_diagonal { Overlap::Full } else { Overlap::Cut }
}

#[cfg(test)]
mod tests {
    use super::super::mask::tests::two_hole;
    use super::*;

    /// Slices and areas of the two-hole block: chords in closed form, total area less two discs.
    #[test]
    fn two_hole_section() {
        let specimen = two_hole();
        let section = Section::new(&specimen);
        let mut intervals = Vec::new();
        let x = specimen.holes[1].center_mm[0];
        section.slice(x, -9.55, 9.55, &mut intervals);
        assert_eq!(intervals, vec![[-9.55, -2.5], [2.5, 9.55]]);
        section.slice(x, -1.0, 4.0, &mut intervals);
        assert_eq!(intervals, vec![[2.5, 4.0]]);
        section.slice(x, -1.0, 1.0, &mut intervals);
        assert!(intervals.is_empty());
        section.slice(13.0, -1.0, 1.0, &mut intervals);
        assert!(intervals.is_empty());
        let area = section.area([-12.7, 12.7], [-9.55, 9.55], 20_000);
        let exact = 25.4 * 19.1 - 2.0 * std::f64::consts::PI * 6.25;
        // Midpoint rule on a square-root end: error about r² (h/r)^1.5 = 6.25 × (0.0005)^1.5 ~ 1e-4.
        assert!((area - exact).abs() < 2e-4);
    }

    #[test]
    fn overlaps() {
        let specimen = two_hole();
        let section = Section::new(&specimen);
        assert_eq!(section.overlap([4.0, 4.5], [-0.2, 0.2]), Overlap::None);
        assert_eq!(section.overlap([6.0, 7.0], [-0.2, 0.2]), Overlap::Cut);
        assert_eq!(section.overlap([9.0, 10.0], [-0.2, 0.2]), Overlap::Full);
        assert_eq!(section.overlap([9.0, 9.0], [-0.2, 0.2]), Overlap::None);
    }
}
