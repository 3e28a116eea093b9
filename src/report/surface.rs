//! The surface of a mesh as facets for [`super::DeformedShape`].

use super::{ReportError, ShapeQuad};
use crate::mesh::{ElementKind, Mesh};
use std::collections::BTreeMap;

/// The outer facets of a mesh, four per quadrilateral face and three per triangular one, with mirrored halves unfolded.
///
/// `displacement` in mm per node; `value_of(element, nodes)` gives a facet's colour value from its element and its
/// four nodes. Faces on mirror planes are not outer faces. Nodes without a displacement count as not displaced.
pub fn surface_quads(
    mesh: &Mesh,
    displacement: &[[f64; 3]],
    value_of: impl Fn(usize, [u32; 4]) -> f64,
) -> Vec<ShapeQuad> {
    let faces = mesh.element_kind.faces();
    // A face is known by its sorted nodes; inner faces appear twice.
    let mut outer: BTreeMap<Vec<u32>, Option<(usize, usize)>> = BTreeMap::new();
    for element in 0..mesh.num_elements() {
        for (f, face) in faces.iter().enumerate() {
            let mut key: Vec<u32> = face.iter().map(|&n| mesh.element(element)[n]).collect();
            key.sort_unstable();
            outer.entry(key).and_modify(|owner| *owner = None).or_insert(Some((element, f)));
        }
    }
    let on_mirror =
        |nodes: &[u32], plane: &[u32]| !plane.is_empty() && nodes.iter().all(|n| plane.binary_search(n).is_ok());
    let sorted = |nodes: &[u32]| {
        let mut nodes = nodes.to_vec();
        nodes.sort_unstable();
        nodes
    };
    let planes = [sorted(&mesh.mirror_y_nodes), sorted(&mesh.mirror_z_nodes)];
    let mut signs = vec![[1.0; 3]];
    for (is_mirrored, axis) in [(mesh.mirror.y, 1), (mesh.mirror.z, 2)] {
        if is_mirrored {
            let mut reflected = signs.clone();
            reflected.iter_mut().for_each(|s| s[axis] = -1.0);
            signs.extend(reflected);
        }
    }

    // By element, so that the order does not depend on how faces are found.
    let mut found: Vec<(usize, usize)> = outer
        .iter()
        .filter(|(nodes, _)| !planes.iter().any(|plane| on_mirror(nodes, plane)))
        .filter_map(|(_, owner)| *owner)
        .collect();
    found.sort_unstable();
    let mut quads = Vec::new();
    for (element, f) in found {
        let nodes = mesh.element(element);
        for corners in facets(mesh.element_kind, f) {
            let facet = corners.map(|c| nodes[faces[f][c]]);
            let value = value_of(element, facet);
            for sign in &signs {
                let reference = facet.map(|n| [0, 1, 2].map(|c| sign[c] * mesh.nodes[n as usize][c]));
                let moved = facet.map(|n| displacement.get(n as usize).copied().unwrap_or([0.0; 3]));
                let mut current = reference;
                for (p, u) in current.iter_mut().zip(moved) {
                    for c in 0..3 {
                        p[c] += sign[c] * u[c];
                    }
                }
                quads.push(ShapeQuad { reference, current, value });
            }
        }
    }
    quads
}

/// Values at the nodes from values at the quadrature points (element after element, in the order of
/// [`ElementKind::quadrature`]): each element gives a node the value of its nearest quadrature point, and elements that
/// share a node are averaged. For pictures; derivatives of the result mean nothing. Nodes without an element get NaN.
///
/// # Errors
/// [`ReportError::LengthMismatch`].
pub fn nodal_values(mesh: &Mesh, quadrature_values: &[f64]) -> Result<Vec<f64>, ReportError> {
    let points = mesh.element_kind.quadrature();
    let expected = points.len() * mesh.num_elements();
    if quadrature_values.len() != expected {
        let (name, found) = ("quadrature values".to_string(), quadrature_values.len());
        return Err(ReportError::LengthMismatch { name, found, expected, of: "quadrature points" });
    }
    // Several points are equally near to some nodes of the prism: all of them count.
    let nearest: Vec<Vec<usize>> = mesh
        .element_kind
        .node_coordinates()
        .iter()
        .map(|node| {
            let squared = |q: usize| (0..3).map(|c| (points[q].0[c] - node[c]).powi(2)).sum::<f64>();
            let least = (0..points.len()).map(squared).fold(f64::INFINITY, f64::min);
            (0..points.len()).filter(|&q| squared(q) < least + 1e-9).collect()
        })
        .collect();
    let mut sums = vec![(0.0, 0.0); mesh.nodes.len()];
    for element in 0..mesh.num_elements() {
        let values = &quadrature_values[element * points.len()..];
        for (&node, near) in mesh.element(element).iter().zip(&nearest) {
            if let Some((sum, count)) = sums.get_mut(node as usize) {
                *sum += near.iter().map(|&q| values[q]).sum::<f64>() / near.len() as f64;
                *count += 1.0;
            }
        }
    }
    Ok(sums.into_iter().map(|(sum, count)| if count > 0.0 { sum / count } else { f64::NAN }).collect())
}

