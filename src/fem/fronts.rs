//! Fronts: the dense matrices in which a sparse matrix is factorised, their tree, and who works on which of them.
//!
//! The multifrontal method (Duff and Reid 1983; Liu 1992, SIAM Review 34) eliminates the columns of one supernode in a
//! dense matrix of these columns' rows. What is left of the rows below, the *update*, goes to the front of the next
//! column that it touches. Updates come and go as on a stack where fronts are taken in postorder.
//!
//! Subtrees that share nothing are *tasks*, on which threads work side by side; the fronts above them follow one by
//! one. How the tree is divided does not depend on the number of threads, so that results do not either.

use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use std::ops::Range;

/// Marks a front without a parent.
const NONE: u32 = u32::MAX;
/// Subtrees with more than this part of all operations are divided.
const LARGEST_TASK: f64 = 1.0 / 16.0;
/// Matrices with fewer operations are one task.
const WORTH_DIVIDING: f64 = 2e7;

/// Consecutive rows of an update that are consecutive in the parent's front too.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    /// First row in the update.
    pub(super) from: u32,
    /// Its row in the front of the parent.
    pub(super) to: u32,
    /// Number of rows.
    pub(super) len: u32,
}

/// A subtree on which one thread works.
#[derive(Clone, Debug)]
pub(super) struct Task {
    /// Its fronts.
    pub(super) fronts: Range<usize>,
    /// Floating-point operations.
    pub(super) work: f64,
    /// Entries that its updates need at most.
    pub(super) arena_len: usize,
}

/// Place of an update.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// The task in whose arena it lies; `None` for a front above all tasks.
    pub(super) task: Option<u32>,
    /// Where it begins there.
    pub(super) offset: usize,
    /// Where it is made, above the updates that go into it.
    pub(super) made_at: usize,
}

/// The tree of the fronts of one pattern.
pub(super) struct Fronts {
    /// Number of columns that each front eliminates.
    num_columns: Vec<u32>,
    /// Number of rows of each front's update.
    num_below: Vec<u32>,
    children: Vec<u32>,
    child_pointers: Vec<usize>,
    runs: Vec<Run>,
    run_pointers: Vec<usize>,
    places: Vec<Place>,
    /// Subtrees without common fronts.
    pub(super) tasks: Vec<Task>,
    /// The fronts above them, children first.
    pub(super) top: Vec<u32>,
    /// Entries that the updates of the top need at most.
    pub(super) top_arena_len: usize,
    /// Floating-point operations of all fronts.
    pub(super) work: f64,
    /// Most columns of a front.
    pub(super) max_columns: usize,
}

impl Fronts {
    /// The fronts of a symbolic factorisation whose columns are in postorder.
    pub(super) fn new(symbolic: &SymbolicSupernodalCholesky<usize>) -> Fronts {
        let num = symbolic.n_supernodes();
        let (begin, end) = (symbolic.supernode_begin(), symbolic.supernode_end());
        let mut front_of = vec![0u32; symbolic.nrows()];
        for s in 0..num {
            front_of[begin[s]..end[s]].fill(s as u32);
        }
        let below = |s: usize| symbolic.supernode(s).pattern();
        let parent: Vec<u32> = (0..num).map(|s| below(s).first().map_or(NONE, |&row| front_of[row])).collect();
        let num_columns: Vec<u32> = (0..num).map(|s| (end[s] - begin[s]) as u32).collect();
        let num_below: Vec<u32> = (0..num).map(|s| below(s).len() as u32).collect();
        let (mut runs, mut run_pointers) = (Vec::new(), vec![0]);
        for s in 0..num {
            if let Some(p) = (parent[s] != NONE).then_some(parent[s] as usize) {
                push_runs(below(s), begin[p]..end[p], below(p), &mut runs);
            }
            run_pointers.push(runs.len());
        }
        let (children, child_pointers) = children_of(&parent);
        let mut fronts = Fronts {
            num_columns,
            num_below,
            children,
            child_pointers,
            runs,
            run_pointers,
            places: Vec::new(),
            tasks: Vec::new(),
            top: Vec::new(),
            top_arena_len: 0,
            work: 0.0,
            max_columns: 0,
        };
        fronts.max_columns = (0..num).map(|s| fronts.num_columns(s)).max().unwrap_or(0);
        fronts.divide(&parent);
        fronts.place_updates();
        fronts
    }

    /// Columns that front `s` eliminates.
    pub(super) fn num_columns(&self, s: usize) -> usize {
        self.num_columns[s] as usize
    }

    /// Rows of the update of front `s`.
    pub(super) fn num_below(&self, s: usize) -> usize {
        self.num_below[s] as usize
    }

    /// The fronts whose updates go into front `s`.
    pub(super) fn children(&self, s: usize) -> &[u32] {
        &self.children[self.child_pointers[s]..self.child_pointers[s + 1]]
    }

