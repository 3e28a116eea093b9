//! Relaxation found in a force history of one specimen whose elastic force over drive is known from a table (finite
//! elements, say): F(t) = s (F∞(d(t)) + Σ gᵢ ∫ e^{−(t−s)/τᵢ} dF∞) + offset.

use super::prony::{HistoryError, PronyTerm, check_times, memory};
use super::starts::{PronyStart, prony_starts};
use crate::homogeneous::{ForceTable, TableError};
use crate::homogeneous::{
    Interval, LeastSquaresOptions, Limit, Selection, compare, covariance, independent_count, minimise, t_quantile,
};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Smallest ratio of neighbouring relaxation times: nearer ones are one.
pub(crate) const MIN_TIME_RATIO: f64 = 2.0;
/// Largest strength of one relaxation.
pub(crate) const MAX_STRENGTH: f64 = 100.0;

/// A recorded force history.
#[derive(Clone, Debug, PartialEq)]
pub struct ForceHistory {
    /// Times, s, rising.
    pub time_s: Vec<f64>,
    /// Drive at these times, mm.
    pub drive_mm: Vec<f64>,
    /// Force, N.
    pub force_n: Vec<f64>,
    /// Standard deviation of one reading, N; estimated from the fit where not known.
    pub force_sd_n: Option<f64>,
}

/// Settings of [`fit_force_history`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceHistoryOptions {
    /// Fits with 0 to this many relaxations, at most 4.
    pub max_terms: usize,
    /// Whether the table's scale s is free (the material's stiffness) or 1.
    pub is_scale_free: bool,
    /// Whether a constant offset of the load cell is free or 0.
    pub is_offset_free: bool,
}

impl Default for ForceHistoryOptions {
    fn default() -> Self {
        ForceHistoryOptions { max_terms: 3, is_scale_free: true, is_offset_free: true }
    }
}

/// Why a history cannot be fitted.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ForceHistoryError {
    /// The samples are not usable.
    #[error(transparent)]
    History(#[from] HistoryError),
    /// The table does not reach.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A setting is out of its range.
    #[error("{name} is {value}; {requirement}")]
    Setting {
        /// Which one.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is needed.
        requirement: &'static str,
    },
    /// Too few samples, or a drive that never moves.
    #[error("{samples} samples whose elastic force ranges over {range_n:.3e} N say nothing; record a loading history")]
    NoInformation {
        /// Samples.
        samples: usize,
        /// Largest minus smallest elastic force, N.
        range_n: f64,
    },
}

/// One relaxation with its intervals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FittedRelaxation {
    /// g, relative to the equilibrium response.
    pub strength: Interval,
    /// τ, s. Its interval is symmetric in ln τ.
    pub time_s: Interval,
    /// Whether the data determine both.
    pub identifiable: bool,
}

/// The fit with a number of relaxations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForceHistoryFit {
    /// Relaxations, shortest first.
    pub relaxations: Vec<FittedRelaxation>,
    /// s.
    pub scale: Interval,
    /// Offset, N.
    pub offset_n: Interval,
    /// Root mean square of data − model, N.
    pub rms_error_n: f64,
    /// Σ (data − model)² / sd² per datum left; none where the sd is not known.
    pub chi2_per_datum: Option<f64>,
    /// The model's force at every sample, N.
    pub force_n: Vec<f64>,
}

impl ForceHistoryFit {
    /// The relaxations as Prony terms.
    pub fn terms(&self) -> Vec<PronyTerm> {
        self.relaxations.iter().map(|r| PronyTerm { strength: r.strength.value, time_s: r.time_s.value }).collect()
    }
}

/// Fits with 0 to N relaxations and the choice among them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForceHistorySequence {
    /// The fits, elastic first.
    pub fits: Vec<ForceHistoryFit>,
    /// Which one the data call for.
    pub selection: Selection,
}

impl ForceHistorySequence {
    /// The chosen fit.
    pub fn chosen(&self) -> &ForceHistoryFit {
        &self.fits[self.selection.chosen().min(self.fits.len() - 1)]
    }
}

