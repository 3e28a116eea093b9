//! A mesh with material, boundary conditions and drives, numbered as other programs number.

use super::convention::Converted;
use crate::material::Material;
use crate::mesh::{ElementKind, Mesh};
use crate::report::nodes_in_vtk_order;

/// What is written: a mesh, how it is held, and how far it is driven.
#[derive(Clone, Copy)]
pub struct Model<'a> {
    /// The mesh, with the nodes of its plates and mirror planes.
    pub mesh: &'a Mesh,
    /// The material.
    pub material: &'a Material,
    /// Drives, mm, one load step each.
    pub drives_mm: &'a [f64],
    /// Unit vector in which the moved face goes for a positive drive.
    pub direction: [f64; 3],
    /// Displacement of the moved face beside the drive, mm; on from the end of the first load step.
    pub beside_drive_mm: [f64; 3],
    /// How often the mesh stands in the test: mirrored copies times samples.
    pub multiplicity: f64,
}

/// A component of the moved face's displacement that is not always zero.
#[derive(Clone, Copy)]
pub(super) struct Driven {
    /// Component, from 0.
    pub component: usize,
    /// Its part of the drive.
    pub per_mm: f64,
    /// What it has beside the drive, mm.
    pub beside_mm: f64,
}

impl Driven {
    /// The components that a model drives.
    pub(super) fn of(model: &Model) -> Vec<Driven> {
        let of_component = |component: usize| Driven {
            component,
            per_mm: model.direction[component],
            beside_mm: model.beside_drive_mm[component],
        };
        (0..3).map(of_component).filter(|d| d.per_mm.abs() > 0.0 || d.beside_mm.abs() > 0.0).collect()
    }
}

/// What stands in a file besides the mesh.
pub(super) struct Written<'a> {
    /// The kind of element.
    pub kind: ElementKind,
    /// The material in the program's convention, MPa.
    pub material: Converted,
    /// Drives, mm.
    pub drives_mm: &'a [f64],
    /// Components of the moved face that are driven.
    pub driven: Vec<Driven>,
    /// What the reader should know, line by line.
    pub comments: Vec<String>,
    /// Name that all programs read.
    pub name: String,
}

/// The nodes of quadratic elements without nodes in faces and in the middle, renumbered from 1.
///
/// Abaqus, CalculiX, FEBio and VTK order them alike: corners of the bottom, of the top, middles of the bottom's edges,
/// of the top's, of the uprights.
pub(super) struct Numbered<'a> {
    mesh: &'a Mesh,
    local: &'static [usize],
    used: Vec<usize>,
    number: Vec<usize>,
}

impl<'a> Numbered<'a> {
    pub(super) fn new(mesh: &'a Mesh) -> Numbered<'a> {
        let count = match mesh.element_kind {
            ElementKind::Hex27 => 20,
            ElementKind::Prism21 => 15,
        };
        let local = &nodes_in_vtk_order(mesh.element_kind)[..count];
        let mut number = vec![0; mesh.nodes.len()];
        for element in 0..mesh.num_elements() {
            for &n in local {
                number[mesh.element(element)[n] as usize] = 1;
            }
        }
        let used: Vec<usize> = (0..number.len()).filter(|&n| number[n] > 0).collect();
        for (index, &node) in used.iter().enumerate() {
            number[node] = index + 1;
        }
        Numbered { mesh, local, used, number }
    }

    /// Number and position (mm) of each node.
    pub(super) fn nodes(&self) -> impl Iterator<Item = (usize, [f64; 3])> {
        self.used.iter().enumerate().map(|(index, &node)| (index + 1, self.mesh.nodes[node]))
    }

    /// Number and nodes of each element.
    pub(super) fn elements(&self) -> impl Iterator<Item = (usize, Vec<usize>)> {
        (0..self.mesh.num_elements()).map(|e| {
            let nodes = self.mesh.element(e);
            (e + 1, self.local.iter().map(|&n| self.number[nodes[n] as usize]).collect())
        })
    }

    /// The numbers of those of `nodes` that are written, without the nodes of the plates where `is_free`.
    fn set(&self, nodes: &[u32], is_free: bool) -> Vec<usize> {
        let mesh = self.mesh;
        let is_held = |n: &u32| mesh.fixed_nodes.binary_search(n).is_ok() || mesh.moved_nodes.binary_search(n).is_ok();
        let kept = nodes.iter().filter(|n| !(is_free && is_held(n)));
        kept.map(|&n| self.number[n as usize]).filter(|&number| number > 0).collect()
    }

    /// The sets of nodes that are held, none of them empty: name, numbers, and the components (x, y, z) that are zero.
    /// The moved nodes are driven in the other `driven` components.
    pub(super) fn held(&self, driven: &[Driven]) -> Vec<NodeSet> {
        let mesh = self.mesh;
        let all = [
            ("FIXED", self.set(&mesh.fixed_nodes, false), [true; 3]),
            (MOVED, self.set(&mesh.moved_nodes, false), [0, 1, 2].map(|i| driven.iter().all(|d| d.component != i))),
            ("MIRROR_Y", self.set(&mesh.mirror_y_nodes, true), [false, true, false]),
            ("MIRROR_Z", self.set(&mesh.mirror_z_nodes, true), [false, false, true]),
        ];
        let sets = all.into_iter().map(|(name, nodes, is_zero)| NodeSet { name, nodes, is_zero });
        sets.filter(|s| !s.nodes.is_empty()).collect()
    }
}

/// Name of the set of nodes on the moved plate or grip.
pub(super) const MOVED: &str = "MOVED";

/// Nodes that are held.
pub(super) struct NodeSet {
    pub name: &'static str,
    pub nodes: Vec<usize>,
    /// The components of the displacement that are zero.
    pub is_zero: [bool; 3],
}
