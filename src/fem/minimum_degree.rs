//! Approximate minimum degree, by faer: an elimination order that needs no C library. In three dimensions it leaves
//! more fill than nested dissection.

use super::graph::Graph;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd::{Control, order_maybe_unsorted, order_maybe_unsorted_scratch};

/// An order of low fill; `None` where there is no graph to speak of, or no memory.
pub(super) fn minimum_degree(graph: &Graph) -> Option<Vec<u32>> {
    let n = graph.offsets.len() - 1;
    if n == 0 || graph.neighbours.is_empty() {
        return None;
    }
    let unsigned = |list: &[i32]| list.iter().map(|v| *v as u32).collect::<Vec<u32>>();
    let (offsets, neighbours) = (unsigned(&graph.offsets), unsigned(&graph.neighbours));
    let pattern = SymbolicSparseColMatRef::new_unsorted_checked(n, n, &offsets, None, &neighbours);
    let (mut order, mut inverse) = (vec![0u32; n], vec![0u32; n]);
    let scratch = order_maybe_unsorted_scratch::<u32>(n, neighbours.len());
    let mut memory = MemBuffer::try_new(scratch).ok()?;
    let stack = MemStack::new(&mut memory);
    order_maybe_unsorted(&mut order, &mut inverse, pattern, Control::default(), stack).ok()?;
    Some(order)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A star: its centre, whose elimination would join all others, goes among the last two.
    #[test]
    fn the_centre_of_a_star_goes_last() {
        let n = 12;
        let centre = 0..1;
        let neighbours: Vec<i32> = (1..n).chain((1..n).flat_map(|_| centre.clone())).collect();
        let offsets: Vec<i32> = std::iter::once(0).chain((0..n).map(|v| n - 1 + v)).collect();
        let order = minimum_degree(&Graph { offsets, neighbours }).expect("an order");
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..n as u32).collect::<Vec<_>>());
        assert!(order[n as usize - 2..].contains(&0), "{order:?}");
    }
}
