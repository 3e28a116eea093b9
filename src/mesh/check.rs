//! The invariants of a mesh: valid indices, positive Jacobians, closed surface, volume and node sets.

use std::collections::HashMap;

use serde::Serialize;

use super::domain::{COINCIDENT, Domain};
use super::error::MeshError;
use super::node_sets::{nodes_on_plane, pull_axis};
use super::options::MeshOptions;
use super::section::{Section, scaled_jacobian};
use super::{ElementKind, Mesh};
use crate::specimen::dumbbell::Profile;
use crate::specimen::{HoleWall, Specimen, Taper};

/// Relative error allowed in a hole's or an arc's area: a parabola through three points of a 60° arc has 0.14 %.
const ARC_AREA_TOLERANCE: f64 = 2e-3;
/// The same of a slot: four parabolas may each pass an end of a straight line in between their points, where the
/// curvature jumps; of 45° arcs of radius r each then misses up to 0.003 r².
const JUMP_AREA_TOLERANCE: f64 = 5e-3;

/// What a mesh is like.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeshQuality {
    /// `hex27` or `prism21`.
    pub element_kind: &'static str,
    /// Number of elements.
    pub num_elements: usize,
    /// Number of nodes.
    pub num_nodes: usize,
    /// Three per node that is neither on the fixed nor on the moved face; less one per node on each mirror plane.
    pub num_free_displacements: usize,
    /// Smallest scaled Jacobian of the elements' sections: 1 = right angles or equilateral, 0 = degenerate.
    pub min_scaled_jacobian: f64,
    /// Mean over the elements of the same.
    pub mean_scaled_jacobian: f64,
    /// Largest ratio of an element's longest to its shortest middle line.
    pub max_aspect_ratio: f64,
    /// Shortest middle line of an element, mm.
    pub min_size_mm: f64,
    /// Longest middle line of an element, mm.
    pub max_size_mm: f64,
    /// Volume by quadrature, mm³ (the meshed part only).
    pub volume_mm3: f64,
}

/// Refuses a section with a poor cell.
pub(super) fn orient_and_limit(section: &Section, options: &MeshOptions) -> Result<(), MeshError> {
    let (worst, element) = section.min_scaled_jacobian();
    if worst >= options.min_scaled_jacobian && worst > 0.0 {
        Ok(())
    } else {
        Err(MeshError::PoorElement { element, scaled_jacobian: worst, limit: options.min_scaled_jacobian })
    }
}

impl Mesh {
    /// Checks everything that the solver takes for granted: valid indices and coordinates; positive geometry Jacobians
    /// at all quadrature points and nodes; each face shared by two elements that agree on its nodes, or on the
    /// specimen's surface or a mirror plane; volume equal to the closed form within the error of quadratic arcs; node
    /// sets complete.
    ///
    /// # Errors
    /// The first violation, as a [`MeshError`].
    pub fn check(&self, specimen: &Specimen) -> Result<(), MeshError> {
        let options = MeshOptions { use_mirror: self.mirror.y || self.mirror.z, ..MeshOptions::standard(specimen) };
        let domain = Domain::new(specimen, &options)?;
        self.check_indices()?;
        self.check_jacobians()?;
        let [found, expected] = [self.taper, domain.taper].map(Taper::slope_per_mm);
        if !((found - expected).abs() * domain.half[0] <= COINCIDENT) {
            return Err(MeshError::WrongTaper { found, expected });
        }
        // In flattened coordinates the faces of a wedge are planes across the axes.
        let flattened = (!self.taper.is_even()).then(|| self.flattened());
        let flat = flattened.as_ref().unwrap_or(self);
        flat.check_faces(&domain)?;
        self.check_volume(&domain)?;
        flat.check_sets(&domain)
    }

