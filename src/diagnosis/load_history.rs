//! What the load curve says: relaxation, softening, the load cell's zero, friction.
//!
//! The force is F(t) = Prony ∗ [η F∞(d(t))] + offset + friction · direction of motion. F∞ is the finite element force over
//! drive, its material free (to first order). η = 1 − ρ erf((W_max − W)/m) is Ogden and Roxburgh's softening with the work
//! W(d) = ∫ F∞ dd of the whole sample in place of the local energy. The Prony series acts on the isochoric second
//! Piola–Kirchhoff stress of every point (Simo 1987; see [`super::memory_kernel`]): at large shear the memory of the stress and
//! that of the force differ.
//!
//! Readings carry white noise and a slow drift; both are in the weights.

use super::error::DiagnosisError;
use super::memory_kernel::MemoryKernel;
use crate::homogeneous::{LeastSquaresOptions, Limit, covariance, erf, minimise};
use crate::rate::{ForceTable, memory};
use crate::recording::LoadCurve;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use serde::{Deserialize, Serialize};

/// Correlation time of the load cell's drift, s.
const DRIFT_TIME_S: f64 = 20.0;
/// Most readings looked at; longer curves are thinned.
const MAX_READINGS: usize = 1200;
/// A further effect must lower the deviance by ln n per parameter and this much more.
const EVIDENCE: f64 = 12.0;
/// … and by this part of what the effects before it explained: their models err by some percent. Further relaxations are parts of
/// one model.
const SMALLEST_SHARE: f64 = 0.02;

/// Allowance of the force model, relative to the force: common effects of the mesh are in the free material.
const ALLOWANCE: f64 = 0.002;
/// Allowance below the largest drive so far, relative to the force there: the deformation of a sample that remembers is not quite
/// that of the elastic one.
const ALLOWANCE_OF_MEMORY: f64 = 0.004;
/// … and near zero drive, within this part of the largest so far, where the force is all memory.
const NEAR_REST: f64 = 0.15;
const ALLOWANCE_NEAR_REST: f64 = 0.03;
/// Start times of a relaxation, s.
const START_TIMES_S: [f64; 4] = [2.0, 8.0, 30.0, 100.0];

/// Elastic force over drive with its derivatives with respect to scaled material parameters.
pub struct ElasticTable {
    force: ForceTable,
    derivatives: Vec<ForceTable>,
    /// W over drive.
    work: ForceTable,
}

impl ElasticTable {
    /// From forces (N) and derivatives at rising drives (mm) that start at zero.
    ///
    /// # Errors
    /// [`DiagnosisError::Setting`] where the drives do not rise.
    pub fn new(drives_mm: &[f64], forces_n: &[f64], derivatives: &[Vec<f64>]) -> Result<ElasticTable, DiagnosisError> {
        let table = |values: &[f64]| {
            ForceTable::new(drives_mm, values).map_err(|_| DiagnosisError::Setting {
                name: "the number of drives of the load curve's table",
                value: drives_mm.len() as f64,
                requirement: "at least two rising drives",
            })
        };
        let force = table(forces_n)?;
        let mut work = vec![0.0];
        for pair in 0..drives_mm.len().saturating_sub(1) {
            let mean = 0.5 * (forces_n[pair] + forces_n[pair + 1]);
            work.push(work[pair] + mean * (drives_mm[pair + 1] - drives_mm[pair]));
        }
        Ok(ElasticTable {
            force,
            derivatives: derivatives.iter().map(|d| table(d)).collect::<Result<_, _>>()?,
            work: table(&work)?,
        })
    }

    fn at(table: &ForceTable, drive: f64) -> f64 {
        // The response to the other direction is the mirror image.
        let limit = table.range()[1];
        let value = table.at(drive.abs().min(limit)).map_or(0.0, |v| v.0);
        value * drive.signum()
    }
}

