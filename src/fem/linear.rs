//! The linear solver: double-precision conjugate gradients with one of two preconditioners.
//!
//! Mostly it is a direct factor ([`super::direct`]); large refined meshes are preconditioned by patches and their
//! coarse mesh ([`super::levels`]).

use super::crew::{Crew, Seat};
use super::direct::{Direct, DirectFactor, Workspace};
use super::dot::dot;
use super::error::LinearError;
use super::levels::{Levels, LevelsFactor};
use super::topology::Topology;
use std::ops::Range;
use std::sync::Arc;

/// How the systems of one mesh are preconditioned: made once, shared by all of them.
#[derive(Clone)]
enum Method {
    /// By a factor of the matrix.
    Direct(Arc<Direct>),
    /// By patches and a coarse mesh.
    Levels(Arc<Levels>),
}

/// The preconditioner of one matrix.
enum Factor {
    Direct(DirectFactor),
    Levels(LevelsFactor),
}

/// Values and preconditioner of a symmetric positive definite matrix (lower triangle, elimination order).
pub(super) struct LinearSystem {
    topology: Arc<Topology>,
    method: Method,
    /// 3×3 blocks of the lower triangle (columns of a block one after the other), in the block pattern of [`Topology`].
    blocks: Arc<Vec<[f64; 9]>>,
    factor: Option<Arc<Factor>>,
    workspace: Workspace,
    num_factorisations: usize,
}

/// Iterations after which a direct factor in single precision is given up.
const MAX_ITERATIONS: usize = 40;

/// Iterations after which levels are: eight digits take up to 130 on a million unknowns.
const MAX_ITERATIONS_BY_LEVELS: usize = 300;

/// Conjugate-gradient iterations that an earlier factor is given: they cost as much as a new one.
const REUSE_ITERATIONS: usize = 10;

/// The same by levels, which take several iterations to a digit.
const REUSE_ITERATIONS_BY_LEVELS: usize = 45;

/// For accuracies below this one levels are made anew: that costs as much as some 15 iterations, and saves more.
const REUSED_LEVELS_ACCURACY: f64 = 2e-3;

/// Matrices of fewer blocks are multiplied by one thread.
const BLOCKS_WORTH_HELP: usize = 300_000;

/// Parts of a product with a larger one, whatever the number of threads.
const PARTS_OF_PRODUCT: usize = 4;

/// Right-hand sides that are solved for at once.
pub(super) const MAX_COLUMNS: usize = 4;

impl LinearSystem {
    /// A system with a direct factor; no values yet.
    ///
    /// # Errors
    /// [`LinearError::OutOfMemory`].
    pub(super) fn new(topology: Arc<Topology>) -> Result<LinearSystem, LinearError> {
        let direct = Direct::new(topology.clone())?;
        Ok(LinearSystem::of(topology, Method::Direct(Arc::new(direct))))
    }

    /// A system of a mesh that refines the mesh of `coarse`, of which `levels` makes the preconditioner with the direct
    /// factor there; `None` where the coarse one has none.
    pub(super) fn refining(
        topology: Arc<Topology>,
        coarse: &LinearSystem,
        levels: impl FnOnce(Arc<Direct>) -> Levels,
    ) -> Option<LinearSystem> {
        match &coarse.method {
            Method::Direct(direct) => {
                Some(LinearSystem::of(topology, Method::Levels(Arc::new(levels(direct.clone())))))
            }
            Method::Levels(_) => None,
        }
    }

    fn of(topology: Arc<Topology>, method: Method) -> LinearSystem {
        LinearSystem {
            topology,
            method,
            blocks: Arc::default(),
            factor: None,
            workspace: Workspace::default(),
            num_factorisations: 0,
        }
    }

    /// A system of the same mesh without values and factor; only the symbolic work is shared.
    pub(super) fn empty_like(&self) -> LinearSystem {
        LinearSystem::of(self.topology.clone(), self.method.clone())
    }

