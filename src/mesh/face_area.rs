//! The part of a bonded face that each of its nodes stands for.

use super::{ElementKind, Mesh};

/// ∫ N_a dA / A of a nine-node quadrilateral (Simpson's rule in both directions).
const QUADRILATERAL: [f64; 9] =
    [1.0 / 36.0, 4.0 / 36.0, 1.0 / 36.0, 4.0 / 36.0, 16.0 / 36.0, 4.0 / 36.0, 1.0 / 36.0, 4.0 / 36.0, 1.0 / 36.0];
/// Of a seven-node triangle.
const TRIANGLE: [f64; 7] = [0.05, 0.05, 0.05, 2.0 / 15.0, 2.0 / 15.0, 2.0 / 15.0, 0.45];

impl Mesh {
    /// Area (mm²) of the bonded faces that each node stands for, zero for other nodes: ∫ N_a dA with straight-sided
    /// faces. At a hole's edge the chord counts for the arc.
    pub fn face_areas(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.nodes.len()];
        for nodes in [&self.fixed_nodes, &self.moved_nodes] {
            let mut is_on_face = vec![false; self.nodes.len()];
            for &v in nodes {
                is_on_face[v as usize] = true;
            }
            for e in 0..self.num_elements() {
                let element = self.element(e);
                for face in self.element_kind.faces() {
                    if !face.iter().all(|&a| is_on_face[element[a] as usize]) {
                        continue;
                    }
                    let corner = |a: usize| self.nodes[element[face[a]] as usize];
                    let is_triangle = self.element_kind == ElementKind::Prism21 && face.len() == TRIANGLE.len();
                    let (weights, area): (&[f64], f64) = if is_triangle {
                        (&TRIANGLE, triangle(corner(0), corner(1), corner(2)))
                    } else {
                        let halves =
                            [triangle(corner(0), corner(2), corner(8)), triangle(corner(0), corner(8), corner(6))];
                        (&QUADRILATERAL, halves.iter().sum())
                    };
                    for (&a, weight) in face.iter().zip(weights) {
                        areas[element[a] as usize] += weight * area;
                    }
                }
            }
        }
        areas
    }
}

fn triangle(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> f64 {
    let (u, v) = ([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]));
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    0.5 * n.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::test_specimens::{bar, two_holes, width_holes};
    use super::super::{MeshOptions, mesh_specimen};

    /// The areas add up to both faces: less the holes' for holes through the face.
    #[test]
    fn areas_add_up() {
        for (specimen, force_prisms) in
            [(two_holes(), false), (two_holes(), true), (bar(), false), (width_holes(), false)]
        {
            let options = MeshOptions { use_mirror: false, force_prisms, ..MeshOptions::search(&specimen) };
            let mesh = mesh_specimen(&specimen, &options).unwrap();
            let b = specimen.block;
            let through_face = specimen.test == crate::specimen::TestKind::DoubleLapShear
                && specimen.holes.iter().all(|h| h.axis == crate::specimen::HoleAxis::Thickness);
            let face = if specimen.test == crate::specimen::TestKind::Uniaxial {
                b.thickness_mm * b.width_mm
            } else {
                b.length_mm * b.width_mm
            };
            let holes: f64 = specimen.holes.iter().map(|h| 0.25 * std::f64::consts::PI * h.diameter_mm.powi(2)).sum();
            let exact = 2.0 * (face - if through_face { holes } else { 0.0 });
            let sum: f64 = mesh.face_areas().iter().sum();
            // Chords for arcs: at most a tenth of the holes' area at eight segments, much less of the face.
            assert!((sum / exact - 1.0).abs() < 0.02, "{sum} {exact}");
        }
    }
}
