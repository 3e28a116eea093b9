//! The search: explore every structure with samples and by what they teach, improve the best by gradients and by what
//! is learnt, confirm the best of those on finer meshes. What is compared is what the confirmation compares, the scan's
//! own voxels included; gradients alone are of integrals in their place. Deterministic by seed at any number of
//! threads: batches are fixed, every evaluation depends on its own input alone, results are taken in order.

use super::candidate::Candidate;
use super::checkpoint::Checkpoint;
use super::confirm::Confirmed;
use super::evaluator::Evaluator;
use super::explore::{is_makeable, sample};
use super::fidelity::Fidelity;
use super::local::{LocalSettings, improve};
use super::material_samples::sample_materials;
use super::objective::Reference;
use super::propose::RaceRules;
use super::search_error::SearchError;
use super::search_run::{Attempt, Judge, Progress, ProgressSink, SearchRun};
use super::space::{Subspace, Variable, subspaces};
use super::state::{MOST_FINE_FAILURES, State};
use super::structure_problem::StructureProblem;
use super::study::Study;
use super::ties::{equal_to_best, simplest};
use super::tolerances::DimensionTolerance;
use super::unfinished::Unfinished;
use super::vary_scan::ChosenScan;
use crate::specimen::Specimen;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Proposals of the solid blocks before anything else is sampled.
const SOLID_PROPOSALS: usize = 10;
/// Parts of the race on the coarse mesh, before each of which the best designs are tried on the fine one.
const LAPS: usize = 3;
/// Structures of which one is.
const CHECKED_STRUCTURES: usize = 8;
/// How far the next lies from those that had no equilibrium there, in ranges of the variables.
const CHECKS_APART: f64 = 0.25;

/// What the search found, best first.
#[derive(Clone, Debug)]
pub struct Found {
    /// The base specimen, at its best drive within the study's range.
    pub base: Confirmed,
    /// Confirmed designs, best objective first, those within every limit before others.
    pub ranked: Vec<Confirmed>,
    /// Places in `ranked` of the designs that are equal to the best within what meshes leave open, the best included.
    pub equal_to_best: Vec<usize>,
    /// Place of the one of them that is simplest to make, which is recommended.
    pub simplest: usize,
    /// What the design that is recommended loses where its dimensions are off.
    pub tolerances: Vec<DimensionTolerance>,
    /// What is left of the gains if the scan's grid lies anywhere; `None` where the study takes it to do so, or its
    /// objective does not hang on it.
    pub gain_anywhere: Option<GainAnywhere>,
    /// The scan that was found for the best, in which all of `ranked` are confirmed; `None` where it is the study's.
    pub scan: Option<ChosenScan>,
    /// Every design evaluated, in order.
    pub candidates: Vec<Candidate>,
    /// Largest objective within limits after each evaluation.
    pub history: Vec<f64>,
    /// Evaluations that failed, with their reasons.
    pub failures: Vec<String>,
    /// Forward solutions at search fidelity, about: evaluations × material samples.
    pub num_evaluations: usize,
}

/// Objectives over the base's if the scan's grid lies anywhere, in place of on the middle of each specimen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GainAnywhere {
    /// Of the best design.
    pub best: f64,
    /// Of the one that is recommended.
    pub recommended: f64,
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
    study.check_search()?;
    let run = SearchRun { study, evaluator: Evaluator::new(study), checkpoint, is_cancelled, progress };
    run.run()
}

