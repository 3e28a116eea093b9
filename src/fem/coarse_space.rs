//! The coarse space inside a refined mesh: fields of the coarse mesh, continued into its elements with least energy.
//!
//! The refined mesh resists changes of volume in each of its elements, the coarse one only on the average: a coarse
//! field taken as it is would be stiffer by the ratio of bulk and shear modulus. Only its values on the faces of the
//! coarse elements are therefore kept; inside, where a refined element has 27 nodes that no other one shares, it
//! follows them as the matrix has it (a harmonic continuation, as in Schöberl 1999, Numerische Mathematik 84). The
//! matrix of the space is then a sum over coarse elements: what the faces do, less what the inside takes off.

use super::crew::Crew;
use super::dot::dot;
use super::error::LinearError;
use super::topology::{NOT_FREE, Topology};
use crate::mesh::{ElementKind, Location, Mesh};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltError, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Accum, MatMut, Par, Spec};
use std::sync::Arc;

/// Nodes of a coarse element.
const COARSE: usize = 27;
/// Nodes inside a refined element.
const INSIDE: usize = 27;
/// The middle of a coarse element, which has no say: it is inside.
const MIDDLE: usize = 13;
/// Unknowns of the two, which are as many.
const UNKNOWNS: usize = 81;
/// Entries of a matrix between them.
const ENTRIES: usize = UNKNOWNS * UNKNOWNS;

/// A coarse element with the nodes of its eight parts.
struct Refined {
    /// Places of the nodes inside.
    inside: [u32; INSIDE],
    /// Places of those on its faces that are free.
    on_faces: Vec<u32>,
    /// Places of its own nodes in the coarse numbering; [`NOT_FREE`] for the middle.
    coarse: [u32; COARSE],
}

/// How the unknowns of a coarse mesh stand for those of a refined one.
pub(super) struct CoarseSpace {
    fine: Arc<Topology>,
    coarse: Arc<Topology>,
    elements: Vec<Refined>,
    /// Places of the coarse elements' middles.
    middles: Vec<u32>,
    /// Coarse places and weights that the node at each fine place follows, and where its list begins.
    weights: Vec<(u32, f64)>,
    weight_pointers: Vec<usize>,
    /// The coarse element that counts each block between nodes on faces.
    counted_by: Vec<u32>,
}

/// What continues the coarse field into the elements: UNKNOWNS × UNKNOWNS of each.
pub(super) type Continuation = Vec<f32>;

impl CoarseSpace {
    /// Of two meshes of which the fine one's nodes lie at `locations` in the coarse one and its elements in `parents`.
    pub(super) fn new(
        [fine_mesh, coarse_mesh]: [&Mesh; 2],
        [fine, coarse]: [&Arc<Topology>; 2],
        locations: &[Location],
        parents: &[u32],
    ) -> CoarseSpace {
        let is_inside = |v: usize| locations[v].reference_coordinates.iter().all(|x| x.abs() < 1.0 - 1e-6);
        let middles: Vec<u32> =
            (0..coarse_mesh.num_elements()).map(|e| coarse.place[coarse_mesh.element(e)[MIDDLE] as usize]).collect();
        let mut of_element: Vec<Vec<u32>> = vec![Vec::new(); coarse_mesh.num_elements()];
        for (e, &parent) in parents.iter().enumerate() {
            of_element[parent as usize].extend_from_slice(fine_mesh.element(e));
        }
        let elements: Vec<Refined> = of_element
            .iter_mut()
            .enumerate()
            .map(|(e, nodes)| {
                nodes.sort_unstable();
                nodes.dedup();
                let (mut inside, mut on_faces) = (Vec::with_capacity(INSIDE), Vec::new());
                for &v in nodes.iter() {
                    let place = fine.place[v as usize];
                    match (is_inside(v as usize), place) {
                        (true, _) => inside.push(place),
                        (false, NOT_FREE) => {}
                        (false, _) => on_faces.push(place),
                    }
                }
                let mut places = [NOT_FREE; COARSE];
                for (a, &v) in coarse_mesh.element(e).iter().enumerate().filter(|(a, _)| *a != MIDDLE) {
                    places[a] = coarse.place[v as usize];
                }
                let mut own = [0; INSIDE];
                own.copy_from_slice(&inside);
                Refined { inside: own, on_faces, coarse: places }
            })
            .collect();
        let mut weights = Vec::new();
        let mut weight_pointers = vec![0];
        for &v in &fine.node_at {
            if !is_inside(v as usize) {
                let at = &locations[v as usize];
                let shapes = ElementKind::Hex27.shape_functions(at.reference_coordinates);
                for (&node, &weight) in coarse_mesh.element(at.element as usize).iter().zip(&shapes) {
                    let place = coarse.place[node as usize];
                    if place != NOT_FREE && weight.abs() > 1e-9 {
                        weights.push((place, weight));
                    }
                }
            }
            weight_pointers.push(weights.len());
        }
        let counted_by = counted_by(fine, &elements);
        let (fine, coarse) = (fine.clone(), coarse.clone());
        CoarseSpace { fine, coarse, elements, middles, weights, weight_pointers, counted_by }
    }

