//! What is known so far: the law fitted to all recordings, its information, its misfit and the states it has visited.

use super::body::{num_done, readings_of};
use super::correction::FinerMeshes;
use super::discrepancy::Discrepancy;
use super::error::NextError;
use super::error_left::ErrorLeft;
use super::options::{NextOptions, Plan};
use super::seen::Seen;
use super::visited::Visited;
use crate::calibration::{
    CalibrateOptions, CalibrationProblem, FitOptions, Law, Objective, Observed, RecordingFit, TermCount, fit_law,
    mean_scans,
};
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::sensitivity::{Covariance, FisherInformation, JointInformation, Protocol, median};
use crate::specimen::Specimen;
use nalgebra::{DMatrix, SymmetricEigen};

/// Most terms where BIC chooses.
const MAX_TERMS: usize = 3;
/// Most blind starts of every number of terms.
const NUM_STARTS: usize = 2;
/// A fit has converged within this part of a standard deviation, which is what a plan asks for.
const TOLERANCE: f64 = 0.05;
/// Most iterations of a fit that only tells the mesh's error, and most rounds of these and fits.
const FIRST_ITERATIONS: usize = 20;
const MOST_ROUNDS: usize = 4;
/// A further term is fitted where the linear model promises this part of what BIC asks of it: the fit itself may gain
/// more, but of such a term takes most of the time that an answer has.
const LEAST_OF_BIC: f64 = 0.5;
/// A parameter that the recordings do not determine counts as known to this relative standard deviation.
pub(super) const UNKNOWN_RELATIVE_SD: f64 = 1.0;
/// Materials that candidates are averaged over differ from the estimate by at most this part of each parameter.
const MOST_CHANGE: f64 = 0.3;
/// Where they would differ by less than this, the estimate stands for them all.
const LEAST_CHANGE: f64 = 1e-3;

/// A material that the posterior leaves possible.
#[derive(Clone, Debug)]
pub(super) struct Point {
    /// Its weight in averages.
    pub(super) weight: f64,
    /// The material.
    pub(super) material: Material,
}

/// What is known so far.
pub(super) struct Posterior {
    /// The estimate.
    pub(super) material: Material,
    /// Of all recordings about material and unknowns of the set-up, with the discrepancy in their noise.
    pub(super) information: JointInformation,
    /// To what the unknowns are known beforehand.
    pub(super) unknown_sd: Vec<f64>,
    /// The misfit beyond noise.
    pub(super) discrepancy: Discrepancy,
    /// The states visited.
    pub(super) visited: Visited,
    /// χ² over its expectation.
    pub(super) chi2_per_datum: f64,
    /// Per parameter of the material, in its unit: standard deviation of what the mesh's error may still make of the
    /// estimate. Scans do not lower it.
    pub(super) mesh_sd: Vec<f64>,
    /// Remarks of the fit.
    pub(super) notes: Vec<String>,
}

