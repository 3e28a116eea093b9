//! A cut (slit) through a specimen: a straight line of its section, extruded, on which the elements part.

use super::Mesh;
use super::block_shape::half_extents_mm;
use super::build::mesh_specimen_parted;
use super::error::MeshError;
use super::options::MeshOptions;
use super::section::sub;
use crate::specimen::{HoleAxis, Outline, Specimen};

/// A straight cut through the section, from face to face along the extrusion, without loss of material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// Its middle in the section: x, and z (y where holes run along the width), mm.
    pub center_mm: [f64; 2],
    /// Half its length, mm.
    pub half_length_mm: f64,
    /// Angle of the cut's line to the section's second axis (z or y), towards x, rad. At 0 its normal is along x.
    pub turn_rad: f64,
}

impl Cut {
    /// Unit vector along the line.
    fn direction(&self) -> [f64; 2] {
        let (sin, cos) = self.turn_rad.sin_cos();
        [sin, cos]
    }

    /// Both ends of the line, mm.
    pub fn ends_mm(&self) -> [[f64; 2]; 2] {
        let d = self.direction();
        [-1.0, 1.0].map(|s| [0, 1].map(|c| self.center_mm[c] + s * self.half_length_mm * d[c]))
    }

    /// The point of this cut that stands where `p` stands to `from`: turned, stretched along the line and moved.
    fn carried(&self, from: &Cut, p: [f64; 2]) -> [f64; 2] {
        let ([s, c], [sin, cos]) = (from.direction(), self.direction());
        let away = sub(p, from.center_mm);
        let along = (away[0] * s + away[1] * c) * self.half_length_mm / from.half_length_mm;
        let across = away[0] * c - away[1] * s;
        [self.center_mm[0] + along * sin + across * cos, self.center_mm[1] + along * cos - across * sin]
    }

    /// Distance of a point from the line, mm.
    fn distance_mm(&self, p: [f64; 2]) -> f64 {
        let (away, d) = (sub(p, self.center_mm), self.direction());
        let along = (away[0] * d[0] + away[1] * d[1]).clamp(-self.half_length_mm, self.half_length_mm);
        (away[0] - along * d[0]).hypot(away[1] - along * d[1])
    }
}

/// The axes of the section of a specimen: x, and z unless holes run along the width.
pub fn section_axes(specimen: &Specimen) -> [usize; 2] {
    let along_width = specimen.holes.first().is_some_and(|h| h.axis == HoleAxis::Width);
    [0, if along_width { 1 } else { 2 }]
}

/// A mesh of triangles of the whole `specimen`, whose elements part along `cut`: nodes inside the line stand there
/// twice, once for each side. The cut must lie inside the section and keep clear of the holes.
///
/// # Errors
/// As [`mesh_specimen_along`](super::mesh_specimen_along).
pub fn mesh_cut_specimen(specimen: &Specimen, options: &MeshOptions, cut: &Cut) -> Result<Mesh, MeshError> {
    mesh_specimen_parted(specimen, options, cut.ends_mm())
}

/// Displacement (mm) that brings a node of a mesh made for `from` to its place in one for `to`: on the cut it goes with
/// the cut, on the outline and on the holes' walls it stays.
pub fn cut_offset(specimen: &Specimen, from: &Cut, to: &Cut, node: [f64; 3]) -> [f64; 3] {
    let axes = section_axes(specimen);
    let p = axes.map(|a| node[a]);
    let fixed = clearance_mm(specimen, p);
    let own = from.distance_mm(p);
    let mut offset = [0.0; 3];
    if fixed > 0.0 {
        let weight = fixed / (fixed + own);
        let carried = to.carried(from, p);
        for c in 0..2 {
            offset[axes[c]] = weight * (carried[c] - p[c]);
        }
    }
    offset
}