/// An effect on the load curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LoadEffect {
    /// A relaxation: g and τ.
    Relaxation,
    /// Softening: ρ = 1/r and m / largest work.
    Mullins,
    /// Offset of the load cell.
    Offset,
    /// Friction against the motion.
    Friction,
}

impl LoadEffect {
    /// The cause that it is a part of.
    pub fn cause(self) -> &'static str {
        match self {
            LoadEffect::Relaxation => "relaxation",
            LoadEffect::Mullins => "mullins",
            LoadEffect::Offset | LoadEffect::Friction => "cell",
        }
    }

    fn num_parameters(self) -> usize {
        match self {
            LoadEffect::Relaxation | LoadEffect::Mullins => 2,
            LoadEffect::Offset | LoadEffect::Friction => 1,
        }
    }
}

/// A fitted effect.
#[derive(Clone, Debug)]
pub struct FittedEffect {
    /// Which.
    pub effect: LoadEffect,
    /// g and τ (s); ρ and m/W_max; offset (N); friction (N).
    pub values: Vec<f64>,
    /// Standard deviations.
    pub sd: Vec<f64>,
    /// Fall of the deviance when it was added.
    pub gained: f64,
}

/// What was found in a load curve.
#[derive(Clone, Debug)]
pub struct LoadHistoryFit {
    /// Effects in the order found.
    pub effects: Vec<FittedEffect>,
    /// Deviance without and with them.
    pub deviance: [f64; 2],
    /// Readings used.
    pub num_readings: usize,
    /// Times of the readings used, s.
    pub time_s: Vec<f64>,
    /// Force without and with the effects, N.
    pub force_n: [Vec<f64>; 2],
    /// The readings, N.
    pub measured_n: Vec<f64>,
    /// Per window: mean of the effects' part of the force, N.
    pub window_excess_n: Vec<f64>,
    /// Root mean square misfit without and with the effects, N.
    pub rms_n: [f64; 2],
}

struct Problem {
    time_s: Vec<f64>,
    measured: Vec<f64>,
    direction: Vec<f64>,
    elastic: Vec<f64>,
    derivatives: Vec<Vec<f64>>,
    work: Vec<f64>,
    largest_work: f64,
    /// Per row of the memory kernel: its history, N.
    histories: Vec<Vec<f64>>,
    /// Per reading: rows and weights that make the force of what is remembered.
    rows: Vec<Vec<(usize, f64)>>,
    whitener: Cholesky<f64, Dyn>,
}

impl Problem {
    /// Force at every reading with parameters: scaled material changes, then the effects'. Also the elastic force alone.
    fn force(&self, effects: &[LoadEffect], p: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let num_material = self.derivatives.len();
        let mut elastic = self.elastic.clone();
        for (d, x) in self.derivatives.iter().zip(p) {
            for (e, d) in elastic.iter_mut().zip(d) {
                *e += x * d;
            }
        }
        // What the material and softening make of the nominal force; it scales what relaxes.
        let mut factor: Vec<f64> = elastic
            .iter()
            .zip(&self.elastic)
            .map(|(now, then)| if then.abs() > 0.0 { now / then } else { 1.0 })
            .collect();
        let mut relaxations = Vec::new();
        let mut added = vec![0.0; elastic.len()];
        let mut at = num_material;
        for effect in effects {
            match effect {
                LoadEffect::Relaxation => relaxations.push((p[at], p[at + 1].exp())),
                LoadEffect::Mullins => {
                    let (rho, width) = (p[at], p[at + 1].exp() * self.largest_work);
                    let mut largest = 0.0f64;
                    for (f, w) in factor.iter_mut().zip(&self.work) {
                        largest = largest.max(*w);
                        *f *= 1.0 - rho * erf((largest - w) / width);
                    }
                }
                LoadEffect::Offset => added.iter_mut().for_each(|a| *a += p[at]),
                LoadEffect::Friction => added.iter_mut().zip(&self.direction).for_each(|(a, d)| *a += p[at] * d),
            }
            at += effect.num_parameters();
        }
        let mut force: Vec<f64> = self.elastic.iter().zip(&factor).map(|(e, f)| e * f).collect();
        for &(strength, time_s) in &relaxations {
            let kept: Vec<Vec<f64>> = self
                .histories
                .iter()
                .map(|history| {
                    let scaled: Vec<f64> = history.iter().zip(&factor).map(|(h, f)| h * f).collect();
                    memory(&self.time_s, &scaled, time_s).0
                })
                .collect();
            for (n, (f, rows)) in force.iter_mut().zip(&self.rows).enumerate() {
                *f += strength * rows.iter().map(|(row, weight)| weight * kept[*row][n]).sum::<f64>();
            }
        }
        force.iter_mut().zip(&added).for_each(|(f, a)| *f += a);
        (force, elastic)
    }