    fn check_volume(&self, domain: &Domain) -> Result<(), MeshError> {
        let volume = self.volume();
        let curved = if domain.holes.is_empty() && domain.profile.is_none() {
            0.0
        } else {
            let of_wall = |wall: &HoleWall| {
                let tolerance = if wall.breaks().is_empty() { ARC_AREA_TOLERANCE } else { JUMP_AREA_TOLERANCE };
                tolerance * wall.area_mm2()
            };
            let holes: f64 = domain.holes.iter().map(|d| of_wall(&d.wall)).sum();
            let of_sides = |profile: Profile| 8.0 * ARC_AREA_TOLERANCE * profile.curved_area_mm2();
            domain.thickest() * (holes + domain.profile.map_or(0.0, of_sides))
        };
        let (expected_mm3, tolerance_mm3) = (domain.volume(), curved + 1e-9 * volume.abs());
        let difference = (volume - expected_mm3).abs();
        if difference.is_nan() || difference > tolerance_mm3 {
            return Err(MeshError::VolumeMismatch { volume_mm3: volume, expected_mm3, tolerance_mm3 });
        }
        Ok(())
    }

    fn check_indices(&self) -> Result<(), MeshError> {
        let bad_nodes = self.nodes.iter().flatten().filter(|x| !x.is_finite()).count();
        let bad_references = self.connectivity.iter().filter(|&&n| n as usize >= self.nodes.len()).count();
        let remainder = self.connectivity.len() % self.element_kind.num_nodes();
        match bad_nodes + bad_references + remainder {
            0 => Ok(()),
            count => Err(MeshError::Malformed { count }),
        }
    }

    fn check_jacobians(&self) -> Result<(), MeshError> {
        let kind = self.element_kind;
        let points: Vec<[f64; 3]> = kind.quadrature().iter().map(|q| q.0).chain(kind.node_coordinates()).collect();
        let gradients: Vec<[[f64; 3]; 27]> = points.iter().map(|&x| kind.shape_gradients(x)).collect();
        for element in 0..self.num_elements() {
            for gradient in &gradients {
                let jacobian = determinant(self.geometry_gradient(element, gradient));
                if jacobian.is_nan() || jacobian <= 0.0 {
                    return Err(MeshError::InvertedElement { element, jacobian });
                }
            }
        }
        Ok(())
    }

    /// ∂X/∂(ξ, η, ζ): row coordinate, column direction.
    pub(super) fn geometry_gradient(&self, element: usize, gradient: &[[f64; 3]; 27]) -> [[f64; 3]; 3] {
        let mut j = [[0.0; 3]; 3];
        // Loops over fixed counts, which the compiler unrolls.
        for (&node, g) in self.element(element).iter().zip(gradient) {
            let x = &self.nodes[node as usize];
            for i in 0..3 {
                for c in 0..3 {
                    j[i][c] += x[i] * g[c];
                }
            }
        }
        j
    }

    /// Volume of the meshed part by quadrature, mm³.
    pub fn volume(&self) -> f64 {
        let quadrature: Vec<([[f64; 3]; 27], f64)> = self
            .element_kind
            .quadrature()
            .into_iter()
            .map(|(x, w)| (self.element_kind.shape_gradients(x), w))
            .collect();
        (0..self.num_elements())
            .map(|e| quadrature.iter().map(|(g, w)| w * determinant(self.geometry_gradient(e, g))).sum::<f64>())
            .sum()
    }

    fn check_faces(&self, domain: &Domain) -> Result<(), MeshError> {
        let faces = self.element_kind.faces();
        // By sorted nodes, which include the middle ones: two elements that disagree on those leave an open face.
        let mut owners: HashMap<Vec<u32>, (usize, usize, u32)> = HashMap::new();
        for element in 0..self.num_elements() {
            let nodes = self.element(element);
            for (index, face) in faces.iter().enumerate() {
                let mut key: Vec<u32> = face.iter().map(|&n| nodes[n]).collect();
                key.sort_unstable();
                owners.entry(key).or_insert((element, index, 0)).2 += 1;
            }
        }
        let mut open: Vec<(usize, usize)> = Vec::new();
        for &(element, index, uses) in owners.values() {
            match uses {
                1 => open.push((element, index)),
                2 => {}
                _ => return Err(MeshError::FaceMismatch { element }),
            }
        }
        open.sort_unstable();
        for (element, index) in open {
            let positions: Vec<[f64; 3]> =
                faces[index].iter().map(|&n| self.nodes[self.element(element)[n] as usize]).collect();
            if !is_on_surface(domain, &positions) {
                let count = positions.len() as f64;
                let center_mm = [0, 1, 2].map(|c| positions.iter().map(|p| p[c]).sum::<f64>() / count);
                return Err(MeshError::OpenFace { element, center_mm });
            }
        }
        Ok(())
    }

