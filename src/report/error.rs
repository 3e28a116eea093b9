//! What can go wrong when a report or a field file is written.

use std::path::PathBuf;

/// Why a file was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// The file system refused.
    #[error("cannot write {}: {source}; choose another folder or free space", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the file system said.
        source: std::io::Error,
    },
    /// A field has not one value per node, element or quadrature point.
    #[error("field {name} has {found} values, the mesh has {expected} {of}")]
    LengthMismatch {
        /// Name of the field.
        name: String,
        /// Values passed.
        found: usize,
        /// Values needed.
        expected: usize,
        /// `nodes`, `elements` or `quadrature points`.
        of: &'static str,
    },
    /// An element names a node that does not exist.
    #[error("element {element} uses node {node}, the mesh has {num_nodes} nodes")]
    UnknownNode {
        /// Element index.
        element: usize,
        /// Node index.
        node: usize,
        /// Nodes in the mesh.
        num_nodes: usize,
    },
    /// The connectivity is not a whole number of elements.
    #[error("the connectivity has {found} entries, not a multiple of {nodes_per_element}")]
    BrokenConnectivity {
        /// Entries passed.
        found: usize,
        /// Nodes of one element.
        nodes_per_element: usize,
    },
}
