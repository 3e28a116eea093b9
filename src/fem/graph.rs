//! The node graph of a mesh.

/// Adjacency in compressed form, without self-loops.
pub struct Graph {
    /// `neighbours[offsets[v]..offsets[v + 1]]` are the neighbours of v.
    pub offsets: Vec<i32>,
    /// Neighbours.
    pub neighbours: Vec<i32>,
}