    fn check_sets(&self, domain: &Domain) -> Result<(), MeshError> {
        let axis = pull_axis(domain.test);
        let mut half = [domain.half[0]; 3];
        (half[domain.b_axis], half[domain.extrusion_axis]) = (domain.half[1], domain.extrusion_half);
        let tolerance = 1e-9 * domain.scale().max(2.0 * domain.extrusion_half);
        let none = f64::INFINITY;
        // With y = 0 mirrored a plate at −y would be missing; only grips are used then.
        for (set, nodes, axis, position) in [
            ("fixed_nodes", &self.fixed_nodes, axis, -half[axis]),
            ("moved_nodes", &self.moved_nodes, axis, half[axis]),
            ("mirror_y_nodes", &self.mirror_y_nodes, 1, if self.mirror.y { 0.0 } else { none }),
            ("mirror_z_nodes", &self.mirror_z_nodes, 2, if self.mirror.z { 0.0 } else { none }),
        ] {
            let expected = nodes_on_plane(self, axis, position, tolerance);
            if *nodes != expected || (position.is_finite() && expected.is_empty()) {
                return Err(MeshError::NodeSetMismatch { set, found: nodes.len(), expected: expected.len() });
            }
        }
        Ok(())
    }

    /// Sizes and shapes.
    pub fn quality(&self) -> MeshQuality {
        let kind = self.element_kind;
        let per_level = kind.num_nodes() / 3;
        let (mut worst, mut sum) = (f64::INFINITY, 0.0);
        let (mut shortest, mut longest, mut aspect) = (f64::INFINITY, 0.0f64, 1.0f64);
        for element in 0..self.num_elements() {
            let nodes = self.element(element);
            let at = |n: usize| self.nodes[nodes[n] as usize];
            // The extrusion runs along y or z: the other coordinates form the section.
            let along = sub3(at(2 * per_level), at(0));
            let is_y = along[1].abs() > along[2].abs();
            let points: Vec<[f64; 2]> =
                (0..per_level).map(|n| at(per_level + n)).map(|p| [p[0], if is_y { p[2] } else { p[1] }]).collect();
            let quality = scaled_jacobian(&points);
            worst = worst.min(quality);
            sum += quality;
            let length = |a: [f64; 3], b: [f64; 3]| sub3(a, b).iter().map(|x| x * x).sum::<f64>().sqrt();
            let level = |n: usize| at(per_level + n);
            let mut lengths = vec![length(at(0), at(2 * per_level))];
            match kind {
                ElementKind::Hex27 => lengths.extend([length(level(3), level(5)), length(level(1), level(7))]),
                ElementKind::Prism21 => lengths.extend((0..3).map(|k| length(level(k), level((k + 1) % 3)))),
            }
            let (low, high) = lengths.iter().fold((f64::INFINITY, 0.0f64), |(l, h), &x| (l.min(x), h.max(x)));
            (shortest, longest, aspect) = (shortest.min(low), longest.max(high), aspect.max(high / low));
        }
        MeshQuality {
            element_kind: match kind {
                ElementKind::Hex27 => "hex27",
                ElementKind::Prism21 => "prism21",
            },
            num_elements: self.num_elements(),
            num_nodes: self.nodes.len(),
            num_free_displacements: self.num_free_displacements(),
            min_scaled_jacobian: worst,
            mean_scaled_jacobian: sum / self.num_elements().max(1) as f64,
            max_aspect_ratio: aspect,
            min_size_mm: shortest,
            max_size_mm: longest,
            volume_mm3: self.volume(),
        }
    }

    fn num_free_displacements(&self) -> usize {
        let mut free = vec![[true; 3]; self.nodes.len()];
        for &n in self.fixed_nodes.iter().chain(&self.moved_nodes) {
            free[n as usize] = [false; 3];
        }
        for &n in &self.mirror_y_nodes {
            free[n as usize][1] = false;
        }
        for &n in &self.mirror_z_nodes {
            free[n as usize][2] = false;
        }
        free.iter().flatten().filter(|f| **f).count()
    }
}

