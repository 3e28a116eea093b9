//! Proposals: the structures that did best in the samples are improved by what their designs so far have taught.
//!
//! A [`Surrogate`] of each structure's gains and margins says where the next designs promise most; they are evaluated,
//! and it learns from them. Every round halves the structures that are left and doubles what each of them gets, until
//! one is left.

use super::explore::is_makeable;
use super::objective::{Judged, Reference};
use super::search_error::SearchError;
use super::search_run::{Attempt, Progress, SearchRun};
use super::space::Subspace;
use super::state::State;
use super::structure_problem::RESERVE;
use super::surrogate::Surrogate;
use crate::optimise::Evolution;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Structures in the first round.
const MOST_STRUCTURES: usize = 8;
/// Designs that a structure proposes at once: by as many standard deviations each is the surrogate believed to be too
/// low. The first takes what looks best, the last looks where little is known.
const OPTIMISM: [f64; 4] = [0.0, 0.5, 1.0, 2.0];
/// A proposal this close to a design seen, in ranges of the variables, teaches nothing new.
const NEAREST: f64 = 4e-3;
/// Values below this, and above its negative, are cut: of designs that are far too poor it does not matter by how much,
/// and the surrogate would bend for them.
const LOWEST: f64 = -0.7;
/// Standard deviations of the first points around a start of the climb on a surrogate.
const FIRST_STEPS: [f64; 2] = [0.05, 0.25];
/// Generations of a climb.
const GENERATIONS: usize = 25;
/// Points that are drawn for one that can be made.
const ATTEMPTS: usize = 30;
/// Streams of random numbers before this one belong to the samples.
const FIRST_STREAM: u64 = 1 << 32;

/// A structure that is being improved.
struct Race {
    space: usize,
    rng: ChaCha8Rng,
    /// Designs seen, their gains and margins, cut.
    points: Vec<Vec<f64>>,
    values: Vec<Vec<f64>>,
    /// The best of them and its merit.
    best: (f64, Vec<f64>),
    /// Whether nothing new is proposed any more.
    is_settled: bool,
}

/// Gains, then margins, cut.
fn values_of(judged: &Judged) -> Vec<f64> {
    judged.gains.iter().chain(&judged.margins).map(|v| v.clamp(LOWEST, -LOWEST)).collect()
}

/// The merit of a design as it counts here: a little inside the limits.
fn merit_of(reference: &Reference, judged: &Judged) -> f64 {
    let mut kept = judged.clone();
    kept.margins.iter_mut().for_each(|m| *m -= RESERVE);
    reference.merit(&kept)
}

impl Race {
    fn of(run: &SearchRun, reference: &Reference, state: &State, space: usize) -> Option<Race> {
        let seen = state.seen_of(space);
        let best = seen.iter().map(|(point, judged)| (merit_of(reference, judged), (*point).clone()));
        let best = best.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let mut rng = ChaCha8Rng::seed_from_u64(run.study.seed);
        rng.set_stream(FIRST_STREAM + space as u64);
        let (points, values) = seen.iter().map(|(point, judged)| ((*point).clone(), values_of(judged))).unzip();
        Some(Race { space, rng, points, values, best, is_settled: false })
    }

    /// Designs that promise most; none where the surrogate has settled.
    fn proposals(&mut self, run: &SearchRun, reference: &Reference, space: &Subspace, like: &Judged) -> Vec<Vec<f64>> {
        let mut found: Vec<Vec<f64>> = Vec::new();
        let Some(surrogate) = Surrogate::fit(&self.points, &self.values) else { return found };
        for optimism in OPTIMISM {
            let merit = |x: &[f64]| {
                let predicted = surrogate.predict(x);
                let (gains, margins) = predicted.split_at(like.gains.len());
                let gains = gains.iter().map(|(mean, sd)| mean + optimism * sd).collect();
                let margins = margins.iter().map(|(mean, _)| *mean).collect();
                merit_of(reference, &Judged { gains, margins, ..like.clone() })
            };
            let point = self.climb(run, space, &merit);
            let is_new = |p: &[f64]| {
                let apart = |o: &Vec<f64>| o.iter().zip(p).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
                surrogate.nearest(p) > NEAREST && found.iter().all(|o| apart(o) > NEAREST)
            };
            if let Some(point) = point.filter(|p| is_new(p)) {
                found.push(point);
            }
        }
        found
    }

