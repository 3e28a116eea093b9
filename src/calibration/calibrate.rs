//! A whole calibration: number of terms, estimate, uncertainty, and what the mesh adds to it.
//!
//! Terms are chosen on a mesh coarser than the one asked for, from several starts. The chosen model and the one with a term
//! less are then fitted again on the mesh asked for: the difference of the estimates tells the discretisation's error (see
//! [`super::allowance`]), and a term that the finer mesh does not ask for was the coarse mesh's and is dropped.

use super::allowance::{Allowance, ERROR_OVER_SHIFT};
use super::contours::{Contour, ContourOptions, contours};
use super::error::CalibrationError;
use super::fit::FitOptions;
use super::observed::Observed;
use super::problem::{CalibrationProblem, RecordingFit};
use super::profile::{Profile, TWO_SIDED_95, bulk_lower_bound_kpa, profile};
use super::stability::least_relative_stiffness;
use super::starts::{Candidates, first_starts, further_starts};
use super::system::Work;
use super::target::{Objective, PAPER_BETA};
use super::terms::{
    DECREMENT_THRESHOLD, Rule, SETTLED, TermRow, TermSelection, choose, compare, degeneracies, is_kept,
};
use crate::material::{MAX_TERMS, Ogden, Parameter};
use crate::mesh::MeshOptions;
use crate::sensitivity::IDENTIFIABILITY_LIMIT;
use crate::specimen::Specimen;

/// Element size of the coarser mesh relative to the finer one.
pub const MESH_RATIO: f64 = 1.0 / 0.7;
/// Discretisation errors of data are taken to be this multiple of our own, to one standard deviation. Ours at the standard
/// size is about that of the usual synthetic recordings (0.004 to 0.012 mm rms at 70 % shear).
pub const DISCRETISATION_FACTOR: f64 = 2.0;

/// How many terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TermCount {
    /// As many as the deciding rule keeps.
    Auto {
        /// At most.
        max: usize,
    },
    /// This many.
    Fixed(usize),
}

/// Settings of [`calibrate`].
#[derive(Clone, Copy, Debug)]
pub struct CalibrateOptions {
    /// Number of terms.
    pub terms: TermCount,
    /// Which rule decides.
    pub rule: Rule,
    /// Threshold of the paper's decrement.
    pub decrement_threshold: f64,
    /// What is minimised.
    pub objective: Objective,
    /// The fits.
    pub fit: FitOptions,
    /// Element size relative to standard.
    pub mesh_factor: f64,
    /// Fit on a coarser mesh too and widen the intervals by what the difference promises.
    pub has_mesh_allowance: bool,
    /// Standard deviation of discretisation errors, the data's included, over the estimated error of our own mesh.
    pub discretisation_factor: f64,
    /// Starts of every number of terms.
    pub num_starts: usize,
    /// A further term is not fitted where the linear model promises less than this decrease of the objective. Zero fits
    /// every term, to show what it does.
    pub least_promise: f64,
    /// Profile likelihoods of all parameters.
    pub has_profiles: bool,
    /// Contours around the estimate.
    pub contours: Option<ContourOptions>,
}

impl Default for CalibrateOptions {
    fn default() -> Self {
        CalibrateOptions {
            terms: TermCount::Auto { max: 3 },
            rule: Rule::Bic,
            decrement_threshold: DECREMENT_THRESHOLD,
            objective: Objective::Weighted,
            fit: FitOptions { max_iterations: 40, ..FitOptions::default() },
            mesh_factor: 1.0,
            has_mesh_allowance: true,
            discretisation_factor: DISCRETISATION_FACTOR,
            num_starts: 3,
            least_promise: 0.0,
            has_profiles: false,
            contours: None,
        }
    }
}

/// One parameter of a [`Calibration`].
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Which.
    pub parameter: Parameter,
    /// Its value in the fitted material.
    pub value: f64,
    /// Standard deviation; none where the data do not determine it.
    pub sd: Option<f64>,
    /// What our own mesh may have shifted it by.
    pub mesh_error: f64,
    /// Standard deviation from discretisation errors, the data's included; of ln κ times κ for κ.
    pub discretisation_sd: f64,
    /// What the structured part of the misfit may have shifted it by, at most.
    pub possible_shift: f64,
    /// 95 % interval; a side that the data leave open is none. κ's is symmetric in ln κ.
    pub interval_95: [Option<f64>; 2],
    /// Whether the standard deviation is below half of the value.
    pub is_identifiable: bool,
}

