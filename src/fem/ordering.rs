//! Elimination order of the node graph: METIS nested dissection, then a postorder of its elimination tree.
//!
//! The graph's vertices are nodes, not unknowns (three unknowns per node share a pattern, so this is nine times less
//! work). Postordering lets the factorisation merge columns into larger supernodes; it does not change the fill.

/// Adjacency in compressed form, without self-loops.
pub struct Graph {
    /// `neighbours[offsets[v]..offsets[v + 1]]` are the neighbours of v.
    pub offsets: Vec<i32>,
    /// Neighbours.
    pub neighbours: Vec<i32>,
}

/// `order[k]` is the vertex eliminated k-th.
pub fn elimination_order(graph: &Graph) -> Vec<u32> {
    let n = graph.offsets.len() - 1;
    let mut order = nested_dissection(graph).unwrap_or_else(|| (0..n as u32).collect());
    postorder(graph, &mut order);
    order
}

/// METIS draws from the C library's `rand`, whose state is the process's: calls at the same time would disturb each
/// other's orders, and with them the last digits of every solution. One at a time each call seeds it anew.
static METIS: std::sync::Mutex<()> = std::sync::Mutex::new(());

/// METIS_NodeND; `None` where the library refuses (empty graph, no memory), in which case any order is correct.
fn nested_dissection(graph: &Graph) -> Option<Vec<u32>> {
    let mut n = (graph.offsets.len() - 1) as i32;
    if n == 0 || graph.neighbours.is_empty() {
        return None;
    }
    let (mut offsets, mut neighbours) = (graph.offsets.clone(), graph.neighbours.clone());
    let mut options = [-1i32; metis_sys::METIS_NOPTIONS as usize];
    let (mut perm, mut inverse) = (vec![0i32; n as usize], vec![0i32; n as usize]);
    // The lock guards no data, so a poisoned one is as good.
    let _one_at_a_time = METIS.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    // SAFETY: the arrays have the lengths that METIS documents (n + 1, offsets[n], METIS_NOPTIONS, n, n), indices are
    // in range by construction, and all outlive the call.
    let status = unsafe {
        metis_sys::METIS_NodeND(
            &mut n,
            offsets.as_mut_ptr(),
            neighbours.as_mut_ptr(),
            std::ptr::null_mut(),
            options.as_mut_ptr(),
            perm.as_mut_ptr(),
            inverse.as_mut_ptr(),
        )
    };
    (status == metis_sys::rstatus_et_METIS_OK).then(|| perm.into_iter().map(|v| v as u32).collect())
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
