//! Which voxels of an unwrapped image can be relied on.

use super::graph::Graph;
use super::quality::Groups;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::PI;

/// Which voxels are kept, and why the others are not.
pub(super) struct Kept {
    pub is_kept: Vec<bool>,
    pub num_inconsistent: usize,
    pub num_unconnected: usize,
}

/// A voxel that disagrees with neighbours: the one with most disagreements goes first, then the noisier one.
struct Candidate {
    num_bad: u32,
    variance: f64,
    voxel: u32,
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        self.num_bad
            .cmp(&other.num_bad)
            .then(self.variance.total_cmp(&other.variance))
            .then(other.voxel.cmp(&self.voxel))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

/// Starting from the voxels of `is_kept`, leaves out voxels until no two kept neighbours differ by more than half a
/// turn, then keeps the largest region that is joined through differences with at least `min_margin`.
pub(super) fn kept(graph: &Graph, unwrapped: &[f64], mut is_kept: Vec<bool>, min_margin: f64) -> Kept {
    let n = graph.len();
    let is_bad = |a: u32, b: u32| (unwrapped[b as usize] - unwrapped[a as usize]).abs() > PI * (1.0 + 1e-9);
    let mut bad_neighbours: Vec<Vec<u32>> = vec![Vec::new(); n];
    for e in &graph.edges {
        if is_kept[e.a as usize] && is_kept[e.b as usize] && is_bad(e.a, e.b) {
            bad_neighbours[e.a as usize].push(e.b);
            bad_neighbours[e.b as usize].push(e.a);
        }
    }
    let mut num_bad: Vec<u32> = bad_neighbours.iter().map(|b| b.len() as u32).collect();
    let candidate = |voxel: u32, num_bad: u32| Candidate { num_bad, variance: graph.variance[voxel as usize], voxel };
    let mut heap: BinaryHeap<Candidate> =
        (0..n as u32).filter(|&v| num_bad[v as usize] > 0).map(|v| candidate(v, num_bad[v as usize])).collect();
    let mut num_inconsistent = 0;
    while let Some(Candidate { num_bad: count, voxel, .. }) = heap.pop() {
        let v = voxel as usize;
        // Entries with an old count have a newer one elsewhere in the heap.
        if !is_kept[v] || count != num_bad[v] || count == 0 {
            continue;
        }
        is_kept[v] = false;
        num_inconsistent += 1;
        for &neighbour in &bad_neighbours[v] {
            let b = neighbour as usize;
            if is_kept[b] && num_bad[b] > 0 {
                num_bad[b] -= 1;
                if num_bad[b] > 0 {
                    heap.push(candidate(neighbour, num_bad[b]));
                }
            }
        }
    }
    let mut groups = Groups::new(n);
    for e in &graph.edges {
        if is_kept[e.a as usize] && is_kept[e.b as usize] && e.margin() >= min_margin {
            groups.join(e.a, e.b, 0);
        }
    }
    let roots: Vec<usize> = (0..n).map(|v| groups.find(v as u32).0 as usize).collect();
    let mut sizes = vec![0usize; n];
    for v in (0..n).filter(|&v| is_kept[v]) {
        sizes[roots[v]] += 1;
    }
    // The first of the largest.
    let largest = (0..n).rev().max_by_key(|&r| sizes[r]);
    let mut num_unconnected = 0;
    for v in 0..n {
        if is_kept[v] && Some(roots[v]) != largest {
            is_kept[v] = false;
            num_unconnected += 1;
        }
    }
    Kept { is_kept, num_inconsistent, num_unconnected }
}
