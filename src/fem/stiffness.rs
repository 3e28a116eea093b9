//! Element stiffnesses into the blocks of the sparse lower triangle.

use super::element_data::{BLOCK_GROUPS, Blocks, MAX_NODES, MAX_SECTION, PAIRED_LEVELS};
use super::topology::{NOT_FREE, Topology};

/// Place among [`PAIRED_LEVELS`].
fn pair_of(row: usize, column: usize) -> usize {
    PAIRED_LEVELS.iter().position(|&levels| levels == [row, column]).unwrap_or_default()
}

impl Topology {
    /// Adds the stiffness of element `e` with these nodes, in the layout of
    /// [`ElementOutput::stiffness`](super::element_data::ElementOutput::stiffness), to the blocks of the lower
    /// triangle.
    pub(super) fn add_element(&self, e: usize, nodes: &[u32], stiffness: &[Blocks], blocks: &mut [[f64; 9]]) {
        let section = nodes.len() / 3;
        let mut places = [NOT_FREE; MAX_NODES];
        for (place, &v) in places.iter_mut().zip(nodes) {
            *place = self.place[v as usize];
        }
        // In the order of the pairs a ≥ b, b-major.
        let mut pairs = self.pair_blocks(e);
        for b in 0..nodes.len() {
            let columns = &stiffness[MAX_SECTION * (b % section)..][..section];
            for level in b / section..3 {
                let pair = pair_of(level, b / section);
                let first = if level == b / section { b % section } else { 0 };
                let rows = &places[section * level..section * (level + 1)];
                let (now, rest) = pairs.split_at(section - first);
                pairs = rest;
                for ((own, &place), &block) in columns[first..].iter().zip(&rows[first..]).zip(now) {
                    if place == NOT_FREE || places[b] == NOT_FREE {
                        continue;
                    }
                    let (most, last) = (&own[pair].0, own[BLOCK_GROUPS - 1].0[pair]);
                    let target = &mut blocks[block as usize];
                    if place >= places[b] {
                        for ki in 0..8 {
                            target[ki] += most[ki];
                        }
                    } else {
                        for ki in 0..8 {
                            target[ki] += most[3 * (ki % 3) + ki / 3];
                        }
                    }
                    target[8] += last;
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
