//! What is known so far: the law fitted to all recordings, its information, its misfit and the states it has visited.

use super::correction::FinerMeshes;
use super::discrepancy::Discrepancy;
use super::error::NextError;
use super::error_left::ErrorLeft;
use super::options::{NextOptions, Plan};
use super::scanned::{ForceRead, ScannedStep};
use super::visited::Visited;
use crate::calibration::{
    CalibrateOptions, CalibrationProblem, FitOptions, Law, Objective, Observed, RecordingFit, TermCount, fit_law,
    mean_scans,
};
use crate::kinematics::{Decomposition, IDENTITY, decompose};
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::sensitivity::{Covariance, FisherInformation, JointInformation, median, unknowns_of};
use crate::specimen::Specimen;
use nalgebra::{DMatrix, SymmetricEigen};

/// Most terms where BIC chooses.
const MAX_TERMS: usize = 3;
/// Blind starts of every number of terms.
const NUM_STARTS: usize = 2;
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
        for (r, steps) in seen.steps.iter().enumerate() {
            for (s, step) in steps.iter().enumerate() {
                let here = &corrected[r];
                let num = num_done(observed, &here.specimen, here.steps[s].drive_mm) as f64;
                let (material, num_unknowns) = (&found.fit.material, seen.unknown_sd.len());
                // Scans of one drive share their discrepancy: each has its part of what their mean tells.
                let of_all = step.information(material, num_unknowns, num, &discrepancy)?;
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
    let fit = |problem: &mut CalibrationProblem, terms: TermCount, iterations: usize, earlier: &[RecordingFit]| {
        let settings = CalibrateOptions {
            terms,
            num_starts: NUM_STARTS,
            fit: FitOptions { max_iterations: iterations, ..FitOptions::default() },
            least_promise: match terms {
                // Two parameters at ln n each.
                TermCount::Auto { .. } => LEAST_OF_BIC * 2.0 * (num_data as f64).ln(),
                TermCount::Fixed(_) => 0.0,
            },
            ..CalibrateOptions::default()
        };
        fit_law(problem, earlier, &settings, on_stage, is_cancelled)
    };
    let FitOptions { max_iterations, tolerance, .. } = FitOptions::default();
    let mesh = |s: &Specimen| MeshOptions::scaled(s, options.mesh_factor);
    let mut problem = CalibrationProblem::new(means, &mesh, Objective::Weighted)?;
    let terms = options.num_terms.map_or(TermCount::Auto { max: MAX_TERMS }, TermCount::Fixed);
    if !options.has_mesh_correction {
        on_stage("what is known so far");
        let law = fit(&mut problem, terms, max_iterations, &[])?;
        law.fit.settled(tolerance)?;
        let error_left = ErrorLeft::none(means, law.fit.material.parameters().len());
        return Ok(Fitted { corrected: means.to_vec(), law, error_left, models: problem });
    }
    on_stage("error of the mesh");
    // With the error of the mesh in the recordings a fit of several terms may be led astray, and never settle.
    let mut before = fit(&mut problem, TermCount::Fixed(options.num_terms.unwrap_or(1)), FIRST_ITERATIONS, &[])?;
    let mut finer = FinerMeshes::new(means, options.mesh_factor)?;
    let mut round = 0;
    loop {
        round += 1;
        let corrected = finer.without_mesh_error(&before.fit, is_cancelled)?;
        on_stage("what is known so far");
        let mut present = problem.with_data(&corrected)?;
        let law = fit(&mut present, terms, max_iterations, &before.by_num_terms)?;
        // A law of more terms tells the error better: large strains and small ones no longer share an exponent. So does
        // one that has settled.
        let is_told = law.fit.material.terms.len() <= before.fit.material.terms.len() && before.fit.is_settled();
        if is_told || round == MOST_ROUNDS {
            law.fit.settled(tolerance)?;
            let error_left = finer.error_left(&present, &law.fit, &corrected)?;
            return Ok(Fitted { models: present.with_data(means)?, corrected, law, error_left });
        }
        problem = present.with_data(means)?;
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

/// How many of the recordings scanned this specimen at this drive.
pub(super) fn num_done(observed: &[Observed], specimen: &Specimen, drive_mm: f64) -> usize {
    let is_at = |o: &Observed| o.steps.iter().any(|s| is_same_drive(s.drive_mm, drive_mm));
    observed.iter().filter(|o| is_same_body(&o.specimen, specimen) && is_at(o)).count()
}

/// Whether two drives are one: actuators keep a micrometre.
pub(super) fn is_same_drive(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-3
}

/// Whether two specimens differ by name and drives alone, and are driven in the same direction.
pub(super) fn is_same_body(a: &Specimen, b: &Specimen) -> bool {
    let body = |s: &Specimen| Specimen { name: String::new(), drive_mm: Vec::new(), ..s.clone() };
    body(a) == body(b) && !a.is_other_way(b.largest_drive_mm())
}

/// What the recordings tell, at the estimate.
struct Seen {
    /// Per recording and drive.
    steps: Vec<Vec<ScannedStep>>,
    /// Per recording and drive: the voxels' states.
    states: Vec<Vec<Vec<Decomposition>>>,
    unknown_sd: Vec<f64>,
}

impl Seen {
    /// `num_scans`: of how many scans each recording is the mean.
    fn of(
        problem: &mut CalibrationProblem,
        fit: &RecordingFit,
        plan: &Plan,
        num_scans: &[usize],
    ) -> Result<Seen, NextError> {
        problem.refuse_unlike_samples("what to scan next")?;
        let observed = problem.observed();
        let mut seen = Seen { steps: Vec::new(), states: Vec::new(), unknown_sd: Vec::new() };
        for (r, (model, view)) in problem.models_and_views().enumerate() {
            let (recording, num) = (&observed[r], num_scans[r] as f64);
            let (mut steps, mut states) = (Vec::new(), Vec::new());
            for (s, equilibrium) in fit.states(r).iter().enumerate() {
                let measured = &recording.steps[s];
                let of_voxels: Vec<Decomposition> = view
                    .gradients(&equilibrium.displacement)?
                    .iter()
                    .map(|g| decompose(&[0, 1, 2].map(|i| [0, 1, 2].map(|j| IDENTITY[i][j] + g[i][j]))))
                    .collect();
                let mut tangent = model.tangent(&fit.material, equilibrium)?;
                let unknowns = unknowns_of(&plan.study.protocol, equilibrium, &mut tangent)?;
                let (fields, forces) = fit.sensitivities(r, s);
                let is_whole = |u: &[f64; 3]| u.iter().all(|x| x.is_finite());
                let weights: Vec<f64> = measured
                    .displacement
                    .iter()
                    .zip(&fields[0])
                    .map(|(u, f)| f64::from(u8::from(is_whole(u) && is_whole(f))))
                    .collect();
                // What is missing must not enter a product.
                let filled = |field: &[[f64; 3]]| -> Vec<[f64; 3]> {
                    field.iter().map(|u| if is_whole(u) { *u } else { [0.0; 3] }).collect()
                };
                let by_unknown = unknowns
                    .iter()
                    .map(|u| u.displacement.as_ref().map(|d| view.average(d).map(|f| filled(&f))).transpose())
                    .collect::<Result<Vec<_>, _>>()?;
                steps.push(ScannedStep {
                    by_parameter: fields.iter().map(|f| filled(f)).collect(),
                    by_unknown,
                    // The states that the law was fitted to are those visited.
                    beyond: vec![0.0; weights.len()],
                    weights,
                    signal: None,
                    // Of one scan.
                    noise_mm2: recording.noise_sd_mm.map(|sd| num * sd * sd * recording.noise_correlation()),
                    voxel_mm3: recording.mask.grid.voxel_volume_mm3(),
                    force: measured.force.map(|force| ForceRead {
                        force_n: equilibrium.force_n,
                        by_parameter: forces.to_vec(),
                        by_unknown: unknowns.iter().map(|u| u.force_n).collect(),
                        sd_n: num.sqrt() * force.sd_n,
                        beyond: 0.0,
                    }),
                });
                states.push(of_voxels);
                seen.unknown_sd = unknowns.iter().map(|u| u.sd).collect();
            }
            seen.steps.push(steps);
            seen.states.push(states);
        }
        Ok(seen)
    }
}

/// The typical distance of voxels beyond the states visited: their median.
pub(super) fn typical(beyond: &[f64]) -> f64 {
    median(beyond.iter().copied()).unwrap_or(0.0)
}