/// Estimates of two meshes.
#[derive(Clone, Debug)]
pub struct MeshComparison {
    /// Free unknowns of the coarser and the finer models, all recordings together.
    pub num_unknowns: [usize; 2],
    /// The material on the coarser mesh.
    pub coarse: Ogden,
    /// What is allowed for discretisation errors.
    pub allowance: Allowance,
}

/// What a calibration found.
#[derive(Debug)]
pub struct Calibration {
    /// The estimate, on the finer mesh, terms in the order of falling exponents.
    pub fit: RecordingFit,
    /// κ, μ₁, α₁, …
    pub estimates: Vec<Estimate>,
    /// ½ Σμα, kPa, with its interval; none without a force.
    pub initial_shear_modulus: Option<(f64, Option<[f64; 2]>)>,
    /// Term selection.
    pub selection: TermSelection,
    /// The two meshes; none where only one was used.
    pub meshes: Option<MeshComparison>,
    /// On request.
    pub profiles: Vec<Profile>,
    /// On request.
    pub contours: Vec<Contour>,
    /// Whether any force was given.
    pub has_force: bool,
    /// All fits together.
    pub work: Work,
    /// Remarks for the reader.
    pub notes: Vec<String>,
}

/// Calibrates on `observed`. `mesh` gives the settings for an element size relative to standard; `on_stage` is told what
/// comes next.
///
/// # Errors
/// [`CalibrationError`]: nothing to compare, no equilibrium, no converged fit.
pub fn calibrate(
    observed: &[Observed],
    mesh: &dyn Fn(&Specimen, f64) -> MeshOptions,
    options: &CalibrateOptions,
    on_stage: &dyn Fn(&str),
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Calibration, CalibrationError> {
    let coarse_factor = options.mesh_factor * if options.has_mesh_allowance { MESH_RATIO } else { 1.0 };
    let mut problem = CalibrationProblem::new(observed, &|s| mesh(s, coarse_factor), options.objective)?;
    let has_force = problem.has_force();
    let mut run = Run::new(options, has_force, on_stage, is_cancelled);
    let (rows, fits) = run.select(&mut problem)?;
    let rule = |rule| choose(&rows, rule, options.decrement_threshold);
    let mut selection = TermSelection {
        by_bic: rule(Rule::Bic),
        by_f_test: rule(Rule::FTest),
        by_decrement: rule(Rule::Decrement),
        decided_by: match options.terms {
            TermCount::Fixed(_) => "fixed".into(),
            TermCount::Auto { .. } => match options.rule {
                Rule::Bic => "bic".into(),
                Rule::FTest => "f_test".into(),
                Rule::Decrement => "decrement".into(),
            },
        },
        chosen: match options.terms {
            TermCount::Fixed(n) => n.min(rows.len()),
            TermCount::Auto { .. } => rule(options.rule),
        },
        needed_chi2_decrease: fits
            .first()
            .filter(|_| options.rule == Rule::Bic)
            .map(|f| 2.0 * (f.num_data as f64).ln()),
        rows,
    };
    let Some(mut coarse) = fits.get(selection.chosen.saturating_sub(1)).cloned() else {
        return Err(CalibrationError::NotConverged {
            iterations: options.fit.max_iterations,
            distance: f64::INFINITY,
            limit: options.fit.tolerance,
        });
    };
    let mut meshes = None;
    let mut fit = coarse.clone();
    if options.has_mesh_allowance {
        on_stage("finer mesh");
        let mut finer = CalibrationProblem::new(observed, &|s| mesh(s, options.mesh_factor), options.objective)?;
        fit = run.fit(&mut finer, &falling(&coarse.material), None)?;
        while selection.chosen > 1 && selection.decided_by != "fixed" {
            let fewer = &fits[selection.chosen - 2];
            let smaller = run.fit(&mut finer, &falling(&fewer.material), None)?;
            let mut pair = vec![run.row(&finer, &smaller, 1, 1)?, run.row(&finer, &fit, 1, 1)?];
            // What a discretisation error within the allowance could make a term of is no evidence for one.
            let start = run.fit(&mut problem, &fewer.material, Some(fewer))?;
            let candidates = Candidates::new(&mut problem, &start, &run.fit_options, is_cancelled)?;
            let of_mesh = (options.discretisation_factor * ERROR_OVER_SHIFT).powi(2)
                * candidates.promise_of_mesh(&problem.targets()?, &smaller);
            pair[0].chi2 = (pair[0].chi2 - of_mesh).max(pair[1].chi2);
            compare(&mut pair, fit.num_data);
            if is_kept(&pair[1], options.rule, options.decrement_threshold) {
                break;
            }
            run.notes.push(format!(
                "term {} is the mesh's: on the finer mesh it lowers χ² by {:.1} only, beyond the {of_mesh:.1} that \
                 discretisation errors within the allowance could make",
                selection.chosen,
                pair[1].chi2_decrease.unwrap_or(0.0)
            ));
            selection.chosen -= 1;
            coarse = fewer.clone();
            fit = smaller;
        }
        let sum = |p: &CalibrationProblem| p.num_unknowns().iter().sum();
        let num_unknowns = [sum(&problem), sum(&finer)];
        coarse = run.fit(&mut problem, &falling(&coarse.material), None)?;
        let allowance = Allowance::new(&fit, &coarse, &finer.targets()?, options.discretisation_factor);
        fit.structured_misfit = allowance.unexplained(fit.structured_misfit);
        meshes = Some(MeshComparison { num_unknowns, coarse: coarse.material.clone(), allowance });
        problem = finer;
    } else {
        fit = run.fit(&mut problem, &falling(&fit.material), None)?;
    }
    if !fit.is_converged && fit.distance < SETTLED {
        run.notes.push(format!(
            "the fit was not at the optimum after {} iterations, {:.2} standard deviations away by the linear model: the data \
             hardly tell its terms apart",
            fit.iterations, fit.distance
        ));
    } else if !fit.is_converged {
        let (iterations, distance, limit) = (fit.iterations, fit.distance, options.fit.tolerance);
        return Err(CalibrationError::NotConverged { iterations, distance, limit });
    }
    let mesh_error = |value: &dyn Fn(&Ogden) -> f64| match &meshes {
        Some(m) => ERROR_OVER_SHIFT * (value(&fit.material) - value(&m.coarse)).abs(),
        None => 0.0,
    };
    let mut estimates: Vec<Estimate> = Vec::new();
    for parameter in fit.material.parameters() {
        let value = fit.material.value(parameter);
        // κ is positive and hardly known: its logarithm is nearer to Gaussian.
        let mesh_error = match parameter {
            Parameter::Kappa => value * mesh_error(&|m: &Ogden| m.value(parameter).ln()),
            _ => mesh_error(&|m: &Ogden| m.value(parameter)),
        };
        estimates.push(estimate(&fit, parameter, value, mesh_error, options.discretisation_factor));
    }
    // Without forces κ is in proportion to the μ₁ that was assumed.
    if has_force && !estimates[0].is_identifiable && !fit.held.contains(0) && options.objective == Objective::Weighted {
        on_stage("bound of kappa");
        estimates[0].interval_95 = [bulk_lower_bound_kpa(&mut problem, &fit, &run.fit_options, is_cancelled)?, None];
    }
    let initial_shear_modulus = has_force.then(|| {
        let (value, sd) = fit.initial_shear_modulus();
        let shear = |m: &Ogden| 0.5 * m.terms.iter().map(|t| t.mu_kpa * t.alpha).sum::<f64>();
        let error = mesh_error(&shear);
        // The shift of a sum of parameters is bounded by its own standard deviation likewise.
        let shift = sd.unwrap_or(0.0) / fit.misfit_factor.sqrt() * fit.structured_misfit;
        let error = options.discretisation_factor * error;
        (value, sd.map(|sd| [-1.0, 1.0].map(|s| value + s * half_width(sd, error, shift))))
    });
    let mut profiles = Vec::new();
    if options.has_profiles {
        on_stage("profiles");
        profiles = profile(&mut problem, &fit, &run.fit_options, is_cancelled)?;
    }
    let mut around = Vec::new();
    if let Some(contour_options) = &options.contours {
        on_stage("contours");
        around = contours(&mut problem, &fit, contour_options, is_cancelled)?;
    }
    run.remark(observed, &fit, has_force, meshes.as_ref());
    let (work, notes) = (run.work, run.notes);
    Ok(Calibration {
        fit,
        estimates,
        initial_shear_modulus,
        selection,
        meshes,
        profiles,
        contours: around,
        has_force,
        work,
        notes,
    })
}

/// Noise and discretisation are independent; the misfit's shift adds up with them in full only in the worst case.
fn half_width(sd: f64, discretisation_sd: f64, possible_shift: f64) -> f64 {
    (TWO_SIDED_95 * sd.hypot(discretisation_sd)).hypot(possible_shift)
}

fn estimate(fit: &RecordingFit, parameter: Parameter, value: f64, mesh_error: f64, factor: f64) -> Estimate {
    let sd = fit.sd(parameter);
    let possible_shift = fit.possible_shift(parameter).unwrap_or(0.0);
    let is_identifiable = sd.is_some_and(|sd| sd < IDENTIFIABILITY_LIMIT * value.abs());
    let discretisation_sd = factor * mesh_error;
    let interval_95 = match sd.filter(|_| is_identifiable) {
        Some(sd) => [-1.0, 1.0].map(|s| {
            let half = half_width(sd, discretisation_sd, possible_shift);
            Some(if parameter == Parameter::Kappa { value * (s * half / value).exp() } else { value + s * half })
        }),
        None => [None; 2],
    };
    Estimate { parameter, value, sd, mesh_error, discretisation_sd, possible_shift, interval_95, is_identifiable }
}

/// The same material with its exponents falling.
pub(super) fn falling(material: &Ogden) -> Ogden {
    let mut sorted = material.clone();
    sorted.terms.sort_by(|a, b| b.alpha.total_cmp(&a.alpha));
    sorted
}

/// What the stages share.
pub(super) struct Run<'a> {
    options: &'a CalibrateOptions,
    fit_options: FitOptions,
    on_stage: &'a dyn Fn(&str),
    is_cancelled: &'a dyn Fn() -> bool,
    work: Work,
    notes: Vec<String>,
}

