//! What a hidden cause does that nothing else could do in its place.

use super::conceal::{ConcealError, RUBBER, Shown, show};
use super::experiment::Experiment;
use crate::specimen::Specimen;
use nalgebra::{DMatrix, DVector};

/// Element size of these comparisons: effects are differences, of which coarse elements know enough.
const MESH_FACTOR: f64 = 2.2;
/// Relative steps of κ and of the other constants of the material.
const BULK_STEP: f64 = 0.2;
const STEP: f64 = 0.02;
/// Part of the largest effect's square that is added to each, so that effects which are alike can be told.
const RIDGE: f64 = 1e-9;

/// The effect of one hidden cause among the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OwnEffect {
    /// What is left of its change of the displacement once the material and the sizes of all other causes have followed
    /// (to first order), mm rms over all drives.
    pub(super) rms_mm: f64,
    /// Largest relative change of a force with it.
    pub(super) force_relative: f64,
}

/// The own effects of all hidden causes, in their order.
///
/// # Errors
/// [`ConcealError`].
pub(super) fn own_effects(specimen: &Specimen, experiment: &Experiment) -> Result<Vec<OwnEffect>, ConcealError> {
    let all = show(specimen, experiment, MESH_FACTOR)?;
    let mut others: Vec<Shown> = Vec::new();
    for place in 0..experiment.hidden.len() {
        others.push(show(specimen, &experiment.without(place, RUBBER), MESH_FACTOR)?);
    }
    for (n, parameter) in experiment.material.parameters().into_iter().enumerate() {
        let mut other = experiment.clone();
        let step = if n == 0 { BULK_STEP } else { STEP };
        other.material.set(parameter, (1.0 + step) * other.material.value(parameter));
        others.push(show(specimen, &other, MESH_FACTOR)?);
    }
    let changes = changes(&all, &others);
    let forces = |n: usize| {
        let pairs = all.forces.iter().zip(&others[n].forces);
        pairs.map(|(with, without)| (with / without - 1.0).abs()).fold(0.0, f64::max)
    };
    Ok((0..experiment.hidden.len())
        .map(|n| OwnEffect { rms_mm: own_rms(&changes, n), force_relative: forces(n) })
        .collect())
}

/// The changes from each of `others` to `all`, one column each, at the voxels that all of them show.
fn changes(all: &Shown, others: &[Shown]) -> DMatrix<f64> {
    let spread = |shown: &Shown| -> Vec<f64> {
        shown.displacement.iter().flat_map(|field| shown.mask.spread(field, [f64::NAN; 3])).flatten().collect()
    };
    let with = spread(all);
    let without: Vec<Vec<f64>> = others.iter().map(spread).collect();
    let rows: Vec<usize> =
        (0..with.len()).filter(|&i| with[i].is_finite() && without.iter().all(|w| w[i].is_finite())).collect();
    DMatrix::from_fn(rows.len(), others.len(), |i, j| with[rows[i]] - without[j][rows[i]])
}

/// Root mean square of what the other columns leave of one.
fn own_rms(changes: &DMatrix<f64>, column: usize) -> f64 {
    let (target, rest) = (changes.column(column).clone_owned(), changes.clone().remove_column(column));
    let num = target.len().max(1) as f64;
    let mut gram = rest.tr_mul(&rest);
    let largest = gram.diagonal().max();
    for i in 0..gram.nrows() {
        gram[(i, i)] += RIDGE * largest;
    }
    let sizes = gram.cholesky().map_or_else(|| DVector::zeros(rest.ncols()), |c| c.solve(&rest.tr_mul(&target)));
    ((target - rest * sizes).norm_squared() / num).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A column that is the sum of two others is nothing of its own; one that is not keeps what they do not have.
    #[test]
    fn what_others_can_do_is_not_its_own() {
        let changes = DMatrix::from_row_slice(4, 3, &[1., 0., 1., 0., 2., 2., 0., 0., 0., 0., 0., 0.]);
        assert!(own_rms(&changes, 2) < 1e-6);
        let changes = DMatrix::from_row_slice(4, 3, &[1., 0., 1., 0., 2., 2., 0., 0., 3., 0., 0., 0.]);
        // 3 in one of four rows.
        assert!((own_rms(&changes, 2) - 1.5).abs() < 1e-6);
    }
}
