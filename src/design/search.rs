//! The search: explore every structure with samples, refine the best with gradients, confirm the best of those on a finer
//! mesh with the scan's own voxels. Deterministic by seed at any number of threads: batches are fixed, every evaluation
//! depends on its own input alone, results are taken in order.

use super::checkpoint::{Checkpoint, CheckpointError};
use super::confirm::{Confirmed, confirm};
use super::explore::{geometry_margins, is_makeable, sample};
use super::local::{LocalModel, LocalProblem, LocalSettings, improve};
use super::objective::{Judged, Reference};
use super::response::{Evaluated, EvaluationFailure, Evaluator};
use super::space::{Subspace, subspaces};
use super::study::{Combine, Study};
use crate::provenance::{VERSION, input_hash};
use crate::specimen::Specimen;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Why a search has no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SearchError {
    /// The base specimen cannot be evaluated, so there is nothing to compare with.
    #[error("the base specimen cannot be evaluated: {cause}; change the base, its drive or the material")]
    Base {
        /// Why.
        cause: EvaluationFailure,
    },
    /// No design could be evaluated.
    #[error("none of {tried} designs could be evaluated and kept within the limits; widen the limits or the ranges")]
    NothingFeasible {
        /// Designs tried.
        tried: usize,
    },
    /// The checkpoint.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// Stopped from outside.
    #[error("stopped after {evaluations} evaluations; best so far: {best}")]
    Stopped {
        /// Evaluations finished.
        evaluations: usize,
        /// The best design's name and gain.
        best: String,
    },
}

/// How far a search is.
#[derive(Clone, Debug)]
pub struct Progress {
    /// `base`, `explore`, `refine`, `confirm`, `verify`.
    pub stage: &'static str,
    /// Finished in this stage.
    pub done: usize,
    /// Of.
    pub total: usize,
    /// Largest objective so far (gain over the base), of designs within the limits.
    pub best: Option<f64>,
}

/// Receives progress; called from several threads.
pub type ProgressSink<'a> = &'a (dyn Fn(&Progress) + Sync);

/// One design that the search has seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// The design; its only drive is the one it is scanned at.
    pub specimen: Specimen,
    /// Gain over the base at search fidelity.
    pub objective: f64,
    /// ln of the objective less penalties.
    pub merit: f64,
    /// Whether force, stretch and guard limits hold at search fidelity.
    pub is_within_limits: bool,
    /// Where it came from.
    pub stage: String,
}

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

/// Points of a refinement and what they were judged.
type Log = Vec<(Vec<f64>, Option<Judged>)>;

type Tried = Result<Evaluated, EvaluationFailure>;

struct Search<'a> {
    study: &'a Study,
    evaluator: Evaluator<'a>,
    checkpoint: &'a Checkpoint,
    is_cancelled: &'a (dyn Fn() -> bool + Sync),
    progress: ProgressSink<'a>,
}

/// Hash of a study, which a checkpoint must share.
pub fn study_hash(study: &Study) -> String {
    input_hash(&serde_json::json!({ "study": study, "version": VERSION }))
}

/// The base specimen at one drive: its largest within the study's range, or the range's largest.
pub fn base_at_drive(study: &Study) -> Specimen {
    let range = study.vary.drive_mm;
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
    let run = Search { study, evaluator: Evaluator::new(study), checkpoint, is_cancelled, progress };
    run.run()
}