/// Distance (mm) of a point of the section from the outline of the block and the holes' walls; zero outside.
pub fn clearance_mm(specimen: &Specimen, p: [f64; 2]) -> f64 {
    let half = half_extents_mm(specimen);
    let axes = section_axes(specimen);
    let sides = [0, 1].map(|c| half[axes[c]] - p[c].abs());
    let holes = specimen.holes.iter().map(|h| h.wall().distance_mm(p));
    holes.chain(sides).fold(f64::INFINITY, f64::min).max(0.0)
}

/// Whether cuts can be made in a specimen: a block.
pub fn takes_cuts(specimen: &Specimen) -> bool {
    specimen.outline == Outline::Block
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::section::cross;
    use crate::mesh::test_specimens::two_holes;
    use crate::mesh::{mesh_specimen, morphed};

    const CUT: Cut = Cut { center_mm: [9.3, -1.5], half_length_mm: 3.0, turn_rad: 0.1 };

    fn options(specimen: &Specimen) -> MeshOptions {
        MeshOptions { use_mirror: false, force_prisms: true, ..MeshOptions::search(specimen) }
    }

    /// The two sides share no node but at the ends of the cut, and nothing is lost.
    #[test]
    fn elements_part_along_the_cut() {
        let specimen = two_holes();
        let mesh = mesh_cut_specimen(&specimen, &options(&specimen), &CUT).unwrap();
        let whole = mesh_specimen(&specimen, &options(&specimen)).unwrap();
        // Both triangulations miss the same part of the holes' circles.
        assert!((mesh.volume() / whole.volume() - 1.0).abs() < 1e-3, "{} {}", mesh.volume(), whole.volume());
        let [from, to] = CUT.ends_mm();
        let along = sub(to, from);
        let is_on = |x: [f64; 3]| CUT.distance_mm([x[0], x[2]]) < 1e-6;
        let is_end = |x: [f64; 3]| [from, to].iter().any(|e| (x[0] - e[0]).hypot(x[2] - e[1]) < 1e-6);
        let mut sides = vec![[false; 2]; mesh.nodes.len()];
        for e in 0..mesh.num_elements() {
            let nodes = mesh.element(e);
            let side: f64 =
                nodes.iter().map(|&n| mesh.nodes[n as usize]).map(|x| cross(along, sub([x[0], x[2]], from))).sum();
            nodes.iter().for_each(|&n| sides[n as usize][usize::from(side > 0.0)] = true);
        }
        let on: Vec<usize> = (0..mesh.nodes.len()).filter(|&n| is_on(mesh.nodes[n])).collect();
        let num_ends = on.iter().filter(|&&n| is_end(mesh.nodes[n])).count();
        assert!(on.iter().all(|&n| is_end(mesh.nodes[n]) || sides[n] != [true; 2]));
        // Every node inside stands there twice.
        for &n in on.iter().filter(|&&n| !is_end(mesh.nodes[n])) {
            let x = mesh.nodes[n];
            let twins = on.iter().filter(|&&m| (0..3).all(|c| (mesh.nodes[m][c] - x[c]).abs() < 1e-9)).count();
            assert_eq!(twins, 2, "{x:?}");
        }
        assert!(num_ends > 0 && on.len() > 3 * num_ends);
    }

    /// A mesh that is brought to another cut is one of it: no element is inverted, the line is the new one.
    #[test]
    fn meshes_follow_the_cut() {
        let specimen = two_holes();
        let mesh = mesh_cut_specimen(&specimen, &options(&specimen), &CUT).unwrap();
        let to = Cut { center_mm: [9.6, -1.0], half_length_mm: 3.4, turn_rad: -0.05 };
        let offsets: Vec<[f64; 3]> = mesh.nodes.iter().map(|x| cut_offset(&specimen, &CUT, &to, *x)).collect();
        let moved = morphed(&mesh, &offsets, 1.0);
        assert!((moved.volume() / mesh.volume() - 1.0).abs() < 1e-6);
        for (before, after) in mesh.nodes.iter().zip(&moved.nodes) {
            if CUT.distance_mm([before[0], before[2]]) < 1e-6 {
                assert!(to.distance_mm([after[0], after[2]]) < 1e-9, "{after:?}");
            }
        }
    }
}
