//! The search: explore every structure with samples, refine the best with gradients, confirm the best of those on a
//! finer mesh with the scan's own voxels. Deterministic by seed at any number of threads: batches are fixed, every
//! evaluation depends on its own input alone, results are taken in order.

use super::candidate::Candidate;
use super::checkpoint::Checkpoint;
use super::confirm::Confirmed;
use super::evaluator::Evaluator;
use super::explore::{is_makeable, sample};
use super::local::{LocalSettings, improve};
use super::objective::Reference;
use super::search_error::SearchError;
use super::search_run::{Attempt, Progress, ProgressSink, SearchRun};
use super::space::{Subspace, subspaces};
use super::state::State;
use super::structure_problem::{Log, StructureProblem};
use super::study::Study;
use super::unfinished::Unfinished;
use crate::specimen::Specimen;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What the search found, best first.
#[derive(Clone, Debug)]
pub struct Found {
    /// The base specimen, at its best drive within the study's range.
    pub base: Confirmed,
    /// Confirmed designs, best objective first, those within every limit before others.
    pub ranked: Vec<Confirmed>,
    /// Every design evaluated, in order.
    pub candidates: Vec<Candidate>,
    /// Largest objective within limits after each evaluation.
    pub history: Vec<f64>,
    /// Evaluations that failed, with their reasons.
    pub failures: Vec<String>,
    /// Forward solutions at search fidelity, about: evaluations × material samples.
    pub num_evaluations: usize,
}

impl Found {
    /// The same as of a run that was stopped after its search, in `stage`.
    pub fn unfinished(&self, study: &Study, stage: &str) -> Unfinished {
        let candidate = |c: &Confirmed| Candidate {
            specimen: c.specimen.clone(),
            objective: c.objective,
            merit: c.objective.ln(),
            is_within_limits: c.is_within_limits,
            stage: "confirm".into(),
        };
        let candidates: Vec<Candidate> = self.ranked.iter().map(candidate).collect();
        let mut unfinished = Unfinished::new(study, stage, &candidates, self.num_evaluations);
        unfinished.note =
            "Stopped during the verification. These designs are confirmed on the fine mesh, not verified.".into();
        unfinished
    }
}

/// The base specimen at one drive: its largest within the study's range, or the range's largest.
pub fn base_at_drive(study: &Study) -> Specimen {
    let range = study.drive_range();
    let drive =
        study.base.drive_mm.iter().copied().filter(|d| *d >= range.min && *d <= range.max).fold(f64::NAN, f64::max);
    let mut base = study.base.clone();
    base.drive_mm = vec![if drive.is_nan() { range.max } else { drive }];
    base
}

