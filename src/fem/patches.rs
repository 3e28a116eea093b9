//! Patches of a mesh: the nodes around each corner of its elements, on which small exact solutions smooth an error.
//!
//! A patch holds the nodes on the corner itself and inside the edges, faces and elements that meet there: 27 where the
//! mesh is regular. Every field without change of volume that lives on a few elements is a sum of such fields on
//! patches, so that their solutions also reduce errors that hardly change volume. Those of single elements do not: a
//! nearly incompressible material couples them (Schöberl 1999, Numerische Mathematik 84; Farrell, Mitchell and Wechsung
//! 2019, SIAM Journal on Scientific Computing 41).

use super::crew::Crew;
use super::error::LinearError;
use super::topology::{NOT_FREE, Topology};
use crate::mesh::{ElementKind, Mesh};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::cholesky::llt::inverse::{inverse, inverse_scratch};
use faer::{MatMut, MatRef, Par, Spec};
use std::ops::Range;
use std::sync::Mutex;

/// Patches that a thread works on at once.
const AT_ONCE: usize = 256;

/// The patches of one mesh.
pub(super) struct Patches {
    /// Places of the nodes, ascending in each patch, one patch after the other.
    places: Vec<u32>,
    /// First node of each patch.
    node_pointers: Vec<usize>,
    /// First entry of each patch's inverse.
    value_pointers: Vec<usize>,
    /// Where the node at each place stands among `places`, and where its list begins.
    occurrences: Vec<u32>,
    occurrence_pointers: Vec<usize>,
}

impl Patches {
    /// Of a mesh of hexahedra with 27 nodes.
    pub(super) fn new(mesh: &Mesh, topology: &Topology) -> Patches {
        debug_assert_eq!(mesh.element_kind, ElementKind::Hex27);
        let mut of_corner: Vec<Vec<u32>> = vec![Vec::new(); mesh.nodes.len()];
        for e in 0..mesh.num_elements() {
            let nodes = mesh.element(e);
            for corner in (0..8).map(|c| [2 * (c & 1), 2 * (c >> 1 & 1), 2 * (c >> 2)]) {
                let around = &mut of_corner[nodes[local_index(corner)] as usize];
                for (a, &v) in nodes.iter().enumerate() {
                    let at = [a % 3, a / 3 % 3, a / 9];
                    let place = topology.place[v as usize];
                    if place != NOT_FREE && (0..3).all(|i| at[i].abs_diff(corner[i]) <= 1) {
                        around.push(place);
                    }
                }
            }
        }
        let mut patches = Patches {
            places: Vec::new(),
            node_pointers: vec![0],
            value_pointers: vec![0],
            occurrences: Vec::new(),
            occurrence_pointers: vec![0],
        };
        let mut lists: Vec<Vec<u32>> = of_corner.into_iter().filter(|list| !list.is_empty()).collect();
        for list in &mut lists {
            list.sort_unstable();
            list.dedup();
        }
        // Neighbours in memory are worked on together.
        lists.sort_by_key(|list| list[0]);
        for list in &lists {
            patches.places.extend_from_slice(list);
            patches.node_pointers.push(patches.places.len());
            let n = 3 * list.len();
            patches.value_pointers.push(patches.value_pointers[patches.value_pointers.len() - 1] + n * n);
        }
        let mut found: Vec<Vec<u32>> = vec![Vec::new(); topology.node_at.len()];
        for (k, &place) in patches.places.iter().enumerate() {
            found[place as usize].push(k as u32);
        }
        for list in found {
            patches.occurrences.extend_from_slice(&list);
            patches.occurrence_pointers.push(patches.occurrences.len());
        }
        patches
    }

    fn len(&self) -> usize {
        self.node_pointers.len() - 1
    }

    /// Ranges of patches that are worked on at once.
    fn chunks(&self) -> impl Iterator<Item = Range<usize>> {
        let len = self.len();
        (0..len.div_ceil(AT_ONCE)).map(move |c| c * AT_ONCE..len.min((c + 1) * AT_ONCE))
    }

