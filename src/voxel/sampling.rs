//! Where a voxel's material part is sampled.

use super::mask::clipped;
use super::section::{Overlap, Section};
use super::{VoxelError, VoxelGrid};
use crate::specimen::Specimen;

/// Numbers of sample points per voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampling {
    /// Gauss points along x, y, z of an uncut voxel (1 to 4). Two per axis average cubics exactly.
    pub gauss_points: [usize; 3],
    /// Slices along x of a voxel that a wall cuts; each slice's intervals carry Gauss points as above.
    pub cut_slices: usize,
}

impl Default for Sampling {
    fn default() -> Self {
        Sampling { gauss_points: [2; 3], cut_slices: 6 }
    }
}

/// A voxel that is shorter than this part of an element, along an axis, needs one point there: within an element fields
/// are quadratic, and the midpoint misses their average by a 24th of the curvature times the square of the edge.
const SHORT_VOXEL: f64 = 0.125;

impl Sampling {
    /// As many points as fields on elements of `element_mm` call for.
    pub fn on_elements_of(element_mm: f64, voxel_mm: [f64; 3]) -> Sampling {
        let of_axis = |edge_mm: f64| if edge_mm < SHORT_VOXEL * element_mm { 1 } else { 2 };
        Sampling { gauss_points: voxel_mm.map(of_axis), ..Sampling::default() }
    }

    pub(super) fn check(&self) -> Result<(), VoxelError> {
        for value in self.gauss_points {
            if !(1..=4).contains(&value) {
                return Err(VoxelError::InvalidSampling { value, limit: 4 });
            }
        }
        if !(1..=64).contains(&self.cut_slices) {
            return Err(VoxelError::InvalidSampling { value: self.cut_slices, limit: 64 });
        }
        Ok(())
    }

    /// Points in the material part of a voxel with weights that sum to one.
    pub(super) fn points(&self, section: &Section, grid: &VoxelGrid, voxel: usize, points: &mut Vec<([f64; 3], f64)>) {
        points.clear();
        let n = grid.indices(voxel);
        let bounds = [0, 1, 2].map(|axis| clipped(grid, section, axis, n[axis]));
        let (across, along) = (section.across, section.along);
        // A voxel on a face has no thickness.
        let rule = |axis: usize| gauss(if grid.normal_axis() == Some(axis) { 1 } else { self.gauss_points[axis] });
        let is_slanted = section.is_slanted(bounds[0], bounds[along]);
        match section.overlap_on(grid, bounds[0], bounds[across]) {
            Overlap::None => return,
            Overlap::Full if !is_slanted => {
                for &(x, wx) in rule(0) {
                    for &(b, wb) in rule(across) {
                        for &(c, wc) in rule(along) {
                            let mut point = [0.0; 3];
                            point[0] = at(bounds[0], x);
                            point[across] = at(bounds[across], b);
                            point[along] = at(bounds[along], c);
                            points.push((point, wx * wb * wc));
                        }
                    }
                }
            }
            Overlap::Full | Overlap::Cut => {
                let is_edge_on = grid.normal_axis() == Some(across);
                let mut intervals: Vec<[f64; 2]> = Vec::new();
                let in_gap = if is_slanted { section.x_within_gap(bounds[0], bounds[along]) } else { bounds[0] };
                for s in 0..self.cut_slices {
                    let x = at(in_gap, (2.0 * s as f64 + 1.0) / self.cut_slices as f64 - 1.0);
                    let mut along_bounds = bounds[along];
                    let mut depth = 1.0;
                    if is_slanted {
                        along_bounds = section.within_gap(x, bounds[along]);
                        depth = along_bounds[1] - along_bounds[0];
                        if !(depth > 0.0) {
                            continue;
                        }
                    }
                    // A face that is seen edge-on is a point across.
                    if is_edge_on {
                        intervals.clear();
                        intervals.push(bounds[across]);
                    } else {
                        section.slice(x, bounds[across][0], bounds[across][1], &mut intervals);
                    }
                    for &interval in &intervals {
                        let width = if is_edge_on { 1.0 } else { interval[1] - interval[0] };
                        for &(b, wb) in rule(across) {
                            for &(c, wc) in rule(along) {
                                let mut point = [0.0; 3];
                                point[0] = x;
                                point[across] = at(interval, b);
                                point[along] = at(along_bounds, c);
                                points.push((point, width * wb * wc * depth));
                            }
                        }
                    }
                }
            }
        }
        let total: f64 = points.iter().map(|p| p.1).sum();
        for (_, weight) in points {
            *weight /= total;
        }
    }
}

