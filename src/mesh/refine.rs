//! Uniform refinement: every hexahedron becomes eight, along its own curved map.
//!
//! The fine mesh describes the same body as the coarse one to the bit of its quadratic geometry, and its finite element
//! space contains the coarse one: a coarse solution is carried over without interpolation error.

use super::{ElementKind, Location, Mesh};
use std::collections::HashMap;

/// A refined mesh and how it lies in the coarse one.
#[derive(Clone, Debug)]
pub struct Refinement {
    /// The fine mesh: layer by layer, like the coarse one.
    pub mesh: Mesh,
    /// Place of each fine node in the coarse mesh.
    pub nodes: Vec<Location>,
    /// Coarse element of each fine element.
    pub parents: Vec<u32>,
}

/// Splits every hexahedron into eight. `None` for prisms.
pub fn refined(coarse: &Mesh) -> Option<Refinement> {
    if coarse.element_kind != ElementKind::Hex27 {
        return None;
    }
    let kind = coarse.element_kind;
    // The 5×5×5 points of a refined element and the parent's shape functions there.
    let coordinates: Vec<[f64; 3]> =
        (0..125).map(|i| [i % 5, (i / 5) % 5, i / 25].map(|c: usize| c as f64 / 2.0 - 1.0)).collect();
    let shapes: Vec<[f64; 27]> = coordinates.iter().map(|&x| kind.shape_functions(x)).collect();
    let extent = coarse.nodes.iter().flatten().fold(1e-30f64, |s, x| s.max(x.abs()));
    // Neighbours compute shared points in different orders: they agree to rounding, far below any node distance.
    let cell = extent * 1e-7;
    let mut known: HashMap<[i64; 3], u32> = HashMap::with_capacity(9 * coarse.nodes.len());
    let mut nodes: Vec<[f64; 3]> = Vec::with_capacity(8 * coarse.nodes.len());
    let mut places = Vec::with_capacity(8 * coarse.nodes.len());
    let num_children = 8 * coarse.num_elements();
    let mut connectivity = vec![0u32; 27 * num_children];
    let mut parents = vec![0u32; num_children];
    let in_layer = elements_in_layer(coarse);
    for e in 0..coarse.num_elements() {
        let parent = coarse.element(e);
        let mut index = [0u32; 125];
        for (slot, n) in shapes.iter().enumerate() {
            let mut x = [0.0; 3];
            for (a, &v) in parent.iter().enumerate() {
                for i in 0..3 {
                    x[i] += n[a] * coarse.nodes[v as usize][i];
                }
            }
            index[slot] = find(&known, x, cell).unwrap_or_else(|| {
                let new = nodes.len() as u32;
                known.insert(x.map(|c| (c / cell).floor() as i64), new);
                nodes.push(x);
                places.push(Location { element: e as u32, reference_coordinates: coordinates[slot] });
                new
            });
        }
        for child in 0..8 {
            let corner = [child & 1, (child >> 1) & 1, child >> 2];
            let (layer, cell) = (2 * (e / in_layer) + corner[2], 4 * (e % in_layer) + (child & 3));
            let new = layer * 4 * in_layer + cell;
            parents[new] = e as u32;
            for k in 0..3 {
                for j in 0..3 {
                    for i in 0..3 {
                        let at = [2 * corner[0] + i, 2 * corner[1] + j, 2 * corner[2] + k];
                        connectivity[27 * new + i + 3 * j + 9 * k] = index[at[0] + 5 * at[1] + 25 * at[2]];
                    }
                }
            }
        }
    }
    let on = |set: &[u32]| nodes_on_faces(coarse, set, &places);
    let mesh = Mesh {
        element_kind: kind,
        fixed_nodes: on(&coarse.fixed_nodes),
        moved_nodes: on(&coarse.moved_nodes),
        mirror_y_nodes: on(&coarse.mirror_y_nodes),
        mirror_z_nodes: on(&coarse.mirror_z_nodes),
        nodes,
        connectivity,
        taper: coarse.taper,
        mirror: coarse.mirror,
    };
    Some(Refinement { mesh, nodes: places, parents })
}

/// Elements per layer: the first element's upper face is the lower face of the one a layer on.
fn elements_in_layer(mesh: &Mesh) -> usize {
    let total = mesh.num_elements();
    (1..total).find(|&m| mesh.element(m)[..9] == mesh.element(0)[18..]).unwrap_or(total).max(1)
}

/// The node already made at `x`, looked for in every cell that `x` may have been rounded into.
fn find(known: &HashMap<[i64; 3], u32>, x: [f64; 3], cell: f64) -> Option<u32> {
    let low = x.map(|c| (c / cell - 1e-3).floor() as i64);
    let high = x.map(|c| (c / cell + 1e-3).floor() as i64);
    for i in low[0]..=high[0] {
        for j in low[1]..=high[1] {
            for k in low[2]..=high[2] {
                if let Some(&found) = known.get(&[i, j, k]) {
                    return Some(found);
                }
            }
        }
    }
    None
}

/// New nodes that lie on a face, edge or corner of their coarse element of which every node is in `set`.
fn nodes_on_faces(coarse: &Mesh, set: &[u32], places: &[Location]) -> Vec<u32> {
    let mut is_in = vec![false; coarse.nodes.len()];
    for &v in set {
        is_in[v as usize] = true;
    }
    (0..places.len() as u32)
        .filter(|&v| {
            let place = &places[v as usize];
            // The parent's nodes with a non-zero shape function carry the new node.
            let n = coarse.element_kind.shape_functions(place.reference_coordinates);
            coarse
                .element(place.element as usize)
                .iter()
                .zip(&n)
                .all(|(&v, weight)| weight.abs() < 1e-12 || is_in[v as usize])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{MeshOptions, mesh_specimen};
    use crate::specimen::Specimen;

    /// The refined mesh has the coarse volume to rounding, positive Jacobians and eight times the elements. (Its nodes
    /// on hole walls lie on the coarse quadratic arcs, a few micrometres off the circle.)
    #[test]
    fn refined_mesh_is_a_mesh_of_the_same_body() {
        let text = include_str!("../../geometries/two-hole-shear.json");
        let specimen = Specimen::from_json(text).expect("a ready specimen");
        let coarse = mesh_specimen(&specimen, &MeshOptions::search(&specimen)).expect("meshable");
        let Refinement { mesh: fine, nodes: places, parents } = refined(&coarse).expect("hexahedra");
        assert_eq!(parents.len(), fine.num_elements());
        assert!(fine.quality().min_scaled_jacobian > 0.2);
        assert_eq!(fine.num_elements(), 8 * coarse.num_elements());
        assert_eq!(places.len(), fine.nodes.len());
        assert!((fine.volume() / coarse.volume() - 1.0).abs() < 1e-9);
        // Bonded and mirror faces are planes: every new node on them is found, and no other.
        let half = specimen.block.thickness_mm / 2.0;
        let expected = fine.nodes.iter().filter(|x| (x[1] + half).abs() < 1e-9).count();
        assert_eq!(fine.fixed_nodes.len(), expected);
        let expected = fine.nodes.iter().filter(|x| x[2].abs() < 1e-9).count();
        assert_eq!(fine.mirror_z_nodes.len(), expected);
    }
}
