//! The numeric Cholesky factorisation by fronts (see [`super::fronts`]).
//!
//! The factor is laid out as faer's supernodal one, whose solves it serves. Against faer's own factorisation, which
//! gathers for each supernode what all earlier ones do to it, each front here is updated by a few large products, and
//! subtrees are worked on side by side.

use super::crew::Crew;
use super::fronts::{Fronts, Run, Task};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltError, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::reborrow::{Reborrow, ReborrowMut};
use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use faer::traits::RealField;
use faer::{Accum, MatMut, MatRef, Par, Spec};
use std::ops::{AddAssign, Mul, Neg, Range, SubAssign};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Columns of a panel of a front that several threads eliminate.
const PANEL: usize = 192;
/// Rows of a chunk of such a panel.
const CHUNK: usize = 768;
/// Columns of a panel of an update.
const UPDATE_PANEL: usize = 96;
/// Fronts with more entries in their eliminated columns than this are worked on panel by panel.
const WORTH_SHARING: usize = 250_000;

/// A precision.
pub(super) trait Real:
    RealField + Copy + Default + AddAssign + SubAssign + Mul<Output = Self> + Neg<Output = Self>
{
}
impl Real for f32 {}
impl Real for f64 {}

/// The lower triangle of a symmetric matrix, column by column.
pub(super) struct Lower<'a, T> {
    /// Column pointers.
    pub(super) pointers: &'a [usize],
    /// Row indices.
    pub(super) rows: &'a [usize],
    /// Entries.
    pub(super) values: &'a [T],
}

/// Memory for the updates, used again by every factorisation.
#[derive(Default)]
pub(super) struct Arenas<T> {
    of_tasks: Vec<Vec<T>>,
    of_top: Vec<T>,
}

impl<T: Real> Arenas<T> {
    fn prepare(&mut self, fronts: &Fronts) {
        if self.of_tasks.len() != fronts.tasks.len() {
            self.of_tasks = fronts.tasks.iter().map(|t| vec![T::default(); t.arena_len]).collect();
            self.of_top = vec![T::default(); fronts.top_arena_len];
        }
    }
}

/// A column whose pivot is not positive.
#[derive(Debug)]
pub(super) struct NonPositivePivot(pub(super) usize);

/// What a thread needs of its own.
struct Scratch {
    /// Row of each unknown in the front at work; only those of the front hold.
    local: Vec<u32>,
    memory: MemBuffer,
}

/// A factorisation at work.
struct Work<'a, T> {
    fronts: &'a Fronts,
    symbolic: &'a SymbolicSupernodalCholesky<usize>,
    matrix: &'a Lower<'a, T>,
}

/// Factorises `matrix` into `l`.
///
/// # Errors
/// [`NonPositivePivot`]: the matrix is not positive definite.
pub(super) fn factorise<T: Real>(
    fronts: &Fronts,
    symbolic: &SymbolicSupernodalCholesky<usize>,
    matrix: &Lower<T>,
    l: &mut [T],
    arenas: &mut Arenas<T>,
    crew: &Crew,
) -> Result<(), NonPositivePivot> {
    arenas.prepare(fronts);
    let Arenas { of_tasks, of_top } = arenas;
    let work = Work { fronts, symbolic, matrix };
    let scratch = || Scratch {
        local: vec![0; symbolic.nrows()],
        memory: MemBuffer::new(cholesky_in_place_scratch::<T>(fronts.max_columns, Par::Seq, Spec::default())),
    };
    let failed = AtomicUsize::new(usize::MAX);
    let values = symbolic.col_ptr_for_val();
    let mut items: Vec<(&Task, &mut [T], &mut Vec<T>)> = Vec::with_capacity(fronts.tasks.len());
    let (mut rest, mut at) = (&mut *l, 0);
    for (task, arena) in fronts.tasks.iter().zip(&mut *of_tasks) {
        let (begin, end) = (values[task.fronts.start], values[task.fronts.end]);
        let (own, after) = std::mem::take(&mut rest)[begin - at..].split_at_mut(end - begin);
        items.push((task, own, arena));
        (rest, at) = (after, end);
    }
    items.sort_by(|a, b| a.0.work.total_cmp(&b.0.work));
    crew.share(items, scratch, |scratch, (task, l, arena)| {
        if failed.load(Ordering::Relaxed) == usize::MAX
            && let Err(NonPositivePivot(column)) = work.task(task, l, arena, scratch)
        {
            failed.fetch_min(column, Ordering::Relaxed);
        }
    });
    match failed.into_inner() {
        usize::MAX => {}
        column => return Err(NonPositivePivot(column)),
    }
    let mut scratch = scratch();
    for &s in &fronts.top {
        let s = s as usize;
        let l = &mut l[values[s]..values[s + 1]];
        let (below, above) = of_top.split_at_mut(fronts.place(s).made_at);
        let update_of = |child: usize| {
            let place = fronts.place(child);
            let arena = place.task.map_or(&*below, |t| &of_tasks[t as usize][..]);
            &arena[place.offset..]
        };
        work.front(s, l, above, &update_of, &mut scratch, crew)?;
        work.settle(s, of_top);
    }
    Ok(())
}

