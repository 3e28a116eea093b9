//! Fits of one recording: the laboratory that predicts it, what its misfit weighs, and what is known beforehand.

use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::evidence::{EVIDENCE, is_large_force, penalty};
use super::fit::{Member, deviance_at, fit, fit_member, scales};
use super::laboratory::Laboratory;
use super::leftover::leftover;
use super::metric::Metric;
use super::prior::{BulkPrior, FitSettings};
use super::supposed::Supposed;
use super::trace::Trace;
use crate::material::Material;

/// Most leaps of a cause after its fit.
const MAX_LEAPS: usize = 3;
/// How much worse than the fit (factor on the deviance) the place of a leap may be: there the material has not followed
/// yet.
const WORSE_BEFORE_BETTER: f64 = 1.5;
/// Standard deviation of the logarithm of a modulus that is as good as known.
pub(super) const KNOWN_LOG_SD: f64 = 0.02;

/// Everything that a fit of the recording needs besides the causes.
pub(super) struct Inference<'a> {
    /// Predicts the recording.
    pub(super) laboratory: Laboratory<'a>,
    /// What a misfit weighs.
    pub(super) metric: Metric,
    /// Priors and stops of fits with causes.
    pub(super) settings: FitSettings,
    /// What is known of κ in the nominal model.
    pub(super) nominal_bulk: BulkPrior,
    /// What was known of κ before anything was found.
    pub(super) believed_bulk: BulkPrior,
    /// Displacement error that meshes may leave, mm rms at the largest drive.
    pub(super) allowance_mm: f64,
    /// Variance (mm²) of each component at every voxel for what the model is known to leave.
    pub(super) discrepancy_mm2: [f64; 3],
    /// Element size as a factor on the standard one.
    pub(super) mesh_factor: f64,
    /// Whether the work is to stop.
    pub(super) is_cancelled: &'a (dyn Fn() -> bool + Sync),
    /// Is told what is being done.
    pub(super) progress: &'a (dyn Fn(&str) + Sync),
}