/// Sample points in the material part of a specimen's voxels, for what is not linear in the field.
pub struct MaterialPoints<'a> {
    section: Section<'a>,
    sampling: Sampling,
}

impl<'a> MaterialPoints<'a> {
    /// Prepares the points of `specimen`.
    ///
    /// # Errors
    /// [`VoxelError::InvalidSampling`].
    pub fn new(specimen: &'a Specimen, sampling: Sampling) -> Result<Self, VoxelError> {
        sampling.check()?;
        Ok(MaterialPoints { section: Section::new(specimen), sampling })
    }

    /// Positions (mm) and weights (sum one) in the material part of a voxel, which must hold some material.
    pub fn of_voxel(&self, grid: &VoxelGrid, voxel: usize, points: &mut Vec<([f64; 3], f64)>) {
        self.sampling.points(&self.section, grid, voxel, points);
    }
}

fn at([low, high]: [f64; 2], reference: f64) -> f64 {
    0.5 * (low + high) + 0.5 * (high - low) * reference
}

/// Gauss–Legendre points and weights on [−1, 1].
fn gauss(num_points: usize) -> &'static [(f64, f64)] {
    const A: f64 = 0.577_350_269_189_625_8;
    const B: f64 = 0.774_596_669_241_483_4;
    const C: f64 = 0.861_136_311_594_052_6;
    const D: f64 = 0.339_981_043_584_856_3;
    const WC: f64 = 0.347_854_845_137_453_85;
    const WD: f64 = 0.652_145_154_862_546_1;
    match num_points {
        1 => &[(0.0, 2.0)],
        2 => &[(-A, 1.0), (A, 1.0)],
        3 => &[(-B, 5.0 / 9.0), (0.0, 8.0 / 9.0), (B, 5.0 / 9.0)],
        _ => &[(-C, WC), (-D, WD), (D, WD), (C, WC)],
    }
}

#[cfg(test)]
mod tests {
    use super::super::mask::tests::{PUBLISHED_VOXEL, solid, two_hole};
    use super::*;

    /// The rule with n points integrates polynomials up to degree 2n − 1.
    #[test]
    fn gauss_rules_have_their_degree() {
        for n in 1..=4 {
            for degree in 0..2 * n {
                let value: f64 = gauss(n).iter().map(|(x, w)| w * x.powi(degree as i32)).sum();
                let exact = if degree % 2 == 0 { 2.0 / (degree as f64 + 1.0) } else { 0.0 };
                assert!((value - exact).abs() < 1e-15);
            }
        }
    }

    /// Points lie in the material; an uncut voxel's are symmetric about its centre.
    #[test]
    fn points_lie_in_the_material() {
        let specimen = two_hole();
        let (section, mut points) = (Section::new(&specimen), Vec::new());
        let grid = VoxelGrid::covering(&specimen, PUBLISHED_VOXEL).unwrap();
        let mut num_cut = 0;
        for voxel in 0..grid.num_voxels() {
            Sampling::default().points(&section, &grid, voxel, &mut points);
            if points.is_empty() {
                continue;
            }
            let mut mean = [0.0; 3];
            for (p, w) in &points {
                for hole in &specimen.holes {
                    assert!((p[0] - hole.center_mm[0]).hypot(p[2] - hole.center_mm[1]) > 2.5);
                }
                for a in 0..3 {
                    mean[a] += w * p[a];
                }
            }
            let center = grid.center_mm(voxel);
            let is_centred = (0..3).all(|a| (mean[a] - center[a]).abs() < 1e-12);
            num_cut += usize::from(!is_centred);
            assert!(is_centred || points.len() > 8 || points.len() % 4 == 0);
        }
        // Each wall of 15.7 mm crosses some 20 columns of 34 layers.
        assert!((30 * 34..60 * 34).contains(&num_cut), "{num_cut}");
    }

    /// A voxel that overhangs the block is sampled in its material part.
    #[test]
    fn overhanging_voxels_are_clipped() {
        let specimen = solid();
        let (section, mut points) = (Section::new(&specimen), Vec::new());
        let grid = VoxelGrid::new([12.7, 3.2, 9.55], [1.0; 3], [1; 3]).unwrap();
        Sampling::default().points(&section, &grid, 0, &mut points);
        let mean = [0, 1, 2].map(|a| points.iter().map(|(p, w)| w * p[a]).sum::<f64>());
        for (found, exact) in mean.into_iter().zip([12.45, 2.95, 9.3]) {
            assert!((found - exact).abs() < 1e-12);
        }
    }
}