impl Posterior {
    /// Fits `observed` together.
    ///
    /// # Errors
    /// [`NextError`].
    pub(super) fn new(
        observed: &[Observed],
        plan: &Plan,
        options: &NextOptions,
        on_stage: &dyn Fn(&str),
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Posterior, NextError> {
        let (means, num_scans): (Vec<Observed>, Vec<usize>) =
            mean_scans(observed).into_iter().map(|m| (m.mean, m.num_scans)).unzip();
        let Fitted { corrected, law: found, error_left, models } =
            fit_together(&means, options, on_stage, is_cancelled)?;
        let mut problem = models.with_data(&corrected)?;
        let discrepancy = Discrepancy::of(&corrected, &found.fit, &error_left);
        let seen = Seen::of(&mut problem, &found.fit, plan, &num_scans)?;
        let visited = Visited::of(seen.states.iter().flatten().flatten());
        let mut information = JointInformation::none(&found.fit.material, seen.unknown_sd.len());
        for (r, here) in corrected.iter().enumerate() {
            let (material, num_unknowns) = (&found.fit.material, seen.unknown_sd.len());
            // Scans of one drive share their discrepancy, as readings of one force do: each has its part of what their
            // mean tells.
            for (step, measured) in seen.steps[r].iter().zip(&here.steps) {
                let num = num_done(observed, &here.specimen, measured.drive_mm) as f64;
                let of_all = step.information(material, num_unknowns, num, &discrepancy)?;
                information.add_times(num_scans[r] as f64 / num, &of_all)?;
            }
            let read_mm: Vec<f64> = readings_of(observed, &here.specimen).collect();
            for (force, reading) in seen.readings[r].iter().zip(&here.on_the_way) {
                let num =
                    read_mm.iter().filter(|read| Protocol::is_same_drive(**read, reading.drive_mm)).count() as f64;
                let of_all = force.information(material, num, &discrepancy);
                information.add_times(num_scans[r] as f64 / num, &of_all)?;
            }
        }
        Ok(Posterior {
            material: found.fit.material.clone(),
            information,
            unknown_sd: seen.unknown_sd,
            discrepancy,
            visited,
            chi2_per_datum: found.fit.chi2_per_datum,
            mesh_sd: error_left.shift.iter().map(|shift| shift.abs()).collect(),
            notes: found.notes,
        })
    }

    /// Information about the material, with `more` about material and unknowns, the unknowns estimated too.
    ///
    /// # Errors
    /// [`NextError::Evaluation`] for what is not finite.
    pub(super) fn about_material(&self, more: Option<&JointInformation>) -> Result<FisherInformation, NextError> {
        let mut all = self.information.clone();
        if let Some(more) = more {
            all.add(more)?;
        }
        Ok(all.about_material(&self.material, &self.unknown_sd)?)
    }

    /// Materials to average over: three points of Gauss–Hermite quadrature along the direction in which the relative
    /// parameters are known least.
    ///
    /// # Errors
    /// [`NextError::Evaluation`] for what is not finite.
    pub(super) fn points(&self) -> Result<Vec<Point>, NextError> {
        let information = self.about_material(None)?;
        let shear = information.shear_indices();
        let change = least_known_direction(&information.covariance(), &shear, information.values());
        let step = change.iter().map(|c| c.abs()).fold(0.0, f64::max);
        let alone = vec![Point { weight: 1.0, material: self.material.clone() }];
        if step < LEAST_CHANGE {
            return Ok(alone);
        }
        let part = (MOST_CHANGE / step).min(1.0);
        let moved = |sign: f64| -> Option<Point> {
            let mut material = self.material.clone();
            for (&index, change) in shear.iter().zip(&change) {
                let parameter = information.parameters()[index];
                let value = information.values()[index];
                material.set(parameter, value + sign * part * change * value.abs());
            }
            material.validate().ok().map(|()| Point { weight: 1.0 / 6.0, material })
        };
        let sides: Vec<Point> = [-1.0, 1.0].into_iter().filter_map(moved).collect();
        let center = Point { weight: 2.0 / 3.0, material: self.material.clone() };
        Ok(std::iter::once(center).chain(sides).collect())
    }
}

/// What is fitted to the means of scans.
struct Fitted<'a> {
    /// The means with the error of the fit's mesh taken off.
    corrected: Vec<Observed>,
    /// The law of these.
    law: Law,
    /// What the extrapolated part of the error leaves open.
    error_left: ErrorLeft,
    /// Models of the means' specimens.
    models: CalibrationProblem<'a>,
}