/// Facets of a face as positions in its list of nodes.
fn facets(kind: ElementKind, face: usize) -> &'static [[usize; 4]] {
    match (kind, face) {
        // Corners 0, 1, 2, middles 3, 4, 5 of the edges 01, 12, 20, centre 6.
        (ElementKind::Prism21, 0 | 1) => &[[0, 3, 6, 5], [3, 1, 4, 6], [6, 4, 2, 5]],
        _ => &[[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]],
    }
}

#[cfg(test)]
mod tests {
    use super::super::vtu::tests::row_of_cells;
    use super::*;

    fn area(p: &[[f64; 3]; 4]) -> f64 {
        let d = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|c| b[c] - a[c]);
        let (u, v) = (d(p[0], p[2]), d(p[1], p[3]));
        let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        0.5 * n.iter().map(|c| c * c).sum::<f64>().sqrt()
    }

    /// The facets of one cell cover its surface: 6 × 4 mm² of the cube; 2 × ½ + (2 + √2) × 2 mm² of the prism.
    #[test]
    fn facets_cover_the_surface() {
        for (kind, exact) in [(ElementKind::Hex27, 24.0), (ElementKind::Prism21, 1.0 + 2.0 * (2.0 + 2f64.sqrt()))] {
            let mesh = row_of_cells(kind, 1);
            let quads = surface_quads(&mesh, &vec![[0.5, 0.0, 0.0]; mesh.nodes.len()], |e, _| e as f64);
            let total: f64 = quads.iter().map(|q| area(&q.reference)).sum();
            assert!((total - exact).abs() < 1e-12);
            assert!(quads.iter().all(|q| (q.current[2][0] - q.reference[2][0] - 0.5).abs() < 1e-15));
        }
    }

    #[test]
    fn nodes_take_the_nearest_quadrature_points() {
        for kind in [ElementKind::Hex27, ElementKind::Prism21] {
            let mesh = row_of_cells(kind, 2);
            let values: Vec<f64> =
                (0..2).flat_map(|e| kind.quadrature().into_iter().map(move |q| q.0[2] + 10.0 * f64::from(e))).collect();
            let nodal = nodal_values(&mesh, &values).expect("right length");
            for (n, value) in nodal.iter().enumerate() {
                // Gauss points lie at √0.6 ζ: a node sees the sign of its own ζ, in its own element.
                let exact = 0.6f64.sqrt() * mesh.nodes[n][2] + if 2 * n < nodal.len() { 0.0 } else { 10.0 };
                assert!((value - exact).abs() < 1e-12, "{kind:?} {n}");
            }
            assert!(matches!(nodal_values(&mesh, &values[1..]), Err(ReportError::LengthMismatch { .. })));
        }
    }

    #[test]
    fn mirrored_meshes_are_unfolded() {
        let mut mesh = row_of_cells(ElementKind::Hex27, 1);
        mesh.nodes.iter_mut().for_each(|p| p[2] += 1.0);
        mesh.mirror.z = true;
        mesh.mirror_z_nodes = (0..9).rev().collect();
        let mut u = vec![[0.0; 3]; 27];
        u[26] = [0.0, 0.0, 0.25];
        let quads = surface_quads(&mesh, &u, |_, _| 1.0);
        let total: f64 = quads.iter().map(|q| area(&q.reference)).sum();
        // Two cubes of edge 2 mm without their common face: 2 × 5 × 4 mm².
        assert!((total - 40.0).abs() < 1e-12);
        let extreme = |f: fn(f64, f64) -> f64| quads.iter().flat_map(|q| q.current).map(|p| p[2]).fold(0.0, f);
        assert!((extreme(f64::max) - 2.25).abs() < 1e-15 && (extreme(f64::min) + 2.25).abs() < 1e-15);
    }
}
