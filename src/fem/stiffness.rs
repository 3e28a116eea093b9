//! Element stiffnesses into the blocks of the sparse lower triangle.

use super::element_data::{MAX_GROUPS, MAX_NODES};
use super::topology::{NOT_FREE, Topology};
use crate::material::{LANES, Lanes};

impl Topology {
    /// Adds the stiffness of element `e` with these nodes, in the layout of
    /// [`ElementOutput::stiffness`](super::element_data::ElementOutput::stiffness), to the blocks of the lower triangle.
    pub(super) fn add_element(
        &self,
        e: usize,
        nodes: &[u32],
        stiffness: &[[[Lanes; MAX_GROUPS]; 3]],
        blocks: &mut [[f64; 9]],
    ) {
        let n = nodes.len();
        let mut places = [NOT_FREE; MAX_NODES];
        for (place, &v) in places.iter_mut().zip(nodes) {
            *place = self.place[v as usize];
        }
        let mut pairs = self.pair_blocks(e);
        for b in 0..n {
            let (now, rest) = pairs.split_at(n - b);
            pairs = rest;
            if places[b] == NOT_FREE {
                continue;
            }
            let columns = &stiffness[3 * b..3 * b + 3];
            for (a, &block) in (b..n).zip(now) {
                if places[a] == NOT_FREE {
                    continue;
                }
                let (group, lane) = (a / LANES, a % LANES);
                let target = &mut blocks[block as usize];
                if places[a] >= places[b] {
                    for k in 0..3 {
                        for i in 0..3 {
                            target[3 * k + i] += columns[k][i][group].0[lane];
                        }
                    }
                } else {
                    for k in 0..3 {
                        for i in 0..3 {
                            target[3 * k + i] += columns[i][k][group].0[lane];
                        }
                    }
                }
            }
        }
    }

    /// Replaces rows and columns of pinned unknowns by their diagonal.
    pub(super) fn pin(&self, blocks: &mut [[f64; 9]]) {
        for (j, pair) in self.block_pointers.windows(2).enumerate() {
            for s in pair[0] as usize..pair[1] as usize {
                let row = self.block_rows[s] as usize;
                let block = &mut blocks[s];
                for k in 0..3 {
                    for i in 0..3 {
                        let is_diagonal = row == j && i == k;
                        if !is_diagonal && (self.is_pinned[3 * j + k] || self.is_pinned[3 * row + i]) {
                            block[3 * k + i] = 0.0;
                        }
                    }
                }
            }
        }
    }
}