    /// The present values and factor as a system of its own. Nothing is copied: whichever of the two is assembled or
    /// factorised first takes memory of its own for that.
    pub(super) fn share(&self) -> LinearSystem {
        LinearSystem { blocks: self.blocks.clone(), factor: self.factor.clone(), ..self.empty_like() }
    }

    /// Zeroes the values, for an assembly to add to. The factor stays.
    pub(super) fn zeroed_blocks(&mut self) -> &mut [[f64; 9]] {
        let len = self.topology.block_rows.len();
        match Arc::get_mut(&mut self.blocks) {
            Some(blocks) if blocks.len() == len => blocks.fill([0.0; 9]),
            _ => self.blocks = Arc::new(vec![[0.0; 9]; len]),
        }
        // Nobody else holds them by now, so nothing is cloned.
        Arc::make_mut(&mut self.blocks).as_mut_slice()
    }

    /// Adds `factor` times the values of a system of the same mesh. A factor is that of the values before.
    pub(super) fn add(&mut self, factor: f64, other: &LinearSystem) {
        for (own, of_other) in Arc::make_mut(&mut self.blocks).iter_mut().zip(&*other.blocks) {
            for (x, y) in own.iter_mut().zip(of_other) {
                *x += factor * y;
            }
        }
    }

    /// K x.
    pub(super) fn times(&self, x: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; x.len()];
        multiply(&self.topology, &self.blocks, x, &mut y, &Crew::alone());
        y
    }

    /// Unknowns, those pinned by mirrors included.
    pub(super) fn num_unknowns(&self) -> usize {
        self.topology.num_unknowns()
    }

    /// Floating-point operations of a direct factor; `None` where there is none.
    pub(super) fn factor_operations(&self) -> Option<f64> {
        match &self.method {
            Method::Direct(direct) => Some(direct.factor_operations()),
            Method::Levels(_) => None,
        }
    }

    /// Calls of [`LinearSystem::factorise`] so far.
    pub(super) fn num_factorisations(&self) -> usize {
        self.num_factorisations
    }

    /// Makes the preconditioner of the present values.
    ///
    /// # Errors
    /// [`LinearError`].
    pub(super) fn factorise(&mut self) -> Result<(), LinearError> {
        self.num_factorisations += 1;
        // The memory of the last factor is used again unless someone else still holds it.
        let old = self.factor.take().and_then(Arc::into_inner);
        let made = match &self.method {
            Method::Direct(direct) => {
                let old = if let Some(Factor::Direct(old)) = old { Some(old) } else { None };
                Factor::Direct(direct.factorise(&self.blocks, old, &mut self.workspace)?)
            }
            Method::Levels(levels) => {
                let old = if let Some(Factor::Levels(old)) = old { Some(old) } else { None };
                Factor::Levels(levels.factorise(&self.blocks, old, &mut self.workspace)?)
            }
        };
        self.factor = Some(Arc::new(made));
        Ok(())
    }

    /// Whether a factor (of these or earlier values) exists.
    pub(super) fn has_factor(&self) -> bool {
        self.factor.is_some()
    }

    /// x ← (factor)⁻¹ x for several right-hand sides, one after the other.
    fn precondition(&self, x: &mut [f64], crew: &Crew) {
        match (&self.method, self.factor.as_deref()) {
            (Method::Direct(direct), Some(Factor::Direct(factor))) => direct.solve(factor, x, crew),
            (Method::Levels(levels), Some(Factor::Levels(factor))) => levels.solve(factor, x, crew),
            // Without a factor these are plain conjugate gradients.
            _ => {}
        }
    }

    /// Solves K X = B for up to four columns at once by preconditioned conjugate gradients, each to
    /// ‖residual‖ ≤ `tolerance` ‖b‖. A direct factor in single precision that is not enough is replaced by one in
    /// double precision.
    ///
    /// # Errors
    /// [`LinearError`].
    pub(super) fn solve(
        &mut self,
        right_hand_sides: &[Vec<f64>],
        tolerance: f64,
    ) -> Result<Vec<Vec<f64>>, LinearError> {
        let direct = match &self.method {
            Method::Direct(direct) => direct.clone(),
            Method::Levels(_) => {
                let found = self.iterate(right_hand_sides, tolerance, MAX_ITERATIONS_BY_LEVELS)?;
                return found.ok_or(LinearError::NotConverged { iterations: MAX_ITERATIONS_BY_LEVELS, tolerance });
            }
        };
        if let Some(x) = self.iterate(right_hand_sides, tolerance, MAX_ITERATIONS)? {
            return Ok(x);
        }
        self.factor = None;
        self.factor = Some(Arc::new(Factor::Direct(direct.factorise_double(&self.blocks)?)));
        match self.iterate(right_hand_sides, tolerance, MAX_ITERATIONS)? {
            Some(x) => Ok(x),
            // With an exact factor the iteration refines to rounding; what is left is the matrix's condition.
            None => {
                let mut x: Vec<Vec<f64>> = right_hand_sides.to_vec();
                for column in &mut x {
                    self.precondition(column, &Crew::alone());
                }
                Ok(x)
            }
        }
    }

    /// As [`LinearSystem::solve`] with the factor of an earlier matrix, as long as that costs less than a new one;
    /// `None` where it does not.
    pub(super) fn solve_with_earlier_factor(
        &self,
        right_hand_sides: &[Vec<f64>],
        tolerance: f64,
    ) -> Option<Vec<Vec<f64>>> {
        let iterations = match self.method {
            Method::Direct(_) => REUSE_ITERATIONS,
            Method::Levels(_) if tolerance < REUSED_LEVELS_ACCURACY => return None,
            Method::Levels(_) => REUSE_ITERATIONS_BY_LEVELS,
        };
        self.iterate(right_hand_sides, tolerance, iterations).ok().flatten()
    }

    /// Whether one iteration with a factor of the present values gains four to five digits, as with a direct one.
    pub(super) fn gains_digits_at_once(&self) -> bool {
        matches!(self.method, Method::Direct(_))
    }

    /// Whether so many iterations suffice.
    #[cfg(test)]
    pub(super) fn solves_within(&self, right: &[f64], tolerance: f64, iterations: usize) -> bool {
        matches!(self.iterate(&[right.to_vec()], tolerance, iterations), Ok(Some(_)))
    }

    /// Conjugate gradients with the factor at hand, which may be that of a nearby matrix; `None` where `max_iterations`
    /// do not suffice.
    ///
    /// # Errors
    /// [`LinearError::NotPositiveDefinite`] where a direction of negative curvature is met.
    fn iterate(
        &self,
        right_hand_sides: &[Vec<f64>],
        tolerance: f64,
        max_iterations: usize,
    ) -> Result<Option<Vec<Vec<f64>>>, LinearError> {
        let topology = &*self.topology;
        let n = topology.num_unknowns();
        let m = right_hand_sides.len();
        let mut x = vec![0.0; n * m];
        let mut r: Vec<f64> = right_hand_sides.iter().flatten().copied().collect();
        let _seat = Seat::take();
        let is_worth_help = match &self.method {
            Method::Direct(direct) => direct.is_worth_help(),
            Method::Levels(_) => true,
        };
        let crew = if is_worth_help { Crew::gather() } else { Crew::alone() };
        let mut z = r.clone();
        self.precondition(&mut z, &crew);
        let mut p = z.clone();
        let mut rz: Vec<f64> = (0..m).map(|c| dot(&r[c * n..][..n], &z[c * n..][..n])).collect();
        let target: Vec<f64> =
            (0..m).map(|c| dot(&r[c * n..][..n], &r[c * n..][..n]) * tolerance * tolerance).collect();
        let mut ap = vec![0.0; n];
        let mut is_done: Vec<bool> = rz.iter().map(|&s| s == 0.0).collect();
        let mut iteration = 0;
        while is_done.iter().any(|d| !d) {
            if iteration == max_iterations {
                return Ok(None);
            }
            iteration += 1;
            for c in 0..m {
                if is_done[c] {
                    continue;
                }
                let range = c * n..(c + 1) * n;
                multiply(topology, &self.blocks, &p[range.clone()], &mut ap, &crew);
                let curvature = dot(&p[range.clone()], &ap);
                if !(curvature > 0.0) {
                    return Err(LinearError::NotPositiveDefinite { index: 0 });
                }
                let step = rz[c] / curvature;
                for i in 0..n {
                    x[c * n + i] += step * p[c * n + i];
                    r[c * n + i] -= step * ap[i];
                }
                let size = dot(&r[range.clone()], &r[range]);
                is_done[c] = size <= target[c];
            }
            if is_done.iter().all(|d| *d) {
                break;
            }
            z.copy_from_slice(&r);
            self.precondition(&mut z, &crew);
            for c in 0..m {
                if is_done[c] {
                    continue;
                }
                let next = dot(&r[c * n..][..n], &z[c * n..][..n]);
                let beta = next / rz[c];
                rz[c] = next;
                for i in c * n..(c + 1) * n {
                    p[i] = z[i] + beta * p[i];
                }
            }
        }
        Ok(Some((0..m).map(|c| x[c * n..(c + 1) * n].to_vec()).collect()))
    }
}