    /// Where the rows of the update of front `s` are in the parent's front.
    pub(super) fn runs(&self, s: usize) -> &[Run] {
        &self.runs[self.run_pointers[s]..self.run_pointers[s + 1]]
    }

    /// Where the update of front `s` is.
    pub(super) fn place(&self, s: usize) -> Place {
        self.places[s]
    }

    /// Operations of one front of n columns and m rows below: a Cholesky factor of n columns, n columns divided by it,
    /// and half of their square.
    fn work_of(&self, s: usize) -> f64 {
        let (n, m) = (self.num_columns(s) as f64, self.num_below(s) as f64);
        n * n * n / 3.0 + n * n * m + n * m * m
    }

    /// Divides the tree into tasks and the top.
    fn divide(&mut self, parent: &[u32]) {
        let num = parent.len();
        let mut of_subtree: Vec<f64> = (0..num).map(|s| self.work_of(s)).collect();
        let mut first: Vec<usize> = (0..num).collect();
        for s in 0..num {
            if parent[s] != NONE {
                let p = parent[s] as usize;
                of_subtree[p] += of_subtree[s];
                first[p] = first[p].min(first[s]);
            }
        }
        let roots = (0..num).filter(|&s| parent[s] == NONE);
        self.work = roots.clone().map(|s| of_subtree[s]).sum();
        let largest = if self.work < WORTH_DIVIDING { f64::INFINITY } else { LARGEST_TASK * self.work };
        let mut open: Vec<usize> = roots.collect();
        while let Some(s) = open.pop() {
            if of_subtree[s] > largest {
                self.top.push(s as u32);
                open.extend(self.children(s).iter().map(|&c| c as usize));
            } else {
                self.tasks.push(Task { fronts: first[s]..s + 1, work: of_subtree[s], arena_len: 0 });
            }
        }
        self.top.sort_unstable();
        self.tasks.sort_by_key(|t| t.fronts.start);
    }

    /// Gives each update its place.
    fn place_updates(&mut self) {
        let nowhere = Place { task: None, offset: 0, made_at: 0 };
        self.places = vec![nowhere; self.num_columns.len()];
        for t in 0..self.tasks.len() {
            let fronts = self.tasks[t].fronts.clone();
            self.tasks[t].arena_len = self.stack(Some(t as u32), fronts);
        }
        let top = self.top.clone();
        self.top_arena_len = self.stack(None, top.into_iter().map(|s| s as usize));
    }

    /// Stacks the updates of some fronts; returns how high the stack gets.
    fn stack(&mut self, task: Option<u32>, fronts: impl Iterator<Item = usize>) -> usize {
        let (mut height, mut highest) = (0, 0);
        for s in fronts {
            let here = |c: &&u32| self.places[**c as usize].task == task && self.is_placed_with(**c as usize, task);
            let offset = self.children(s).iter().find(here).map_or(height, |&c| self.places[c as usize].offset);
            let len = self.num_below(s).pow(2);
            self.places[s] = Place { task, offset, made_at: height };
            highest = highest.max(height + len);
            height = offset + len;
        }
        highest
    }

    /// Whether front `s` belongs to this task, or to the top.
    fn is_placed_with(&self, s: usize, task: Option<u32>) -> bool {
        match task {
            Some(t) => self.tasks[t as usize].fronts.contains(&s),
            None => self.top.binary_search(&(s as u32)).is_ok(),
        }
    }
}

/// The children of each front, in order, compressed.
fn children_of(parent: &[u32]) -> (Vec<u32>, Vec<usize>) {
    let mut pointers = vec![0usize; parent.len() + 1];
    for &p in parent.iter().filter(|p| **p != NONE) {
        pointers[p as usize + 1] += 1;
    }
    for s in 0..parent.len() {
        pointers[s + 1] += pointers[s];
    }
    let mut cursor = pointers.clone();
    let mut children = vec![0u32; pointers[parent.len()]];
    for (s, &p) in parent.iter().enumerate().filter(|(_, p)| **p != NONE) {
        children[cursor[p as usize]] = s as u32;
        cursor[p as usize] += 1;
    }
    (children, pointers)
}

/// Runs of the rows of an update in the front that eliminates `columns` and has `below` under them.
fn push_runs(rows: &[usize], columns: Range<usize>, below: &[usize], runs: &mut Vec<Run>) {
    let mut at = 0;
    let mut last: Option<Run> = None;
    for (from, &row) in rows.iter().enumerate() {
        let to = if row < columns.end {
            row - columns.start
        } else {
            // Both lists are sorted, and the parent has every row of its children.
            while below[at] < row {
                at += 1;
            }
            columns.len() + at
        };
        match &mut last {
            Some(run) if (run.to + run.len) as usize == to => run.len += 1,
            _ => {
                runs.extend(last);
                last = Some(Run { from: from as u32, to: to as u32, len: 1 });
            }
        }
    }
    runs.extend(last);
}