/// Runs a study's search.
///
/// # Errors
/// [`SearchError`].
pub fn search(
    study: &Study,
    checkpoint: &Checkpoint,
    progress: ProgressSink,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Found, SearchError> {
    let run = SearchRun { study, evaluator: Evaluator::new(study), checkpoint, is_cancelled, progress };
    run.run()
}

impl SearchRun<'_> {
    fn run(&self) -> Result<Found, SearchError> {
        let study = self.study;
        let report = |stage, done, total, best| (self.progress)(&Progress { stage, done, total, best });
        report("base", 0, 1, None);
        let base_specimen = base_at_drive(study);
        let base = match self.evaluated(&base_specimen, None) {
            None => return Err(State::default().stopped(study, "base")),
            Some(Err(cause)) => return Err(SearchError::Base { cause }),
            Some(Ok(evaluated)) => evaluated,
        };
        let reference = Reference::new(study, self.evaluator.samples(), &base.responses);
        let spaces = subspaces(study);
        let mut state = State::default();
        self.explore(&reference, &spaces, &base_specimen, &mut state)?;
        self.refine(&reference, &spaces, &mut state)?;
        let (base, ranked) = self.confirm_all(&base_specimen, &reference, &spaces, &mut state)?;
        Ok(Found {
            base,
            ranked,
            history: state.history,
            failures: state.failures,
            num_evaluations: state.num_evaluations,
            candidates: state.candidates,
        })
    }

    fn explore(
        &self,
        reference: &Reference,
        spaces: &[Subspace],
        base: &Specimen,
        state: &mut State,
    ) -> Result<(), SearchError> {
        let study = self.study;
        let total = study.budget.explore;
        // The base at every drive limit, if it can be made, then two rounds: all structures alike, then the better
        // half.
        let mut batch: Vec<(usize, Vec<f64>)> = Vec::new();
        for (index, space) in spaces.iter().enumerate() {
            for drive in [base.drive_mm[0], study.drive_range().max] {
                if let Some(vector) = space.vector_of(base, drive)
                    && is_makeable(&space.specimen(&vector), &study.limits, study.scan.voxel_mm)
                {
                    batch.push((index, vector));
                }
            }
        }
        let first_round = (total / 2).max(spaces.len());
        let mut quota = vec![(first_round / spaces.len()).max(1); spaces.len()];
        for round in 0..2u64 {
            for (index, space) in spaces.iter().enumerate() {
                let wanted = if space.structure.num_holes() == 0 { quota[index].min(3) } else { quota[index] };
                let stream = 2 * index as u64 + round;
                for vector in sample(space, &study.limits, study.scan.voxel_mm, wanted, study.seed, stream) {
                    batch.push((index, vector));
                }
            }
            self.evaluate_batch(reference, spaces, &std::mem::take(&mut batch), total, state)?;
            let mut order: Vec<usize> = (0..spaces.len()).collect();
            let best = |index: usize| state.best_of_space(index);
            order.sort_by(|a, b| best(*b).total_cmp(&best(*a)).then(a.cmp(b)));
            quota = vec![0; spaces.len()];
            let kept = order.len().div_ceil(2);
            let left = total.saturating_sub(state.candidates.len() + state.failures.len());
            for index in &order[..kept] {
                quota[*index] = left / kept;
            }
        }
        Ok(())
    }

    fn evaluate_batch(
        &self,
        reference: &Reference,
        spaces: &[Subspace],
        batch: &[(usize, Vec<f64>)],
        total: usize,
        state: &mut State,
    ) -> Result<(), SearchError> {
        let done = AtomicUsize::new(state.num_evaluations);
        let best_before = state.history.last().copied();
        // Largest merit seen by any thread, for display only.
        let best = std::sync::Mutex::new(best_before);
        let results: Vec<Option<Attempt>> = batch
            .par_iter()
            .map(|(space, vector)| {
                let attempt = self.evaluated(&spaces[*space].specimen(vector), None);
                if let (Some(Ok(evaluated)), Ok(mut best)) = (&attempt, best.lock()) {
                    let judged = reference.judge(evaluated);
                    if judged.margins.iter().all(|m| *m >= 0.0) {
                        let gain = reference.objective(&judged).exp();
                        *best = Some(best.map_or(gain, |b| b.max(gain)));
                    }
                }
                let shown = best.lock().ok().and_then(|b| *b);
                let count = done.fetch_add(1, Ordering::Relaxed) + 1;
                (self.progress)(&Progress { stage: "explore", done: count.min(total), total, best: shown });
                attempt
            })
            .collect();
        let mut was_stopped = false;
        for ((space, vector), result) in batch.iter().zip(results) {
            let specimen = spaces[*space].specimen(vector);
            match result {
                None => was_stopped = true,
                Some(Ok(evaluated)) => {
                    state.add((*space, vector), specimen, reference, &reference.judge(&evaluated), "explore");
                }
                Some(Err(cause)) => state.fail(&specimen, &cause),
            }
        }
        if was_stopped { Err(state.stopped(self.study, "explore")) } else { Ok(()) }
    }

    fn refine(&self, reference: &Reference, spaces: &[Subspace], state: &mut State) -> Result<(), SearchError> {
        let budget = self.study.budget;
        let starts = state.starts(budget.refine);
        let total = starts.len() * budget.iterations;
        let done = AtomicUsize::new(0);
        // Largest gain within the limits seen by any thread, for display only.
        let best = std::sync::Mutex::new(state.history.last().copied());
        let on_evaluation = |gain: Option<f64>| {
            let shown = best.lock().ok().and_then(|mut best| {
                *best = best.map_or(gain, |b| Some(gain.map_or(b, |g| b.max(g))));
                *best
            });
            let count = done.fetch_add(1, Ordering::Relaxed) + 1;
            (self.progress)(&Progress { stage: "refine", done: count.min(total), total, best: shown });
        };
        let outcomes: Vec<(Log, bool)> = starts
            .par_iter()
            .map(|(index, start)| {
                let problem = StructureProblem::new(self, reference, &spaces[*index], &on_evaluation);
                let settings = LocalSettings { max_evaluations: budget.iterations, ..LocalSettings::default() };
                improve(&problem, start, &settings);
                let was_stopped = problem.was_stopped.load(Ordering::Relaxed);
                (problem.log.into_inner().unwrap_or_default(), was_stopped)
            })
            .collect();
        let mut any_stopped = false;
        for ((index, _), (log, was_stopped)) in starts.iter().zip(outcomes) {
            for (vector, judged) in log {
                match judged {
                    Some(judged) => {
                        let specimen = spaces[*index].specimen(&vector);
                        state.add((*index, &vector), specimen, reference, &judged, "refine");
                    }
                    None => state.num_evaluations += 1,
                }
            }
            any_stopped |= was_stopped;
        }
        if any_stopped { Err(state.stopped(self.study, "refine")) } else { Ok(()) }
    }
}