/// y = K x with the lower triangle. The parts into which a large product is divided do not depend on the threads, so
/// that its rounding does not.
fn multiply(topology: &Topology, blocks: &[[f64; 9]], x: &[f64], y: &mut [f64], crew: &Crew) {
    let num = topology.block_pointers.len() - 1;
    if blocks.len() < BLOCKS_WORTH_HELP {
        y.fill(0.0);
        return multiply_columns(topology, blocks, x, y, 0..num);
    }
    // As many blocks in each part.
    let bound = |part: usize| {
        let target = (blocks.len() / PARTS_OF_PRODUCT * part) as u32;
        if part == PARTS_OF_PRODUCT { num } else { topology.block_pointers.partition_point(|&p| p < target) }
    };
    let mut sums = vec![vec![0.0; y.len()]; PARTS_OF_PRODUCT];
    let items = sums.iter_mut().enumerate().collect();
    crew.share(
        items,
        || (),
        |(), (part, sum): (usize, &mut Vec<f64>)| {
            multiply_columns(topology, blocks, x, sum, bound(part)..bound(part + 1));
        },
    );
    for (i, y) in y.iter_mut().enumerate() {
        *y = sums.iter().map(|sum| sum[i]).sum();
    }
}

/// y += what columns of the lower triangle and their mirror images do to x.
fn multiply_columns(topology: &Topology, blocks: &[[f64; 9]], x: &[f64], y: &mut [f64], columns: Range<usize>) {
    for j in columns {
        let (start, end) = (topology.block_pointers[j] as usize, topology.block_pointers[j + 1] as usize);
        let xj = [x[3 * j], x[3 * j + 1], x[3 * j + 2]];
        // The diagonal block: its lower triangle.
        let d = &blocks[start];
        let mut sum = [
            d[0] * xj[0] + d[1] * xj[1] + d[2] * xj[2],
            d[1] * xj[0] + d[4] * xj[1] + d[5] * xj[2],
            d[2] * xj[0] + d[5] * xj[1] + d[8] * xj[2],
        ];
        for (&row, b) in topology.block_rows[start + 1..end].iter().zip(&blocks[start + 1..end]) {
            let i = 3 * row as usize;
            let xi = [x[i], x[i + 1], x[i + 2]];
            for (c, yi) in y[i..i + 3].iter_mut().enumerate() {
                *yi += b[c] * xj[0] + b[3 + c] * xj[1] + b[6 + c] * xj[2];
            }
            for (k, s) in sum.iter_mut().enumerate() {
                *s += b[3 * k] * xi[0] + b[3 * k + 1] * xi[1] + b[3 * k + 2] * xi[2];
            }
        }
        for (c, s) in sum.iter().enumerate() {
            y[3 * j + c] += s;
        }
    }
}
