//! What a candidate is worth: relative standard deviations with the posterior and it together.

use super::candidate::Candidate;
use super::error::NextError;
use super::options::Precision;
use super::posterior::{Point, Posterior, UNKNOWN_RELATIVE_SD};
use super::trial::Trial;
use crate::sensitivity::{FisherInformation, JointInformation};
use crate::specimen::{farthest_from_zero, leads_on};

/// Most further scans of one kind that are thought of.
pub(super) const MOST_SCANS: usize = 1000;

/// Relative standard deviations of all μ and α, and the determinant of their relative covariance.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Knowledge {
    /// In the order of the material's μ and α.
    pub(super) relative_sd: Vec<f64>,
    /// ½ ln det of the relative covariance.
    pub(super) half_log_det: f64,
}

impl Knowledge {
    /// What `information` about the material promises; [`UNKNOWN_RELATIVE_SD`] at most.
    fn of(information: &FisherInformation) -> Knowledge {
        let shear = information.shear_indices();
        let covariance = information.covariance();
        let sd_of = |&i: &usize| covariance.relative_sd(i).unwrap_or(UNKNOWN_RELATIVE_SD).min(UNKNOWN_RELATIVE_SD);
        let relative_sd: Vec<f64> = shear.iter().map(sd_of).collect();
        let apart = || relative_sd.iter().map(|sd| sd.ln()).sum::<f64>();
        let together = covariance.criterion(crate::sensitivity::Criterion::LogDeterminant, &shear);
        let half_log_det = together.map_or_else(apart, |d| 0.5 * d);
        Knowledge { relative_sd, half_log_det }
    }

    /// What is known so far.
    ///
    /// # Errors
    /// [`NextError::Evaluation`] for what is not finite.
    pub(super) fn so_far(posterior: &Posterior) -> Result<Knowledge, NextError> {
        Ok(Knowledge::of(&posterior.about_material(None)?))
    }

    /// The parameter that is the farthest from its precision (known least, where none is asked), and its relative
    /// standard deviation over that precision (itself).
    pub(super) fn worst(&self, names: &[String], precision: &Precision) -> (usize, f64) {
        let over = |i: usize| match precision.of(&names[i]) {
            _ if precision.is_empty() => self.relative_sd[i],
            limit => self.relative_sd[i] / limit,
        };
        let all = (0..self.relative_sd.len()).map(|i| (i, over(i)));
        all.fold((0, 0.0), |worst, next| if next.1 > worst.1 { next } else { worst })
    }
}

/// A candidate and the trials of its specimen.
pub(super) struct Worth<'a> {
    pub(super) posterior: &'a Posterior,
    pub(super) points: &'a [Point],
    /// One per point.
    pub(super) trials: &'a [Trial],
    pub(super) candidate: &'a Candidate,
}

impl Worth<'_> {
    /// What is known after `num` such scans: variances are means over the materials that the posterior leaves possible.
    ///
    /// # Errors
    /// [`NextError::Evaluation`] for what is not finite.
    pub(super) fn after(&self, num: f64) -> Result<Knowledge, NextError> {
        let mut weight = 0.0;
        let mut variance: Vec<f64> = Vec::new();
        let mut half_log_det = 0.0;
        for (p, point) in self.points.iter().enumerate() {
            let Some(more) = self.information(p, point, num)? else { continue };
            let known = Knowledge::of(&self.posterior.about_material(Some(&more))?);
            variance.resize(known.relative_sd.len(), 0.0);
            variance.iter_mut().zip(&known.relative_sd).for_each(|(sum, sd)| *sum += point.weight * sd * sd);
            half_log_det += point.weight * known.half_log_det;
            weight += point.weight;
        }
        let relative_sd = variance.iter().map(|sum| (sum / weight).sqrt()).collect();
        Ok(Knowledge { relative_sd, half_log_det: half_log_det / weight })
    }

    /// What `num` such scans add with the material `p`; none where it has no equilibrium.
    fn information(&self, p: usize, point: &Point, num: f64) -> Result<Option<JointInformation>, NextError> {
        let Posterior { material, discrepancy, unknown_sd, .. } = self.posterior;
        let num_unknowns = unknown_sd.len();
        let mut sum = JointInformation::none(&point.material, num_unknowns);
        for (&drive, &done) in self.candidate.drives_mm.iter().zip(&self.candidate.num_done) {
            let step = self.trials[p].steps.iter().find(|s| s.drive_mm == drive);
            let Some(step) = step else { return Ok(None) };
            let of = |count: f64| step.scanned.information(&point.material, num_unknowns, count, discrepancy);
            sum.add_times(1.0, &of(done as f64 + num)?)?;
            sum.add_times(-1.0, &of(done as f64)?)?;
        }
        let largest = farthest_from_zero(self.candidate.drives_mm.iter().copied());
        let is_scanned = |drive: f64| self.candidate.drives_mm.contains(&drive);
        let readings =
            self.trials[p].readings.iter().filter(|(drive, _)| leads_on(*drive, largest) && !is_scanned(*drive));
        for (drive, reading) in readings {
            let done = self.candidate.num_read(*drive) as f64;
            let of = |count: f64| reading.information(&point.material, count, discrepancy);
            sum.add_times(1.0, &of(done + num))?;
            sum.add_times(-1.0, &of(done))?;
        }
        Ok(Some(sum.carried_to(material)?))
    }

    /// The fewest such scans with which every parameter has its precision; none where [`MOST_SCANS`] do not suffice.
    ///
    /// # Errors
    /// [`NextError::Evaluation`] for what is not finite.
    pub(super) fn num_scans_to(&self, names: &[String], precision: &Precision) -> Result<Option<usize>, NextError> {
        let suffices =
            |num: usize| -> Result<bool, NextError> { Ok(self.after(num as f64)?.worst(names, precision).1 <= 1.0) };
        if !suffices(MOST_SCANS)? {
            return Ok(None);
        }
        // More scans never know less: halve the interval.
        let (mut few, mut enough) = (0, MOST_SCANS);
        while enough - few > 1 {
            let middle = if few == 0 && enough > 4 { enough.isqrt() } else { few.midpoint(enough) };
            if suffices(middle)? {
                enough = middle;
            } else {
                few = middle;
            }
        }
        Ok(Some(enough))
    }
}
