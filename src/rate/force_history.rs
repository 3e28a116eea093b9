//! Relaxation found in a force history of one specimen whose elastic force over drive is known from a table (finite
//! elements, say): F(t) = s (F∞(d(t)) + Σ gᵢ ∫ e^{−(t−s)/τᵢ} dF∞) + offset.

use super::channels::channels;
use super::force_history_input::{ForceHistory, ForceHistoryError, ForceHistoryOptions};
use super::force_history_result::{FittedRelaxation, ForceHistoryFit, ForceHistorySequence};
use super::prony::{HistoryError, check_times, memory};
use super::starts::{PronyStart, prony_starts};
use crate::homogeneous::{Deformation, ForceTable, Interval, compare, independent_count, t_quantile};
use crate::material::initial_shear_modulus_kpa;
use crate::optimise::{LeastSquaresOptions, LinearLimit, Minimum, covariance, minimise};
use nalgebra::{DMatrix, DVector};

/// Smallest ratio of neighbouring relaxation times: nearer ones are one.
pub(crate) const MIN_TIME_RATIO: f64 = 2.0;
/// Largest strength of one relaxation.
pub(crate) const MAX_STRENGTH: f64 = 100.0;

/// A history ready to be fitted.
struct Elastic<'a> {
    history: &'a ForceHistory,
    /// F∞, N.
    force: Vec<f64>,
    /// What relaxes, with its weight in the force: memory = Σ weight · memory of values.
    channels: Vec<(Vec<f64>, Vec<f64>)>,
    /// 1 for samples that are fitted, else 0.
    used: Vec<f64>,
}

impl<'a> Elastic<'a> {
    fn new(
        history: &'a ForceHistory,
        table: &ForceTable,
        options: &ForceHistoryOptions,
    ) -> Result<Elastic<'a>, ForceHistoryError> {
        let force = table.forces(&history.drive_mm)?;
        let channels = match &options.layer {
            None => vec![(vec![1.0; force.len()], force.clone())],
            Some(layer) => {
                let mut lists = vec![(Vec::new(), Vec::new()), (Vec::new(), Vec::new())];
                for (&drive, f) in history.drive_mm.iter().zip(&force) {
                    let shear = drive / layer.gap_mm;
                    let c = channels(&layer.terms, &Deformation::SimpleShear { shear });
                    let stress = c.stress[0] + shear * c.stress[1];
                    // At rest both vanish; their slopes' ratio is the limit.
                    let modulus = initial_shear_modulus_kpa(&layer.terms);
                    let scale = if shear.abs() > 1e-4 { f / stress } else { table.at(0.0)?.1 * layer.gap_mm / modulus };
                    for k in 0..2 {
                        lists[k].0.push(scale * c.weight[k]);
                        lists[k].1.push(c.stress[k]);
                    }
                }
                lists
            }
        };
        let used = history.drive_mm.iter().map(|d| f64::from(u8::from(d.abs() >= options.min_drive_mm))).collect();
        Ok(Elastic { history, force, channels, used })
    }

    /// The force's memory for one τ, and its derivative with respect to τ.
    fn memory(&self, tau_s: f64) -> (Vec<f64>, Vec<f64>) {
        let n = self.force.len();
        let (mut values, mut slopes) = (vec![0.0; n], vec![0.0; n]);
        for (weight, list) in &self.channels {
            let (v, s) = memory(&self.history.time_s, list, tau_s);
            for i in 0..n {
                values[i] += weight[i] * v[i];
                slopes[i] += weight[i] * s[i];
            }
        }
        (values, slopes)
    }

    /// The model's force at every sample, N.
    fn model(&self, x: &[f64]) -> Vec<f64> {
        let mut relaxed = self.force.clone();
        for term in x[2..].chunks(2) {
            for (value, m) in relaxed.iter_mut().zip(self.memory(term[1].exp()).0) {
                *value += term[0] * m;
            }
        }
        relaxed.iter().map(|r| x[0] * r + x[1]).collect()
    }

    /// Residual (model − data) in N and Jacobian with respect to (s, offset, g₁, ln τ₁, …); zero at samples left out.
    fn evaluate(&self, x: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
        let (n, num_terms) = (self.force.len(), (x.len() - 2) / 2);
        let mut jacobian = DMatrix::zeros(n, x.len());
        let mut relaxed = DVector::from_row_slice(&self.force);
        for k in 0..num_terms {
            let (g, tau) = (x[2 + 2 * k], x[3 + 2 * k].exp());
            let (values, slopes) = self.memory(tau);
            for i in 0..n {
                relaxed[i] += g * values[i];
                jacobian[(i, 2 + 2 * k)] = x[0] * values[i] * self.used[i];
                jacobian[(i, 3 + 2 * k)] = x[0] * g * tau * slopes[i] * self.used[i];
            }
        }
        for i in 0..n {
            jacobian[(i, 0)] = relaxed[i] * self.used[i];
            jacobian[(i, 1)] = self.used[i];
        }
        let residual = DVector::from_fn(n, |i, _| (x[0] * relaxed[i] + x[1] - self.history.force_n[i]) * self.used[i]);
        (residual, jacobian)
    }
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
    if let Some(layer) = &options.layer
        && !(layer.gap_mm > 0.0 && initial_shear_modulus_kpa(&layer.terms) > 0.0)
    {
        let (value, requirement) = (layer.gap_mm, "a layer needs a positive gap and terms of positive modulus");
        return Err(ForceHistoryError::Setting { name: "layer", value, requirement });
    }
    let elastic = Elastic::new(history, table, options)?;
    let n = elastic.used.iter().filter(|u| **u > 0.5).count();
    let ends = elastic.force.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(*v), b.max(*v)]);
    if n < 2 * options.max_terms + 4 || !(ends[1] - ends[0] > 0.0) {
        return Err(ForceHistoryError::NoInformation { samples: n, range_n: ends[1] - ends[0] });
    }
    let mut found = Vec::new();
    for num_terms in 0..=options.max_terms {
        if let Some(fit) = fit_with(&elastic, num_terms, options) {
            found.push((num_terms, fit));
        } else {
            break;
        }
    }
    let base = usize::from(options.is_scale_free) + usize::from(options.is_offset_free);
    let least = (base + 2 * options.max_terms + 2) as f64;
    let independent = found.last().map_or(n as f64, |(_, f)| independent_count(&[&kept(&f.0, &elastic.used)], least));
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
    let fits = found.into_iter().map(|(_, (r, j, x))| describe(&elastic, options, &r, &j, &x)).collect();
    Ok(ForceHistorySequence { fits, selection })
}

