//! The least-squares problem of a load curve: its readings, what they weigh, and the force that effects make.
//!
//! The force is F(t) = Prony ∗ [η F∞(d(t))] + offset + friction · direction of motion. F∞ is the finite element force
//! over drive, its material free (to first order). η = 1 − ρ erf((W_max − W)/m) is Ogden and Roxburgh's softening with
//! the work W(d) = ∫ F∞ dd of the whole sample in place of the local energy. The Prony series acts on the isochoric
//! second Piola–Kirchhoff stress of every point (Simo 1987; see [`super::memory_kernel`]): at large shear the memory of
//! the stress and that of the force differ.
//!
//! Readings carry white noise and a slow drift of the load cell. Both are in their covariance, with an allowance for
//! the model.

use super::elastic_table::ElasticTable;
use super::load_effect::{EffectParameter, ForceChange, LoadEffect, LoadReadings};
use super::memory_kernel::MemoryKernel;
use crate::optimise::{LeastSquaresOptions, LinearLimit, covariance, minimise};
use crate::rate::memory;
use crate::recording::LoadCurve;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Correlation time of the load cell's drift, s.
const DRIFT_TIME_S: f64 = 20.0;
/// Most readings looked at; longer curves are thinned.
const MAX_READINGS: usize = 1200;
/// Fewest readings from which anything is told.
const MIN_READINGS: usize = 20;
/// Allowance of the force model, relative to the force: common effects of the mesh are in the free material.
const ALLOWANCE: f64 = 0.002;
/// The error of the force model is a smooth function of the drive: errors at drives that lie so far apart, as a part of
/// the largest, are hardly correlated.
const SMOOTH_OVER: f64 = 0.3;
/// Allowance below the largest drive so far, relative to the force there: the deformation of a sample that remembers is
/// not quite that of the elastic one.
const ALLOWANCE_OF_MEMORY: f64 = 0.004;
/// The drive is near zero within this part of the largest so far: there the force is all memory.
const NEAR_REST: f64 = 0.15;
/// Allowance near zero drive, relative to the force at the largest drive so far.
const ALLOWANCE_NEAR_REST: f64 = 0.03;

/// A load curve to be explained.
pub(super) struct LoadProblem {
    /// The readings.
    pub(super) readings: LoadReadings,
    /// Per row of the memory kernel: its history, N.
    histories: Vec<Vec<f64>>,
    /// Per reading: rows and weights that make the force of what is remembered.
    rows: Vec<Vec<(usize, f64)>>,
    /// Factor of the readings' covariance.
    whitener: Cholesky<f64, Dyn>,
}

/// A fit of some effects.
pub(super) struct LoadFit {
    /// Weighted squares of the misfit.
    pub(super) deviance: f64,
    /// Scaled changes of the material, then the effects' parameters in order, as fitted.
    pub(super) parameters: Vec<f64>,
    /// Their standard deviations; infinite where the readings do not bound a parameter.
    pub(super) sd: Vec<f64>,
}

impl LoadProblem {
    /// From a curve, the elastic force over drive, the memory of the load and the standard deviation of the load cell's
    /// drift; `None` where there are too few readings.
    pub(super) fn new(
        curve: &LoadCurve,
        table: &ElasticTable,
        kernel: &MemoryKernel,
        drift_sd_n: f64,
    ) -> Option<LoadProblem> {
        let (time_s, drive_mm, measured_n) = thinned(curve);
        if measured_n.len() < MIN_READINGS {
            return None;
        }
        let elastic_n: Vec<f64> = drive_mm.iter().map(|d| ElasticTable::at(&table.force, *d)).collect();
        let derivatives =
            table.derivatives.iter().map(|t| drive_mm.iter().map(|d| ElasticTable::at(t, *d)).collect()).collect();
        let work: Vec<f64> = drive_mm.iter().map(|d| ElasticTable::at(&table.work, d.abs())).collect();
        let largest_work = work.iter().fold(1e-12f64, |s, w| s.max(*w));
        let white_sd_n = white_noise(&drive_mm, &measured_n, drift_sd_n);
        let errors = ReadingErrors { white_sd_n, drift_sd_n, allowance_n: allowances(&drive_mm, &elastic_n) };
        let covariance = errors.covariance(&time_s, &drive_mm, &elastic_n);
        let whitener = Cholesky::new(covariance)?;
        let direction = directions(&drive_mm);
        Some(LoadProblem {
            histories: kernel.histories(&drive_mm),
            rows: drive_mm.iter().map(|d| kernel.weights(*d)).collect(),
            whitener,
            readings: LoadReadings { time_s, measured_n, direction, elastic_n, derivatives, work, largest_work },
        })
    }