    fn whitened(&self, values: &[f64]) -> DVector<f64> {
        let mut x = DVector::from_column_slice(values);
        self.whitener.l_dirty().solve_lower_triangular_mut(&mut x);
        x
    }

    /// Residuals and Jacobian, whitened.
    fn evaluate(&self, effects: &[LoadEffect], p: &[f64]) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let (force, _) = self.force(effects, p);
        if force.iter().any(|f| !f.is_finite()) {
            return None;
        }
        let misfit: Vec<f64> = force.iter().zip(&self.measured).map(|(f, m)| f - m).collect();
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

    fn fit(&self, effects: &[LoadEffect], start: &[f64]) -> Option<(f64, Vec<f64>, Vec<f64>)> {
        let num_material = self.derivatives.len();
        let duration = self.time_s.last()? - self.time_s.first()?;
        let mut limits = Vec::new();
        let mut largest_step = vec![0.3; num_material];
        let mut bound = |i: usize, low: f64, high: f64| {
            limits.push(Limit::at_least(i, low));
            limits.push(Limit::at_most(i, high));
        };
        for i in 0..num_material {
            bound(i, -0.8, 4.0);
        }
        let mut at = num_material;
        for effect in effects {
            match effect {
                LoadEffect::Relaxation => {
                    bound(at, 0.0, 10.0);
                    // A relaxation longer than half the record is not told from elasticity.
                    bound(at + 1, 0.2f64.ln(), (0.5 * duration.max(2.0)).ln());
                    largest_step.extend([0.5, 0.7]);
                }
                LoadEffect::Mullins => {
                    bound(at, 0.0, 0.95);
                    bound(at + 1, 0.01f64.ln(), 3f64.ln());
                    largest_step.extend([0.3, 0.7]);
                }
                LoadEffect::Offset => largest_step.push(1e3),
                LoadEffect::Friction => {
                    bound(at, 0.0, 1e3);
                    largest_step.push(1e3);
                }
            }
            at += effect.num_parameters();
        }
        let options = LeastSquaresOptions { max_evaluations: 60, tolerance: 1e-6 };
        let found = minimise(start, &limits, &largest_step, &options, &mut |p| self.evaluate(effects, p))?;
        let (matrix, known) = covariance(&found.jacobian, 1.0, 1e-10);
        let sd =
            (0..start.len()).map(|i| if known[i] { matrix[(i, i)].max(0.0).sqrt() } else { f64::INFINITY }).collect();
        Some((found.sum_of_squares, found.parameters, sd))
    }
}

/// Gain, effect, deviance, parameters and their standard deviations of a fit.
type Trial = (f64, LoadEffect, f64, Vec<f64>, Vec<f64>);

