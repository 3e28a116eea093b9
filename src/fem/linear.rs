//! The linear solver: a supernodal Cholesky factor in single precision as preconditioner of double-precision conjugate
//! gradients, with a double-precision factor where that is not enough.
//!
//! Symbolic work is done once per mesh. Measured on these matrices (κ/μ ≈ 130–800): the single-precision factor takes
//! half the time and memory, and one iteration of conjugate gradients gains four to five digits.

use super::crew::{Crew, Seat};
use super::dot::dot;
use super::error::LinearError;
use super::fronts::Fronts;
use super::multifrontal::{Arenas, Lower, NonPositivePivot, Real, factorise};
use super::substitution::FactorByFronts;
use super::topology::Topology;
use faer::Side;
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
};
use std::sync::Arc;

/// Pattern and symbolic factorisation of the tangents of one mesh: made once, shared by all systems of that mesh.
struct Analysis {
    topology: Arc<Topology>,
    symbolic: SymbolicCholesky<usize>,
    fronts: Fronts,
}

impl Analysis {
    fn supernodal(&self) -> &SymbolicSupernodalCholesky<usize> {
        supernodal(&self.symbolic)
    }
}

/// The supernodes, which [`LinearSystem::new`] asked for.
fn supernodal(symbolic: &SymbolicCholesky<usize>) -> &SymbolicSupernodalCholesky<usize> {
    match symbolic.raw() {
        SymbolicCholeskyRaw::Supernodal(supernodal) => supernodal,
        SymbolicCholeskyRaw::Simplicial(_) => unreachable!("supernodes were asked for"),
    }
}

/// A factor in one precision.
enum Factor {
    Single(Vec<f32>),
    Double(Vec<f64>),
}

/// Values and factor of a symmetric positive definite matrix (lower triangle, elimination order).
pub(super) struct LinearSystem {
    analysis: Arc<Analysis>,
    /// 3×3 blocks of the lower triangle (columns of a block one after the other), in the block pattern of [`Topology`].
    blocks: Arc<Vec<[f64; 9]>>,
    factor: Option<Arc<Factor>>,
    single_values: Vec<f32>,
    /// Memory of the factorisation in single precision.
    arenas: Arenas<f32>,
    num_factorisations: usize,
}

/// Iterations after which a single-precision factor is given up.
const MAX_ITERATIONS: usize = 40;

/// Factorisations of more operations are worth the time that it takes to call for help: a tenth of a millisecond.
const WORTH_HELP: f64 = 1e8;

/// Substitutions with a factor of more entries are worth it.
const ENTRIES_WORTH_HELP: usize = 1_500_000;

/// Right-hand sides that are solved for at once.
pub(super) const MAX_COLUMNS: usize = 4;

impl LinearSystem {
    /// Symbolic analysis; no values yet.
    ///
    /// # Errors
    /// [`LinearError::OutOfMemory`].
    pub(super) fn new(topology: Arc<Topology>) -> Result<LinearSystem, LinearError> {
        let n = topology.num_unknowns();
        // With the identity ordering the analysis reads the *upper* triangle, the numeric call the lower one.
        let (upper_pointers, upper_rows) = transpose(n, &topology.column_pointers, &topology.row_indices);
        let upper = SymbolicSparseColMatRef::new_checked(n, n, &upper_pointers, None, &upper_rows);
        let parameters = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let symbolic = factorize_symbolic_cholesky(upper, Side::Upper, SymmetricOrdering::Identity, parameters)
            .map_err(|_| LinearError::OutOfMemory { num_unknowns: n })?;
        let fronts = Fronts::new(supernodal(&symbolic));
        Ok(LinearSystem::of(Arc::new(Analysis { topology, symbolic, fronts })))
    }

    fn of(analysis: Arc<Analysis>) -> LinearSystem {
        LinearSystem {
            analysis,
            blocks: Arc::default(),
            factor: None,
            single_values: Vec::new(),
            arenas: Arenas::default(),
            num_factorisations: 0,
        }
    }

    /// A system of the same mesh without values and factor; only the symbolic work is shared.
    pub(super) fn empty_like(&self) -> LinearSystem {
        LinearSystem::of(self.analysis.clone())
    }

    /// The present values and factor as a system of its own. Nothing is copied: whichever of the two is assembled or
    /// factorised first takes memory of its own for that.
    pub(super) fn share(&self) -> LinearSystem {
        LinearSystem { blocks: self.blocks.clone(), factor: self.factor.clone(), ..self.empty_like() }
    }

    /// Zeroes the values, for an assembly to add to. The factor stays.
    pub(super) fn zeroed_blocks(&mut self) -> &mut [[f64; 9]] {
        let len = self.analysis.topology.block_rows.len();
        match Arc::get_mut(&mut self.blocks) {
            Some(blocks) if blocks.len() == len => blocks.fill([0.0; 9]),
            _ => self.blocks = Arc::new(vec![[0.0; 9]; len]),
        }
        // Nobody else holds them by now, so nothing is cloned.
        Arc::make_mut(&mut self.blocks).as_mut_slice()
    }

    /// Unknowns, those pinned by mirrors included.
    pub(super) fn num_unknowns(&self) -> usize {
        self.analysis.topology.num_unknowns()
    }

    /// Calls of [`LinearSystem::factorise`] so far.
    pub(super) fn num_factorisations(&self) -> usize {
        self.num_factorisations
    }

