//! Unknowns, their elimination order and the sparsity pattern of the tangent stiffness.
//!
//! Nodes on the plates are known and left out. Every other node carries three unknowns, numbered in elimination order;
//! a component that a mirror plane fixes keeps its number, with an identity row, so that the pattern stays in 3×3
//! blocks.

use super::graph::Graph;
use super::ordering::elimination_order;
use crate::mesh::Mesh;

/// Marks a node without unknowns.
pub const NOT_FREE: u32 = u32::MAX;

/// The numbering of the unknowns and the lower-triangular pattern.
pub struct Topology {
    /// Place of each mesh node in the elimination order, or [`NOT_FREE`].
    pub place: Vec<u32>,
    /// Mesh node at each place.
    pub node_at: Vec<u32>,
    /// Unknowns fixed to zero by a mirror plane.
    pub is_pinned: Vec<bool>,
    /// First 3×3 block of each node's column; the diagonal block comes first.
    pub block_pointers: Vec<u32>,
    /// Row (node place) of each block.
    pub block_rows: Vec<u32>,
    /// Per element, for local pairs (a ≥ b) in the order b-major: the block of the column of the earlier node.
    pair_block: Vec<u32>,
    /// Elements in the order in which the elimination first meets them: neighbours in memory are assembled together.
    pub element_order: Vec<u32>,
    pairs_per_element: usize,
}

impl Topology {
    /// Numbers the free nodes of `mesh`: those not on a plate, and those on a plate that are released.
    pub fn new(mesh: &Mesh, is_released: &[bool]) -> Topology {
        let num_nodes = mesh.nodes.len();
        let mut is_free = vec![true; num_nodes];
        for &v in mesh.fixed_nodes.iter().chain(&mesh.moved_nodes) {
            is_free[v as usize] = is_released[v as usize];
        }
        // A node that no element uses would make the matrix singular.
        let mut is_used = vec![false; num_nodes];
        for &v in &mesh.connectivity {
            is_used[v as usize] = true;
        }
        let mut compact = vec![NOT_FREE; num_nodes];
        let mut free = Vec::new();
        for v in 0..num_nodes {
            if is_free[v] && is_used[v] {
                compact[v] = free.len() as u32;
                free.push(v as u32);
            }
        }
        let (elements_of, element_offsets) = elements_of_nodes(mesh, &compact, free.len());
        let graph = node_graph(mesh, &compact, &free, &elements_of, &element_offsets);
        let order = elimination_order(&graph);
        let mut place_of_compact = vec![0u32; free.len()];
        for (k, &v) in order.iter().enumerate() {
            place_of_compact[v as usize] = k as u32;
        }
        let mut place = vec![NOT_FREE; num_nodes];
        let mut node_at = vec![0u32; free.len()];
        for (c, &v) in free.iter().enumerate() {
            place[v as usize] = place_of_compact[c];
            node_at[place_of_compact[c] as usize] = v;
        }
        let mut is_pinned = vec![false; 3 * free.len()];
        for (nodes, component) in [(&mesh.mirror_y_nodes, 1), (&mesh.mirror_z_nodes, 2)] {
            for &v in nodes {
                if place[v as usize] != NOT_FREE {
                    is_pinned[3 * place[v as usize] as usize + component] = true;
                }
            }
        }
        let mut topology = Topology {
            place,
            node_at,
            is_pinned,
            block_pointers: vec![0],
            block_rows: Vec::new(),
            element_order: Vec::new(),
            pair_block: Vec::new(),
            pairs_per_element: 0,
        };
        topology.build_pattern(&graph, &order, &place_of_compact);
        topology.build_pairs(mesh);
        let first = |e: u32| mesh.element(e as usize).iter().map(|&v| topology.place[v as usize]).min();
        let mut element_order: Vec<u32> = (0..mesh.num_elements() as u32).collect();
        element_order.sort_by_key(|&e| first(e));
        topology.element_order = element_order;
        topology
    }

    /// Number of unknowns, pinned ones included.
    pub fn num_unknowns(&self) -> usize {
        self.is_pinned.len()
    }

    /// Number of unknowns that can move.
    pub fn num_free_unknowns(&self) -> usize {
        self.is_pinned.iter().filter(|p| !**p).count()
    }

    /// The 3×3 block pattern: rows ≥ column, sorted, per column.
    fn build_pattern(&mut self, graph: &Graph, order: &[u32], place_of_compact: &[u32]) {
        for (k, &v) in order.iter().enumerate() {
            let mut rows: Vec<u32> = vec![k as u32];
            for e in graph.offsets[v as usize]..graph.offsets[v as usize + 1] {
                let row = place_of_compact[graph.neighbours[e as usize] as usize];
                if row > k as u32 {
                    rows.push(row);
                }
            }
            rows.sort_unstable();
            self.block_rows.extend_from_slice(&rows);
            self.block_pointers.push(self.block_rows.len() as u32);
        }
    }