    /// The makeable point of largest `merit`, from the best design seen.
    fn climb(&mut self, run: &SearchRun, space: &Subspace, merit: &dyn Fn(&[f64]) -> f64) -> Option<Vec<f64>> {
        let (limits, voxel_mm) = (&run.study.limits, run.study.scan.voxel_mm);
        let mut best: Option<(f64, Vec<f64>)> = None;
        for step in FIRST_STEPS {
            let mut evolution = Evolution::new(&self.best.1, step);
            for _ in 0..GENERATIONS {
                let mut generation: Vec<(f64, Vec<f64>)> = Vec::new();
                for _ in 0..evolution.population() {
                    let drawn = (0..ATTEMPTS).find_map(|_| {
                        let point: Vec<f64> =
                            evolution.draw(&mut self.rng).into_iter().map(|t| t.clamp(0.0, 1.0)).collect();
                        is_makeable(&space.specimen(&point), limits, voxel_mm).then_some(point)
                    });
                    generation.extend(drawn.map(|point| (merit(&point), point)));
                }
                generation.sort_by(|a, b| b.0.total_cmp(&a.0));
                if let Some(first) = generation.first()
                    && best.as_ref().is_none_or(|b| first.0 > b.0)
                {
                    best = Some(first.clone());
                }
                let ranked: Vec<Vec<f64>> = generation.into_iter().map(|(_, point)| point).collect();
                evolution.learn(&ranked);
            }
        }
        best.map(|(_, point)| point)
    }

    /// Learns what became of a proposal.
    fn learn(&mut self, reference: &Reference, point: Vec<f64>, judged: Option<&Judged>) {
        let num_values = self.values.first().map_or(0, Vec::len);
        self.values.push(judged.map_or_else(|| vec![LOWEST; num_values], values_of));
        let merit = judged.map_or(f64::NEG_INFINITY, |j| merit_of(reference, j));
        if merit > self.best.0 {
            self.best = (merit, point.clone());
        }
        self.points.push(point);
    }
}

impl SearchRun<'_> {
    /// Improves the best structures of `state` by the study's budget of evaluations.
    pub(super) fn propose(
        &self,
        reference: &Reference,
        spaces: &[Subspace],
        state: &mut State,
    ) -> Result<(), SearchError> {
        let total = self.study.budget.propose;
        let mut races: Vec<Race> = Vec::new();
        if total > 0 {
            let best = state.best_structures(MOST_STRUCTURES);
            races.extend(best.into_iter().filter_map(|space| Race::of(self, reference, state, space)));
        }
        let Some(like) = state.first_judged().filter(|_| !races.is_empty()).cloned() else { return Ok(()) };
        let num_rounds = races.len().next_power_of_two().ilog2() as usize + 1;
        let done = AtomicUsize::new(0);
        for round in 0..num_rounds {
            let end = total * (round + 1) / num_rounds;
            while done.load(Ordering::Relaxed) < end && races.iter().any(|r| !r.is_settled) {
                self.evaluate_proposals(&mut races, (reference, &like), spaces, &done, state)?;
            }
            races.sort_by(|a, b| b.best.0.total_cmp(&a.best.0).then(a.space.cmp(&b.space)));
            races.truncate(races.len().div_ceil(2));
        }
        Ok(())
    }

    /// The next proposals of every structure that has not settled, evaluated and learnt from.
    fn evaluate_proposals(
        &self,
        races: &mut [Race],
        (reference, like): (&Reference, &Judged),
        spaces: &[Subspace],
        done: &AtomicUsize,
        state: &mut State,
    ) -> Result<(), SearchError> {
        let proposed: Vec<Vec<Vec<f64>>> = races
            .par_iter_mut()
            .map(|r| if r.is_settled { Vec::new() } else { r.proposals(self, reference, &spaces[r.space], like) })
            .collect();
        let mut batch: Vec<(usize, Vec<f64>)> = Vec::new();
        for (index, (race, points)) in races.iter_mut().zip(proposed).enumerate() {
            race.is_settled = points.is_empty();
            batch.extend(points.into_iter().map(|point| (index, point)));
        }
        let best = state.history.last().copied();
        let total = self.study.budget.propose;
        let places: Vec<usize> = races.iter().map(|r| r.space).collect();
        let results: Vec<Option<Attempt>> = batch
            .par_iter()
            .map(|(race, point)| {
                let attempt = self.estimated(&spaces[places[*race]].specimen(point));
                let count = done.fetch_add(1, Ordering::Relaxed) + 1;
                (self.progress)(&Progress { stage: "propose", done: count.min(total), total, best });
                attempt
            })
            .collect();
        let mut was_stopped = false;
        for ((race, point), result) in batch.into_iter().zip(results) {
            let space = races[race].space;
            let specimen = spaces[space].specimen(&point);
            let judged = match result {
                None => {
                    was_stopped = true;
                    continue;
                }
                Some(Ok(evaluated)) => {
                    let judged = reference.judge(&evaluated);
                    state.add((space, &point), specimen, reference, &judged, "propose");
                    Some(judged)
                }
                Some(Err(cause)) => {
                    state.fail(&specimen, &cause);
                    None
                }
            };
            races[race].learn(reference, point, judged.as_ref());
        }
        if was_stopped { Err(state.stopped(self.study, "propose")) } else { Ok(()) }
    }
}
