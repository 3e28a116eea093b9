//! The direct factor: a supernodal Cholesky factor, in single precision unless that fails.
//!
//! Symbolic work is done once per mesh. Measured on these matrices (κ/μ ≈ 130–800): the single-precision factor takes
//! half the time and memory, and one iteration of conjugate gradients with it gains four to five digits.

use super::crew::{Crew, Seat};
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

/// Factorisations of more operations are worth the time that it takes to call for help: a tenth of a millisecond.
const WORTH_HELP: f64 = 1e8;

/// Substitutions with a factor of more entries are worth it.
const ENTRIES_WORTH_HELP: usize = 1_500_000;

/// Pattern and symbolic factorisation of the tangents of one mesh.
pub(super) struct Direct {
    topology: Arc<Topology>,
    /// Column pointers of the lower triangle (scalar unknowns).
    pointers: Vec<usize>,
    /// Row indices, increasing in each column, the diagonal first.
    rows: Vec<usize>,
    symbolic: SymbolicCholesky<usize>,
    fronts: Fronts,
}

/// A factor in one precision.
pub(super) enum DirectFactor {
    Single(Vec<f32>),
    Double(Vec<f64>),
}

/// Memory of factorisations in single precision.
#[derive(Default)]
pub(super) struct Workspace {
    values: Vec<f32>,
    arenas: Arenas<f32>,
}

impl Direct {
    /// Analyses the pattern of `topology`.
    ///
    /// # Errors
    /// [`LinearError::OutOfMemory`].
    pub(super) fn new(topology: Arc<Topology>) -> Result<Direct, LinearError> {
        let n = topology.num_unknowns();
        let (pointers, rows) = topology.scalar_pattern();
        // With the identity ordering the analysis reads the *upper* triangle, the numeric call the lower one.
        let (upper_pointers, upper_rows) = transpose(n, &pointers, &rows);
        let upper = SymbolicSparseColMatRef::new_checked(n, n, &upper_pointers, None, &upper_rows);
        let parameters = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let symbolic = factorize_symbolic_cholesky(upper, Side::Upper, SymmetricOrdering::Identity, parameters)
            .map_err(|_| LinearError::OutOfMemory { num_unknowns: n })?;
        let fronts = Fronts::new(supernodal(&symbolic));
        Ok(Direct { topology, pointers, rows, symbolic, fronts })
    }

    /// Factorises the matrix of these `blocks`, in single precision unless that fails. Memory of an `old` factor is
    /// used again.
    ///
    /// # Errors
    /// [`LinearError::NotPositiveDefinite`].
    pub(super) fn factorise(
        &self,
        blocks: &[[f64; 9]],
        old: Option<DirectFactor>,
        workspace: &mut Workspace,
    ) -> Result<DirectFactor, LinearError> {
        let mut l = match old {
            Some(DirectFactor::Single(l)) => l,
            _ => vec![0.0; self.symbolic.len_val()],
        };
        self.topology.to_scalar(blocks, |x| x as f32, &mut workspace.values);
        let result = self.factor_of(&workspace.values, &mut l, &mut workspace.arenas);
        if result.is_ok() && l.iter().step_by(97).all(|x| x.is_finite()) {
            return Ok(DirectFactor::Single(l));
        }
        drop(l);
        self.factorise_double(blocks)
    }

    /// Factorises the matrix of these `blocks` in double precision.
    ///
    /// # Errors
    /// [`LinearError::NotPositiveDefinite`].
    pub(super) fn factorise_double(&self, blocks: &[[f64; 9]]) -> Result<DirectFactor, LinearError> {
        let mut l = vec![0.0f64; self.symbolic.len_val()];
        let mut values = Vec::new();
        self.topology.to_scalar(blocks, |x| x, &mut values);
        self.factor_of(&values, &mut l, &mut Arenas::default())?;
        Ok(DirectFactor::Double(l))
    }

    /// Factorises the matrix of these `values` (the lower triangle in the pattern of the unknowns) into `l`, with the
    /// help of whoever is idle.
    fn factor_of<T: Real>(&self, values: &[T], l: &mut [T], arenas: &mut Arenas<T>) -> Result<(), LinearError> {
        let lower = Lower { pointers: &self.pointers, rows: &self.rows, values };
        let _seat = Seat::take();
        let crew = if self.fronts.work < WORTH_HELP { Crew::alone() } else { Crew::gather() };
        factorise(&self.fronts, supernodal(&self.symbolic), &lower, l, arenas, &crew)
            .map_err(|NonPositivePivot(index)| LinearError::NotPositiveDefinite { index })
    }

    /// Floating-point operations of a factorisation.
    pub(super) fn factor_operations(&self) -> f64 {
        self.fronts.work
    }

    /// Whether threads help each other in [`Direct::solve`].
    pub(super) fn is_worth_help(&self) -> bool {
        self.symbolic.len_val() >= ENTRIES_WORTH_HELP
    }

    /// x ← (factor)⁻¹ x for several right-hand sides, one after the other.
    pub(super) fn solve(&self, factor: &DirectFactor, x: &mut [f64], crew: &Crew) {
        let (fronts, symbolic) = (&self.fronts, supernodal(&self.symbolic));
        match factor {
            DirectFactor::Single(values) => {
                let mut single: Vec<f32> = x.iter().map(|&v| v as f32).collect();
                FactorByFronts { fronts, symbolic, values }.solve(&mut single, crew);
                for (a, &b) in x.iter_mut().zip(&single) {
                    *a = f64::from(b);
                }
            }
            DirectFactor::Double(values) => FactorByFronts { fronts, symbolic, values }.solve(x, crew),
        }
    }
}

/// The supernodes, which [`Direct::new`] asked for.
fn supernodal(symbolic: &SymbolicCholesky<usize>) -> &SymbolicSupernodalCholesky<usize> {
    match symbolic.raw() {
        SymbolicCholeskyRaw::Supernodal(supernodal) => supernodal,
        SymbolicCholeskyRaw::Simplicial(_) => unreachable!("supernodes were asked for"),
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
