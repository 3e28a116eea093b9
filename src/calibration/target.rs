//! What a fit compares with: measured values, their weights in the objective, and the noise that they carry.
//!
//! The objective is Σ_drives [ Σ_voxels Σ_c p_c (u_c − ū_c)² + p_F (F − F_model)² ]. With p = 1/σ² it is χ²; what is
//! unknown of the load cell then couples the forces (see [`super::all_forces`]). With other p (the paper's
//! ℓ_u + βℓ_F, or values that share their noise with their neighbours) the covariance of the estimate is a sandwich of
//! the objective's curvature and the noise's true covariance.

use super::error::CalibrationError;
use super::force_readings::{ForceOnTheWay, LoadCell};
use super::observed::{Observed, View};
use super::prediction::Prediction;
use super::synthetic::Measurement;
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
    /// p of each voxel and component, mm⁻²: zero where missing or not measured.
    pub(super) precision: Vec<[f64; 3]>,
    /// Variance of the noise of each voxel and component, mm²; of filtered values as of a mean of eight; zero where it
    /// has no bound, as of what is not measured, so that its products with a weight of zero are numbers.
    noise_mm2: Vec<[f64; 3]>,
    pub(super) force: Option<TargetForce>,
}

/// Whether any component counts.
fn has_weight(precision: &[f64; 3]) -> bool {
    precision.iter().any(|p| *p > 0.0)
}

/// The variance in products with weights, which are zero where it has no bound.
fn where_bounded(noise_mm2: [f64; 3]) -> [f64; 3] {
    noise_mm2.map(|variance| if variance.is_finite() { variance } else { 0.0 })
}

impl<'a> TargetStep<'a> {
    /// A force alone.
    fn of_force(reading: &ForceOnTheWay) -> TargetStep<'a> {
        let sd_n = reading.force.sd_n;
        let force = TargetForce { value_n: reading.force.value_n, sd_n, weight: 1.0 / (sd_n * sd_n) };
        TargetStep { measured: &[], precision: Vec::new(), noise_mm2: Vec::new(), force: Some(force) }
    }

    /// Whether anything but a force was measured.
    pub(super) fn is_scanned(&self) -> bool {
        !self.precision.is_empty()
    }

    /// Places of the voxels that count.
    pub(super) fn used(&self) -> impl Iterator<Item = usize> {
        self.precision.iter().enumerate().filter(|(_, p)| has_weight(p)).map(|(v, _)| v)
    }

    /// Gives the force the weight of the paper's loss.
    fn weigh_force_by_paper(&mut self, scale: f64) {
        if let Some(force) = &mut self.force {
            force.weight = scale / (force.value_n * force.value_n);
        }
    }
}

/// All of one recording.
#[derive(Clone, Debug)]
pub(super) struct Target<'a> {
    /// Those of the scans, then those at which the force alone was read.
    pub(super) steps: Vec<TargetStep<'a>>,
    pub(super) load_cell: LoadCell,
    /// Whether the weights of the forces are the inverse of their covariance.
    pub(super) is_weighed_by_noise: bool,
    /// Of filtered data.
    view: Option<&'a View>,
}

impl<'a> Target<'a> {
    /// Of a synthetic measurement, with χ² as objective.
    pub(super) fn of_measurement(data: &'a Measurement, scan: &ScanSettings) -> Target<'a> {
        let weight = 1.0 / (scan.force_sd_n * scan.force_sd_n);
        // The variance of a voxel of weight w is σ²/w.
        let sd_mm = scan.noise().displacement_sd_mm;
        let noise_of = |w: &[f64; 3]| {
            let variance = |c: usize| if w[c] > 0.0 { sd_mm[c] * sd_mm[c] / w[c] } else { 0.0 };
            where_bounded([0, 1, 2].map(variance))
        };
        let precision_of = |w: &[f64; 3]| [0, 1, 2].map(|c| w[c] / (sd_mm[c] * sd_mm[c]));
        let steps = (0..data.drives_mm.len())
            .map(|d| TargetStep {
                measured: &data.displacements[d],
                precision: data.weights_of(d).iter().map(precision_of).collect(),
                noise_mm2: data.weights_of(d).iter().map(noise_of).collect(),
                force: Some(TargetForce { value_n: data.forces_n[d], sd_n: scan.force_sd_n, weight }),
            })
            .chain(data.on_the_way.iter().map(TargetStep::of_force))
            .collect();
        Target { steps, load_cell: data.load_cell, is_weighed_by_noise: true, view: None }
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
            let weigh = |(u, noise): (&[f64; 3], &[f64; 3])| match is_whole(u) {
                true => noise.map(|variance| 1.0 / (shared * variance)),
                false => [0.0; 3],
            };
            let mut steps = Vec::with_capacity(recording.steps.len());
            for (number, step) in recording.steps.iter().enumerate() {
                let noise_mm2: Vec<[f64; 3]> =
                    (0..step.displacement.len()).map(|v| recording.noise_mm2(number, v)).collect();
                if !step.displacement.iter().any(is_whole) {
                    let name = "the number of voxels with a displacement";
                    return Err(CalibrationError::InvalidValue { name, value: 0.0, requirement: "positive" });
                }
                steps.push(TargetStep {
                    measured: &step.displacement,
                    precision: step.displacement.iter().zip(&noise_mm2).map(weigh).collect(),
                    noise_mm2: noise_mm2.into_iter().map(where_bounded).collect(),
                    force: step.force.map(|f| TargetForce {
                        value_n: f.value_n,
                        sd_n: f.sd_n,
                        weight: 1.0 / (f.sd_n * f.sd_n),
                    }),
                });
            }
            steps.extend(recording.on_the_way.iter().map(TargetStep::of_force));
            let view = view.is_filtered().then_some(view);
            targets.push(Target { steps, load_cell: recording.load_cell, is_weighed_by_noise: true, view });
        }
        if let Objective::Paper { beta } = objective {
            let num_steps: usize = targets.iter().flat_map(|t| &t.steps).filter(|s| s.is_scanned()).count();
            let num_forces = targets.iter().flat_map(|t| &t.steps).filter(|s| s.force.is_some()).count();
            // ℓ × scale is χ² where the noise is the mean one and |u|_max that of the first step.
            let mut scale = None;
            for (target, recording) in targets.iter_mut().zip(observed) {
                let num_measured = recording.mask.grid.measured().into_iter().filter(|m| *m).count() as f64;
                let precision = recording.noise_sd_mm.iter().map(|sd| 1.0 / (sd * sd)).sum::<f64>() / num_measured;
                target.is_weighed_by_noise = false;
                for step in &mut target.steps {
                    if !step.is_scanned() {
                        // Its force weighs as those of the scans do.
                        let scale = scale.unwrap_or(1.0);
                        step.weigh_force_by_paper(scale * beta / num_forces as f64);
                        continue;
                    }
                    let used = step.used().count() as f64;
                    let squares = step.measured.iter().filter(|u| is_whole(u)).map(|u| u.iter().map(|x| x * x).sum());
                    let largest: f64 = squares.fold(f64::MIN_POSITIVE, f64::max);
                    let scale = *scale.get_or_insert(precision * used * largest * num_steps as f64);
                    for precision in step.precision.iter_mut().flatten().filter(|p| **p > 0.0) {
                        *precision = scale / (used * largest * num_steps as f64);
                    }
                    step.weigh_force_by_paper(scale * beta / num_forces as f64);
                }
            }
        }
        Ok(targets)
    }