impl<T: Real> Work<'_, T> {
    /// Works on the fronts of a task; `l` is their part of the factor.
    fn task(&self, task: &Task, l: &mut [T], arena: &mut [T], scratch: &mut Scratch) -> Result<(), NonPositivePivot> {
        let values = self.symbolic.col_ptr_for_val();
        let begin = values[task.fronts.start];
        for s in task.fronts.clone() {
            let l = &mut l[values[s] - begin..values[s + 1] - begin];
            let (below, above) = arena.split_at_mut(self.fronts.place(s).made_at);
            let update_of = |child: usize| &below[self.fronts.place(child).offset..];
            self.front(s, l, above, &update_of, scratch, &Crew::alone())?;
            self.settle(s, arena);
        }
        Ok(())
    }

    /// Moves the update of front `s` from where it was made to where it stays.
    fn settle(&self, s: usize, arena: &mut [T]) {
        let place = self.fronts.place(s);
        if place.made_at != place.offset {
            let len = self.fronts.num_below(s).pow(2);
            arena.copy_within(place.made_at..place.made_at + len, place.offset);
        }
    }

    /// Eliminates the columns of front `s` into `l` and leaves its update at the beginning of `update`.
    fn front<'u>(
        &self,
        s: usize,
        l: &mut [T],
        update: &mut [T],
        update_of: &dyn Fn(usize) -> &'u [T],
        scratch: &mut Scratch,
        crew: &Crew,
    ) -> Result<(), NonPositivePivot>
    where
        T: 'u,
    {
        let (n, m) = (self.fronts.num_columns(s), self.fronts.num_below(s));
        let height = n + m;
        let begin = self.gather(s, l, scratch);
        for &child in self.fronts.children(s) {
            let child = child as usize;
            let (runs, update, num) = (self.fronts.runs(child), update_of(child), self.fronts.num_below(child));
            add_update(runs, update, num, &Part { columns: 0..n, first_row: 0, height }, l);
        }
        eliminate(MatMut::from_column_major_slice_mut(l, height, n), scratch, crew)
            .map_err(|NonPositivePivot(column)| NonPositivePivot(begin + column))?;
        if m == 0 {
            return Ok(());
        }
        let update = &mut update[..m * m];
        let rows = MatRef::from_column_major_slice(l, height, n).split_at_row(n).1;
        let crew = if is_worth_sharing(height, n) { crew } else { &Crew::alone() };
        subtract_square(rows, MatMut::from_column_major_slice_mut(update, m, m), UPDATE_PANEL, Accum::Replace, crew);
        for &child in self.fronts.children(s) {
            let child = child as usize;
            let (runs, from, num) = (self.fronts.runs(child), update_of(child), self.fronts.num_below(child));
            add_update(runs, from, num, &Part { columns: n..height, first_row: n, height: m }, update);
        }
        Ok(())
    }

    /// Writes the matrix's entries of the columns of front `s` into `l`; returns the first column.
    fn gather(&self, s: usize, l: &mut [T], scratch: &mut Scratch) -> usize {
        let (n, m) = (self.fronts.num_columns(s), self.fronts.num_below(s));
        let begin = self.symbolic.supernode_begin()[s];
        l.fill(T::default());
        for (row, &i) in self.symbolic.supernode(s).pattern().iter().enumerate() {
            scratch.local[i] = (n + row) as u32;
        }
        let Lower { pointers, rows, values } = self.matrix;
        for j in 0..n {
            let range = pointers[begin + j]..pointers[begin + j + 1];
            let column = &mut l[j * (n + m)..][..n + m];
            for (&i, &value) in rows[range.clone()].iter().zip(&values[range]) {
                let row = if i < begin + n { i - begin } else { scratch.local[i] as usize };
                column[row] += value;
            }
        }
        begin
    }
}

