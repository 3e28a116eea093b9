//! Meshes: a section (quadrilaterals or triangles, quadratic, following the hole walls as curves) extruded.
//!
//! ```text
//! specimen ─ domain ─┬─ quads ── cells ── grid       structured grids; O-grids in the holes' power-diagram cells
//!                    └─ triangles                   constrained Delaunay refinement, where quadrilaterals fail
//!                         └─ section ─ build        extrusion in graded levels, node sets
//! mesh ─ check, locator, morph                      invariants and quality; inverse map; shape derivatives
//!      ─ block_shape                                a block whose faces lie off the drawing
//!      ─ cut                                        a slit, on which the elements part
//! ```
//!
//! The section is (x, z) extruded along y, or (x, y) extruded along z where holes run along the width. Every mesh is
//! conforming, its curved walls (of circles, ellipses and slots) carry exact nodes at element corners and middles, and
//! equal input gives equal bits. A wedge is meshed as the block of even thickness that it is in flattened coordinates
//! ([`Taper`]), and its nodes are then raised to where they are.

mod block_shape;
mod build;
mod cells;
mod check;
mod cut;
mod discretisation;
mod domain;
mod element;
mod error;
mod face_area;
mod grading;
mod grid;
mod locator;
mod morph;
mod node_sets;
mod options;
mod parting;
mod power;
mod quads;
mod refine;
mod section;
mod size;
#[cfg(feature = "triangles")]
mod triangles;
#[cfg(not(feature = "triangles"))]
#[path = "no_triangles.rs"]
mod triangles;

#[cfg(test)]
mod layout_tests;
#[cfg(test)]
mod notch_tests;
#[cfg(test)]
mod outline_tests;
#[cfg(test)]
mod test_specimens;
#[cfg(test)]
mod wedge_tests;

pub use block_shape::{BlockShape, FACE_TERMS, face_term_degree, face_term_name, half_extents_mm, made_mesh};
pub use build::{mesh_specimen, mesh_specimen_along};
pub use check::MeshQuality;
pub use cut::{Cut, clearance_mm, cut_offset, mesh_cut_specimen, section_axes, takes_cuts};
pub use discretisation::{COARSER, CoarserMeshes, MeshedResult, error_over_difference, sd_over_extrapolated};
pub use element::ElementKind;
pub use error::{LigamentEnd, MeshError};
pub use locator::{Column, ColumnShape, LevelShape, Location, Locator};
pub use morph::{DesignVariable, morphed, shape_velocity};
pub use options::MeshOptions;
pub use refine::{Refinement, refined};
pub use size::{MeshSize, SIZE_FACTORS};

use crate::specimen::Taper;

/// Which mirror planes through the origin the mesh uses. A mirrored mesh covers the half with the positive
/// coordinate only; normal displacement is zero on the plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mirror {
    /// y = 0 (uniaxial only).
    pub y: bool,
    /// z = 0.
    pub z: bool,
}

/// A mesh of one element kind. Coordinates in mm in the specimen's frame.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// The element; its node order is described there.
    pub element_kind: ElementKind,
    /// Reference positions of the nodes, mm.
    pub nodes: Vec<[f64; 3]>,
    /// `num_elements × nodes_per_element` node indices, element after element.
    pub connectivity: Vec<u32>,
    /// How the gap goes along x, where the extrusion is along y: flattened, the mesh has plane layers.
    pub taper: Taper,
    /// Mirror planes in use.
    pub mirror: Mirror,
    /// Nodes on the fixed plate or grip (−y or −x).
    pub fixed_nodes: Vec<u32>,
    /// Nodes on the moved plate or grip (+y or +x).
    pub moved_nodes: Vec<u32>,
    /// Nodes on y = 0 where `mirror.y`, else empty.
    pub mirror_y_nodes: Vec<u32>,
    /// Nodes on z = 0 where `mirror.z`, else empty.
    pub mirror_z_nodes: Vec<u32>,
}

impl Mesh {
    /// Number of elements.
    pub fn num_elements(&self) -> usize {
        self.connectivity.len() / self.element_kind.num_nodes()
    }

    /// The same mesh of the block of even thickness that a wedge is in flattened coordinates.
    fn flattened(&self) -> Mesh {
        let nodes = self.nodes.iter().map(|&x| self.taper.flattened(x)).collect();
        Mesh { nodes, taper: Taper::default(), ..self.clone() }
    }

    /// Node indices of an element, in the order of [`ElementKind`].
    pub fn element(&self, element: usize) -> &[u32] {
        let n = self.element_kind.num_nodes();
        &self.connectivity[element * n..(element + 1) * n]
    }
}