/// Residual (model − data) in N and Jacobian with respect to (s, offset, g₁, ln τ₁, …).
fn evaluate(time_s: &[f64], elastic: &[f64], force: &[f64], x: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
    let (n, num_terms) = (time_s.len(), (x.len() - 2) / 2);
    let mut jacobian = DMatrix::zeros(n, x.len());
    let mut relaxed = DVector::from_row_slice(elastic);
    for k in 0..num_terms {
        let (g, tau) = (x[2 + 2 * k], x[3 + 2 * k].exp());
        let (values, slopes) = memory(time_s, elastic, tau);
        for i in 0..n {
            relaxed[i] += g * values[i];
            jacobian[(i, 2 + 2 * k)] = x[0] * values[i];
            jacobian[(i, 3 + 2 * k)] = x[0] * g * tau * slopes[i];
        }
    }
    jacobian.column_mut(0).copy_from(&relaxed);
    jacobian.column_mut(1).fill(1.0);
    let residual = DVector::from_fn(n, |i, _| x[0] * relaxed[i] + x[1] - force[i]);
    (residual, jacobian)
}

/// Fits 0 to `options.max_terms` relaxations to a force history whose elastic force is `table` at the drive.
///
/// Before the first sample the specimen is taken to be at rest at the first drive.
///
/// # Errors
/// [`ForceHistoryError`].
pub fn fit_force_history(
    history: &ForceHistory,
    table: &ForceTable,
    options: &ForceHistoryOptions,
) -> Result<ForceHistorySequence, ForceHistoryError> {
    check_times(&history.time_s, history.drive_mm.len())?;
    check_times(&history.time_s, history.force_n.len())?;
    if let Some(index) = history.force_n.iter().position(|f| !f.is_finite()) {
        return Err(HistoryError::Value { index, value: history.force_n[index] }.into());
    }
    if options.max_terms > 4 {
        let (value, requirement) = (options.max_terms as f64, "at most 4 relaxations can be told apart");
        return Err(ForceHistoryError::Setting { name: "max_terms", value, requirement });
    }
    if let Some(sd) = history.force_sd_n
        && !(sd > 0.0 && sd.is_finite())
    {
        let requirement = "a standard deviation must be positive";
        return Err(ForceHistoryError::Setting { name: "force_sd_n", value: sd, requirement });
    }
    let elastic = table.forces(&history.drive_mm)?;
    let n = elastic.len();
    let ends = elastic.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(*v), b.max(*v)]);
    if n < 2 * options.max_terms + 4 || !(ends[1] - ends[0] > 0.0) {
        return Err(ForceHistoryError::NoInformation { samples: n, range_n: ends[1] - ends[0] });
    }
    let mut found = Vec::new();
    for num_terms in 0..=options.max_terms {
        if let Some(fit) = fit_with(history, &elastic, num_terms, options) {
            found.push((num_terms, fit));
        } else {
            break;
        }
    }
    let base = usize::from(options.is_scale_free) + usize::from(options.is_offset_free);
    let least = (base + 2 * options.max_terms + 2) as f64;
    let independent = found.last().map_or(n as f64, |(_, f)| independent_count(&[f.0.as_slice()], least));
    let models: Vec<(String, usize, f64)> = found
        .iter()
        .map(|(k, f)| {
            let name = match k {
                0 => "elastic".to_string(),
                1 => "1 relaxation".into(),
                k => format!("{k} relaxations"),
            };
            (name, base + 2 * k, f.0.norm_squared())
        })
        .collect();
    let selection = compare(&models, n, independent);
    let fits = found.into_iter().map(|(_, (r, j, x))| describe(history, options, &r, &j, &x)).collect();
    Ok(ForceHistorySequence { fits, selection })
}

type Raw = (DVector<f64>, DMatrix<f64>, Vec<f64>);