/// Which part of a front an update is added to.
struct Part {
    /// Its columns in the front; its rows begin with `first_row`.
    columns: Range<usize>,
    first_row: usize,
    /// Number of its rows.
    height: usize,
}

/// Adds those columns of a child's update (lower triangle, `num` rows) that are in a part of the parent's front.
fn add_update<T: Real>(runs: &[Run], update: &[T], num: usize, part: &Part, into: &mut [T]) {
    for (k, run) in runs.iter().enumerate() {
        for t in 0..run.len {
            let column = (run.to + t) as usize;
            if !part.columns.contains(&column) {
                continue;
            }
            let from = &update[(run.from + t) as usize * num..][..num];
            let into = &mut into[(column - part.columns.start) * part.height..][..part.height];
            let own = Run { from: run.from + t, to: run.to + t, len: run.len - t };
            for rows in std::iter::once(&own).chain(&runs[k + 1..]) {
                let len = rows.len as usize;
                let into = &mut into[rows.to as usize - part.first_row..][..len];
                for (a, &b) in into.iter_mut().zip(&from[rows.from as usize..][..len]) {
                    *a += b;
                }
            }
        }
    }
}

/// Eliminates the columns of a front: its upper square becomes a Cholesky factor, the rest is divided by it.
fn eliminate<T: Real>(mut front: MatMut<T>, scratch: &mut Scratch, crew: &Crew) -> Result<(), NonPositivePivot> {
    let (height, n) = (front.nrows(), front.ncols());
    let panel = if is_worth_sharing(height, n) { PANEL } else { n };
    let mut begin = 0;
    while begin < n {
        let end = n.min(begin + panel);
        let (done, later) = front.rb_mut().split_at_col_mut(end);
        let panel = done.subcols_mut(begin, end - begin).split_at_row_mut(begin).1;
        let (mut square, mut rows) = panel.split_at_row_mut(end - begin);
        let memory = MemStack::new(&mut scratch.memory);
        cholesky_in_place(square.rb_mut(), Default::default(), Par::Seq, memory, Spec::default())
            .map_err(|LltError::NonPositivePivot { index }| NonPositivePivot(begin + index))?;
        let square = square.rb();
        let divide = |rows: MatMut<T>| solve_lower_triangular_in_place(square, rows.transpose_mut(), Par::Seq);
        if end == n && begin == 0 {
            divide(rows);
            return Ok(());
        }
        crew.share(row_chunks(rows.rb_mut()), || (), |(), rows| divide(rows));
        // Columns of the front that are still to be eliminated; their rows above are not looked at any more.
        let later = later.split_at_row_mut(end).1;
        subtract_square(rows.rb(), later, PANEL, Accum::Add, crew);
        begin = end;
    }
    Ok(())
}

/// Whether a front is worked on panel by panel.
fn is_worth_sharing(height: usize, num_columns: usize) -> bool {
    height * num_columns > WORTH_SHARING
}

/// Rows in chunks.
fn row_chunks<T>(mut rows: MatMut<T>) -> Vec<MatMut<T>> {
    let mut chunks = Vec::with_capacity(rows.nrows().div_ceil(CHUNK));
    while rows.nrows() > CHUNK {
        let (chunk, rest) = rows.split_at_row_mut(CHUNK);
        chunks.push(chunk);
        rows = rest;
    }
    chunks.push(rows);
    chunks
}

/// The lower triangle of `into` (its first columns, if it has fewer than rows) −= A Aᵀ, or = −A Aᵀ, panel by panel.
fn subtract_square<T: Real>(a: MatRef<T>, into: MatMut<T>, panel: usize, accum: Accum, crew: &Crew) {
    let subtract = |begin: usize, into: MatMut<T>| {
        let (left, right) = (a.split_at_row(begin).1, a.subrows(begin, into.ncols()));
        matmul(into, accum, left, right.transpose(), -T::one_impl(), Par::Seq);
    };
    let mut rest = into;
    let mut panels = Vec::new();
    let mut begin = 0;
    while rest.ncols() > 0 {
        let width = panel.min(rest.ncols());
        let (columns, after) = rest.split_at_col_mut(width);
        rest = after;
        let columns = columns.split_at_row_mut(begin).1;
        if crew.num_threads() == 1 {
            subtract(begin, columns);
        } else {
            panels.push((begin, columns));
        }
        begin += width;
    }
    // The longest are taken first.
    panels.reverse();
    crew.share(panels, || (), |(), (begin, columns)| subtract(begin, columns));
}

#[cfg(test)]
#[path = "multifrontal_tests.rs"]
mod tests;