type Raw = (DVector<f64>, DMatrix<f64>, Vec<f64>);

/// The values of the samples that are fitted.
fn kept(values: &DVector<f64>, used: &[f64]) -> Vec<f64> {
    values.iter().zip(used).filter(|(_, u)| **u > 0.5).map(|(v, _)| *v).collect()
}

fn fit_with(elastic: &Elastic, num_terms: usize, options: &ForceHistoryOptions) -> Option<Raw> {
    let (n, time_s) = (elastic.force.len(), &elastic.history.time_s);
    let used = DVector::from_row_slice(&elastic.used);
    let force = DVector::from_row_slice(&elastic.history.force_n).component_mul(&used);
    let own = DVector::from_row_slice(&elastic.force).component_mul(&used);
    // Free columns of the linear start: the elastic force and a constant.
    let mut free = Vec::new();
    let mut fixed = DVector::zeros(n);
    if options.is_scale_free {
        free.push(own);
    } else {
        fixed = own;
    }
    if options.is_offset_free {
        free.push(used.clone());
    }
    let data = &force - &fixed;
    let column = |tau: f64| DVector::from_vec(elastic.memory(tau).0).component_mul(&used);
    let starts = if num_terms == 0 {
        vec![PronyStart::default()]
    } else {
        prony_starts(time_s, num_terms, &free, &column, &data, 4)
    };
    let mut best: Option<Minimum> = None;
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
        let limits = limits_of(num_terms, 2, time_s);
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
            let (r, mut j) = elastic.evaluate(x);
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
pub(crate) fn limits_of(num_terms: usize, first: usize, time_s: &[f64]) -> Vec<LinearLimit> {
    let [shortest, longest] = super::starts::time_range(time_s);
    let mut limits = Vec::new();
    for k in 0..num_terms {
        let (g, tau) = (first + 2 * k, first + 2 * k + 1);
        limits.push(LinearLimit::at_least(g, 0.0));
        limits.push(LinearLimit::at_most(g, MAX_STRENGTH));
        limits.push(LinearLimit::at_least(tau, (0.2 * shortest).ln()));
        limits.push(LinearLimit::at_most(tau, (5.0 * longest).ln()));
        if k > 0 {
            limits.push(LinearLimit { coefficients: vec![(tau, -1.0), (tau - 2, 1.0)], bound: -MIN_TIME_RATIO.ln() });
        }
    }
    limits
}

fn describe(
    elastic: &Elastic,
    options: &ForceHistoryOptions,
    residual: &DVector<f64>,
    jacobian: &DMatrix<f64>,
    x: &[f64],
) -> ForceHistoryFit {
    let history = elastic.history;
    let fitted = kept(residual, &elastic.used);
    let n = fitted.len() as f64;
    let num_terms = (x.len() - 2) / 2;
    let num_free = usize::from(options.is_scale_free) + usize::from(options.is_offset_free) + 2 * num_terms;
    let left = (n - num_free as f64).max(1.0);
    let independent = independent_count(&[&fitted], num_free as f64 + 2.0);
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
        force_n: elastic.model(x),
    }
}

#[cfg(test)]
#[path = "force_history_tests.rs"]
mod tests;