/// Fits `means`, with the error of the fit's mesh taken off, which fits before tell.
fn fit_together<'a>(
    means: &'a [Observed],
    options: &NextOptions,
    on_stage: &dyn Fn(&str),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Fitted<'a>, NextError> {
    let num_data: usize = means.iter().map(|o| 3 * o.mask.num_voxels() * o.steps.len()).sum();
    let fit = |problem: &CalibrationProblem, terms: TermCount, iterations: usize, earlier: &[RecordingFit]| {
        let settings = CalibrateOptions {
            terms,
            num_starts: NUM_STARTS,
            tries_all_starts: false,
            fit: FitOptions { max_iterations: iterations, tolerance: TOLERANCE, ..FitOptions::default() },
            least_promise: match terms {
                // Two parameters at ln n each.
                TermCount::Auto { .. } => LEAST_OF_BIC * 2.0 * (num_data as f64).ln(),
                TermCount::Fixed(_) => 0.0,
            },
            ..CalibrateOptions::default()
        };
        fit_law(problem, earlier, &settings, on_stage, is_cancelled)
    };
    let FitOptions { max_iterations, .. } = FitOptions::default();
    let mesh = |s: &Specimen| MeshOptions::scaled(s, options.mesh_factor);
    let problem = CalibrationProblem::new(means, &mesh, Objective::Weighted)?;
    let terms = options.num_terms.map_or(TermCount::Auto { max: MAX_TERMS }, TermCount::Fixed);
    if !options.has_mesh_correction {
        on_stage("what is known so far");
        let law = fit(&problem, terms, max_iterations, &[])?;
        law.fit.settled(TOLERANCE)?;
        let error_left = ErrorLeft::none(means, law.fit.material.parameters().len());
        return Ok(Fitted { corrected: means.to_vec(), law, error_left, models: problem });
    }
    on_stage("error of the mesh");
    // At first one term, by the scans alone: forces on the way would take most of the time. With the error in the
    // recordings a fit of several terms may be led astray, and never settle.
    let has_readings = means.iter().any(|o| !o.on_the_way.is_empty());
    let scans: Vec<Observed> = means.iter().map(Observed::without_readings).collect();
    let mut problem = problem.with_data(&scans)?;
    let mut before = fit(&problem, TermCount::Fixed(1), FIRST_ITERATIONS, &[])?;
    let mut finer = FinerMeshes::new(means, options.mesh_factor)?;
    let mut round = 0;
    loop {
        round += 1;
        let knows_all = round > 1 || !has_readings;
        let corrected = finer.without_mesh_error(&before.fit, is_cancelled)?;
        on_stage("what is known so far");
        let present = problem.with_data(&corrected)?;
        let mut law = fit(&present, terms, max_iterations, &before.by_num_terms)?;
        // A law of more terms tells the error better: large strains and small ones no longer share an exponent. So does
        // one that has settled, and one that knows of all forces.
        let is_told =
            law.fit.material.terms.len() <= before.fit.material.terms.len() && before.fit.is_settled() && knows_all;
        if is_told || round == MOST_ROUNDS {
            if !law.fit.is_settled() {
                law = fit(&present, terms, max_iterations, &[])?;
            }
            law.fit.settled(TOLERANCE)?;
            let error_left = finer.error_left(&present, &law.fit, &corrected)?;
            return Ok(Fitted { models: present.with_data(means)?, corrected, law, error_left });
        }
        problem = present.with_data(&scans)?;
        on_stage("error of the mesh");
        before = law;
    }
}

/// √3 standard deviations along the leading direction of the relative covariance of the parameters `shear`.
fn least_known_direction(covariance: &Covariance, shear: &[usize], values: &[f64]) -> Vec<f64> {
    let relative = DMatrix::from_fn(shear.len(), shear.len(), |a, b| {
        let (i, j) = (shear[a], shear[b]);
        match covariance.covariance(i, j) {
            Some(both) => both / (values[i] * values[j]).abs(),
            None if i == j => UNKNOWN_RELATIVE_SD * UNKNOWN_RELATIVE_SD,
            None => 0.0,
        }
    });
    let eigen = SymmetricEigen::new(relative);
    let leading = eigen.eigenvalues.imax();
    let size = (3.0 * eigen.eigenvalues[leading].max(0.0)).sqrt();
    eigen.eigenvectors.column(leading).iter().map(|v| v * size).collect()
}

/// The typical distance of voxels beyond the states visited: their median.
pub(super) fn typical(beyond: &[f64]) -> f64 {
    median(beyond.iter().copied()).unwrap_or(0.0)
}