    /// The same weights for other values: displacements per drive, and forces (N) where there were forces.
    pub(super) fn with_measured(&self, displacements: &'a [Vec<[f64; 3]>], forces_n: &[f64]) -> Target<'a> {
        let mut other = self.clone();
        for ((step, field), force_n) in other.steps.iter_mut().zip(displacements).zip(forces_n) {
            if step.is_scanned() {
                step.measured = field;
            }
            if let Some(force) = &mut step.force {
                force.value_n = *force_n;
            }
        }
        other
    }

    /// The forces that are compared, with the place of each among the steps.
    pub(super) fn forces(&self) -> impl Iterator<Item = (usize, TargetForce)> {
        self.steps.iter().enumerate().filter_map(|(d, step)| Some((d, step.force?)))
    }

    /// Expected objective of pure noise, and the number of data.
    pub(super) fn expectation(&self) -> (f64, usize) {
        let averaged = self.view.map(View::num_averaged);
        let (mut sum, mut count) = (0.0, 0);
        for step in &self.steps {
            for v in step.used() {
                // A mean of n acquired values has 8/n of the variance of a mean of eight.
                let share = averaged.as_ref().map_or(1.0, |a| 8.0 / a[v] as f64);
                for c in 0..3 {
                    sum += step.precision[v][c] * share * step.noise_mm2[v][c];
                }
                count += step.precision[v].iter().filter(|p| **p > 0.0).count();
            }
            if let Some(force) = step.force {
                sum += force.weight * force.sd_n * force.sd_n;
                count += 1;
            }
        }
        (sum, count)
    }

    /// Adds what the displacements' noise gives the covariance of the objective's half gradient.
    pub(super) fn add_score(&self, prediction: &Prediction, score: &mut DMatrix<f64>) -> Result<(), CalibrationError> {
        let n = score.nrows();
        for (step, (fields, _)) in self.steps.iter().zip(prediction.derivatives()).filter(|(s, _)| s.is_scanned()) {
            // What a change of each value by the standard deviation of its noise adds to the half gradient; missing
            // voxels have no weight, and what stands there must not enter a product.
            let of_field = |field: &Vec<[f64; 3]>| -> Vec<[f64; 3]> {
                let mut weighted = vec![[0.0; 3]; field.len()];
                for v in step.used() {
                    let (precision, noise_mm2) = (step.precision[v], step.noise_mm2[v]);
                    weighted[v] = [0, 1, 2].map(|c| precision[c] * noise_mm2[c].sqrt() * field[v][c]);
                }
                weighted
            };
            let weighted: Vec<Vec<[f64; 3]>> = fields.iter().map(of_field).collect();
            let (weighted, share) = match self.view {
                // Acquired noise is √8 that of a mean of eight.
                Some(view) => {
                    let acquired: Result<Vec<_>, _> = weighted.iter().map(|q| view.on_acquired(q)).collect();
                    (acquired?, 8.0)
                }
                None => (weighted, 1.0),
            };
            for i in 0..n {
                for j in 0..=i {
                    let pairs = weighted[i].iter().flatten().zip(weighted[j].iter().flatten());
                    let sum = share * pairs.map(|(a, b)| a * b).sum::<f64>();
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