    fn build_pairs(&mut self, mesh: &Mesh) {
        let n = mesh.element_kind.num_nodes();
        self.pairs_per_element = n * (n + 1) / 2;
        self.pair_block.reserve(self.pairs_per_element * mesh.num_elements());
        for e in 0..mesh.num_elements() {
            let nodes = mesh.element(e);
            for b in 0..n {
                for a in b..n {
                    let (pa, pb) = (self.place[nodes[a] as usize], self.place[nodes[b] as usize]);
                    let block = if pa == NOT_FREE || pb == NOT_FREE {
                        0
                    } else {
                        // Every pair of an element's nodes is an edge of the graph, so the search succeeds.
                        let start = self.block_pointers[pa.min(pb) as usize];
                        let end = self.block_pointers[pa.min(pb) as usize + 1];
                        let rows = &self.block_rows[start as usize..end as usize];
                        start + rows.binary_search(&pa.max(pb)).unwrap_or_default() as u32
                    };
                    self.pair_block.push(block);
                }
            }
        }
    }

    /// Blocks of an element's pairs (a ≥ b, b-major).
    pub fn pair_blocks(&self, element: usize) -> &[u32] {
        &self.pair_block[element * self.pairs_per_element..(element + 1) * self.pairs_per_element]
    }

    /// The pattern of scalar unknowns: column pointers of the lower triangle, and row indices, increasing in each
    /// column, the diagonal first.
    pub fn scalar_pattern(&self) -> (Vec<usize>, Vec<usize>) {
        let mut pointers = vec![0];
        let mut indices = Vec::with_capacity(self.num_lower_entries());
        for pair in self.block_pointers.windows(2) {
            let rows = &self.block_rows[pair[0] as usize..pair[1] as usize];
            for c in 0..3 {
                for (r, &row) in rows.iter().enumerate() {
                    indices.extend((if r == 0 { c } else { 0 }..3).map(|i| 3 * row as usize + i));
                }
                pointers.push(indices.len());
            }
        }
        (pointers, indices)
    }

    /// Entries of the lower triangle: nine of each block, of those on the diagonal six.
    fn num_lower_entries(&self) -> usize {
        9 * self.block_rows.len() - 3 * self.node_at.len()
    }

    /// Writes the lower triangle of `blocks` (3×3, column by column) in the scalar pattern.
    pub fn to_scalar<T>(&self, blocks: &[[f64; 9]], convert: impl Fn(f64) -> T, out: &mut Vec<T>) {
        out.clear();
        out.reserve(self.num_lower_entries());
        for pair in self.block_pointers.windows(2) {
            let column = &blocks[pair[0] as usize..pair[1] as usize];
            for k in 0..3 {
                for (r, block) in column.iter().enumerate() {
                    for i in if r == 0 { k } else { 0 }..3 {
                        out.push(convert(block[3 * k + i]));
                    }
                }
            }
        }
    }
}

/// Elements around each free node, compressed.
fn elements_of_nodes(mesh: &Mesh, compact: &[u32], num_free: usize) -> (Vec<u32>, Vec<usize>) {
    let mut offsets = vec![0usize; num_free + 1];
    for &v in &mesh.connectivity {
        let c = compact[v as usize];
        if c != NOT_FREE {
            offsets[c as usize + 1] += 1;
        }
    }
    for v in 0..num_free {
        offsets[v + 1] += offsets[v];
    }
    let mut cursor = offsets.clone();
    let mut elements = vec![0u32; offsets[num_free]];
    let n = mesh.element_kind.num_nodes();
    for (slot, &v) in mesh.connectivity.iter().enumerate() {
        let c = compact[v as usize];
        if c != NOT_FREE {
            elements[cursor[c as usize]] = (slot / n) as u32;
            cursor[c as usize] += 1;
        }
    }
    (elements, offsets)
}

fn node_graph(mesh: &Mesh, compact: &[u32], free: &[u32], elements_of: &[u32], offsets: &[usize]) -> Graph {
    let mut graph = Graph { offsets: vec![0], neighbours: Vec::new() };
    let mut seen = vec![NOT_FREE; free.len()];
    for c in 0..free.len() {
        seen[c] = c as u32;
        for &e in &elements_of[offsets[c]..offsets[c + 1]] {
            for &v in mesh.element(e as usize) {
                let other = compact[v as usize];
                if other != NOT_FREE && seen[other as usize] != c as u32 {
                    seen[other as usize] = c as u32;
                    graph.neighbours.push(other as i32);
                }
            }
        }
        graph.offsets.push(graph.neighbours.len() as i32);
    }
    graph
}