    /// Number of material parameters, which come first among the fitted ones.
    pub(super) fn num_material(&self) -> usize {
        self.readings.derivatives.len()
    }

    /// Time from the first to the last reading, s.
    pub(super) fn duration_s(&self) -> f64 {
        let time_s = &self.readings.time_s;
        time_s.last().zip(time_s.first()).map_or(0.0, |(last, first)| last - first)
    }

    /// Force at every reading with parameters: scaled material changes, then the effects'. Also the elastic force
    /// alone.
    pub(super) fn force(&self, effects: &[&'static dyn LoadEffect], p: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let readings = &self.readings;
        let mut elastic = readings.elastic_n.clone();
        for (d, x) in readings.derivatives.iter().zip(p) {
            for (e, d) in elastic.iter_mut().zip(d) {
                *e += x * d;
            }
        }
        // What the material and softening make of the nominal force; it scales what relaxes.
        let factor: Vec<f64> = elastic
            .iter()
            .zip(&readings.elastic_n)
            .map(|(now, then)| if then.abs() > 0.0 { now / then } else { 1.0 })
            .collect();
        let mut change = ForceChange { factor, added_n: vec![0.0; elastic.len()], relaxations: Vec::new() };
        let mut at = self.num_material();
        for effect in effects {
            let count = self.parameters_of(*effect).len();
            effect.act(&p[at..at + count], readings, &mut change);
            at += count;
        }
        let mut force: Vec<f64> = readings.elastic_n.iter().zip(&change.factor).map(|(e, f)| e * f).collect();
        for &(strength, time_s) in &change.relaxations {
            let kept: Vec<Vec<f64>> = self
                .histories
                .iter()
                .map(|history| {
                    let scaled: Vec<f64> = history.iter().zip(&change.factor).map(|(h, f)| h * f).collect();
                    memory(&readings.time_s, &scaled, time_s).0
                })
                .collect();
            for (n, (f, rows)) in force.iter_mut().zip(&self.rows).enumerate() {
                *f += strength * rows.iter().map(|(row, weight)| weight * kept[*row][n]).sum::<f64>();
            }
        }
        force.iter_mut().zip(&change.added_n).for_each(|(f, a)| *f += a);
        (force, elastic)
    }

    /// An effect's parameters in this load curve.
    pub(super) fn parameters_of(&self, effect: &dyn LoadEffect) -> Vec<EffectParameter> {
        effect.parameters(self.duration_s())
    }

    fn whitened(&self, values: &[f64]) -> DVector<f64> {
        let mut x = DVector::from_column_slice(values);
        self.whitener.l_dirty().solve_lower_triangular_mut(&mut x);
        x
    }

    /// Residuals and Jacobian, whitened.
    fn evaluate(&self, effects: &[&'static dyn LoadEffect], p: &[f64]) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let (force, _) = self.force(effects, p);
        if force.iter().any(|f| !f.is_finite()) {
            return None;
        }
        let misfit: Vec<f64> = force.iter().zip(&self.readings.measured_n).map(|(f, m)| f - m).collect();
        let residual = self.whitened(&misfit);
        let mut jacobian = DMatrix::zeros(residual.len(), p.len());
        for i in 0..p.len() {
            let h = 1e-4 * p[i].abs().max(1e-2);
            let mut moved = p.to_vec();
            moved[i] += h;
            let ahead = self.force(effects, &moved).0;
            moved[i] -= 2.0 * h;
            let behind = self.force(effects, &moved).0;
            let slope: Vec<f64> = ahead.iter().zip(&behind).map(|(a, b)| (a - b) / (2.0 * h)).collect();
            jacobian.set_column(i, &self.whitened(&slope));
        }
        Some((residual, jacobian))
    }

    /// Fits the material and effects from `start`; `None` where no step can be made.
    pub(super) fn fit(&self, effects: &[&'static dyn LoadEffect], start: &[f64]) -> Option<LoadFit> {
        let num_material = self.num_material();
        let mut limits = Vec::new();
        let mut largest_step = vec![0.3; num_material];
        let mut bound = |i: usize, [low, high]: [f64; 2]| {
            limits.push(LinearLimit::at_least(i, low));
            limits.push(LinearLimit::at_most(i, high));
        };
        for i in 0..num_material {
            bound(i, [-0.8, 4.0]);
        }
        for (n, parameter) in effects.iter().flat_map(|e| self.parameters_of(*e)).enumerate() {
            if let Some(range) = parameter.limits {
                bound(num_material + n, range);
            }
            largest_step.push(parameter.largest_step);
        }
        let options = LeastSquaresOptions { max_evaluations: 60, tolerance: 1e-6 };
        let found = minimise(start, &limits, &largest_step, &options, &mut |p| self.evaluate(effects, p))?;
        let (matrix, known) = covariance(&found.jacobian, 1.0, 1e-10);
        let sd =
            (0..start.len()).map(|i| if known[i] { matrix[(i, i)].max(0.0).sqrt() } else { f64::INFINITY }).collect();
        Some(LoadFit { deviance: found.sum_of_squares, parameters: found.parameters, sd })
    }
}

/// Times, drives and readings, so few that all can be looked at; of readings at one time the first is kept.
fn thinned(curve: &LoadCurve) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let every = curve.time_s.len().div_ceil(MAX_READINGS).max(1);
    let pick = |values: &[f64]| -> Vec<f64> { values.iter().copied().step_by(every).collect() };
    let (mut time_s, mut drive_mm, mut measured) = (pick(&curve.time_s), pick(&curve.drive_mm), pick(&curve.force_n));
    let keep: Vec<bool> = (0..time_s.len()).map(|i| i == 0 || time_s[i] > time_s[i - 1]).collect();
    for list in [&mut time_s, &mut drive_mm, &mut measured] {
        let mut k = keep.iter();
        list.retain(|_| *k.next().unwrap_or(&false));
    }
    (time_s, drive_mm, measured)
}

/// The direction of motion at each drive.
fn directions(drive_mm: &[f64]) -> Vec<f64> {
    let mut direction = vec![0.0; drive_mm.len()];
    for i in 1..drive_mm.len() {
        let change = drive_mm[i] - drive_mm[i - 1];
        direction[i] = if change.abs() > 1e-9 { change.signum() } else { direction[i - 1] };
    }
    direction
}

/// Standard deviation of the white noise, N, from second differences while the drive rests; the drift's where it hardly
/// ever rests.
fn white_noise(drive_mm: &[f64], measured: &[f64], drift_sd_n: f64) -> f64 {
    let mut differences: Vec<f64> = (1..measured.len().saturating_sub(1))
        .filter(|&i| (drive_mm[i + 1] - drive_mm[i - 1]).abs() < 1e-9)
        .map(|i| (measured[i + 1] - 2.0 * measured[i] + measured[i - 1]).abs())
        .collect();
    differences.sort_by(f64::total_cmp);
    match differences.len() {
        0..10 => drift_sd_n,
        m => (1.4826 * differences[m / 2] / 6f64.sqrt()).max(1e-3 * drift_sd_n),
    }
}

/// The allowance of the force model at each reading, N.
fn allowances(drive_mm: &[f64], elastic: &[f64]) -> Vec<f64> {
    let mut largest = [0.0f64; 2];
    drive_mm
        .iter()
        .zip(elastic)
        .map(|(drive, force)| {
            if drive.abs() >= largest[0] {
                largest = [drive.abs(), force.abs()];
                return ALLOWANCE * force.abs();
            }
            let is_near_rest = drive.abs() < NEAR_REST * largest[0];
            let of_memory = if is_near_rest { ALLOWANCE_NEAR_REST } else { ALLOWANCE_OF_MEMORY };
            (ALLOWANCE * force.abs()).max(of_memory * largest[1])
        })
        .collect()
}

/// What readings err by.
struct ReadingErrors {
    /// Standard deviation of their noise, N.
    white_sd_n: f64,
    /// Standard deviation of the load cell's slow drift, N.
    drift_sd_n: f64,
    /// Allowance of each reading, N.
    allowance_n: Vec<f64>,
}

impl ReadingErrors {
    /// Covariance of the readings, N²: drift, noise, allowance, and an error of the force model that is a smooth
    /// function of the drive.
    fn covariance(&self, time_s: &[f64], drive_mm: &[f64], elastic_n: &[f64]) -> DMatrix<f64> {
        let largest_mm = drive_mm.iter().fold(1e-12f64, |s, d| s.max(d.abs()));
        DMatrix::from_fn(time_s.len(), time_s.len(), |i, j| {
            let drift = self.drift_sd_n.powi(2) * (-(time_s[i] - time_s[j]).abs() / DRIFT_TIME_S).exp();
            let apart = (drive_mm[i] - drive_mm[j]) / (SMOOTH_OVER * largest_mm);
            let smooth = ALLOWANCE.powi(2) * elastic_n[i] * elastic_n[j] * (-0.5 * apart * apart).exp();
            let each = if i == j { self.white_sd_n.powi(2) + self.allowance_n[i].powi(2) } else { 0.0 };
            drift + smooth + each
        })
    }
}