impl Search<'_> {
    fn tried(&self, specimen: &Specimen, subspace: Option<&Subspace>) -> Option<Tried> {
        let kind = if subspace.is_some() { "gradient" } else { "value" };
        let key = input_hash(&serde_json::json!({ "specimen": specimen, "kind": kind }));
        self.checkpoint.get_or(&key, || match self.evaluator.evaluate(specimen, subspace, &|| (self.is_cancelled)()) {
            Err(EvaluationFailure::Cancelled) => None,
            other => Some(other),
        })
    }

    fn run(&self) -> Result<Found, SearchError> {
        let study = self.study;
        let report = |stage, done, total, best| (self.progress)(&Progress { stage, done, total, best });
        report("base", 0, 1, None);
        let base_specimen = base_at_drive(study);
        let base = match self.tried(&base_specimen, None) {
            None => return Err(SearchError::Stopped { evaluations: 0, best: "none".into() }),
            Some(Err(cause)) => return Err(SearchError::Base { cause }),
            Some(Ok(evaluated)) => evaluated,
        };
        let reference = Reference::new(study, self.evaluator.samples(), &base);
        let spaces = subspaces(study);
        let mut state = State::default();
        self.explore(&reference, &spaces, &base_specimen, &mut state)?;
        self.refine(&reference, &spaces, &mut state)?;
        let finalists = state.finalists(study);
        if finalists.is_empty() {
            return Err(SearchError::NothingFeasible { tried: state.candidates.len() });
        }
        let (base, ranked) = self.confirm_all(&base_specimen, &finalists, &state)?;
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
        // The base at every drive limit, if it can be made, then two rounds: all structures alike, then the better half.
        let mut batch: Vec<(usize, Vec<f64>)> = Vec::new();
        for (index, space) in spaces.iter().enumerate() {
            for drive in [base.drive_mm[0], study.vary.drive_mm.max] {
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
        let results: Vec<Option<Tried>> = batch
            .par_iter()
            .map(|(space, vector)| {
                let tried = self.tried(&spaces[*space].specimen(vector), None);
                if let (Some(Ok(evaluated)), Ok(mut best)) = (&tried, best.lock()) {
                    let judged = reference.judge(evaluated);
                    if judged.margins.iter().all(|m| *m >= 0.0) {
                        let gain = reference.objective(&judged).exp();
                        *best = Some(best.map_or(gain, |b| b.max(gain)));
                    }
                }
                let shown = best.lock().ok().and_then(|b| *b);
                let count = done.fetch_add(1, Ordering::Relaxed) + 1;
                (self.progress)(&Progress { stage: "explore", done: count.min(total), total, best: shown });
                tried
            })
            .collect();
        for ((space, vector), result) in batch.iter().zip(results) {
            let specimen = spaces[*space].specimen(vector);
            match result {
                None => return Err(state.stopped()),
                Some(Ok(evaluated)) => {
                    state.add((*space, vector), specimen, reference, &reference.judge(&evaluated), "explore");
                }
                Some(Err(cause)) => state.fail(&specimen, &cause),
            }
        }
        Ok(())
    }

    fn refine(&self, reference: &Reference, spaces: &[Subspace], state: &mut State) -> Result<(), SearchError> {
        let budget = self.study.budget;
        let starts = state.starts(budget.refine);
        let total = starts.len() * budget.iterations;
        let done = AtomicUsize::new(0);
        let best = state.history.last().copied();
        let outcomes: Vec<(Log, bool)> = starts
            .par_iter()
            .map(|(index, start)| {
                let problem = Problem {
                    search: self,
                    reference,
                    subspace: &spaces[*index],
                    log: std::sync::Mutex::default(),
                    was_stopped: std::sync::atomic::AtomicBool::new(false),
                    on_evaluation: &|| {
                        let count = done.fetch_add(1, Ordering::Relaxed) + 1;
                        (self.progress)(&Progress { stage: "refine", done: count.min(total), total, best });
                    },
                };
                let settings = LocalSettings { max_evaluations: budget.iterations, ..LocalSettings::default() };
                improve(&problem, start, &settings);
                let was_stopped = problem.was_stopped.load(Ordering::Relaxed);
                (problem.log.into_inner().unwrap_or_default(), was_stopped)
            })
            .collect();
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
            if was_stopped {
                return Err(state.stopped());
            }
        }
        Ok(())
    }

    fn confirm_all(
        &self,
        base: &Specimen,
        finalists: &[Specimen],
        state: &State,
    ) -> Result<(Confirmed, Vec<Confirmed>), SearchError> {
        let mut all = vec![base.clone()];
        all.extend_from_slice(finalists);
        let (total, done) = (all.len(), AtomicUsize::new(0));
        let best = state.history.last().copied();
        let results: Vec<Option<Result<Confirmed, EvaluationFailure>>> = all
            .par_iter()
            .map(|specimen| {
                let key = input_hash(&serde_json::json!({ "specimen": specimen, "kind": "confirm" }));
                let result =
                    self.checkpoint.get_or(&key, || match confirm(self.study, specimen, &|| (self.is_cancelled)()) {
                        Err(EvaluationFailure::Cancelled) => None,
                        other => Some(other),
                    });
                let count = done.fetch_add(1, Ordering::Relaxed) + 1;
                (self.progress)(&Progress { stage: "confirm", done: count, total, best });
                result
            })
            .collect();
        let mut results = results.into_iter();
        let base = match results.next().flatten() {
            None => return Err(state.stopped()),
            Some(Err(cause)) => return Err(SearchError::Base { cause }),
            Some(Ok(mut base)) => {
                base.compare(self.study, &base.clone());
                base
            }
        };
        let mut ranked = Vec::new();
        for result in results {
            match result {
                None => return Err(state.stopped()),
                Some(Err(_)) => {}
                Some(Ok(mut confirmed)) => {
                    confirmed.compare(self.study, &base);
                    ranked.push(confirmed);
                }
            }
        }
        ranked.sort_by(|a, b| b.is_within_limits.cmp(&a.is_within_limits).then(b.objective.total_cmp(&a.objective)));
        if !ranked.first().is_some_and(|best| best.is_within_limits) {
            return Err(SearchError::NothingFeasible { tried: state.candidates.len() });
        }
        Ok((base, ranked))
    }
}

/// What has been seen so far.
#[derive(Default)]
struct State {
    candidates: Vec<Candidate>,
    /// Structure and vector of each candidate.
    points: Vec<(usize, Vec<f64>)>,
    history: Vec<f64>,
    failures: Vec<String>,
    num_evaluations: usize,
}