    /// The matrix of the space for the fine matrix of these `blocks`, and what continues its fields into the elements.
    ///
    /// # Errors
    /// [`LinearError::NotPositiveDefinite`].
    pub(super) fn condense(
        &self,
        blocks: &[[f64; 9]],
        crew: &Crew,
    ) -> Result<(Vec<[f64; 9]>, Continuation), LinearError> {
        let mut matrix = vec![[0.0; 9]; self.coarse.block_rows.len()];
        let mut continuation = vec![0.0f32; ENTRIES * self.elements.len()];
        crew.in_turn(
            self.elements.len(),
            || Scratch::new(self.fine.node_at.len(), self.coarse.node_at.len()),
            |scratch, e| self.condense_element(e, blocks, scratch),
            |scratch, e| {
                continuation[ENTRIES * e..][..ENTRIES].copy_from_slice(&scratch.continuation);
                self.add(e, &scratch.of_coarse, &mut matrix);
            },
        )?;
        for &place in &self.middles {
            let diagonal = &mut matrix[self.coarse.block_pointers[place as usize] as usize];
            *diagonal = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        }
        self.coarse.pin(&mut matrix);
        Ok((matrix, continuation))
    }

    /// What coarse element `e` adds to the matrix of the space, and its continuation, into `scratch`.
    fn condense_element(&self, e: usize, blocks: &[[f64; 9]], scratch: &mut Scratch) -> Result<(), LinearError> {
        let element = &self.elements[e];
        self.gather_blocks(e, blocks, scratch);
        let Scratch { inside, from_faces, of_coarse, continuation, memory, .. } = scratch;
        let mut factor = MatMut::from_column_major_slice_mut(inside, UNKNOWNS, UNKNOWNS);
        let stack = MemStack::new(memory);
        cholesky_in_place(factor.as_mut(), Default::default(), Par::Seq, stack, Spec::default()).map_err(
            |LltError::NonPositivePivot { index }| LinearError::NotPositiveDefinite {
                index: 3 * element.inside[index / 3] as usize + index % 3,
            },
        )?;
        let factor = factor.as_ref();
        let mut half = MatMut::from_column_major_slice_mut(from_faces, UNKNOWNS, UNKNOWNS);
        solve_lower_triangular_in_place(factor, half.as_mut(), Par::Seq);
        let square = MatMut::from_column_major_slice_mut(of_coarse, UNKNOWNS, UNKNOWNS);
        matmul(square, Accum::Add, half.as_ref().transpose(), half.as_ref(), -1.0, Par::Seq);
        solve_upper_triangular_in_place(factor.transpose(), half, Par::Seq);
        for (out, &value) in continuation.iter_mut().zip(from_faces.iter()) {
            *out = -value as f32;
        }
        Ok(())
    }