fn sub3(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Determinant of a 3 × 3 matrix.
pub(super) fn determinant(m: [[f64; 3]; 3]) -> f64 {
    m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
        + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
}

/// All nodes of the face on one and the same known surface.
fn is_on_surface(domain: &Domain, positions: &[[f64; 3]]) -> bool {
    let scale = domain.scale().max(2.0 * domain.extrusion_half);
    let tolerance = 1e-7 * scale;
    let on_plane = |axis: usize, value: f64| positions.iter().all(|p| (p[axis] - value).abs() < tolerance);
    let extrusion_low = if domain.extrusion_mirrored { 0.0 } else { -domain.extrusion_half };
    let planes = [
        (0, -domain.half[0]),
        (0, domain.half[0]),
        (domain.extrusion_axis, extrusion_low),
        (domain.extrusion_axis, domain.extrusion_half),
    ];
    if planes.iter().any(|&(axis, value)| on_plane(axis, value)) {
        return true;
    }
    if domain.bottom == 0.0 && on_plane(domain.b_axis, 0.0) {
        return true;
    }
    let on_profile =
        |sign: f64| positions.iter().all(|p| (sign * p[domain.b_axis] - domain.half_width(p[0])).abs() < tolerance);
    if on_profile(1.0) || (domain.bottom < 0.0 && on_profile(-1.0)) {
        return true;
    }
    domain
        .holes
        .iter()
        .any(|d| positions.iter().all(|p| d.wall.distance_mm([p[0], p[domain.b_axis]]).abs() < tolerance))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::mesh_specimen;
    use crate::mesh::test_specimens::{off_axis, two_holes};

    fn damaged(damage: impl FnOnce(&mut Mesh)) -> Result<(), MeshError> {
        let specimen = two_holes();
        let mut mesh = mesh_specimen(&specimen, &MeshOptions::search(&specimen)).unwrap();
        damage(&mut mesh);
        mesh.check(&specimen)
    }

    #[test]
    fn damage_is_found() {
        assert_eq!(damaged(|_| {}), Ok(()));
        assert_eq!(damaged(|m| m.nodes[5][1] = f64::NAN), Err(MeshError::Malformed { count: 1 }));
        assert_eq!(damaged(|m| m.connectivity[7] = 1 << 30), Err(MeshError::Malformed { count: 1 }));
        let swapped = damaged(|m| m.connectivity.swap(0, 2));
        assert!(matches!(swapped, Err(MeshError::InvertedElement { element: 0, .. })), "{swapped:?}");
        let missing = damaged(|m| m.connectivity.truncate(m.connectivity.len() - 27));
        assert!(matches!(missing, Err(MeshError::OpenFace { .. })), "{missing:?}");
        let bulged = damaged(|m| m.nodes.iter_mut().filter(|p| p[0] > 12.6).for_each(|p| p[0] += 1e-3));
        assert!(matches!(bulged, Err(MeshError::OpenFace { .. })), "{bulged:?}");
        let twice = damaged(|m| m.connectivity.extend_from_within(..27));
        assert!(matches!(twice, Err(MeshError::FaceMismatch { .. } | MeshError::OpenFace { .. })), "{twice:?}");
        let untagged = damaged(|m| m.moved_nodes.truncate(3));
        assert!(matches!(untagged, Err(MeshError::NodeSetMismatch { set: "moved_nodes", .. })), "{untagged:?}");
        let unmirrored = damaged(|m| m.mirror_z_nodes.clear());
        assert!(matches!(unmirrored, Err(MeshError::NodeSetMismatch { set: "mirror_z_nodes", .. })));
        let specimen = two_holes();
        let mesh = mesh_specimen(&specimen, &MeshOptions::search(&specimen)).unwrap();
        assert!(mesh.check(&off_axis()).is_err());
    }

    #[test]
    fn quality_counts() {
        let specimen = two_holes();
        let mesh = mesh_specimen(&specimen, &MeshOptions::search(&specimen)).unwrap();
        let quality = mesh.quality();
        assert_eq!((quality.element_kind, quality.num_nodes), ("hex27", mesh.nodes.len()));
        assert!(quality.min_scaled_jacobian <= quality.mean_scaled_jacobian && quality.mean_scaled_jacobian <= 1.0);
        assert!(quality.min_size_mm > 0.0 && quality.max_size_mm < 6.4);
        assert!(quality.max_aspect_ratio >= 1.0);
        let json = serde_json::to_value(&quality).unwrap();
        assert!(json["volume_mm3"].as_f64().unwrap() > 1000.0);
    }
}
