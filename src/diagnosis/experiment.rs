//! The experiment that would tell two explanations apart.
//!
//! Both explanations fit what was recorded. How well a further step at another drive would tell them apart is a least
//! squares distance: from the first explanation's prediction of that step to the nearest prediction that the second one
//! can give while it still fits the recording at hand (T-optimality: Atkinson and Fedorov 1975).

use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::fit::{derivatives, normal_matrix};
use super::inference::Inference;
use super::laboratory::Laboratory;
use super::metric::Metric;
use super::prior::FitSettings;
use crate::calibration::{Observed, ObservedForce, ObservedStep};
use crate::mesh::MeshOptions;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Drives looked at, relative to the largest one recorded: that one again, farther, half way, and the other way.
const DRIVES: [f64; 4] = [1.0, 1.5, 0.5, -1.0];

/// A further step of the same sample under the same scan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = TellingExperiment)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// Drive, mm.
    pub drive_mm: f64,
    /// Distance of the two explanations there, in standard deviations.
    pub distance_sd: f64,
}

/// Experiments that tell `other` from `best`, most telling first; drives without an equilibrium are left out.
///
/// # Errors
/// [`DiagnosisError`]: the work was cancelled, or the specimen cannot be meshed.
pub(super) fn experiments(
    inference: &mut Inference,
    [best, other]: [&CauseFit; 2],
) -> Result<Vec<Experiment>, DiagnosisError> {
    let Inference { laboratory, metric, settings, mesh_factor, allowance_mm, is_cancelled, .. } = inference;
    let observed = laboratory.observed();
    let known = information(laboratory, metric, other, settings)?;
    let last = observed.steps.iter().max_by(|a, b| a.drive_mm.abs().total_cmp(&b.drive_mm.abs()));
    let Some(last) = last else { return Ok(Vec::new()) };
    let mut found = Vec::new();
    for part in DRIVES {
        let drive_mm = part * last.drive_mm;
        // What the load train takes follows the force, here that of the recorded step in proportion.
        let force = last.force.map(|f| ObservedForce { value_n: part * f.value_n, sd_n: f.sd_n });
        let step = ObservedStep {
            drive_mm,
            force,
            displacement: vec![[0.0; 3]; observed.mask.num_voxels()],
            relative_noise: last.relative_noise.clone(),
            faces_per_mm: last.faces_per_mm.clone(),
        };
        let mut planned: Observed = observed.clone();
        planned.steps = vec![step];
        let metric = Metric::new(&planned, *allowance_mm * part.abs(), &|_| true);
        let mut there = Laboratory::new(&planned, &MeshOptions::scaled(&planned.specimen, *mesh_factor))?;
        let ours = there.predict(&best.material, &best.scene(), is_cancelled);
        let theirs = there.predict(&other.material, &other.scene(), is_cancelled);
        if is_cancelled() {
            return Err(DiagnosisError::Solve(crate::fem::SolveError::Cancelled { reached_mm: drive_mm }));
        }
        let (Ok(ours), Ok(theirs)) = (ours, theirs) else { continue };
        let Ok(columns) = derivatives(&mut there, &other.material, &other.causes, &theirs) else { continue };
        let apart = metric.weigh(&ours.trace.plus(-1.0, &theirs.trace));
        let weighed = metric.weigh_all(&columns);
        let gradient = DVector::from_iterator(weighed.len(), weighed.iter().map(|c| metric.inner(c, &apart)));
        let own = metric.products(&weighed, &weighed);
        let Some(factor) = (&known + own).cholesky() else { continue };
        let squared = metric.inner(&apart, &apart) - gradient.dot(&factor.solve(&gradient));
        found.push(Experiment { drive_mm, distance_sd: squared.max(0.0).sqrt() });
    }
    found.sort_by(|a, b| b.distance_sd.total_cmp(&a.distance_sd));
    Ok(found)
}

/// What the recording at hand and the priors know of the parameters.
fn information(
    laboratory: &mut Laboratory,
    metric: &Metric,
    fitted: &CauseFit,
    settings: &FitSettings,
) -> Result<DMatrix<f64>, DiagnosisError> {
    let columns = derivatives(laboratory, &fitted.material, &fitted.causes, &fitted.prediction)?;
    let weighed = metric.weigh_all(&columns);
    Ok(normal_matrix(metric, &weighed, &fitted.material, &fitted.causes, settings))
}