impl<'a> Inference<'a> {
    /// The same for fits beside it, with a laboratory of its own.
    pub(super) fn twin(&self) -> Inference<'a> {
        Inference { laboratory: self.laboratory.twin(), metric: self.metric.clone(), ..*self }
    }

    /// What a misfit weighs at the voxels for which `is_kept`.
    pub(super) fn metric_of(&self, is_kept: &dyn Fn(usize) -> bool) -> Metric {
        let metric = Metric::new(self.laboratory.observed(), self.allowance_mm, is_kept);
        if self.accepts_discrepancy() { metric.with_variance(self.discrepancy_mm2) } else { metric }
    }

    /// Whether misfits are weighed by what a model is known to leave.
    pub(super) fn accepts_discrepancy(&self) -> bool {
        self.discrepancy_mm2.iter().any(|v| *v > 0.0)
    }

    /// Weighs misfits from now on by what `residual` leaves beyond noise, and at least by the allowance: the mean of a
    /// box of voxels then has the standard deviation that such means are seen to have. Without it a model that cannot
    /// be exact is fitted to its own errors, and whatever is believed of its parameters counts for nothing.
    pub(super) fn accept_discrepancy(&mut self, residual: &Trace) {
        let left = leftover(self.laboratory.observed(), residual, &self.metric);
        self.weigh_by(left.variance_mm2(self.allowance_mm));
    }

    /// Weighs misfits by noise and allowance alone again.
    pub(super) fn forget_discrepancy(&mut self) {
        self.weigh_by([0.0; 3]);
    }

    /// Weighs misfits by these variances (mm²) too, for what the model is known to leave.
    pub(super) fn weigh_by(&mut self, discrepancy_mm2: [f64; 3]) {
        self.discrepancy_mm2 = discrepancy_mm2;
        self.metric = self.metric_of(&|_| true);
    }

    /// The deviance of a fit by the present weights, what is known beforehand left out.
    pub(super) fn misfit_of(&self, residual: &Trace) -> f64 {
        let weighed = self.metric.weigh(residual);
        self.metric.inner(&weighed, &weighed)
    }

    /// Whether what a fit leaves, in displacements and in forces, is no more than the error of a mesh.
    pub(super) fn leaves_no_more_than_a_mesh(&self, fitted: &CauseFit) -> bool {
        let observed = self.laboratory.observed();
        let left = leftover(observed, &fitted.residual, &self.metric);
        left.structured_rms_mm < self.allowance_mm && !is_large_force(observed, &fitted.residual)
    }

    /// How much of a fit's deviance noise does not account for.
    pub(super) fn misfit_beyond_noise(&self, fitted: &CauseFit) -> f64 {
        (fitted.deviance - self.metric.num_data() as f64).max(0.0)
    }

    /// The deviance of a fit and what its parameters cost: of two fits the one that costs less explains more for their
    /// number.
    pub(super) fn cost_of(&self, fitted: &CauseFit) -> f64 {
        fitted.deviance + penalty(&self.metric, fitted.num_parameters())
    }

    /// Fits a material and causes from where they are.
    ///
    /// # Errors
    /// As [`fit`].
    pub(super) fn fit(
        &mut self,
        measured: &Trace,
        material: &Material,
        causes: &[Supposed],
    ) -> Result<CauseFit, DiagnosisError> {
        fit(&mut self.laboratory, &self.metric, measured, material, causes, &self.settings, self.is_cancelled)
    }

    /// Fits again from where the last cause of a fit could leap to, as long as that explains more; `known` as in
    /// [`Self::fit_beyond`].
    ///
    /// # Errors
    /// As [`fit`].
    pub(super) fn with_leaps(
        &mut self,
        measured: &Trace,
        mut found: CauseFit,
        known: &[Trace],
    ) -> Result<CauseFit, DiagnosisError> {
        for _ in 0..MAX_LEAPS {
            let limit = WORSE_BEFORE_BETTER * found.deviance;
            let Some((_, leapt)) = self.best_leap(measured, &found)?.filter(|leap| leap.0 < limit) else { break };
            match self.fit_beyond(measured, &found.material, &leapt, known) {
                Ok(other) if other.deviance < found.deviance - EVIDENCE => found = other,
                Err(error) if (self.is_cancelled)() => return Err(error),
                _ => break,
            }
        }
        Ok(found)
    }

    /// As [`Self::fit`], with `known` changes of the prediction for all parameters but the last cause's; none known:
    /// all are worked out.
    ///
    /// # Errors
    /// As [`fit`].
    pub(super) fn fit_beyond(
        &mut self,
        measured: &Trace,
        material: &Material,
        causes: &[Supposed],
        known: &[Trace],
    ) -> Result<CauseFit, DiagnosisError> {
        let places = (0..scales(material, causes).len()).collect();
        let Inference { laboratory, metric, settings, is_cancelled, .. } = self;
        let causes = causes.to_vec();
        let member = Member { laboratory, metric, measured, causes, settings: *settings, known, places };
        fit_member(member, material, *is_cancelled)
    }

    /// The deviance of a material and causes as they are.
    ///
    /// # Errors
    /// As [`fit`].
    pub(super) fn deviance_at(
        &mut self,
        measured: &Trace,
        material: &Material,
        causes: &[Supposed],
    ) -> Result<f64, DiagnosisError> {
        let Inference { laboratory, metric, settings, is_cancelled, .. } = self;
        deviance_at(laboratory, metric, measured, material, causes, settings, *is_cancelled)
    }

    /// Of the leaps of a fit's last cause the one with the smallest deviance, and that deviance; the material stays.
    fn best_leap(
        &mut self,
        measured: &Trace,
        found: &CauseFit,
    ) -> Result<Option<(f64, Vec<Supposed>)>, DiagnosisError> {
        let Some(last) = found.causes.last() else { return Ok(None) };
        let mut best: Option<(f64, Vec<Supposed>)> = None;
        for values in last.cause.leaps(&last.values) {
            let mut leapt = found.causes.clone();
            if let Some(last) = leapt.last_mut() {
                last.values = values;
            }
            match self.deviance_at(measured, &found.material, &leapt) {
                Ok(deviance) if best.as_ref().is_none_or(|b| deviance < b.0) => best = Some((deviance, leapt)),
                Err(error) if (self.is_cancelled)() => return Err(error),
                _ => {}
            }
        }
        Ok(best)
    }
}