    /// Factorises the present values, in single precision unless that fails.
    ///
    /// # Errors
    /// [`LinearError`].
    pub(super) fn factorise(&mut self) -> Result<(), LinearError> {
        self.num_factorisations += 1;
        // The memory of the last factor is used again unless someone else still holds it.
        let mut l = match self.factor.take().and_then(Arc::into_inner) {
            Some(Factor::Single(l)) => l,
            _ => vec![0.0; self.analysis.symbolic.len_val()],
        };
        self.analysis.topology.to_scalar(&self.blocks, |x| x as f32, &mut self.single_values);
        let result = factor_of(&self.analysis, &self.single_values, &mut l, &mut self.arenas);
        if result.is_ok() && l.iter().step_by(97).all(|x| x.is_finite()) {
            self.factor = Some(Arc::new(Factor::Single(l)));
            return Ok(());
        }
        self.factorise_double()
    }

    /// Factorises the present values in double precision.
    ///
    /// # Errors
    /// [`LinearError`].
    fn factorise_double(&mut self) -> Result<(), LinearError> {
        self.factor = None;
        let mut l = vec![0.0f64; self.analysis.symbolic.len_val()];
        let mut values = Vec::new();
        self.analysis.topology.to_scalar(&self.blocks, |x| x, &mut values);
        factor_of(&self.analysis, &values, &mut l, &mut Arenas::default())?;
        self.factor = Some(Arc::new(Factor::Double(l)));
        Ok(())
    }

    /// Whether a factor (of these or earlier values) exists.
    pub(super) fn has_factor(&self) -> bool {
        self.factor.is_some()
    }

    /// x ← (factor)⁻¹ x for several right-hand sides, one after the other.
    fn precondition(&self, x: &mut [f64], crew: &Crew) {
        let (fronts, symbolic) = (&self.analysis.fronts, self.analysis.supernodal());
        match self.factor.as_deref() {
            None => {}
            Some(Factor::Single(values)) => {
                let mut single: Vec<f32> = x.iter().map(|&v| v as f32).collect();
                FactorByFronts { fronts, symbolic, values }.solve(&mut single, crew);
                for (a, &b) in x.iter_mut().zip(&single) {
                    *a = f64::from(b);
                }
            }
            Some(Factor::Double(values)) => FactorByFronts { fronts, symbolic, values }.solve(x, crew),
        }
    }

    /// Solves K X = B for up to four columns at once by preconditioned conjugate gradients, each to
    /// ‖residual‖ ≤ `tolerance` ‖b‖. Falls back on a fresh double-precision factor.
    ///
    /// # Errors
    /// [`LinearError::NotPositiveDefinite`].
    pub(super) fn solve(
        &mut self,
        right_hand_sides: &[Vec<f64>],
        tolerance: f64,
    ) -> Result<Vec<Vec<f64>>, LinearError> {
        if let Some(x) = self.iterate(right_hand_sides, tolerance, MAX_ITERATIONS)? {
            return Ok(x);
        }
        self.factorise_double()?;
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

    /// Conjugate gradients with the factor at hand, which may be that of a nearby matrix; `None` where `max_iterations`
    /// do not suffice.
    ///
    /// # Errors
    /// [`LinearError::NotPositiveDefinite`] where a direction of negative curvature is met.
    pub(super) fn iterate(
        &self,
        right_hand_sides: &[Vec<f64>],
        tolerance: f64,
        max_iterations: usize,
    ) -> Result<Option<Vec<Vec<f64>>>, LinearError> {
        let topology = &self.analysis.topology;
        let n = topology.num_unknowns();
        let m = right_hand_sides.len();
        let mut x = vec![0.0; n * m];
        let mut r: Vec<f64> = right_hand_sides.iter().flatten().copied().collect();
        let _seat = Seat::take();
        let crew = if self.analysis.symbolic.len_val() < ENTRIES_WORTH_HELP { Crew::alone() } else { Crew::gather() };
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
                multiply(topology, &self.blocks, &p[range.clone()], &mut ap);
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

/// Factorises the matrix of these `values` (the lower triangle in the pattern of the unknowns) into `l`, with the help
/// of whoever is idle.
///
/// # Errors
/// [`LinearError::NotPositiveDefinite`].
fn factor_of<T: Real>(
    analysis: &Analysis,
    values: &[T],
    l: &mut [T],
    arenas: &mut Arenas<T>,
) -> Result<(), LinearError> {
    let Analysis { topology, fronts, .. } = analysis;
    let lower = Lower { pointers: &topology.column_pointers, rows: &topology.row_indices, values };
    let _seat = Seat::take();
    let crew = if fronts.work < WORTH_HELP { Crew::alone() } else { Crew::gather() };
    factorise(fronts, analysis.supernodal(), &lower, l, arenas, &crew)
        .map_err(|NonPositivePivot(index)| LinearError::NotPositiveDefinite { index })
}

/// y = K x with the lower triangle.
fn multiply(topology: &Topology, blocks: &[[f64; 9]], x: &[f64], y: &mut [f64]) {
    y.fill(0.0);
    for (j, pair) in topology.block_pointers.windows(2).enumerate() {
        let (start, end) = (pair[0] as usize, pair[1] as usize);
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

/// Pattern of the transpose.
fn transpose(n: usize, pointers: &[usize], rows: &[usize]) -> (Vec<usize>, Vec<usize>) {
    let mut out_pointers = vec![0usize; n + 1];
    for &r in rows {
        out_pointers[r + 1] += 1;
    }
    for i in 0..n {
        out_pointers[i + 1] += out_pointers[i];
    }
    let mut cursor = out_pointers.clone();
    let mut out_rows = vec![0usize; rows.len()];
    for j in 0..n {
        for &r in &rows[pointers[j]..pointers[j + 1]] {
            out_rows[cursor[r]] = j;
            cursor[r] += 1;
        }
    }
    (out_pointers, out_rows)
}