/// Looks for effects in a load curve whose elastic force is `table` and whose memory is `kernel`; `drift_sd_n` is the standard
/// deviation of the load cell's slow drift, `windows_s` are the steps' windows; only effects that are allowed are supposed.
pub fn fit_load_history(
    curve: &LoadCurve,
    table: &ElasticTable,
    kernel: &MemoryKernel,
    drift_sd_n: f64,
    windows_s: &[Option<[f64; 2]>],
    is_allowed: &dyn Fn(LoadEffect) -> bool,
) -> Option<LoadHistoryFit> {
    let problem = prepare(curve, table, kernel, drift_sd_n)?;
    let num_material = problem.derivatives.len();
    let mut effects: Vec<LoadEffect> = Vec::new();
    let mut gained: Vec<f64> = Vec::new();
    let (nominal_deviance, mut best, mut sd) = problem.fit(&[], &vec![0.0; num_material])?;
    let nominal = problem.force(&[], &best).0;
    let mut deviance = nominal_deviance;
    let n = problem.measured.len() as f64;
    loop {
        let mut found: Option<Trial> = None;
        let candidates = [LoadEffect::Offset, LoadEffect::Friction, LoadEffect::Mullins, LoadEffect::Relaxation];
        for candidate in candidates {
            let count = effects.iter().filter(|e| **e == candidate).count();
            let most = if candidate == LoadEffect::Relaxation { 3 } else { 1 };
            if count >= most || !is_allowed(candidate) {
                continue;
            }
            let mut trial = effects.clone();
            trial.push(candidate);
            let starts: Vec<Vec<f64>> = match candidate {
                LoadEffect::Relaxation => START_TIMES_S.iter().map(|t| vec![0.05, t.ln()]).collect(),
                LoadEffect::Mullins => vec![vec![0.1, 0.1f64.ln()], vec![0.1, 0.5f64.ln()]],
                LoadEffect::Offset | LoadEffect::Friction => vec![vec![0.01]],
            };
            for start in starts {
                let whole: Vec<f64> = best.iter().copied().chain(start).collect();
                let Some((d, p, s)) = problem.fit(&trial, &whole) else { continue };
                let gain = deviance - d - candidate.num_parameters() as f64 * n.ln();
                if found.as_ref().is_none_or(|f| gain > f.0) {
                    found = Some((gain, candidate, d, p, s));
                }
            }
        }
        let Some((gain, effect, d, p, s)) = found else { break };
        let is_further = effect == LoadEffect::Relaxation && effects.contains(&effect);
        let share = if is_further { 0.0 } else { SMALLEST_SHARE };
        if gain < EVIDENCE.max(share * (nominal_deviance - deviance)) || effects.len() >= 5 {
            break;
        }
        effects.push(effect);
        gained.push(deviance - d);
        (deviance, best, sd) = (d, p, s);
    }
    let (force, elastic) = problem.force(&effects, &best);
    let mut at = num_material;
    let mut fitted = Vec::new();
    for (effect, gained) in effects.iter().zip(gained) {
        let m = effect.num_parameters();
        let (mut values, mut sds) = (best[at..at + m].to_vec(), sd[at..at + m].to_vec());
        if matches!(effect, LoadEffect::Relaxation | LoadEffect::Mullins) {
            values[1] = values[1].exp();
            sds[1] *= values[1];
        }
        fitted.push(FittedEffect { effect: *effect, values, sd: sds, gained });
        at += m;
    }
    let mean_in = |[start, end]: [f64; 2]| {
        let inside: Vec<f64> = problem
            .time_s
            .iter()
            .zip(force.iter().zip(&elastic))
            .filter(|(t, _)| **t >= start && **t <= end)
            .map(|(_, (f, e))| f - e)
            .collect();
        if inside.is_empty() { 0.0 } else { inside.iter().sum::<f64>() / inside.len() as f64 }
    };
    let rms = |model: &[f64]| {
        let sum: f64 = model.iter().zip(&problem.measured).map(|(a, b)| (a - b).powi(2)).sum();
        (sum / n).sqrt()
    };
    Some(LoadHistoryFit {
        effects: fitted,
        deviance: [nominal_deviance, deviance],
        num_readings: problem.measured.len(),
        window_excess_n: windows_s.iter().map(|w| w.map_or(0.0, mean_in)).collect(),
        rms_n: [rms(&nominal), rms(&force)],
        force_n: [nominal, force],
        time_s: problem.time_s,
        measured_n: problem.measured,
    })
}

