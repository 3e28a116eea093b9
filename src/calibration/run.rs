//! The stages of a calibration: fits from several starts, the choice of the number of terms, and remarks.

use super::calibrate_options::{CalibrateOptions, TermCount};
use super::error::CalibrationError;
use super::observed::Observed;
use super::options::FitOptions;
use super::outcome::MeshComparison;
use super::prediction::SolverWork;
use super::problem::CalibrationProblem;
use super::recording_fit::RecordingFit;
use super::starts::{first_starts, further_starts, law_starts};
use super::target::{Objective, PAPER_BETA};
use super::terms::{DecidedBy, Rule, TermRow, TermSelection, choose, compare, degeneracies, is_kept};
use crate::fem::side_by_side;
use crate::material::{MAX_TERMS, Material, least_relative_stiffness};

/// The same material with its exponents falling.
pub(super) fn with_falling_exponents(material: &Material) -> Material {
    let mut sorted = material.clone();
    sorted.terms.sort_by(|a, b| b.alpha.total_cmp(&a.alpha));
    sorted
}

/// Where a fit starts: the exponents of its terms, or the parameters of its law.
fn start_in_words(start: &Material) -> String {
    let rounded = |v: f64| (100.0 * v).round() / 100.0;
    if let Some(law) = &start.law {
        let values = law.parameters().iter().map(|p| format!("{} {}", p.name(), rounded(law.value(*p))));
        return format!("law from {}", values.collect::<Vec<_>>().join(", "));
    }
    let count = start.terms.len();
    let exponents: Vec<f64> = start.terms.iter().map(|t| rounded(t.alpha)).collect();
    format!("{count} term{} from α {exponents:?}", if count == 1 { "" } else { "s" })
}

/// The objective that a fit reached.
fn reached(fit: &RecordingFit) -> f64 {
    fit.history.last().copied().unwrap_or(f64::INFINITY)
}

/// What the stages of a calibration share.
pub(super) struct Run<'a> {
    options: &'a CalibrateOptions,
    /// Those of `options` with what is held because no force was recorded.
    pub(super) fit_options: FitOptions,
    /// Earlier fits on this mesh, from which those of their numbers of terms start.
    earlier: &'a [RecordingFit],
    on_stage: &'a dyn Fn(&str),
    is_cancelled: &'a (dyn Fn() -> bool + Sync),
    /// What all fits have taken so far.
    pub(super) work: SolverWork,
    /// Remarks for the reader.
    pub(super) notes: Vec<String>,
}

