//! Elimination order of the node graph: nested dissection or, without METIS, approximate minimum degree; then a
//! postorder of its elimination tree.
//!
//! The graph's vertices are nodes, not unknowns (three unknowns per node share a pattern, so this is nine times less
//! work). Postordering lets the factorisation merge columns into larger supernodes; it does not change the fill.

use super::graph::Graph;
use super::minimum_degree::minimum_degree;
#[cfg(feature = "metis")]
use super::nested_dissection::nested_dissection;

/// `order[k]` is the vertex eliminated k-th.
pub fn elimination_order(graph: &Graph) -> Vec<u32> {
    let n = graph.offsets.len() - 1;
    #[cfg(feature = "metis")]
    let dissected = nested_dissection(graph);
    #[cfg(not(feature = "metis"))]
    let dissected = None;
    // Any order is correct; a good one leaves little fill.
    let mut order = dissected.or_else(|| minimum_degree(graph)).unwrap_or_else(|| (0..n as u32).collect());
    postorder(graph, &mut order);
    order
}

/// Reorders `order` to a postorder of its elimination tree (Liu's algorithm with path compression).
fn postorder(graph: &Graph, order: &mut [u32]) {
    let n = order.len();
    let mut position = vec![0u32; n];
    for (k, &v) in order.iter().enumerate() {
        position[v as usize] = k as u32;
    }
    const NONE: u32 = u32::MAX;
    let (mut parent, mut ancestor) = (vec![NONE; n], vec![NONE; n]);
    for k in 0..n {
        let v = order[k] as usize;
        for e in graph.offsets[v]..graph.offsets[v + 1] {
            let mut j = position[graph.neighbours[e as usize] as usize];
            if j as usize >= k {
                continue;
            }
            while ancestor[j as usize] != NONE && ancestor[j as usize] != k as u32 {
                let next = ancestor[j as usize];
                ancestor[j as usize] = k as u32;
                j = next;
            }
            if ancestor[j as usize] == NONE {
                ancestor[j as usize] = k as u32;
                parent[j as usize] = k as u32;
            }
        }
    }
    // Children lists in increasing order, then an explicit-stack depth-first walk.
    let (mut first, mut next) = (vec![NONE; n + 1], vec![NONE; n]);
    for k in (0..n).rev() {
        let p = if parent[k] == NONE { n } else { parent[k] as usize };
        next[k] = first[p];
        first[p] = k as u32;
    }
    let mut post = Vec::with_capacity(n);
    let mut stack = Vec::new();
    let mut root = first[n];
    while root != NONE {
        stack.push(root);
        while let Some(&top) = stack.last() {
            let child = first[top as usize];
            if child == NONE {
                post.push(order[top as usize]);
                stack.pop();
            } else {
                first[top as usize] = next[child as usize];
                stack.push(child);
            }
        }
        root = next[root as usize];
    }
    order.copy_from_slice(&post);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A path graph: the order is a permutation, and every vertex's parent comes after it (checked through its being a
    /// permutation that eliminates a path without fill beyond one neighbour).
    #[test]
    fn order_is_a_permutation() {
        let n = 400;
        let (mut offsets, mut neighbours) = (vec![0], vec![]);
        for v in 0..n {
            if v > 0 {
                neighbours.push(v - 1);
            }
            if v + 1 < n {
                neighbours.push(v + 1);
            }
            offsets.push(neighbours.len() as i32);
        }
        let mut order = elimination_order(&Graph { offsets, neighbours });
        order.sort_unstable();
        assert!(order.iter().enumerate().all(|(k, &v)| k == v as usize));
    }
}
