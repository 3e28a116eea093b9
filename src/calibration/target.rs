//! What a fit compares with: measured values, their weights in the objective, and the noise that they carry.
//!
//! The objective is Σ_drives [ Σ_voxels w Σ_c p_c (u_c − ū_c)² + p_F (F − F_model)² ]. With p = 1/σ² it is χ²; with
//! other p (the paper's ℓ_u + βℓ_F, or values that share their noise with their neighbours) the covariance of the
//! estimate is a sandwich of the objective's curvature and the noise's true covariance.

use super::error::CalibrationError;
use super::observed::{Observed, View};
use super::prediction::Prediction;
use super::synthetic::Measurement;
use crate::fem::Equilibrium;
use crate::sensitivity::ScanSettings;
use nalgebra::DMatrix;

/// What a fit minimises.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Objective {
    /// χ²: every value with the inverse of its variance. Values that share their noise (after a filter) count as one
    /// per acquired voxel.
    #[default]
    Weighted,
    /// The paper's ℓ_u + βℓ_F, means over the drives.
    Paper {
        /// β; the paper's is 4·10⁻⁴.
        beta: f64,
    },
}

/// β of the paper.
pub const PAPER_BETA: f64 = 4e-4;

/// A force to compare with.
#[derive(Clone, Copy, Debug)]
pub(super) struct TargetForce {
    pub(super) value_n: f64,
    pub(super) sd_n: f64,
    pub(super) weight: f64,
}

/// One drive.
#[derive(Clone, Debug)]
pub(super) struct TargetStep<'a> {
    pub(super) measured: &'a [[f64; 3]],
    /// w of each voxel: zero where missing; its noise variance is σ²/w.
    pub(super) weights: Vec<f64>,
    /// p of each component, mm⁻².
    pub(super) component_weights: [f64; 3],
    pub(super) force: Option<TargetForce>,
}

/// All of one recording.
#[derive(Clone, Debug)]
pub(super) struct Target<'a> {
    pub(super) steps: Vec<TargetStep<'a>>,
    noise_sd_mm: [f64; 3],
    /// Of filtered data.
    view: Option<&'a View>,
}

impl<'a> Target<'a> {
    /// Of a synthetic measurement, with χ² as objective.
    pub(super) fn of_measurement(data: &'a Measurement, scan: &ScanSettings) -> Target<'a> {
        let weight = 1.0 / (scan.force_sd_n * scan.force_sd_n);
        let steps = (0..data.drives_mm.len())
            .map(|d| TargetStep {
                measured: &data.displacements[d],
                weights: data.weights_of(d),
                component_weights: scan.noise_sd_mm.map(|sd| 1.0 / (sd * sd)),
                force: Some(TargetForce { value_n: data.forces_n[d], sd_n: scan.force_sd_n, weight }),
            })
            .collect();
        Target { steps, noise_sd_mm: scan.noise_sd_mm, view: None }
    }

    /// Of recordings. The paper's objective is multiplied by a constant that gives it the size of χ².
    pub(super) fn of_recordings(
        observed: &'a [Observed],
        views: &'a [View],
        objective: Objective,
    ) -> Result<Vec<Target<'a>>, CalibrationError> {
        let is_whole = |u: &[f64; 3]| u.iter().all(|x| x.is_finite());
        let mut targets: Vec<Target<'a>> = Vec::with_capacity(observed.len());
        for (recording, view) in observed.iter().zip(views) {
            let shared = recording.noise_correlation();
            let mut steps = Vec::with_capacity(recording.steps.len());
            for step in &recording.steps {
                let weights: Vec<f64> = step.displacement.iter().map(|u| f64::from(u8::from(is_whole(u)))).collect();
                if !weights.iter().any(|w| *w > 0.0) {
                    let name = "the number of voxels with a displacement";
                    return Err(CalibrationError::InvalidValue { name, value: 0.0, requirement: "positive" });
                }
                steps.push(TargetStep {
                    measured: &step.displacement,
                    weights,
                    component_weights: recording.noise_sd_mm.map(|sd| 1.0 / (shared * sd * sd)),
                    force: step.force.map(|f| TargetForce {
                        value_n: f.value_n,
                        sd_n: f.sd_n,
                        weight: 1.0 / (f.sd_n * f.sd_n),
                    }),
                });
            }
            let view = view.is_filtered().then_some(view);
            targets.push(Target { steps, noise_sd_mm: recording.noise_sd_mm, view });
        }
        if let Objective::Paper { beta } = objective {
            let num_steps: usize = targets.iter().map(|t| t.steps.len()).sum();
            let num_forces = targets.iter().flat_map(|t| &t.steps).filter(|s| s.force.is_some()).count();
            // ℓ × scale is χ² where the noise is the mean one and |u|_max that of the first step.
            let mut scale = None;
            for target in &mut targets {
                let precision = target.noise_sd_mm.iter().map(|sd| 1.0 / (sd * sd)).sum::<f64>() / 3.0;
                for step in &mut target.steps {
                    let used = step.weights.iter().filter(|w| **w > 0.0).count() as f64;
                    let squares = step.measured.iter().filter(|u| is_whole(u)).map(|u| u.iter().map(|x| x * x).sum());
                    let largest: f64 = squares.fold(f64::MIN_POSITIVE, f64::max);
                    let scale = *scale.get_or_insert(precision * used * largest * num_steps as f64);
                    step.component_weights = [scale / (used * largest * num_steps as f64); 3];
                    if let Some(force) = &mut step.force {
                        force.weight = scale * beta / (force.value_n * force.value_n * num_forces as f64);
                    }
                }
            }
        }
        Ok(targets)
    }

