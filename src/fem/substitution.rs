//! Forward and backward substitution with a factor by fronts, subtrees side by side.
//!
//! All right-hand sides go through a front together: the factor is read once for all of them, and reading it is most of
//! the work.

use super::crew::Crew;
use super::dot::dot;
use super::fronts::Fronts;
use super::multifrontal::Real;
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use faer::{Accum, MatMut, MatRef, Par};
use std::ops::Range;

/// A factor with its tree.
pub(super) struct FactorByFronts<'a, T> {
    /// The tree.
    pub(super) fronts: &'a Fronts,
    /// Its rows and columns.
    pub(super) symbolic: &'a SymbolicSupernodalCholesky<usize>,
    /// The entries.
    pub(super) values: &'a [T],
}

/// A task with its unknowns of every right-hand side and what it does to those above it.
struct Item<'x, T> {
    task: usize,
    own: Vec<&'x mut [T]>,
    beyond: &'x mut Vec<Vec<T>>,
}

/// The rows of a front, of every right-hand side.
struct Rows<T> {
    /// Those of the columns that it eliminates.
    own: Vec<T>,
    /// Those below.
    below: Vec<T>,
}

impl<T> Default for Rows<T> {
    fn default() -> Rows<T> {
        Rows { own: Vec::new(), below: Vec::new() }
    }
}

