//! A diagnosed recording, ready to be fitted and predicted with others.

use super::error::DiagnosisError;
use super::laboratory::Laboratory;
use super::load_curve::take_off_effects;
use super::metric::Metric;
use super::outcome::Diagnosis;
use super::trace::Trace;
use crate::mesh::MeshOptions;

/// One diagnosed recording.
pub(super) struct Case<'a> {
    /// Its name.
    pub(super) name: &'a str,
    /// What was found.
    pub(super) found: &'a Diagnosis,
    /// Predicts it.
    pub(super) laboratory: Laboratory<'a>,
    /// The weights of its misfit, as in the last fit of the diagnosis.
    pub(super) metric: Metric,
    /// Noise alone, as χ² weighs it.
    pub(super) noise: Metric,
    /// What was recorded, less what the load curve explained and what the mesh gets wrong.
    pub(super) measured: Trace,
}

impl<'a> Case<'a> {
    /// As the diagnosis compared it.
    ///
    /// # Errors
    /// [`DiagnosisError`]: the specimen cannot be meshed.
    pub(super) fn new(name: &'a str, found: &'a Diagnosis, mesh_factor: f64) -> Result<Case<'a>, DiagnosisError> {
        let mesh = MeshOptions::scaled(&found.observed.specimen, mesh_factor);
        let laboratory = Laboratory::new(&found.observed, &mesh)?;
        let mut measured = laboratory.measured();
        // As in the diagnosis: what the load curve explained is taken off, and what the mesh gets wrong.
        take_off_effects(&mut measured, found.load.as_ref());
        if let Some(defect) = &found.mesh_defect {
            measured = defect.taken_off(&measured);
        }
        let metric = Metric::new(&found.observed, found.allowance_mm, &|_| true);
        let metric = match found.discrepancy_mm2.iter().any(|v| *v > 0.0) {
            true => metric.with_variance(found.discrepancy_mm2),
            false => metric,
        };
        let noise = Metric::new(&found.observed, 0.0, &|_| true);
        Ok(Case { name, found, laboratory, metric, noise, measured })
    }
}