fn fit_with(history: &ForceHistory, elastic: &[f64], num_terms: usize, options: &ForceHistoryOptions) -> Option<Raw> {
    let n = elastic.len();
    let force = DVector::from_row_slice(&history.force_n);
    // Free columns of the linear start: the elastic force and a constant.
    let mut free = Vec::new();
    let mut fixed = DVector::zeros(n);
    if options.is_scale_free {
        free.push(DVector::from_row_slice(elastic));
    } else {
        fixed = DVector::from_row_slice(elastic);
    }
    if options.is_offset_free {
        free.push(DVector::from_element(n, 1.0));
    }
    let data = &force - &fixed;
    let column = |tau: f64| DVector::from_vec(memory(&history.time_s, elastic, tau).0);
    let starts = if num_terms == 0 {
        vec![PronyStart::default()]
    } else {
        prony_starts(&history.time_s, num_terms, &free, &column, &data, 4)
    };
    let mut best: Option<crate::homogeneous::Minimum> = None;
    for start in starts {
        let scale = if options.is_scale_free { start.free.first().copied().unwrap_or(1.0) } else { 1.0 };
        let scale = if scale.abs() > 1e-9 { scale } else { 1.0 };
        let mut x = vec![scale, 0.0];
        if options.is_offset_free {
            x[1] = start.free.last().copied().unwrap_or(0.0);
        }
        for &(strength, tau) in &start.terms {
            x.extend([(strength / scale).clamp(1e-4, 0.5 * MAX_STRENGTH), tau.ln()]);
        }
        let limits = limits_of(num_terms, 2, &history.time_s);
        let mut steps = vec![scale.abs().max(1.0), force.amax().max(1e-12)];
        if !options.is_scale_free {
            steps[0] = 0.0;
        }
        if !options.is_offset_free {
            steps[1] = 0.0;
        }
        for _ in 0..num_terms {
            steps.extend([1.0, 1.0]);
        }
        let settings = LeastSquaresOptions { max_evaluations: 200, tolerance: 1e-10 };
        let found = minimise(&x, &limits, &steps, &settings, &mut |x| {
            let (r, mut j) = evaluate(&history.time_s, elastic, &history.force_n, x);
            for (c, is_free) in [(0, options.is_scale_free), (1, options.is_offset_free)] {
                if !is_free {
                    j.column_mut(c).fill(0.0);
                }
            }
            Some((r, j))
        });
        if let Some(m) = found
            && best.as_ref().is_none_or(|b| m.sum_of_squares < b.sum_of_squares)
        {
            best = Some(m);
        }
    }
    best.map(|m| (m.residual, m.jacobian, m.parameters))
}

/// g ≥ 0, times within what the samples can show, ordered. The terms' unknowns (g, ln τ) begin at `first`.
pub(crate) fn limits_of(num_terms: usize, first: usize, time_s: &[f64]) -> Vec<Limit> {
    let [shortest, longest] = super::starts::time_range(time_s);
    let mut limits = Vec::new();
    for k in 0..num_terms {
        let (g, tau) = (first + 2 * k, first + 2 * k + 1);
        limits.push(Limit::at_least(g, 0.0));
        limits.push(Limit::at_most(g, MAX_STRENGTH));
        limits.push(Limit::at_least(tau, (0.2 * shortest).ln()));
        limits.push(Limit::at_most(tau, (5.0 * longest).ln()));
        if k > 0 {
            limits.push(Limit { coefficients: vec![(tau, -1.0), (tau - 2, 1.0)], bound: -MIN_TIME_RATIO.ln() });
        }
    }
    limits
}

fn describe(
    history: &ForceHistory,
    options: &ForceHistoryOptions,
    residual: &DVector<f64>,
    jacobian: &DMatrix<f64>,
    x: &[f64],
) -> ForceHistoryFit {
    let n = residual.len() as f64;
    let num_terms = (x.len() - 2) / 2;
    let num_free = usize::from(options.is_scale_free) + usize::from(options.is_offset_free) + 2 * num_terms;
    let left = (n - num_free as f64).max(1.0);
    let independent = independent_count(&[residual.as_slice()], num_free as f64 + 2.0);
    let estimated = residual.norm_squared() / left * (n / independent);
    let variance = history.force_sd_n.map_or(estimated, |sd| estimated.max(sd * sd));
    let (matrix, is_determined) = covariance(jacobian, variance, 1e-6);
    let t95 = t_quantile(0.05, (independent - num_free as f64).max(1.0));
    let linear = |i: usize| {
        let half = t95 * matrix[(i, i)].max(0.0).sqrt();
        Interval { value: x[i], interval_95: [x[i] - half, x[i] + half] }
    };
    let relaxations = (0..num_terms)
        .map(|k| {
            let (g, tau) = (2 + 2 * k, 3 + 2 * k);
            // A time known to no factor of ten thousand is not known.
            let half = (t95 * matrix[(tau, tau)].max(0.0).sqrt()).min(50.0);
            let identifiable = is_determined[g] && is_determined[tau] && half < 9.0 && x[g] > 0.0;
            let time = Interval { value: x[tau].exp(), interval_95: [(x[tau] - half).exp(), (x[tau] + half).exp()] };
            FittedRelaxation { strength: linear(g), time_s: time, identifiable }
        })
        .collect();
    ForceHistoryFit {
        relaxations,
        scale: linear(0),
        offset_n: linear(1),
        rms_error_n: (residual.norm_squared() / n).sqrt(),
        chi2_per_datum: history.force_sd_n.map(|sd| residual.norm_squared() / (sd * sd * left)),
        force_n: residual.iter().zip(&history.force_n).map(|(r, f)| r + f).collect(),
    }
}

#[cfg(test)]
#[path = "force_history_tests.rs"]
mod tests;