    /// The parts of the fine matrix that coarse element `e` counts: inside, between inside and the coarse nodes, and
    /// between coarse nodes.
    fn gather_blocks(&self, e: usize, blocks: &[[f64; 9]], scratch: &mut Scratch) {
        let element = &self.elements[e];
        let Scratch { local, coarse_local, inside, from_faces, of_coarse, .. } = scratch;
        for matrix in [&mut *inside, &mut *from_faces, &mut *of_coarse] {
            matrix.fill(0.0);
        }
        let nodes = || element.inside.iter().chain(&element.on_faces).map(|&place| place as usize);
        for (a, place) in nodes().enumerate() {
            local[place] = a as u32;
        }
        for (a, &place) in element.coarse.iter().enumerate().filter(|(_, p)| **p != NOT_FREE) {
            coarse_local[place as usize] = a as u32;
        }
        // First unknown in the element, and weight, of the coarse nodes that a node follows.
        let followed = |place: usize| {
            let weights = &self.weights[self.weight_pointers[place]..self.weight_pointers[place + 1]];
            weights.iter().map(|&(to, weight)| (3 * coarse_local[to as usize] as usize, weight))
        };
        for (b, column) in nodes().enumerate() {
            for s in self.fine.block_pointers[column] as usize..self.fine.block_pointers[column + 1] as usize {
                let row = self.fine.block_rows[s] as usize;
                if local[row] == NOT_FREE {
                    continue;
                }
                let (a, block) = (local[row] as usize, &blocks[s]);
                match (a < INSIDE, b < INSIDE) {
                    (true, true) => {
                        add_block(inside, [3 * a, 3 * b], block, 1.0);
                        if a != b {
                            add_transposed(inside, [3 * b, 3 * a], block, 1.0);
                        }
                    }
                    (true, false) => followed(column).for_each(|(c, w)| add_block(from_faces, [3 * a, c], block, w)),
                    (false, true) => followed(row).for_each(|(c, w)| add_transposed(from_faces, [3 * b, c], block, w)),
                    (false, false) if self.counted_by[s] == e as u32 => {
                        for (r, first) in followed(row) {
                            for (c, second) in followed(column) {
                                add_block(of_coarse, [r, c], block, first * second);
                                if row != column {
                                    add_transposed(of_coarse, [c, r], block, first * second);
                                }
                            }
                        }
                    }
                    (false, false) => {}
                }
            }
        }
        for place in nodes() {
            local[place] = NOT_FREE;
        }
    }

    /// Adds the matrix of coarse element `e`.
    fn add(&self, e: usize, of_coarse: &[f64], matrix: &mut [[f64; 9]]) {
        let places = &self.elements[e].coarse;
        let mut pairs = self.coarse.pair_blocks(e).iter();
        for b in 0..COARSE {
            for (a, &block) in (b..COARSE).zip(&mut pairs) {
                if places[a] == NOT_FREE || places[b] == NOT_FREE {
                    continue;
                }
                // The block's rows are those of the node that is eliminated later.
                let (row, column) = if places[a] >= places[b] { (a, b) } else { (b, a) };
                let target = &mut matrix[block as usize];
                for k in 0..3 {
                    for i in 0..3 {
                        target[3 * k + i] += of_coarse[(3 * column + k) * UNKNOWNS + 3 * row + i];
                    }
                }
            }
        }
    }

    /// What of a fine residual the coarse space sees.
    pub(super) fn restrict(&self, continuation: &Continuation, fine: &[f64]) -> Vec<f64> {
        let mut coarse = vec![0.0; self.coarse.num_unknowns()];
        for (place, pair) in self.weight_pointers.windows(2).enumerate() {
            for &(to, weight) in &self.weights[pair[0]..pair[1]] {
                for i in 0..3 {
                    coarse[3 * to as usize + i] += weight * fine[3 * place + i];
                }
            }
        }
        let mut inside = [0.0f32; UNKNOWNS];
        for (element, continuation) in self.elements.iter().zip(continuation.chunks_exact(ENTRIES)) {
            gather(&element.inside, fine, &mut inside);
            for (a, &place) in element.coarse.iter().enumerate().filter(|(_, p)| **p != NOT_FREE) {
                for i in 0..3 {
                    let column = &continuation[(3 * a + i) * UNKNOWNS..][..UNKNOWNS];
                    coarse[3 * place as usize + i] += f64::from(dot(column, &inside));
                }
            }
        }
        for (x, &is_pinned) in coarse.iter_mut().zip(&self.coarse.is_pinned) {
            if is_pinned {
                *x = 0.0;
            }
        }
        coarse
    }