impl<T: Real> FactorByFronts<'_, T> {
    /// x ← (L Lᵀ)⁻¹ x for right-hand sides one after the other in `x`.
    pub(super) fn solve(&self, x: &mut [T], crew: &Crew) {
        let n = self.symbolic.nrows();
        let num = x.len() / n.max(1);
        let mut beyond: Vec<Vec<Vec<T>>> = self.fronts.tasks.iter().map(|_| vec![Vec::new(); num]).collect();
        let scratch = || (Rows::default(), vec![vec![T::default(); n]; num]);
        crew.share(self.items(x, &mut beyond), scratch, |(rows, changes), item| self.forward_task(item, rows, changes));
        for (task, beyond) in self.fronts.tasks.iter().zip(&beyond) {
            for (column, changes) in x.chunks_exact_mut(n).zip(beyond) {
                for (&row, &change) in self.rows_beyond(&task.fronts).iter().zip(changes) {
                    column[row] -= change;
                }
            }
        }
        let mut rows = Rows::default();
        let mut columns: Vec<&mut [T]> = x.chunks_exact_mut(n.max(1)).collect();
        for &s in &self.fronts.top {
            self.forward(s as usize, 0, &mut columns, &mut rows, |column, _, row, change| column[row] -= change);
        }
        for &s in self.fronts.top.iter().rev() {
            self.backward(s as usize, 0, &mut columns, &mut rows, |column, _, row| column[row]);
        }
        let above = x.to_vec();
        crew.share(self.items(x, &mut beyond), Rows::default, |rows, item| self.backward_task(item, rows, &above));
    }

    /// The tasks with their parts of `x`, the largest last.
    fn items<'x>(&self, x: &'x mut [T], beyond: &'x mut [Vec<Vec<T>>]) -> Vec<Item<'x, T>> {
        let n = self.symbolic.nrows();
        let mut items: Vec<Item<T>> =
            beyond.iter_mut().enumerate().map(|(task, beyond)| Item { task, own: Vec::new(), beyond }).collect();
        for column in x.chunks_exact_mut(n.max(1)) {
            let (mut rest, mut at) = (column, 0);
            for item in &mut items {
                let own = self.columns_of(&self.fronts.tasks[item.task].fronts);
                let (mine, after) = rest[own.start - at..].split_at_mut(own.len());
                item.own.push(mine);
                (rest, at) = (after, own.end);
            }
        }
        items.sort_by(|a, b| self.fronts.tasks[a.task].work.total_cmp(&self.fronts.tasks[b.task].work));
        items
    }

    fn columns_of(&self, fronts: &Range<usize>) -> Range<usize> {
        self.symbolic.supernode_begin()[fronts.start]..self.symbolic.supernode_end()[fronts.end - 1]
    }

    /// The rows beyond a subtree's own columns on which it acts: those of its root.
    fn rows_beyond(&self, fronts: &Range<usize>) -> &[usize] {
        self.symbolic.supernode(fronts.end - 1).pattern()
    }

    fn forward_task(&self, item: Item<T>, rows: &mut Rows<T>, changes: &mut [Vec<T>]) {
        let Item { task, mut own, beyond } = item;
        let fronts = &self.fronts.tasks[task].fronts;
        let range = self.columns_of(fronts);
        for s in fronts.clone() {
            self.forward(s, range.start, &mut own, rows, |own, column, row, change| match row < range.end {
                true => own[row - range.start] -= change,
                false => changes[column][row] += change,
            });
        }
        for (beyond, changes) in beyond.iter_mut().zip(changes) {
            beyond.clear();
            beyond.extend(self.rows_beyond(fronts).iter().map(|&row| std::mem::take(&mut changes[row])));
        }
    }

    fn backward_task(&self, item: Item<T>, rows: &mut Rows<T>, above: &[T]) {
        let Item { task, mut own, .. } = item;
        let fronts = &self.fronts.tasks[task].fronts;
        let (n, range) = (self.symbolic.nrows(), self.columns_of(fronts));
        for s in fronts.clone().rev() {
            self.backward(s, range.start, &mut own, rows, |own, column, row| match row < range.end {
                true => own[row - range.start],
                false => above[column * n + row],
            });
        }
    }

    /// The factor's entries of front `s`, column by column.
    fn entries(&self, s: usize) -> &[T] {
        let values = self.symbolic.col_ptr_for_val();
        &self.values[values[s]..values[s + 1]]
    }

    /// The same, in the square and in the rows below.
    fn block(&self, s: usize) -> (MatRef<'_, T>, MatRef<'_, T>) {
        let n = self.fronts.num_columns(s);
        MatRef::from_column_major_slice(self.entries(s), n + self.fronts.num_below(s), n).split_at_row(n)
    }

    /// Forward substitution with front `s`; `own` begins with unknown `first`. `change`(right-hand side, its number,
    /// row, by how much) takes off what that does to the rows below.
    fn forward(
        &self,
        s: usize,
        first: usize,
        own: &mut [&mut [T]],
        rows: &mut Rows<T>,
        mut change: impl FnMut(&mut [T], usize, usize, T),
    ) {
        let (square, below) = self.block(s);
        let (n, m, num) = (square.nrows(), below.nrows(), own.len());
        let begin = self.symbolic.supernode_begin()[s] - first;
        rows.own.clear();
        own.iter().for_each(|x| rows.own.extend_from_slice(&x[begin..begin + n]));
        let mut x = MatMut::from_column_major_slice_mut(&mut rows.own, n, num);
        solve_lower_triangular_in_place(square, x.as_mut(), Par::Seq);
        rows.below.resize(m * num, T::default());
        let changes = MatMut::from_column_major_slice_mut(&mut rows.below[..m * num], m, num);
        matmul(changes, Accum::Replace, below, x, T::one_impl(), Par::Seq);
        let pattern = self.symbolic.supernode(s).pattern();
        for (column, x) in own.iter_mut().enumerate() {
            x[begin..begin + n].copy_from_slice(&rows.own[column * n..][..n]);
            for (&row, &by) in pattern.iter().zip(&rows.below[column * m..][..m]) {
                change(x, column, row, by);
            }
        }
    }

    /// Backward substitution with front `s`; `own` begins with unknown `first`. `value`(right-hand side, its number,
    /// row) gives the rows below.
    fn backward(
        &self,
        s: usize,
        first: usize,
        own: &mut [&mut [T]],
        rows: &mut Rows<T>,
        value: impl Fn(&[T], usize, usize) -> T,
    ) {
        let (square, below) = self.block(s);
        let (n, m, num) = (square.nrows(), below.nrows(), own.len());
        let begin = self.symbolic.supernode_begin()[s] - first;
        let pattern = self.symbolic.supernode(s).pattern();
        rows.own.clear();
        rows.below.clear();
        for (column, x) in own.iter().enumerate() {
            rows.own.extend_from_slice(&x[begin..begin + n]);
            rows.below.extend(pattern.iter().map(|&row| value(x, column, row)));
        }
        if num == 1 {
            // Columns of the factor lie together; a general product would go through its rows.
            for (x, column) in rows.own.iter_mut().zip(self.entries(s).chunks_exact(n + m)) {
                *x -= dot(&column[n..], &rows.below);
            }
        }
        let known = MatRef::from_column_major_slice(&rows.below, m, num);
        let mut x = MatMut::from_column_major_slice_mut(&mut rows.own, n, num);
        if num > 1 {
            matmul(x.as_mut(), Accum::Add, below.transpose(), known, -T::one_impl(), Par::Seq);
        }
        solve_upper_triangular_in_place(square.transpose(), x, Par::Seq);
        for (x, found) in own.iter_mut().zip(rows.own.chunks_exact(n)) {
            x[begin..begin + n].copy_from_slice(found);
        }
    }
}
