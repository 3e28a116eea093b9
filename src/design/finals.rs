//! The end of a search: confirmation of the finalists on the finer mesh, and the repair of those that keep a limit in
//! the search and break it there.

use super::aim::ObjectiveKind;
use super::confirm::Confirmed;
use super::local::{LocalSettings, improve};
use super::material_samples::sample_materials;
use super::objective::Reference;
use super::rounding::in_steps;
use super::search_error::SearchError;
use super::search_run::{Confirmation, Progress, SearchRun};
use super::space::Subspace;
use super::state::{Finalist, State, is_same};
use super::structure_problem::StructureProblem;
use crate::specimen::Specimen;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Designs that are repaired at most: those with the largest gains.
const MAX_REPAIRS: usize = 2;

/// Evaluations of one repair at most.
const REPAIR_EVALUATIONS: usize = 6;

impl SearchRun<'_> {
    /// A design's confirmation in the study's scan.
    fn confirmed(&self, specimen: &Specimen) -> Confirmation {
        self.confirmed_in(&self.study.scan, specimen)
    }

    /// The base, confirmed and compared with itself.
    pub(super) fn confirm_base(&self, base: &Specimen, state: &State) -> Result<Confirmed, SearchError> {
        match self.confirmed(base) {
            None => Err(state.stopped(self.study, "base")),
            Some(Err(cause)) => Err(SearchError::Base { cause }),
            Some(Ok(mut base)) => {
                base.compare(self.study, &base.clone());
                Ok(base)
            }
        }
    }

    /// The ranked designs, best first, those within every limit before others.
    pub(super) fn confirm_all(
        &self,
        base: &Confirmed,
        spaces: &[Subspace],
        state: &mut State,
    ) -> Result<Vec<Confirmed>, SearchError> {
        let study = self.study;
        let mut finalists: Vec<Finalist> = Vec::new();
        for finalist in state.finalists(study).into_iter().map(|f| self.in_steps(f)) {
            // Two designs may become one when they are rounded.
            if !finalists.iter().any(|f| is_same(&f.specimen, &finalist.specimen)) {
                finalists.push(finalist);
            }
        }
        let (total, done) = (finalists.len(), AtomicUsize::new(0));
        let (best, leader) = (state.history.last().copied(), state.leader());
        let results: Vec<Confirmation> = finalists
            .par_iter()
            .map(|finalist| {
                let result = self.confirmed(&finalist.specimen);
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                (self.progress)(&Progress { stage: "confirm", done, total, best, leader: leader.clone() });
                result
            })
            .collect();
        let samples = sample_materials(&study.materials);
        let fine = Reference::new(study, &samples, &base.responses);
        let mut ranked = Vec::new();
        let mut broken = Vec::new();
        for (finalist, result) in finalists.iter().zip(results) {
            match result {
                None => return Err(state.stopped(study, "confirm")),
                Some(Err(cause)) => state.fail(&finalist.specimen, None, &cause),
                Some(Ok(mut confirmed)) => {
                    confirmed.compare(study, base);
                    if !confirmed.is_within_limits && finalist.is_within_limits {
                        confirmed.remark = Some(broken_limits(&fine, &confirmed));
                        broken.push((finalist, confirmed.judged(&fine).worst_margins, confirmed.objective));
                    }
                    ranked.push(confirmed);
                }
            }
        }
        // What broke is worth repairing if it is better than what is left.
        let is_kept = |c: &&Confirmed| c.is_within_limits;
        let best_kept = ranked.iter().filter(is_kept).map(|c| c.objective).fold(0.0, f64::max);
        broken.retain(|(_, _, objective)| *objective > best_kept);
        broken.sort_by(|a, b| b.2.total_cmp(&a.2));
        // Gradients are of one scan alone, and know nothing of what a diagnosis would find.
        let has_gradients = study.vary.earlier_scan_mm.is_none() && study.objective.kind != ObjectiveKind::Detect;
        broken.truncate(if has_gradients { MAX_REPAIRS } else { 0 });
        let in_integrals = match broken.is_empty() {
            true => None,
            false => Some(self.in_integrals(&base.specimen, state)?),
        };
        for (finalist, margins, objective) in broken {
            let Some(in_integrals) = &in_integrals else { break };
            if let Some(mut repaired) = self.repair(finalist, &margins, in_integrals, spaces, state)? {
                repaired.compare(study, base);
                repaired.remark = Some(format!(
                    "Repaired: a design with a gain of {objective:.3} kept every limit on the coarse mesh of the search and broke \
                     one at confirmation; this is the design nearby that keeps it."
                ));
                ranked.push(repaired);
            }
        }
        let is_better = |c: &Confirmed| c.is_within_limits && c.objective >= base.objective;
        if !ranked.iter().any(is_better) && base.is_within_limits {
            let mut itself = base.clone();
            let is_only = !ranked.iter().any(|c| c.is_within_limits);
            let why = if is_only { "kept every limit" } else { "within the limits was as good" };
            itself.remark = Some(format!("The base specimen itself: no other design {why} at confirmation."));
            ranked.push(itself);
        }
        ranked.sort_by(Confirmed::by_rank);
        if !ranked.first().is_some_and(|best| best.is_within_limits) {
            return Err(SearchError::NothingFeasible { tried: state.candidates.len() });
        }
        Ok(ranked)
    }

    /// The finalist as a mould maker would make it, where it can be made so.
    fn in_steps(&self, finalist: Finalist) -> Finalist {
        let made = in_steps(&finalist.specimen, &self.study.limits, self.study.scan.voxel_mm);
        Finalist { specimen: made.unwrap_or(finalist.specimen), ..finalist }
    }

    /// Improves a finalist anew with the margins of `in_integrals` shifted to those that the confirmation gave, and
    /// confirms where that ends. `None` where nothing came of it.
    fn repair(
        &self,
        finalist: &Finalist,
        confirmed: &[Vec<f64>],
        in_integrals: &Reference,
        spaces: &[Subspace],
        state: &mut State,
    ) -> Result<Option<Confirmed>, SearchError> {
        let searched = match self.evaluated(&finalist.specimen, None) {
            None => return Err(state.stopped(self.study, "repair")),
            Some(Err(_)) => return Ok(None),
            Some(Ok(evaluated)) => in_integrals.judge(&evaluated).worst_margins,
        };
        let shifted = in_integrals.lowered(confirmed, &searched);
        let (index, start) = &finalist.point;
        let (done, best, leader) = (AtomicUsize::new(0), state.history.last().copied(), state.leader());
        let on_evaluation = || {
            let total = REPAIR_EVALUATIONS;
            let done = (done.fetch_add(1, Ordering::Relaxed) + 1).min(total);
            (self.progress)(&Progress { stage: "repair", done, total, best, leader: leader.clone() });
        };
        let problem = StructureProblem::new(self, &shifted, &spaces[*index], &on_evaluation);
        // Near the start: what broke is small.
        let settings = LocalSettings { max_evaluations: REPAIR_EVALUATIONS, radius: 0.05, smallest_radius: 1e-4 };
        let improved = improve(&problem, start, &settings);
        state.num_evaluations += done.load(Ordering::Relaxed);
        if problem.was_stopped.load(Ordering::Relaxed) {
            return Err(state.stopped(self.study, "repair"));
        }
        let Some(improved) = improved else { return Ok(None) };
        let repaired = spaces[*index].specimen(&improved.x);
        let repaired = in_steps(&repaired, &self.study.limits, self.study.scan.voxel_mm).unwrap_or(repaired);
        match self.confirmed(&repaired) {
            None => Err(state.stopped(self.study, "repair")),
            Some(Err(_)) => Ok(None),
            Some(Ok(confirmed)) => Ok(Some(confirmed)),
        }
    }
}

/// Which response limits break at confirmation, in words.
fn broken_limits(fine: &Reference, confirmed: &Confirmed) -> String {
    let margins = confirmed.judged(fine).worst_margins;
    let mut names: Vec<String> = Vec::new();
    for (prior, of_prior) in margins.iter().enumerate() {
        for (limit, margin) in of_prior.iter().enumerate().filter(|(_, m)| **m < -1e-9) {
            names.push(format!("{} by {:.2} %", fine.limit_name(prior, limit), 100.0 * (1.0 - margin.exp())));
        }
    }
    format!("Kept every limit on the coarse mesh of the search; at confirmation it misses {}.", names.join(", "))
}