    /// Adds a coarse field to a fine one.
    pub(super) fn prolong(&self, continuation: &Continuation, coarse: &[f64], fine: &mut [f64]) {
        for (place, pair) in self.weight_pointers.windows(2).enumerate() {
            for &(from, weight) in &self.weights[pair[0]..pair[1]] {
                for i in 0..3 {
                    fine[3 * place + i] += weight * coarse[3 * from as usize + i];
                }
            }
        }
        let mut values = [0.0f32; UNKNOWNS];
        for (element, continuation) in self.elements.iter().zip(continuation.chunks_exact(ENTRIES)) {
            gather(&element.coarse, coarse, &mut values);
            let mut inside = [0.0f32; UNKNOWNS];
            for (column, &x) in continuation.chunks_exact(UNKNOWNS).zip(&values) {
                for (y, &a) in inside.iter_mut().zip(column) {
                    *y += a * x;
                }
            }
            for (a, &place) in element.inside.iter().enumerate() {
                for i in 0..3 {
                    fine[3 * place as usize + i] += f64::from(inside[3 * a + i]);
                }
            }
        }
    }
}

/// matrix += weight × block with the block's first row and column at `[row, column]`.
fn add_block(matrix: &mut [f64], [row, column]: [usize; 2], block: &[f64; 9], weight: f64) {
    for k in 0..3 {
        for i in 0..3 {
            matrix[(column + k) * UNKNOWNS + row + i] += weight * block[3 * k + i];
        }
    }
}

/// The same with the block transposed.
fn add_transposed(matrix: &mut [f64], [row, column]: [usize; 2], block: &[f64; 9], weight: f64) {
    for k in 0..3 {
        for i in 0..3 {
            matrix[(column + i) * UNKNOWNS + row + k] += weight * block[3 * k + i];
        }
    }
}

/// The values at these places; zero where there are none.
fn gather(places: &[u32; 27], from: &[f64], into: &mut [f32; UNKNOWNS]) {
    for (a, &place) in places.iter().enumerate() {
        for i in 0..3 {
            into[3 * a + i] = if place == NOT_FREE { 0.0 } else { from[3 * place as usize + i] as f32 };
        }
    }
}

/// What a thread needs of its own.
struct Scratch {
    /// Number of each fine node in the element at work, those inside first; [`NOT_FREE`] elsewhere.
    local: Vec<u32>,
    /// Number of each coarse node in it; only those of the element hold.
    coarse_local: Vec<u32>,
    inside: Vec<f64>,
    from_faces: Vec<f64>,
    of_coarse: Vec<f64>,
    continuation: Vec<f32>,
    memory: MemBuffer,
}

impl Scratch {
    fn new(num_fine: usize, num_coarse: usize) -> Scratch {
        Scratch {
            local: vec![NOT_FREE; num_fine],
            coarse_local: vec![NOT_FREE; num_coarse],
            inside: vec![0.0; ENTRIES],
            from_faces: vec![0.0; ENTRIES],
            of_coarse: vec![0.0; ENTRIES],
            continuation: vec![0.0; ENTRIES],
            memory: MemBuffer::new(cholesky_in_place_scratch::<f64>(UNKNOWNS, Par::Seq, Spec::default())),
        }
    }
}

/// The first coarse element on whose faces both nodes of each block lie; [`NOT_FREE`] where one is inside.
fn counted_by(fine: &Topology, elements: &[Refined]) -> Vec<u32> {
    let mut counted = vec![NOT_FREE; fine.block_rows.len()];
    let mut seen = vec![NOT_FREE; fine.node_at.len()];
    for (e, element) in elements.iter().enumerate() {
        for &place in &element.on_faces {
            seen[place as usize] = e as u32;
        }
        for &column in &element.on_faces {
            let column = column as usize;
            for s in fine.block_pointers[column] as usize..fine.block_pointers[column + 1] as usize {
                if seen[fine.block_rows[s] as usize] == e as u32 && counted[s] == NOT_FREE {
                    counted[s] = e as u32;
                }
            }
        }
    }
    counted
}
