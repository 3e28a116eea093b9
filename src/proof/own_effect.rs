//! What a hidden cause does that nothing else could do in its place.

use super::conceal::{ConcealError, RUBBER, Shown, show};
use super::draw::{Hidden, HiddenCause};
use super::experiment::Experiment;
use crate::specimen::Specimen;
use nalgebra::{DMatrix, DVector};

/// Element size of these comparisons: effects are differences, of which coarse elements know enough.
const MESH_FACTOR: f64 = 2.2;
/// Relative steps of κ and of the other constants of the material.
const BULK_STEP: f64 = 0.2;
const STEP: f64 = 0.02;
/// Part of each effect's square that is added to it, so that effects which are alike can be told.
const RIDGE: f64 = 1e-9;

/// The effect of one hidden cause among the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OwnEffect {
    /// What is left of its change of the displacement once the material, the sizes of all other causes and, where one
    /// of them is a background, all of its coefficients have followed (to first order), mm rms over all drives.
    pub(super) rms_mm: f64,
    /// Largest relative change of a force with it.
    pub(super) force_relative: f64,
}

/// The own effects of all hidden causes, in their order.
///
/// # Errors
/// [`ConcealError`].
pub(super) fn own_effects(specimen: &Specimen, experiment: &Experiment) -> Result<Vec<OwnEffect>, ConcealError> {
    let all = show(specimen, experiment, MESH_FACTOR, &[])?;
    let mut others: Vec<Shown> = Vec::new();
    for place in 0..experiment.hidden.len() {
        others.push(show(specimen, &experiment.without(place, RUBBER), MESH_FACTOR, &[])?);
    }
    for (n, parameter) in experiment.material.parameters().into_iter().enumerate() {
        let mut other = experiment.clone();
        let step = if n == 0 { BULK_STEP } else { STEP };
        other.material.set(parameter, (1.0 + step) * other.material.value(parameter));
        others.push(show(specimen, &other, MESH_FACTOR, &[])?);
    }
    let rows = rows_of_all(&all, &others);
    let changes = changes(&all, &others, &rows);
    let is_smooth = |hidden: &Hidden| hidden.cause == HiddenCause::Background;
    let forces = |n: usize| {
        let pairs = all.forces.iter().zip(&others[n].forces);
        pairs.map(|(with, without)| (with / without - 1.0).abs()).fold(0.0, f64::max)
    };
    let own = |(n, hidden): (usize, &Hidden)| {
        let smooth = match experiment.hidden.iter().any(is_smooth) && !is_smooth(hidden) {
            true => smooth_fields(&all, &rows),
            false => DMatrix::zeros(rows.len(), 0),
        };
        OwnEffect { rms_mm: own_rms(&changes, n, &smooth), force_relative: forces(n) }
    };
    Ok(experiment.hidden.iter().enumerate().map(own).collect())
}

/// Displacements at every drive and voxel of the grid, one number after the other; NaN where none is shown.
fn spread(shown: &Shown) -> Vec<f64> {
    shown.displacement.iter().flat_map(|field| shown.mask.spread(field, [f64::NAN; 3])).flatten().collect()
}

/// The places of numbers that all of them show.
fn rows_of_all(all: &Shown, others: &[Shown]) -> Vec<usize> {
    let (with, without): (Vec<f64>, Vec<Vec<f64>>) = (spread(all), others.iter().map(spread).collect());
    (0..with.len()).filter(|&i| with[i].is_finite() && without.iter().all(|w| w[i].is_finite())).collect()
}

/// The changes from each of `others` to `all`, one column each, at `rows`.
fn changes(all: &Shown, others: &[Shown], rows: &[usize]) -> DMatrix<f64> {
    let with = spread(all);
    let without: Vec<Vec<f64>> = others.iter().map(spread).collect();
    DMatrix::from_fn(rows.len(), others.len(), |i, j| with[rows[i]] - without[j][rows[i]])
}

/// Fields of up to second degree in the position, alike at every drive, at `rows`: a background has any of them.
fn smooth_fields(all: &Shown, rows: &[usize]) -> DMatrix<f64> {
    let grid = &all.mask.grid;
    let extent = [0, 1, 2].map(|a| 0.5 * grid.voxel_mm[a] * grid.shape[a] as f64);
    let terms_at = |row: usize| -> [f64; 10] {
        let x = grid.center_mm(row / 3 % grid.num_voxels());
        let [x, y, z] = [0, 1, 2].map(|a| x[a] / extent[a]);
        [1.0, x, y, z, x * x, y * y, z * z, x * y, y * z, z * x]
    };
    DMatrix::from_fn(rows.len(), 30, |i, j| if rows[i] % 3 == j / 10 { terms_at(rows[i])[j % 10] } else { 0.0 })
}

/// Root mean square of what the other columns and `also` leave of one.
fn own_rms(changes: &DMatrix<f64>, column: usize, also: &DMatrix<f64>) -> f64 {
    let target = changes.column(column).clone_owned();
    let num = target.len().max(1) as f64;
    let num_others = changes.ncols() - 1;
    let mut rest = changes.clone().remove_column(column).resize_horizontally(num_others + also.ncols(), 0.0);
    rest.columns_mut(num_others, also.ncols()).copy_from(also);
    let mut gram = rest.tr_mul(&rest);
    // In units of each column: smooth fields are of order one, effects of hundredths.
    let scale: Vec<f64> = gram.diagonal().iter().map(|d| 1.0 / d.max(f64::MIN_POSITIVE).sqrt()).collect();
    for i in 0..gram.nrows() {
        for j in 0..gram.ncols() {
            gram[(i, j)] *= scale[i] * scale[j];
        }
        gram[(i, i)] += RIDGE;
    }
    let right = rest.tr_mul(&target).zip_map(&DVector::from_vec(scale.clone()), |r, s| r * s);
    let sizes = gram.cholesky().map_or_else(|| DVector::zeros(rest.ncols()), |c| c.solve(&right));
    let sizes = sizes.zip_map(&DVector::from_vec(scale), |x, s| x * s);
    ((target - rest * sizes).norm_squared() / num).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A column that is the sum of two others is nothing of its own; one that is not keeps what they do not have.
    #[test]
    fn what_others_can_do_is_not_its_own() {
        let changes = DMatrix::from_row_slice(4, 3, &[1., 0., 1., 0., 2., 2., 0., 0., 0., 0., 0., 0.]);
        assert!(own_rms(&changes, 2, &DMatrix::zeros(4, 0)) < 1e-6);
        let changes = DMatrix::from_row_slice(4, 3, &[1., 0., 1., 0., 2., 2., 0., 0., 3., 0., 0., 0.]);
        // 3 in one of four rows.
        assert!((own_rms(&changes, 2, &DMatrix::zeros(4, 0)) - 1.5).abs() < 1e-6);
    }
}
