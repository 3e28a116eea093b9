//! Quality-guided unwrapping: groups of voxels are joined, most trusted difference first.

use super::graph::{Edge, Graph};
use std::f64::consts::TAU;

/// Joined in the order of falling margins.
pub(super) fn by_margin(graph: &Graph) -> Vec<f64> {
    joined(graph, |edge| -edge.margin())
}

/// Joined in the order of rising second differences: an edge's quality is the sum of its voxels' reliabilities, the
/// reliability one over the root of the sum of squared second differences.
pub(super) fn by_second_difference(graph: &Graph) -> Vec<f64> {
    let reliability = |n: u32| 1.0 / graph.roughness[n as usize].sqrt().max(1e-12);
    joined(graph, |edge| -(reliability(edge.a) + reliability(edge.b)))
}

/// A forest of groups; each voxel knows its whole turns relative to its parent.
pub(super) struct Groups {
    parent: Vec<u32>,
    turns: Vec<i32>,
    size: Vec<u32>,
}

impl Groups {
    pub fn new(n: usize) -> Self {
        Groups { parent: (0..n as u32).collect(), turns: vec![0; n], size: vec![1; n] }
    }

    /// The group's root and the turns relative to it.
    pub fn find(&mut self, n: u32) -> (u32, i32) {
        let (mut root, mut total) = (n, 0);
        while self.parent[root as usize] != root {
            total += self.turns[root as usize];
            root = self.parent[root as usize];
        }
        // Path compression: every voxel on the way now hangs on the root.
        let (mut at, mut rest) = (n, total);
        while at != root {
            let (next, own) = (self.parent[at as usize], self.turns[at as usize]);
            self.parent[at as usize] = root;
            self.turns[at as usize] = rest;
            rest -= own;
            at = next;
        }
        (root, total)
    }

    /// Joins the groups of a and b so that b has `turns` more than a.
    pub fn join(&mut self, a: u32, b: u32, turns: i32) {
        let ((ra, ka), (rb, kb)) = (self.find(a), self.find(b));
        if ra == rb {
            return;
        }
        let shift = ka + turns - kb;
        if self.size[ra as usize] >= self.size[rb as usize] {
            self.parent[rb as usize] = ra;
            self.turns[rb as usize] = shift;
            self.size[ra as usize] += self.size[rb as usize];
        } else {
            self.parent[ra as usize] = rb;
            self.turns[ra as usize] = -shift;
            self.size[rb as usize] += self.size[ra as usize];
        }
    }
}

fn joined(graph: &Graph, cost: impl Fn(&Edge) -> f64) -> Vec<f64> {
    let mut order: Vec<(f64, u32)> = graph.edges.iter().enumerate().map(|(n, e)| (cost(e), n as u32)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut groups = Groups::new(graph.len());
    for (_, n) in order {
        let edge = graph.edges[n as usize];
        let (from, to) = (graph.phase[edge.a as usize], graph.phase[edge.b as usize]);
        groups.join(edge.a, edge.b, ((from + edge.difference - to) / TAU).round() as i32);
    }
    (0..graph.len()).map(|n| graph.phase[n] + TAU * f64::from(groups.find(n as u32).1)).collect()
}