impl SearchRun<'_> {
    fn run(&self) -> Result<Found, SearchError> {
        let study = self.study;
        (self.progress)(&Progress { stage: "base", done: 0, total: 1, best: None, leader: None });
        let base_specimen = base_at_drive(study);
        let mut state = State::default();
        let (base, (coarse, fine)) = rayon::join(
            || self.confirm_base(&base_specimen, &state),
            || (self.estimated(&base_specimen, Fidelity::Coarse), self.estimated(&base_specimen, Fidelity::Fine)),
        );
        let base = base?;
        let coarse = self.judge(&base, Fidelity::Coarse, coarse, &state)?;
        let fine = self.judge(&base, Fidelity::Fine, fine, &state)?;
        let spaces = subspaces(study);
        self.explore((&coarse, &fine), &spaces, &base_specimen, &mut state)?;
        if study.budget.refine > 0 {
            let in_integrals = self.in_integrals(&base_specimen, &state)?;
            let in_integrals = self.as_confirmed(&base, &in_integrals);
            self.refine(&fine, &in_integrals, &spaces, &mut state)?;
        }
        self.race(&RaceRules::of_proposals(study.budget.propose), &fine, &spaces, &mut state)?;
        if spaces.iter().any(|s| s.structure.num_holes() > 0) {
            self.race(&RaceRules::of_solid(study.budget.propose, &spaces), &fine, &spaces, &mut state)?;
        }
        self.step_by_rows(&fine, &spaces, &mut state)?;
        let ranked = self.confirm_all(&base, &spaces, &mut state)?;
        let (ranked, scan) = self.with_best_scan(&base, ranked, &mut state)?;
        let equal_to_best = equal_to_best(study, &base, &ranked);
        let simplest = simplest(&ranked, &equal_to_best).unwrap_or(0);
        let tolerances = match ranked.get(simplest) {
            Some(recommended) => self.tolerances(&base.specimen, recommended, &state)?,
            None => Vec::new(),
        };
        let anywhere = |place: usize| {
            let design: &Confirmed = ranked.get(place)?;
            self.gain_anywhere(&base.specimen, &design.specimen, design.scan()?)
        };
        let best = anywhere(0);
        let recommended = if simplest == 0 { best } else { anywhere(simplest) };
        Ok(Found {
            gain_anywhere: best.zip(recommended).map(|(best, recommended)| GainAnywhere { best, recommended }),
            equal_to_best,
            simplest,
            tolerances,
            scan,
            base,
            ranked,
            history: state.history,
            failures: state.failures,
            num_evaluations: state.num_evaluations,
            candidates: state.candidates,
        })
    }

    /// Gains over the base at a fidelity, at which the base gave `estimated`; limits as at the confirmation.
    fn judge(
        &self,
        base: &Confirmed,
        fidelity: Fidelity,
        estimated: Option<Attempt>,
        state: &State,
    ) -> Result<Judge<'_>, SearchError> {
        let reference = self.reference_from(estimated, state)?;
        Ok(Judge { fidelity, reference: self.as_confirmed(base, &reference) })
    }

    /// Gains over the base in integrals in place of voxels.
    pub(super) fn in_integrals(&self, base: &Specimen, state: &State) -> Result<Reference<'_>, SearchError> {
        self.reference_from(self.evaluated(base, None), state)
    }

    /// Gains over a base with this evaluation.
    pub(super) fn reference_from(&self, base: Option<Attempt>, state: &State) -> Result<Reference<'_>, SearchError> {
        match base {
            None => Err(state.stopped(self.study, "base")),
            Some(Err(cause)) => Err(SearchError::Base { cause }),
            Some(Ok(base)) => Ok(Reference::new(self.study, self.evaluator.samples(), &base.responses)),
        }
    }

    /// The same with the limits of the confirmation, as far as the base shows the difference: there they must hold for
    /// every material that the priors leave possible, in the search for the central ones alone, unless the study's
    /// budget says otherwise.
    fn as_confirmed<'a>(&self, base: &Confirmed, reference: &Reference<'a>) -> Reference<'a> {
        let samples = sample_materials(&self.study.materials);
        let confirmed = Reference::new(self.study, &samples, &base.responses).of_base();
        reference.lowered(&confirmed.worst_margins, &reference.of_base().worst_margins)
    }

    fn explore(
        &self,
        (judge, fine): (&Judge, &Judge),
        spaces: &[Subspace],
        base: &Specimen,
        state: &mut State,
    ) -> Result<(), SearchError> {
        let study = self.study;
        let total = study.budget.explore;
        // The base at every drive limit, if it can be made, and samples of the solid blocks.
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
        let quota = (total / 2).div_ceil(spaces.len().max(1)).max(1);
        let is_solid = |space: &Subspace| space.structure.num_holes() == 0;
        let sampled = |index: usize, known: &[(Variable, f64)]| {
            let made = (&study.limits, study.scan.voxel_mm);
            let vectors = sample(&spaces[index], made, quota, (study.seed, index as u64), known);
            vectors.into_iter().map(move |vector| (index, vector)).collect::<Vec<_>>()
        };
        let (solid, holed): (Vec<usize>, Vec<usize>) = (0..spaces.len()).partition(|&s| is_solid(&spaces[s]));
        batch.extend(solid.iter().flat_map(|&s| sampled(s, &[])));
        self.evaluate_batch(judge, spaces, ("explore", &batch, total), state)?;
        if !holed.is_empty() {
            // A good solid block is soon found, and shows where to begin with holes.
            let (proposals, counted) = (SOLID_PROPOSALS.min(total / 6), (state.num_evaluations, total));
            self.race(&RaceRules::of_samples(proposals, Some(solid.clone()), counted), judge, spaces, state)?;
        }
        // Half of the samples of a structure have the dimensions and the drive of the best design with fewer holes.
        let num_holes = |space: usize| spaces[space].structure.num_holes();
        let mut counts: Vec<usize> = holed.iter().map(|&s| num_holes(s)).collect();
        counts.dedup();
        for count in counts {
            let known_of = |index: usize| {
                let test = spaces[index].structure.test;
                let alike = |s: usize| num_holes(s) < count && spaces[s].structure.test == test;
                state.best_among(&alike).map_or(Vec::new(), |(s, vector)| {
                    let values = spaces[*s].variables.iter().copied().zip(vector.iter().copied());
                    values.filter(|(variable, _)| !variable.is_of_holes()).collect::<Vec<_>>()
                })
            };
            let with_count = holed.iter().filter(|&&s| num_holes(s) == count);
            let batch: Vec<(usize, Vec<f64>)> = with_count.flat_map(|&s| sampled(s, &known_of(s))).collect();
            self.evaluate_batch(judge, spaces, ("explore", &batch, total), state)?;
        }
        for lap in 0..LAPS {
            self.check_on_fine_mesh(fine, spaces, total, state)?;
            let so_far = state.num_evaluations;
            let proposals = total.saturating_sub(so_far).div_ceil(LAPS - lap);
            self.race(&RaceRules::of_samples(proposals, None, (so_far, total)), judge, spaces, state)?;
        }
        Ok(())
    }

    /// Solves the best designs of the best structures on the fine mesh, so that the race on the coarse one is not led
    /// by structures that have no equilibrium there: near folding little is stable and everything tells much.
    fn check_on_fine_mesh(
        &self,
        fine: &Judge,
        spaces: &[Subspace],
        total: usize,
        state: &mut State,
    ) -> Result<(), SearchError> {
        if self.study.budget.propose == 0 {
            return Ok(());
        }
        let is_there = |space: &usize, state: &State| !state.is_given_up(*space);
        let leading: Vec<usize> = state.best_structures(usize::MAX);
        let leading: Vec<usize> =
            leading.into_iter().filter(|space| is_there(space, state)).take(CHECKED_STRUCTURES).collect();
        for _ in 0..MOST_FINE_FAILURES {
            let left = leading.iter().filter(|space| is_there(space, state));
            let batch: Vec<(usize, Vec<f64>)> =
                left.filter_map(|space| state.to_check(*space, CHECKS_APART).cloned()).collect();
            self.evaluate_batch(fine, spaces, ("explore", &batch, total), state)?;
        }
        Ok(())
    }

    pub(super) fn evaluate_batch(
        &self,
        judge: &Judge,
        spaces: &[Subspace],
        (stage, batch, total): (&'static str, &[(usize, Vec<f64>)], usize),
        state: &mut State,
    ) -> Result<(), SearchError> {
        let reference = &judge.reference;
        let done = AtomicUsize::new(state.num_evaluations);
        // The best design seen by any thread, for display only.
        let best = std::sync::Mutex::new((state.history.last().copied(), state.leader()));
        let results: Vec<Option<Attempt>> = batch
            .par_iter()
            .map(|(space, vector)| {
                let specimen = spaces[*space].specimen(vector);
                let attempt = self.estimated(&specimen, judge.fidelity);
                if let (Some(Ok(evaluated)), Ok(mut best)) = (&attempt, best.lock()) {
                    let judged = reference.judge(evaluated);
                    if judged.margins.iter().all(|m| *m >= 0.0) {
                        let gain = reference.objective(&judged).exp();
                        if best.0.is_none_or(|before| gain > before) {
                            *best = (Some(gain), Some(specimen));
                        }
                    }
                }
                let (best, leader) = best.lock().map(|shown| shown.clone()).unwrap_or_default();
                let count = done.fetch_add(1, Ordering::Relaxed) + 1;
                (self.progress)(&Progress { stage, done: count.min(total), total, best, leader });
                attempt
            })
            .collect();
        let mut was_stopped = false;
        for ((space, vector), result) in batch.iter().zip(results) {
            let specimen = spaces[*space].specimen(vector);
            match result {
                None => was_stopped = true,
                Some(Ok(evaluated)) => {
                    state.add((*space, vector), specimen, judge, &reference.judge(&evaluated), stage);
                }
                Some(Err(cause)) => state.fail(&specimen, Some((*space, vector, judge.fidelity)), &cause),
            }
        }
        if was_stopped { Err(state.stopped(self.study, stage)) } else { Ok(()) }
    }

    /// Improves the best designs by the gradients of `in_integrals`, and judges where that ends by `judge`.
    fn refine(
        &self,
        judge: &Judge,
        in_integrals: &Reference,
        spaces: &[Subspace],
        state: &mut State,
    ) -> Result<(), SearchError> {
        let budget = self.study.budget;
        let starts = state.starts(budget.refine);
        let total = starts.len() * budget.iterations;
        let done = AtomicUsize::new(0);
        let (best, leader) = (state.history.last().copied(), state.leader());
        let on_evaluation = || {
            let (done, leader) = ((done.fetch_add(1, Ordering::Relaxed) + 1).min(total), leader.clone());
            (self.progress)(&Progress { stage: "refine", done, total, best, leader });
        };
        let improved: Vec<Option<(usize, Vec<f64>)>> = starts
            .par_iter()
            .map(|(index, start)| {
                let problem = StructureProblem::new(self, in_integrals, &spaces[*index], &on_evaluation);
                let settings = LocalSettings { max_evaluations: budget.iterations, ..LocalSettings::default() };
                let found = improve(&problem, start, &settings);
                // A start without an evaluation is left as it is.
                let end = found.map_or_else(|| start.clone(), |found| found.x);
                (!problem.was_stopped.load(Ordering::Relaxed)).then_some((*index, end))
            })
            .collect();
        state.num_evaluations += done.load(Ordering::Relaxed);
        let ends: Option<Vec<(usize, Vec<f64>)>> = improved.into_iter().collect();
        let ends = ends.ok_or_else(|| state.stopped(self.study, "refine"))?;
        self.evaluate_batch(judge, spaces, ("refine", &ends, total), state)
    }
}