impl<'a> Run<'a> {
    /// With nothing fitted yet.
    pub(super) fn new(
        options: &'a CalibrateOptions,
        has_force: bool,
        on_stage: &'a dyn Fn(&str),
        is_cancelled: &'a (dyn Fn() -> bool + Sync),
    ) -> Run<'a> {
        // Without a force all moduli share a factor: μ₁ stays where it is.
        let held = if has_force { options.fit.held } else { options.fit.held.with(1) };
        let fit_options = FitOptions { held, ..options.fit };
        let work = SolverWork::default();
        Run { options, fit_options, earlier: &[], on_stage, is_cancelled, work, notes: Vec::new() }
    }

    /// The fits of the numbers of terms that `earlier` has start where those ended.
    pub(super) fn with_earlier(self, earlier: &'a [RecordingFit]) -> Self {
        Run { earlier, ..self }
    }

    /// The best fit of each number of terms, and which number each rule takes.
    ///
    /// # Errors
    /// [`CalibrationError::NotConverged`] where no fit is left; any other error of the fits.
    pub(super) fn select_terms(
        &mut self,
        problem: &CalibrationProblem,
    ) -> Result<(TermSelection, Vec<RecordingFit>), CalibrationError> {
        let options = self.options;
        let (rows, fits) = self.select(problem)?;
        let Some(first) = fits.first() else {
            return Err(CalibrationError::NotConverged {
                iterations: options.fit.max_iterations,
                distance: f64::INFINITY,
                limit: options.fit.tolerance,
            });
        };
        let rule = |rule| choose(&rows, rule, options.decrement_threshold);
        let (decided_by, chosen) = match options.terms {
            _ if options.law.is_some() => (DecidedBy::Fixed, rows.len()),
            TermCount::Fixed(n) => (DecidedBy::Fixed, n.clamp(1, rows.len())),
            TermCount::Auto { .. } => (options.rule.into(), rule(options.rule)),
        };
        let needed_chi2_decrease = (options.rule == Rule::Bic).then(|| 2.0 * (first.num_data as f64).ln());
        let (by_bic, by_f_test, by_decrement) = (rule(Rule::Bic), rule(Rule::FTest), rule(Rule::Decrement));
        Ok((TermSelection { by_bic, by_f_test, by_decrement, decided_by, chosen, needed_chi2_decrease, rows }, fits))
    }

    /// `fit` with its terms in the order of falling exponents.
    pub(super) fn in_order(
        &mut self,
        problem: &CalibrationProblem,
        fit: RecordingFit,
    ) -> Result<RecordingFit, CalibrationError> {
        let sorted = with_falling_exponents(&fit.material);
        if sorted == fit.material {
            return Ok(fit);
        }
        let mut order: Vec<usize> = (0..sorted.terms.len()).collect();
        order.sort_by(|&a, &b| fit.material.terms[b].alpha.total_cmp(&fit.material.terms[a].alpha));
        let predictions = fit.predictions.into_iter().map(|p| p.with_terms_in_order(&order)).collect();
        let there = RecordingFit { material: sorted, predictions, ..fit };
        let fit = problem.fit_from(&there, &self.fit_options, self.is_cancelled)?;
        self.count(&there.material, &fit);
        Ok(fit)
    }

    /// Notes a fit that is near its optimum only.
    ///
    /// # Errors
    /// [`CalibrationError::NotConverged`] where it is far from it.
    pub(super) fn settle(&mut self, fit: &RecordingFit) -> Result<(), CalibrationError> {
        fit.settled(self.options.fit.tolerance)?;
        self.note_unsettled(fit);
        Ok(())
    }

    /// Notes a fit that is not at its optimum.
    pub(super) fn note_unsettled(&mut self, fit: &RecordingFit) {
        let (iterations, distance) = (fit.iterations, fit.distance);
        if !fit.is_converged {
            self.notes.push(format!(
                "the fit was not at the optimum after {iterations} iterations, {distance:.2} standard deviations away by \
                 the linear model: the data hardly tell its terms apart"
            ));
        }
    }

    /// The best fit of each number of terms, up to the first that the deciding rule does not keep.
    pub(super) fn select(
        &mut self,
        problem: &CalibrationProblem,
    ) -> Result<(Vec<TermRow>, Vec<RecordingFit>), CalibrationError> {
        let (mut rows, mut fits): (Vec<TermRow>, Vec<RecordingFit>) = (Vec::new(), Vec::new());
        if let Some(kind) = self.options.law {
            (self.on_stage)("a law in the first invariant");
            let starts = law_starts(problem.observed(), kind);
            return Ok(self.best_of(problem, &starts, None)?.map_or((rows, fits), |(row, fit)| (vec![row], vec![fit])));
        }
        let (most, is_auto) = match self.options.terms {
            TermCount::Auto { max } => (max, true),
            TermCount::Fixed(n) => (n, false),
        };
        while rows.len() < most.clamp(1, MAX_TERMS - 1) {
            (self.on_stage)(&format!("{} term{}", rows.len() + 1, if rows.is_empty() { "" } else { "s" }));
            let found = match self.again(problem, rows.len() + 1)? {
                Some(found) => Some(found),
                None => {
                    let (starts, enough) = self.blind_starts(problem, fits.last())?;
                    self.best_of(problem, &starts, enough.filter(|_| !self.options.tries_all_starts))?
                }
            };
            let Some((row, fit)) = found else { break };
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

    /// The fit of this number of terms from where the earlier one ended; none where there is none, or where that is no
    /// start any more.
    fn again(
        &mut self,
        problem: &CalibrationProblem,
        num_terms: usize,
    ) -> Result<Option<(TermRow, RecordingFit)>, CalibrationError> {
        let Some(earlier) = self.earlier.iter().find(|f| f.material.terms.len() == num_terms) else { return Ok(None) };
        match problem.fit_from(earlier, &self.fit_options, self.is_cancelled) {
            Ok(fit) => {
                self.count(&earlier.material, &fit);
                Ok(Some((self.row(problem, &fit, 1, 1)?, fit)))
            }
            Err(e) if e.is_of_the_data() => Ok(None),
            Err(e) => Err(e),
        }
    }

    /// Starts of a first term, or of one more than the `last` fit has; and the objective that the likeliest of them
    /// promises.
    fn blind_starts(
        &self,
        problem: &CalibrationProblem,
        last: Option<&RecordingFit>,
    ) -> Result<(Vec<Material>, Option<f64>), CalibrationError> {
        // Of a first term nothing is promised: any optimum will do.
        let Some(last) = last else { return Ok((first_starts(problem.observed()), Some(f64::INFINITY))) };
        let further = further_starts(problem, last, &self.fit_options, self.options.num_starts, self.is_cancelled)?;
        let is_promising = |(promise, _): &(f64, Material)| *promise >= self.options.least_promise;
        let promised = further.first().map(|(promise, _)| reached(last) - promise);
        Ok((further.into_iter().filter(is_promising).map(|(_, start)| start).collect(), promised))
    }

    /// Counts and tells a fit.
    fn count(&mut self, start: &Material, fit: &RecordingFit) {
        self.work.add(fit.work);
        (self.on_stage)(&format!("  {}: χ² {:.1} in {} iterations", start_in_words(start), fit.chi2, fit.iterations));
    }

    /// One fit, counted and told.
    pub(super) fn fit(
        &mut self,
        problem: &CalibrationProblem,
        start: &Material,
        near: Option<&RecordingFit>,
    ) -> Result<RecordingFit, CalibrationError> {
        let fit = problem.fit(start, near, &self.fit_options, self.is_cancelled)?;
        self.count(start, &fit);
        Ok(fit)
    }

    /// The best of the fits from `starts`, of which none is tried after one that converged at an objective of `enough`;
    /// none where none has an equilibrium or is stable.
    pub(super) fn best_of(
        &mut self,
        problem: &CalibrationProblem,
        starts: &[Material],
        enough: Option<f64>,
    ) -> Result<Option<(TermRow, RecordingFit)>, CalibrationError> {
        let mut found: Vec<RecordingFit> = Vec::new();
        let mut failure = None;
        // A fit that converged is one that others have to come below.
        let mut to_beat: Option<f64> = None;
        let mut left = &starts[..starts.len().min(self.options.num_starts.max(1))];
        while !left.is_empty() && !to_beat.zip(enough).is_some_and(|(best, enough)| best <= enough) {
            // The first alone, for the others to come below; then side by side, unless one of them may be enough.
            let is_alone = enough.is_some() || found.is_empty();
            let (batch, others) = left.split_at(if is_alone { 1 } else { left.len() });
            left = others;
            let (options, is_cancelled) = (FitOptions { to_beat, ..self.fit_options }, self.is_cancelled);
            let fits = side_by_side(batch.iter().collect(), |start| problem.fit(start, None, &options, is_cancelled));
            for (start, fit) in batch.iter().zip(fits) {
                match fit {
                    Ok(fit) => {
                        self.count(start, &fit);
                        let visited = problem.visited_stretches(&fit)?;
                        if least_relative_stiffness(&fit.material, &visited) > 0.0 {
                            if fit.is_converged && to_beat.is_none_or(|best| reached(&fit) < best) {
                                to_beat = Some(reached(&fit));
                            }
                            found.push(fit);
                        }
                    }
                    Err(e) if e.is_of_the_data() => {
                        (self.on_stage)(&format!("  {}: {e}", start_in_words(start)));
                        failure = Some(e);
                    }
                    Err(e) => return Err(e),
                }
            }
        }
        found.sort_by(|a, b| reached(a).total_cmp(&reached(b)));
        // An optimum beats a point on the way that is no better than the noise of a step.
        let best = found.iter().position(|f| f.is_converged && reached(f) < reached(&found[0]) + 1.0).unwrap_or(0);
        if found.is_empty() {
            return match failure {
                Some(e) if starts.first().is_some_and(|s| s.terms.len() < 2) => Err(e),
                _ => Ok(None),
            };
        }
        let fit = found[best].clone();
        let num_agreeing = found.iter().filter(|f| reached(f) < reached(&fit) + 1.0).count();
        Ok(Some((self.row(problem, &fit, starts.len(), num_agreeing)?, fit)))
    }

    /// The line of the term selection for a fit.
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

    /// Notes what the reader should know of the estimate.
    pub(super) fn remark(
        &mut self,
        observed: &[Observed],
        fit: &RecordingFit,
        has_force: bool,
        meshes: Option<&MeshComparison>,
    ) {
        if let Some(MeshComparison { allowance, .. }) = meshes {
            self.notes.push(format!(
                "discretisation: our mesh's displacements are {:.4} mm (rms, largest drive) from the limit of fine meshes; the \
                 intervals allow for errors of {} times that, to one standard deviation",
                allowance.own_error_mm, allowance.factor
            ));
        }
        self.remark_misfit(fit);
        self.remark_data(observed, fit, has_force);
    }

    /// Whether the misfit is more than noise, and what that does to the intervals.
    fn remark_misfit(&mut self, fit: &RecordingFit) {
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
    }

    /// What the recordings lack, and at which limits the estimate stands.
    pub(super) fn remark_data(&mut self, observed: &[Observed], fit: &RecordingFit, has_force: bool) {
        if !has_force {
            self.notes.push(
                "no force was recorded: displacements determine exponents and ratios of moduli only; μ₁ was assumed"
                    .into(),
            );
        }
        for recording in observed.iter().filter(|o| o.is_noise_estimated) {
            self.notes.push(format!("the noise was estimated from the recording: {:.4?} mm", recording.noise_sd_mm));
        }
        for [x, y, z] in observed.iter().filter_map(Observed::noise_range) {
            self.notes.push(format!(
                "the noise differs over the image, and voxels count by the noise around them: a tenth of them have less \
                 than {:.2?} times the typical one along x, y, z, a tenth more than {:.2?} times",
                [x[0], y[0], z[0]],
                [x[1], y[1], z[1]]
            ));
        }
        for (n, recording) in observed.iter().enumerate().filter(|(_, o)| o.num_outliers > 0) {
            let of = if observed.len() > 1 { format!(" of recording {}", n + 1) } else { String::new() };
            self.notes.push(format!(
                "{} voxels{of} hold no displacement and are left out: they agree with hardly any neighbour, as where a mask \
                 marks more than the sample",
                recording.num_outliers
            ));
        }
        for limit in &fit.reached_limits {
            self.notes.push(format!("the estimate stands at a limit: {limit}"));
        }
    }
}
