//! What meshes and soft edges do to estimates.
//!
//! Noise alone gives intervals that are far too narrow: 20,000 voxels average it out. What is left is the error of the
//! mesh, of ours and, where data are synthetic, of the mesh that they come from. Two things are done about it:
//!
//! * A fit is corrected by the prediction of a finer mesh ([`Finer`]).
//! * The standard deviations are widened by the shifts that other meshes make ([`widen`]). The prediction of another
//!   mesh differs from ours by a multiple of our error. Fitted as if it were a misfit, to first order, this difference
//!   says how far our error moves each parameter. Causes with a soft edge are widened likewise by the shift that an
//!   edge twice as wide makes.

use super::cause_fit::CauseFit;
use super::clusters::clustered_sd;
use super::error::DiagnosisError;
use super::fit::{derivatives, fit, normal_matrix, scales};
use super::laboratory::Laboratory;
use super::metric::Metric;
use super::other_mesh::OtherMesh;
use super::prior::FitSettings;
use super::scene::Scene;
use super::trace::Trace;
use crate::calibration::SD_OVER_SHIFT;
use crate::mesh::{MeshOptions, error_over_difference};
use nalgebra::DVector;
use rayon::prelude::*;

/// Element size of the finer mesh as a factor on ours.
pub(super) const FINER: f64 = 0.5;
/// The smallest element size of the finer mesh, as a factor on the standard one. The error of a mesh that fine is
/// smaller than what a recording shows.
const FINEST: f64 = 0.45;
/// Most passes of the correction of one fit.
const MAX_CORRECTIONS: usize = 3;
/// What the finer mesh predicts beyond ours is not worked out again where the prediction has moved by less than this
/// part of it (rms): it changes by some percent of that.
const HARDLY_MOVED: f64 = 0.2;
/// A finer mesh whose element size is closer to ours than this factor says nothing about our error.
const HARDLY_FINER: f64 = 0.9;
/// Other meshes: element size as a factor on ours, and whether they are of prisms. Prisms err in another pattern than
/// hexahedra, so that a parameter which hexahedra leave alone for their symmetry is not taken to be free of error. A
/// single mesh may shift a parameter by little because it happens to err as ours does; therefore the mean square over
/// all meshes counts.
const COARSER: [(f64, bool); 3] = [(1.25, false), (1.6, false), (1.6, true)];

/// The finer mesh of a recording, on which what was found with ours is corrected.
pub struct Finer<'a> {
    mesh: OtherMesh<'a>,
    /// Element size as a factor on ours.
    ratio: f64,
    /// What our mesh predicted where the defect of a fit without causes was last worked out, and that defect.
    nominal: Option<(Trace, MeshDefect)>,
}

/// What a finer mesh does to a fit's prediction.
#[derive(Clone)]
pub struct MeshDefect {
    /// Predicted on the finer mesh minus predicted on ours.
    pub trace: Trace,
    /// Element size of the finer mesh as a factor on ours.
    pub ratio: f64,
}

impl MeshDefect {
    /// What the mesh of the diagnosis would have shown of a recording, were it not for its own error.
    pub fn taken_off(&self, recorded: &Trace) -> Trace {
        recorded.plus(-1.0, &self.trace)
    }

    /// Whether a prediction of ours is so near that of which this was worked out that another one would say the same.
    fn holds_at(&self, prediction: &Trace, worked_out_of: &Trace) -> bool {
        prediction.plus(-1.0, worked_out_of).rms_mm() < HARDLY_MOVED * self.trace.rms_mm()
    }
}