impl State {
    fn add(
        &mut self,
        (space, vector): (usize, &[f64]),
        specimen: Specimen,
        reference: &Reference,
        judged: &Judged,
        stage: &str,
    ) {
        let objective = reference.objective(judged).exp();
        let is_within_limits = judged.margins.iter().all(|m| *m >= -1e-9);
        self.num_evaluations += 1;
        let best = self.history.last().copied().unwrap_or(0.0);
        self.history.push(if is_within_limits { best.max(objective) } else { best });
        self.points.push((space, vector.to_vec()));
        self.candidates.push(Candidate {
            specimen,
            objective,
            merit: reference.merit(judged),
            is_within_limits,
            stage: stage.into(),
        });
    }

    fn fail(&mut self, specimen: &Specimen, cause: &EvaluationFailure) {
        self.num_evaluations += 1;
        self.failures.push(format!("{}: {cause}", specimen.name));
    }

    fn best_of_space(&self, space: usize) -> f64 {
        let merits = self.candidates.iter().zip(&self.points).filter(|(_, p)| p.0 == space).map(|(c, _)| c.merit);
        merits.fold(f64::NEG_INFINITY, f64::max)
    }

    /// Candidates by merit, best first.
    fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.candidates.len()).collect();
        order.sort_by(|a, b| self.candidates[*b].merit.total_cmp(&self.candidates[*a].merit).then(a.cmp(b)));
        order
    }

    /// The best candidates to refine, one of each structure as far as there are structures, best first.
    fn starts(&self, count: usize) -> Vec<(usize, Vec<f64>)> {
        let order = self.order();
        let mut starts: Vec<(usize, Vec<f64>)> = Vec::new();
        for per_structure in 1..=count.max(1) {
            let mut used = std::collections::HashMap::new();
            for &index in &order {
                let seen: &mut usize = used.entry(self.points[index].0).or_default();
                *seen += 1;
                if starts.len() < count && *seen == per_structure {
                    starts.push(self.points[index].clone());
                }
            }
        }
        starts
    }

    /// Designs to confirm: the best by merit, and the best of every number of holes, so that the report can say where
    /// holes help.
    fn finalists(&self, study: &Study) -> Vec<Specimen> {
        let mut finalists: Vec<Specimen> = Vec::new();
        let mut per_space = std::collections::HashMap::new();
        let mut by_count = std::collections::BTreeMap::new();
        for index in self.order() {
            let candidate = &self.candidates[index];
            by_count.entry(candidate.specimen.holes.len()).or_insert_with(|| candidate.specimen.clone());
            let count: &mut usize = per_space.entry(self.points[index].0).or_default();
            // Near copies along one refinement teach nothing: four of a structure.
            if finalists.len() < study.budget.confirm && *count < 4 {
                *count += 1;
                finalists.push(candidate.specimen.clone());
            }
        }
        for specimen in by_count.into_values() {
            if !finalists.contains(&specimen) {
                finalists.push(specimen);
            }
        }
        finalists
    }

    fn stopped(&self) -> SearchError {
        let best = self.order().first().map_or("none".into(), |&i| {
            let c = &self.candidates[i];
            format!("{} with a gain of {:.3}", c.specimen.name, c.objective)
        });
        SearchError::Stopped { evaluations: self.num_evaluations, best }
    }
}

/// A structure's local problem.
struct Problem<'a> {
    search: &'a Search<'a>,
    reference: &'a Reference<'a>,
    subspace: &'a Subspace,
    log: std::sync::Mutex<Log>,
    was_stopped: std::sync::atomic::AtomicBool,
    on_evaluation: &'a (dyn Fn() + Sync),
}

impl LocalProblem for Problem<'_> {
    fn model(&self, x: &[f64]) -> Option<LocalModel> {
        let specimen = self.subspace.specimen(x);
        let tried = self.search.tried(&specimen, Some(self.subspace));
        (self.on_evaluation)();
        let judged = match tried {
            None => {
                self.was_stopped.store(true, Ordering::Relaxed);
                None
            }
            Some(Err(_)) => None,
            Some(Ok(evaluated)) => Some(self.reference.judge(&evaluated)),
        };
        if let Ok(mut log) = self.log.lock() {
            log.push((x.to_vec(), judged.clone()));
        }
        let judged = judged?;
        // From per-millimetre to per-unit of the scaled variables.
        let scaled = |rows: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let count = rows.first().map_or(0, Vec::len);
            (0..count)
                .map(|entry| {
                    rows.iter()
                        .zip(&self.subspace.ranges)
                        .map(|(row, range)| row[entry] * (range.max - range.min))
                        .collect()
                })
                .collect()
        };
        let is_mean = self.search.study.objective.combine == Combine::GeometricMean;
        Some(LocalModel {
            weights: if is_mean { judged.weights.clone() } else { Vec::new() },
            gain_gradients: scaled(&judged.gain_gradients),
            margin_gradients: scaled(&judged.margin_gradients),
            gains: judged.gains,
            margins: judged.margins,
        })
    }

    fn geometry(&self, x: &[f64]) -> Vec<f64> {
        let study = self.search.study;
        geometry_margins(&self.subspace.specimen(x), &study.limits, study.scan.voxel_mm)
    }

    fn is_free(&self, index: usize) -> bool {
        self.subspace.is_continuous(index)
    }
}
