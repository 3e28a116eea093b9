//! Circles of a directed graph.

use std::collections::BTreeSet;

/// The groups of more than one node in which each reaches each other one, sorted, by Tarjan's algorithm.
pub fn circles(num_nodes: usize, edges: &BTreeSet<(usize, usize)>) -> Vec<Vec<usize>> {
    let mut search = Search {
        neighbours: vec![Vec::new(); num_nodes],
        order: vec![None; num_nodes],
        lowest: vec![0; num_nodes],
        is_open: vec![false; num_nodes],
        open: Vec::new(),
        num_seen: 0,
        groups: Vec::new(),
    };
    for &(from, to) in edges {
        search.neighbours[from].push(to);
    }
    for node in 0..num_nodes {
        if search.order[node].is_none() {
            search.visit(node);
        }
    }
    let mut groups: Vec<Vec<usize>> = search.groups.into_iter().filter(|g| g.len() > 1).collect();
    groups.iter_mut().for_each(|g| g.sort_unstable());
    groups.sort();
    groups
}

struct Search {
    neighbours: Vec<Vec<usize>>,
    order: Vec<Option<usize>>,
    /// The earliest open node that a node reaches.
    lowest: Vec<usize>,
    is_open: Vec<bool>,
    open: Vec<usize>,
    num_seen: usize,
    groups: Vec<Vec<usize>>,
}

impl Search {
    fn visit(&mut self, node: usize) {
        self.order[node] = Some(self.num_seen);
        self.lowest[node] = self.num_seen;
        self.num_seen += 1;
        self.open.push(node);
        self.is_open[node] = true;
        for next in self.neighbours[node].clone() {
            match self.order[next] {
                None => {
                    self.visit(next);
                    self.lowest[node] = self.lowest[node].min(self.lowest[next]);
                }
                Some(order) if self.is_open[next] => self.lowest[node] = self.lowest[node].min(order),
                Some(_) => {}
            }
        }
        if self.order[node] == Some(self.lowest[node]) {
            let start = self.open.iter().position(|n| *n == node).expect("it is open");
            let group = self.open.split_off(start);
            for &n in &group {
                self.is_open[n] = false;
            }
            self.groups.push(group);
        }
    }
}