impl<'a> Finer<'a> {
    /// Of a laboratory whose element size is `mesh_factor` times the standard one; `None` where that is fine already,
    /// or the finer one cannot be meshed.
    pub fn new(ours: &Laboratory<'a>, mesh_factor: f64) -> Option<Finer<'a>> {
        let ratio = FINER.max(FINEST / mesh_factor);
        if ratio > HARDLY_FINER {
            return None;
        }
        let mesh = MeshOptions::scaled(&ours.observed().specimen, ratio * mesh_factor);
        Some(Finer { mesh: OtherMesh::new(ours, &mesh).ok()?, ratio, nominal: None })
    }

    /// Corrects a fit by the finer mesh's prediction (deferred correction: what the finer mesh predicts beyond ours is
    /// taken off the measured, and the fit repeated on ours from where it ended; where that moves the prediction much,
    /// once more). `fitted.residual` is then against the finer mesh to first order.
    ///
    /// # Errors
    /// [`DiagnosisError`]: the finer model has no equilibrium, or the work was cancelled.
    pub fn correct(
        &mut self,
        laboratory: &mut Laboratory,
        metric: &Metric,
        measured: &Trace,
        settings: &FitSettings,
        fitted: &mut CauseFit,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<MeshDefect, DiagnosisError> {
        let mut defect = match self.known_near(fitted) {
            Some(known) => known,
            None => self.defect(laboratory, fitted, is_cancelled)?,
        };
        for pass in 1..=MAX_CORRECTIONS {
            let before = fitted.prediction.trace.clone();
            let seen = defect.taken_off(measured);
            *fitted = fit(laboratory, metric, &seen, &fitted.material, &fitted.causes, settings, is_cancelled)?;
            if pass == MAX_CORRECTIONS || defect.holds_at(&fitted.prediction.trace, &before) {
                break;
            }
            match self.defect(laboratory, fitted, is_cancelled) {
                Ok(next) => defect = next,
                Err(error) if is_cancelled() => return Err(error),
                // What was corrected so far stands.
                Err(_) => break,
            }
        }
        Ok(defect)
    }

    /// The defect of a fit without causes that hardly differs from the last of these.
    fn known_near(&self, fitted: &CauseFit) -> Option<MeshDefect> {
        let (at, defect) = self.nominal.as_ref().filter(|_| fitted.causes.is_empty())?;
        defect.holds_at(&fitted.prediction.trace, at).then(|| defect.clone())
    }

    /// What the finer mesh predicts beyond ours, that of `laboratory`.
    ///
    /// # Errors
    /// As [`Self::correct`].
    pub fn defect(
        &mut self,
        laboratory: &mut Laboratory,
        fitted: &CauseFit,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<MeshDefect, DiagnosisError> {
        let trace = self.mesh.beyond(laboratory.model_of(&fitted.scene())?, fitted, is_cancelled)?;
        let defect = MeshDefect { trace, ratio: self.ratio };
        if fitted.causes.is_empty() {
            self.nominal = Some((fitted.prediction.trace.clone(), defect.clone()));
        }
        Ok(defect)
    }
}

/// The coarser meshes of a recording, by which intervals are widened. They are made where they are first asked for.
#[derive(Default)]
pub struct Coarser<'a> {
    /// Each with its element size as a factor on ours.
    meshes: Vec<(f64, OtherMesh<'a>)>,
}

impl<'a> Coarser<'a> {
    /// Of a laboratory whose element size is `mesh_factor` times the standard one.
    fn of(&mut self, ours: &Laboratory<'a>, mesh_factor: f64) -> Result<&mut [(f64, OtherMesh<'a>)], DiagnosisError> {
        if self.meshes.is_empty() {
            let other = |&(coarser, force_prisms): &(f64, bool)| {
                let scaled = MeshOptions::scaled(&ours.observed().specimen, coarser * mesh_factor);
                Ok((coarser, OtherMesh::new(ours, &MeshOptions { force_prisms, ..scaled })?))
            };
            self.meshes = COARSER.iter().map(other).collect::<Result<_, DiagnosisError>>()?;
        }
        Ok(&mut self.meshes)
    }
}

/// Makes the standard deviations of `fitted`, found by `laboratory` on a mesh of `mesh_factor` and corrected by
/// `defect`, at least as large as what the fit leaves calls for ([`clustered_sd`]), and adds the meshes' share.
///
/// # Errors
/// [`DiagnosisError`]: the coarser model has no equilibrium, or the work was cancelled.
pub fn widen<'a>(
    laboratory: &mut Laboratory<'a>,
    (coarser, mesh_factor): (&mut Coarser<'a>, f64),
    metric: &Metric,
    settings: &FitSettings,
    fitted: &mut CauseFit,
    defect: Option<&MeshDefect>,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<(), DiagnosisError> {
    let observed = laboratory.observed();
    let columns = derivatives(laboratory, &fitted.material, &fitted.causes, &fitted.prediction)?;
    let weighed = metric.weigh_all(&columns);
    let matrix = normal_matrix(metric, &weighed, &fitted.material, &fitted.causes, settings);
    let Some(factor) = matrix.cholesky() else { return Ok(()) };
    if let Some(clustered) = clustered_sd(observed, metric, fitted, settings, &columns) {
        fitted.sd.iter_mut().zip(clustered).for_each(|(sd, clustered)| *sd = sd.max(clustered));
    }
    let shift_by = |change: &Trace| {
        let change = metric.weigh(change);
        factor.solve(&DVector::from_iterator(weighed.len(), weighed.iter().map(|c| metric.inner(c, &change))))
    };
    // The shift by the error of our mesh, as each of the other meshes tells it.
    let meshes = coarser.of(laboratory, mesh_factor)?;
    let ours = laboratory.model_of(&fitted.scene())?;
    let by_mesh = |(coarser, mesh): &mut (f64, OtherMesh)| {
        let beyond = mesh.beyond(ours, fitted, is_cancelled)?;
        Ok(shift_by(&beyond) * error_over_difference(*coarser))
    };
    let mut shifts = meshes.par_iter_mut().map(by_mesh).collect::<Result<Vec<_>, DiagnosisError>>()?;
    // The part of that error which the correction by the finer mesh leaves.
    let left = defect.map_or(1.0, |d| 1.0 - 1.0 / error_over_difference(d.ratio));
    shifts.extend(defect.map(|d| shift_by(&d.trace) * error_over_difference(d.ratio)));
    let mut square = DVector::<f64>::zeros(weighed.len());
    for shift in &shifts {
        square += shift.component_mul(shift) / shifts.len() as f64;
    }
    // The data may come from a mesh, whose error is then like that of ours; it is not known whether they do.
    square *= 1.0 + left * left;
    let mut wider = Scene::default();
    let mut has_edge = false;
    for c in &fitted.causes {
        if c.cause.apply_wider(&c.values, &mut wider) {
            has_edge = true;
        } else {
            c.cause.apply(&c.values, &mut wider);
        }
    }
    if has_edge {
        // The true edge may have any width from sharp to twice ours.
        let theirs = laboratory.predict(&fitted.material, &wider, is_cancelled)?;
        let shift = shift_by(&fitted.prediction.trace.plus(-1.0, &theirs.trace)) * SD_OVER_SHIFT;
        square += shift.component_mul(&shift);
    }
    let scales = scales(&fitted.material, &fitted.causes);
    for ((sd, square), scale) in fitted.sd.iter_mut().zip(square.iter()).zip(scales) {
        *sd = sd.hypot(scale * square.sqrt());
    }
    // The bulk modulus, the first, is not known less than it was beforehand.
    if let Some(sd) = fitted.sd.first_mut() {
        *sd = sd.min(settings.bulk.log_sd * fitted.material.bulk_kpa);
    }
    Ok(())
}

#[cfg(test)]
#[path = "mesh_error_tests.rs"]
mod tests;
