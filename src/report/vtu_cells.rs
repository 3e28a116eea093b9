//! Node orders of VTK's quadratic cells.

use crate::mesh::ElementKind;

/// VTK's number of the cell type that shows an element.
pub(super) fn cell_type(kind: ElementKind) -> u8 {
    match kind {
        // VTK_TRIQUADRATIC_HEXAHEDRON
        ElementKind::Hex27 => 29,
        // VTK_BIQUADRATIC_QUADRATIC_WEDGE
        ElementKind::Prism21 => 32,
    }
}

/// Our local node for each node of VTK's cell.
///
/// VTK's order: corners (bottom, then top, around), middles of the bottom's edges, of the top's, of the uprights, then
/// centres of faces (hexahedron: −ξ, +ξ, −η, +η, −ζ, +ζ; wedge: its three quadrilaterals), then the centre. VTK has no
/// wedge with nodes in the triangles' centres: the prism's three bubble nodes are not shown.
pub fn nodes_in_vtk_order(kind: ElementKind) -> &'static [usize] {
    match kind {
        ElementKind::Hex27 => &[
            0, 2, 8, 6, 18, 20, 26, 24, // corners
            1, 5, 7, 3, 19, 23, 25, 21, // edges of the bottom and of the top
            9, 11, 17, 15, // uprights
            12, 14, 10, 16, 4, 22, // faces
            13, // centre
        ],
        ElementKind::Prism21 => &[
            0, 1, 2, 14, 15, 16, // corners
            3, 4, 5, 17, 18, 19, // edges of the bottom and of the top
            7, 8, 9, // uprights
            10, 11, 12, // quadrilaterals 01, 12, 20
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every node beyond the corners lies in the middle of those corners that VTK's documentation names.
    #[test]
    fn middles_lie_between_the_corners_that_vtk_names() {
        let hex: [&[usize]; 19] = [
            &[0, 1],
            &[1, 2],
            &[2, 3],
            &[3, 0],
            &[4, 5],
            &[5, 6],
            &[6, 7],
            &[7, 4],
            &[0, 4],
            &[1, 5],
            &[2, 6],
            &[3, 7],
            &[0, 4, 7, 3],
            &[1, 2, 6, 5],
            &[0, 1, 5, 4],
            &[3, 7, 6, 2],
            &[0, 3, 2, 1],
            &[4, 5, 6, 7],
            &[0, 1, 2, 3, 4, 5, 6, 7],
        ];
        let wedge: [&[usize]; 12] = [
            &[0, 1],
            &[1, 2],
            &[2, 0],
            &[3, 4],
            &[4, 5],
            &[5, 3],
            &[0, 3],
            &[1, 4],
            &[2, 5],
            &[0, 1, 4, 3],
            &[1, 2, 5, 4],
            &[2, 0, 3, 5],
        ];
        for (kind, corners, middles) in [(ElementKind::Hex27, 8, &hex[..]), (ElementKind::Prism21, 6, &wedge[..])] {
            let order = nodes_in_vtk_order(kind);
            assert_eq!(order.len(), corners + middles.len());
            let mut unique = order.to_vec();
            unique.sort_unstable();
            unique.dedup();
            assert_eq!(unique.len(), order.len());
            let x = kind.node_coordinates();
            for (m, of) in middles.iter().enumerate() {
                let mean = [0, 1, 2].map(|c| of.iter().map(|&n| x[order[n]][c]).sum::<f64>() / of.len() as f64);
                let found = x[order[corners + m]];
                assert!((0..3).all(|c| (found[c] - mean[c]).abs() < 1e-15), "{kind:?} node {}", corners + m);
            }
        }
    }
}
