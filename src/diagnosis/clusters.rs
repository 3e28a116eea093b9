//! Standard deviations that do not take what a fit leaves for noise.
//!
//! Where a model is not exact, its residuals are shared by neighbouring voxels, and the inverse of the normal matrix
//! takes every one of them for a datum of its own. What really scatters are the sums over regions. The block is
//! therefore divided into columns through its thickness, and the variance is that of an estimate over such clusters:
//! θ is found without one column after the other, θ₋ᵢ − θ = H₋ᵢ⁻¹ g₋ᵢ to first order, and
//!
//! var θ = (m − 1)/m Σᵢ (θ₋ᵢ − θ̄)²
//!
//! for m columns (the jackknife over clusters; to first order in a column's share of what is known it is the sandwich
//! H⁻¹ (Σ gᵢ gᵢᵀ) H⁻¹; Cameron and Miller, A practitioner's guide to cluster-robust inference, 2015). A column that
//! holds more than half of what is known of a parameter counts as one that holds half: without it next to nothing
//! would be known, whatever the residuals are.

use super::cause_fit::CauseFit;
use super::fit::{normal_system, scales};
use super::metric::Metric;
use super::prior::FitSettings;
use super::trace::Trace;
use crate::calibration::Observed;
use nalgebra::DVector;

/// Columns along the length and across the width. Each is several times as wide as the smooth parts of a residual.
const COLUMNS: [usize; 2] = [6, 4];
/// Fewer columns with voxels say nothing.
const FEWEST: usize = 8;
/// Largest factor on what a column does to a parameter to first order, for its own share of what is known.
const LARGEST_LEVERAGE: f64 = 2.0;

/// The standard deviation of each parameter of `fitted` (as [`CauseFit::sd`]) over columns of the block; `columns` are
/// the changes of its prediction with each scaled parameter. `None` where there are too few columns.
pub(super) fn clustered_sd(
    observed: &Observed,
    metric: &Metric,
    fitted: &CauseFit,
    settings: &FitSettings,
    columns: &[Trace],
) -> Option<Vec<f64>> {
    let CauseFit { material, causes, prediction, .. } = fitted;
    let measured = fitted.residual.plus(1.0, &prediction.trace);
    let system = |metric: &Metric| normal_system(metric, &measured, prediction, material, causes, settings, columns);
    let (matrix, gradient) = system(metric);
    let whole = matrix.cholesky()?;
    // The fit may have ended a little before its end.
    let at = whole.solve(&gradient);
    let column_of = columns_of(observed);
    let mut moved: Vec<DVector<f64>> = Vec::new();
    for left_out in 0..COLUMNS.iter().product() {
        if !column_of.contains(&left_out) {
            continue;
        }
        let (matrix, gradient) = system(&metric.of_part(&|v| column_of[v] != left_out));
        let first_order = whole.solve(&gradient) - &at;
        let full = matrix.cholesky().map(|part| part.solve(&gradient) - &at);
        moved.push(full.map_or_else(
            || first_order.clone() * LARGEST_LEVERAGE,
            |full| {
                full.zip_map(&first_order, |full, first| {
                    let limit = LARGEST_LEVERAGE * first.abs();
                    full.clamp(-limit, limit)
                })
            },
        ));
    }
    let num = moved.len() as f64;
    if moved.len() < FEWEST {
        return None;
    }
    let mean = moved.iter().fold(DVector::zeros(at.len()), |sum, m| sum + m) / num;
    let mut variance = DVector::<f64>::zeros(at.len());
    for m in &moved {
        let away = m - &mean;
        variance += away.component_mul(&away) * ((num - 1.0) / num);
    }
    Some(scales(material, causes).iter().zip(variance.iter()).map(|(scale, v)| scale * v.sqrt()).collect())
}

/// The column of every voxel.
fn columns_of(observed: &Observed) -> Vec<usize> {
    let b = observed.specimen.block;
    let place = |x: f64, extent: f64, num: usize| {
        let t = ((x / extent + 0.5) * num as f64).floor().max(0.0);
        (t as usize).min(num - 1)
    };
    let of_voxel = |&v: &u32| {
        let x = observed.mask.grid.center_mm(v as usize);
        place(x[0], b.length_mm, COLUMNS[0]) + COLUMNS[0] * place(x[2], b.width_mm, COLUMNS[1])
    };
    observed.mask.voxels.iter().map(of_voxel).collect()
}

#[cfg(test)]
#[path = "clusters_tests.rs"]
mod tests;