    /// Inverts the part of the matrix of these `blocks` that belongs to each patch, in the memory of `old` inverses.
    ///
    /// # Errors
    /// [`LinearError::NotPositiveDefinite`].
    pub(super) fn invert(
        &self,
        topology: &Topology,
        blocks: &[[f64; 9]],
        old: Option<Vec<f32>>,
        crew: &Crew,
    ) -> Result<Vec<f32>, LinearError> {
        let mut values = old.unwrap_or_else(|| vec![0.0; self.value_pointers[self.len()]]);
        let mut items = Vec::new();
        let mut rest = &mut values[..];
        for range in self.chunks() {
            let len = self.value_pointers[range.end] - self.value_pointers[range.start];
            let (own, after) = rest.split_at_mut(len);
            items.push((range, own));
            rest = after;
        }
        let failed = Mutex::new(None);
        let largest = self.node_pointers.windows(2).map(|pair| 3 * (pair[1] - pair[0])).max().unwrap_or(0);
        let state = || {
            let scratch = cholesky_in_place_scratch::<f32>(largest, Par::Seq, Spec::default())
                .or(inverse_scratch::<f32>(largest, Par::Seq));
            (vec![0.0f32; largest * largest], MemBuffer::new(scratch))
        };
        crew.share(items, state, |(matrix, memory), (range, own)| {
            let first = self.value_pointers[range.start];
            for patch in range {
                let nodes = &self.places[self.node_pointers[patch]..self.node_pointers[patch + 1]];
                let n = 3 * nodes.len();
                let matrix = &mut matrix[..n * n];
                part_of(topology, blocks, nodes, matrix);
                let out = &mut own[self.value_pointers[patch] - first..][..n * n];
                if let Err(pivot) = inverted(matrix, n, out, MemStack::new(memory)) {
                    let index = 3 * nodes[pivot / 3] as usize + pivot % 3;
                    *failed.lock().unwrap_or_else(|e| e.into_inner()) = Some(index);
                    return;
                }
            }
        });
        match failed.into_inner().unwrap_or_else(|e| e.into_inner()) {
            Some(index) => Err(LinearError::NotPositiveDefinite { index }),
            None => Ok(values),
        }
    }

    /// z += the sum of all patches' solutions for the residual `r`, with their `inverses`.
    pub(super) fn add_solutions(&self, inverses: &[f32], r: &[f64], z: &mut [f64], crew: &Crew) {
        let mut solutions = vec![0.0f32; 3 * self.places.len()];
        let mut items = Vec::new();
        let mut rest = &mut solutions[..];
        for range in self.chunks() {
            let (own, after) = rest.split_at_mut(3 * (self.node_pointers[range.end] - self.node_pointers[range.start]));
            items.push((range, own));
            rest = after;
        }
        crew.share(items, Vec::new, |residual: &mut Vec<f32>, (range, own)| {
            let first = self.node_pointers[range.start];
            for patch in range {
                let (begin, end) = (self.node_pointers[patch], self.node_pointers[patch + 1]);
                residual.clear();
                for &place in &self.places[begin..end] {
                    residual.extend(r[3 * place as usize..][..3].iter().map(|&x| x as f32));
                }
                let out = &mut own[3 * (begin - first)..3 * (end - first)];
                let inverse = &inverses[self.value_pointers[patch]..self.value_pointers[patch + 1]];
                for (column, &x) in inverse.chunks_exact(out.len()).zip(residual.iter()) {
                    for (y, &a) in out.iter_mut().zip(column) {
                        *y += a * x;
                    }
                }
            }
        });
        for (place, pair) in self.occurrence_pointers.windows(2).enumerate() {
            for &k in &self.occurrences[pair[0]..pair[1]] {
                for i in 0..3 {
                    z[3 * place + i] += f64::from(solutions[3 * k as usize + i]);
                }
            }
        }
    }
}

/// Number of a node in its element by its place along each axis (0, 1 or 2).
fn local_index(at: [usize; 3]) -> usize {
    at[0] + 3 * at[1] + 9 * at[2]
}

/// The lower triangle of the part of a matrix that belongs to these places (ascending), column by column.
fn part_of(topology: &Topology, blocks: &[[f64; 9]], places: &[u32], matrix: &mut [f32]) {
    let n = 3 * places.len();
    matrix.fill(0.0);
    for (b, &place) in places.iter().enumerate() {
        let range =
            topology.block_pointers[place as usize] as usize..topology.block_pointers[place as usize + 1] as usize;
        let mut a = b;
        for (&row, block) in topology.block_rows[range.clone()].iter().zip(&blocks[range]) {
            while a < places.len() && places[a] < row {
                a += 1;
            }
            if a == places.len() {
                break;
            }
            if places[a] == row {
                for k in 0..3 {
                    for i in 0..3 {
                        matrix[(3 * b + k) * n + 3 * a + i] = block[3 * k + i] as f32;
                    }
                }
            }
        }
    }
}

/// Inverts a matrix of `n` rows, of which the lower triangle is read; the pivot that is not positive, if one is.
fn inverted(matrix: &mut [f32], n: usize, out: &mut [f32], memory: &mut MemStack) -> Result<(), usize> {
    let mut factor = MatMut::from_column_major_slice_mut(matrix, n, n);
    cholesky_in_place(factor.as_mut(), Default::default(), Par::Seq, memory, Spec::default())
        .map_err(|faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot { index }| index)?;
    inverse(
        MatMut::from_column_major_slice_mut(out, n, n),
        MatRef::from_column_major_slice(matrix, n, n),
        Par::Seq,
        memory,
    );
    for j in 0..n {
        for i in j + 1..n {
            out[i * n + j] = out[j * n + i];
        }
    }
    Ok(())
}