impl<'a> Run<'a> {
    pub(super) fn new(
        options: &'a CalibrateOptions,
        has_force: bool,
        on_stage: &'a dyn Fn(&str),
        is_cancelled: &'a dyn Fn() -> bool,
    ) -> Run<'a> {
        // Without a force all moduli share a factor: μ₁ stays where it is.
        let held = if has_force { options.fit.held } else { options.fit.held.with(1) };
        let fit_options = FitOptions { held, ..options.fit };
        Run { options, fit_options, on_stage, is_cancelled, work: Work::default(), notes: Vec::new() }
    }

    /// The best fit of each number of terms, up to the first that the deciding rule does not keep.
    pub(super) fn select(
        &mut self,
        problem: &mut CalibrationProblem,
    ) -> Result<(Vec<TermRow>, Vec<RecordingFit>), CalibrationError> {
        let (mut rows, mut fits): (Vec<TermRow>, Vec<RecordingFit>) = (Vec::new(), Vec::new());
        let (most, is_auto) = match self.options.terms {
            TermCount::Auto { max } => (max, true),
            TermCount::Fixed(n) => (n, false),
        };
        while rows.len() < most.clamp(1, MAX_TERMS - 1) {
            (self.on_stage)(&format!("{} term{}", rows.len() + 1, if rows.is_empty() { "" } else { "s" }));
            let starts = match fits.last() {
                None => first_starts(problem.observed()),
                Some(last) => {
                    further_starts(problem, last, &self.fit_options, self.options.num_starts, self.is_cancelled)?
                        .into_iter()
                        .filter(|(promise, _)| *promise >= self.options.least_promise)
                        .map(|(_, start)| start)
                        .collect()
                }
            };
            let Some((row, fit)) = self.best_of(problem, &starts)? else { break };
            rows.push(row);
            fits.push(fit);
            compare(&mut rows, fits[0].num_data);
            let is_last_kept = is_kept(&rows[rows.len() - 1], self.options.rule, self.options.decrement_threshold);
            if is_auto && rows.len() > 1 && !is_last_kept {
                break;
            }
        }
        Ok((rows, fits))
    }

    fn fit(
        &mut self,
        problem: &mut CalibrationProblem,
        start: &Ogden,
        near: Option<&RecordingFit>,
    ) -> Result<RecordingFit, CalibrationError> {
        let fit = problem.fit(start, near, &self.fit_options, self.is_cancelled)?;
        self.work.add(fit.work);
        (self.on_stage)(&format!(
            "  {} terms from α {:?}: χ² {:.1} in {} iterations",
            start.terms.len(),
            start.terms.iter().map(|t| (100.0 * t.alpha).round() / 100.0).collect::<Vec<_>>(),
            fit.chi2,
            fit.iterations
        ));
        Ok(fit)
    }

    /// The best of the fits from `starts`; none where none has an equilibrium or is stable.
    pub(super) fn best_of(
        &mut self,
        problem: &mut CalibrationProblem,
        starts: &[Ogden],
    ) -> Result<Option<(TermRow, RecordingFit)>, CalibrationError> {
        let mut found: Vec<RecordingFit> = Vec::new();
        let mut failure = None;
        for start in starts.iter().take(self.options.num_starts.max(1)) {
            match self.fit(problem, start, None) {
                Ok(fit) => {
                    let visited = problem.visited_stretches(&fit)?;
                    if least_relative_stiffness(&fit.material, &visited) > 0.0 {
                        found.push(fit);
                    }
                }
                Err(e) if e.is_of_the_data() => {
                    (self.on_stage)(&format!("  {} terms: {e}", start.terms.len()));
                    failure = Some(e);
                }
                Err(e) => return Err(e),
            }
        }
        let last = |f: &RecordingFit| f.history.last().copied().unwrap_or(f64::INFINITY);
        found.sort_by(|a, b| last(a).total_cmp(&last(b)));
        // An optimum beats a point on the way that is no better than the noise of a step.
        let best = found.iter().position(|f| f.is_converged && last(f) < last(&found[0]) + 1.0).unwrap_or(0);
        if found.is_empty() {
            return match failure {
                Some(e) if starts.first().is_some_and(|s| s.terms.len() == 1) => Err(e),
                _ => Ok(None),
            };
        }
        let fit = found[best].clone();
        let num_agreeing = found.iter().filter(|f| last(f) < last(&fit) + 1.0).count();
        Ok(Some((self.row(problem, &fit, starts.len(), num_agreeing)?, fit)))
    }

    pub(super) fn row(
        &self,
        problem: &CalibrationProblem,
        fit: &RecordingFit,
        num_starts: usize,
        num_agreeing: usize,
    ) -> Result<TermRow, CalibrationError> {
        let beta = match self.options.objective {
            Objective::Paper { beta } => beta,
            Objective::Weighted => PAPER_BETA,
        };
        let visited = problem.visited_stretches(fit)?;
        Ok(TermRow {
            num_terms: fit.material.terms.len(),
            chi2: fit.chi2,
            chi2_per_datum: fit.chi2_per_datum,
            paper_loss: fit.loss_u + beta * fit.loss_f.unwrap_or(0.0),
            initial_shear_modulus_kpa: fit.initial_shear_modulus().0,
            values: fit.material.parameters().iter().map(|p| fit.material.value(*p)).collect(),
            chi2_decrease: None,
            f_value: None,
            f_p_value: None,
            bic_change: None,
            decrement: None,
            num_starts,
            num_agreeing,
            is_converged: fit.is_converged,
            distance_sd: fit.distance,
            least_relative_stiffness: least_relative_stiffness(&fit.material, &visited),
            degeneracies: degeneracies(fit, &visited),
        })
    }

    fn remark(&mut self, observed: &[Observed], fit: &RecordingFit, has_force: bool, meshes: Option<&MeshComparison>) {
        if !has_force {
            self.notes.push(
                "no force was recorded: displacements determine exponents and ratios of moduli only; μ₁ was assumed"
                    .into(),
            );
        }
        if let Some(MeshComparison { allowance, .. }) = meshes {
            self.notes.push(format!(
                "discretisation: our mesh's displacements are {:.4} mm (rms, largest drive) from the limit of fine meshes; the \
                 intervals allow for errors of {} times that, to one standard deviation",
                allowance.own_error_mm, allowance.factor
            ));
        }
        if fit.misfit_factor > 1.0 && fit.structured_misfit > 0.0 {
            self.notes.push(format!(
                "the misfit is {:.3} times that of the noise: model or data leave something out. The intervals hold what an \
                 error of the size of that misfit could shift each parameter by at most",
                fit.misfit_factor
            ));
        } else if fit.misfit_factor > 1.0 {
            self.notes.push(format!(
                "the misfit is {:.3} times that of the noise: no more than discretisation errors explain",
                fit.misfit_factor
            ));
        }
        for recording in observed.iter().filter(|o| o.is_noise_estimated) {
            self.notes.push(format!("the noise was estimated from the recording: {:.4?} mm", recording.noise_sd_mm));
        }
        for limit in &fit.reached_limits {
            self.notes.push(format!("the estimate stands at a limit: {limit}"));
        }
    }
}