fn prepare(curve: &LoadCurve, table: &ElasticTable, kernel: &MemoryKernel, drift_sd_n: f64) -> Option<Problem> {
    let every = curve.time_s.len().div_ceil(MAX_READINGS).max(1);
    let pick = |values: &[f64]| -> Vec<f64> { values.iter().copied().step_by(every).collect() };
    let (mut time_s, mut drive_mm, mut measured) = (pick(&curve.time_s), pick(&curve.drive_mm), pick(&curve.force_n));
    // Readings at one time add nothing.
    let keep: Vec<bool> = (0..time_s.len()).map(|i| i == 0 || time_s[i] > time_s[i - 1]).collect();
    for list in [&mut time_s, &mut drive_mm, &mut measured] {
        let mut k = keep.iter();
        list.retain(|_| *k.next().unwrap_or(&false));
    }
    let n = measured.len();
    if n < 20 {
        return None;
    }
    let mut direction = vec![0.0; n];
    for i in 1..n {
        let change = drive_mm[i] - drive_mm[i - 1];
        direction[i] = if change.abs() > 1e-9 { change.signum() } else { direction[i - 1] };
    }
    let elastic: Vec<f64> = drive_mm.iter().map(|d| ElasticTable::at(&table.force, *d)).collect();
    let derivatives =
        table.derivatives.iter().map(|t| drive_mm.iter().map(|d| ElasticTable::at(t, *d)).collect()).collect();
    let work: Vec<f64> = drive_mm.iter().map(|d| ElasticTable::at(&table.work, d.abs())).collect();
    let largest_work = work.iter().fold(1e-12f64, |s, w| s.max(*w));
    // White noise from second differences while the drive rests.
    let mut differences: Vec<f64> = (1..n.saturating_sub(1))
        .filter(|&i| (drive_mm[i + 1] - drive_mm[i - 1]).abs() < 1e-9)
        .map(|i| (measured[i + 1] - 2.0 * measured[i] + measured[i - 1]).abs())
        .collect();
    differences.sort_by(f64::total_cmp);
    let white = match differences.len() {
        0..10 => drift_sd_n,
        m => (1.4826 * differences[m / 2] / 6f64.sqrt()).max(1e-3 * drift_sd_n),
    };
    let mut largest = [0.0f64; 2];
    let allowance: Vec<f64> = drive_mm
        .iter()
        .zip(&elastic)
        .map(|(drive, force)| {
            if drive.abs() >= largest[0] {
                largest = [drive.abs(), force.abs()];
                return ALLOWANCE * force.abs();
            }
            let is_near_rest = drive.abs() < NEAR_REST * largest[0];
            let of_memory = if is_near_rest { ALLOWANCE_NEAR_REST } else { ALLOWANCE_OF_MEMORY };
            (ALLOWANCE * force.abs()).max(of_memory * largest[1])
        })
        .collect();
    let matrix = DMatrix::from_fn(n, n, |i, j| {
        let drift = drift_sd_n * drift_sd_n * (-(time_s[i] - time_s[j]).abs() / DRIFT_TIME_S).exp();
        let each = if i == j { white * white + allowance[i] * allowance[i] } else { 0.0 };
        drift + each
    });
    let whitener = Cholesky::new(matrix)?;
    let histories = kernel.histories(&drive_mm);
    let rows = drive_mm.iter().map(|d| kernel.weights(*d)).collect();
    let known =
        Problem { time_s, measured, direction, elastic, derivatives, work, largest_work, histories, rows, whitener };
    Some(known)
}