    /// The same weights for other values: displacements per drive, and forces of `states` where there were forces.
    pub(super) fn with_measured(&self, displacements: &'a [Vec<[f64; 3]>], states: &[Equilibrium]) -> Target<'a> {
        let mut other = self.clone();
        for ((step, field), state) in other.steps.iter_mut().zip(displacements).zip(states) {
            step.measured = field;
            if let Some(force) = &mut step.force {
                force.value_n = state.force_n;
            }
        }
        other
    }

    /// Expected objective of pure noise, and the number of data.
    pub(super) fn expectation(&self) -> (f64, usize) {
        let averaged = self.view.map(View::num_averaged);
        let (mut sum, mut count) = (0.0, 0);
        for step in &self.steps {
            for (v, weight) in step.weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
                // A mean of n acquired values has 8/n of the variance of a mean of eight.
                let share = averaged.as_ref().map_or(1.0 / weight, |a| 8.0 / a[v] as f64);
                for c in 0..3 {
                    let variance = share * self.noise_sd_mm[c] * self.noise_sd_mm[c];
                    sum += weight * step.component_weights[c] * variance;
                }
                count += 3;
            }
            if let Some(force) = step.force {
                sum += force.weight * force.sd_n * force.sd_n;
                count += 1;
            }
        }
        (sum, count)
    }

    /// Adds the covariance of the objective's half gradient under the noise, in the parameters' units.
    pub(super) fn add_score(&self, prediction: &Prediction, score: &mut DMatrix<f64>) -> Result<(), CalibrationError> {
        let n = score.nrows();
        for (step, (fields, forces)) in self.steps.iter().zip(prediction.derivatives()) {
            let weighted: Vec<Vec<[f64; 3]>> =
                fields
                    .iter()
                    .map(|field| {
                        field
                            .iter()
                            .zip(&step.weights)
                            // Missing voxels have no weight; what stands there must not enter a product.
                            .map(|(s, w)| {
                                if *w > 0.0 {
                                    [0, 1, 2].map(|c| w * step.component_weights[c] * s[c])
                                } else {
                                    [0.0; 3]
                                }
                            })
                            .collect()
                    })
                    .collect();
            let (weighted, spread, share) = match self.view {
                // Acquired noise is √8 that of a mean of eight.
                Some(view) => {
                    let acquired: Result<Vec<_>, _> = weighted.iter().map(|q| view.on_acquired(q)).collect();
                    (acquired?, Vec::new(), 8.0)
                }
                None => (weighted, step.weights.clone(), 1.0),
            };
            for i in 0..n {
                for j in 0..=i {
                    let mut sum = 0.0;
                    for (v, (a, b)) in weighted[i].iter().zip(&weighted[j]).enumerate() {
                        let variance = match spread.get(v) {
                            Some(w) if *w > 0.0 => 1.0 / w,
                            Some(_) => continue,
                            None => share,
                        };
                        for c in 0..3 {
                            sum += variance * self.noise_sd_mm[c] * self.noise_sd_mm[c] * a[c] * b[c];
                        }
                    }
                    if let Some(force) = step.force {
                        sum += (force.weight * force.sd_n).powi(2) * forces[i] * forces[j];
                    }
                    score[(i, j)] += sum;
                    if i != j {
                        score[(j, i)] += sum;
                    }
                }
            }
        }
        Ok(())
    }
}
