//! A mesh as VTK's cells show it: the nodes that are written, and the cells' nodes in VTK's order.

use super::ReportError;
use super::vtu_cells::{cell_type, nodes_in_vtk_order};
use crate::mesh::Mesh;

/// What of a mesh is written for VTK.
///
/// Hexahedra become triquadratic ones, prisms biquadratic wedges, which lack the bubble nodes in their triangles; nodes
/// that no cell shows are left out. A mirrored mesh is shown as it is, the half or quarter.
pub struct ShownMesh<'a> {
    mesh: &'a Mesh,
    /// Nodes that are written, in the mesh's order.
    used: Vec<usize>,
    /// Number in the file of each node of the mesh.
    number: Vec<u32>,
}

impl<'a> ShownMesh<'a> {
    /// What is shown of `mesh`.
    ///
    /// # Errors
    /// [`ReportError::BrokenConnectivity`], [`ReportError::UnknownNode`].
    pub fn new(mesh: &'a Mesh) -> Result<Self, ReportError> {
        let nodes_per_element = mesh.element_kind.num_nodes();
        if !mesh.connectivity.len().is_multiple_of(nodes_per_element) {
            return Err(ReportError::BrokenConnectivity { found: mesh.connectivity.len(), nodes_per_element });
        }
        let num_nodes = mesh.nodes.len();
        let mut is_used = vec![false; num_nodes];
        for element in 0..mesh.num_elements() {
            for &local in nodes_in_vtk_order(mesh.element_kind) {
                let node = mesh.element(element)[local] as usize;
                *is_used.get_mut(node).ok_or(ReportError::UnknownNode { element, node, num_nodes })? = true;
            }
        }
        let used: Vec<usize> = (0..num_nodes).filter(|&n| is_used[n]).collect();
        let mut number = vec![0; num_nodes];
        for (i, &node) in used.iter().enumerate() {
            number[node] = i as u32;
        }
        Ok(ShownMesh { mesh, used, number })
    }

    /// Nodes that are written.
    pub fn num_points(&self) -> usize {
        self.used.len()
    }

    /// Cells, one for each element.
    pub fn num_cells(&self) -> usize {
        self.mesh.num_elements()
    }

    /// Nodes of a cell.
    pub fn nodes_per_cell(&self) -> usize {
        nodes_in_vtk_order(self.mesh.element_kind).len()
    }

    /// VTK's number of the cells' type.
    pub fn cell_type(&self) -> u8 {
        cell_type(self.mesh.element_kind)
    }

    /// Reference positions of the nodes, mm.
    pub fn positions_mm(&self) -> Vec<[f64; 3]> {
        self.used.iter().map(|&n| self.mesh.nodes[n]).collect()
    }

    /// The nodes of each cell in VTK's order, from 0, cell after cell.
    pub fn connectivity(&self) -> Vec<u32> {
        let order = nodes_in_vtk_order(self.mesh.element_kind);
        let of_cell = |e: usize| {
            let nodes = self.mesh.element(e);
            order.iter().map(move |&local| self.number[nodes[local] as usize])
        };
        (0..self.num_cells()).flat_map(of_cell).collect()
    }

    /// Of a field on the nodes of the mesh, `components` numbers each, what is written.
    ///
    /// # Errors
    /// [`ReportError::LengthMismatch`].
    pub fn of_nodes(&self, name: &str, components: usize, values: &[f64]) -> Result<Vec<f64>, ReportError> {
        check_length(name, values.len(), components, self.mesh.nodes.len(), "nodes")?;
        Ok(self.used.iter().flat_map(|&n| values[n * components..(n + 1) * components].iter().copied()).collect())
    }

    /// Whether a field has `components` numbers for each element.
    ///
    /// # Errors
    /// [`ReportError::LengthMismatch`].
    pub fn check_elements(&self, name: &str, components: usize, values: &[f64]) -> Result<(), ReportError> {
        check_length(name, values.len(), components, self.num_cells(), "elements")
    }
}

fn check_length(
    name: &str,
    count: usize,
    components: usize,
    expected: usize,
    of: &'static str,
) -> Result<(), ReportError> {
    if count == components * expected {
        return Ok(());
    }
    Err(ReportError::LengthMismatch { name: name.to_string(), found: count / components.max(1), expected, of })
}
