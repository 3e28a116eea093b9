//! Evolution: the structures that did best in the samples are improved by an evolution strategy ([`Evolution`]) on the
//! objective itself, voxels counted whole. Every round halves the structures that are left and doubles what each of
//! them gets, until one is left.

use super::explore::{is_makeable, shrink};
use super::objective::Reference;
use super::search_error::SearchError;
use super::search_run::{Attempt, Progress, SearchRun};
use super::space::Subspace;
use super::state::State;
use super::structure_problem::RESERVE;
use crate::optimise::Evolution;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Structures in the first round.
const MOST_STRUCTURES: usize = 8;
/// Standard deviation of the first points around the best sample of a structure, as a part of the variables' ranges.
const FIRST_STEP: f64 = 0.15;
/// A structure whose points lie closer together than this has settled.
const SETTLED_STEP: f64 = 1e-3;
/// Points that are drawn for one that can be made.
const ATTEMPTS: usize = 60;
/// Streams of random numbers before this one belong to the samples.
const FIRST_STREAM: u64 = 1 << 32;

/// A structure that is being improved.
struct Race {
    space: usize,
    evolution: Evolution,
    rng: ChaCha8Rng,
    best: f64,
}

impl Race {
    fn new(space: usize, start: &[f64], best: f64, seed: u64) -> Race {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(FIRST_STREAM + space as u64);
        Race { space, evolution: Evolution::new(start, FIRST_STEP), rng, best }
    }

    /// A generation of makeable points; fewer where there is hardly one around here.
    fn generation(&mut self, run: &SearchRun, space: &Subspace) -> Vec<Vec<f64>> {
        let (limits, voxel_mm) = (&run.study.limits, run.study.scan.voxel_mm);
        let mut points = Vec::new();
        for _ in 0..self.evolution.population() {
            let mut drawn = Vec::new();
            let found = (0..ATTEMPTS).find(|_| {
                drawn = self.evolution.draw(&mut self.rng).into_iter().map(|t| t.clamp(0.0, 1.0)).collect();
                is_makeable(&space.specimen(&drawn), limits, voxel_mm)
            });
            match found {
                Some(_) => points.push(drawn),
                None => points.extend(shrink(space, drawn, limits, voxel_mm)),
            }
        }
        points
    }
}

impl SearchRun<'_> {
    /// Improves the best structures of `state` by the study's budget of evaluations.
    pub(super) fn evolve(
        &self,
        reference: &Reference,
        spaces: &[Subspace],
        state: &mut State,
    ) -> Result<(), SearchError> {
        let total = self.study.budget.evolve;
        let starts = state.best_of_each(MOST_STRUCTURES);
        if total == 0 || starts.is_empty() {
            return Ok(());
        }
        let new = |(space, start, merit): (usize, Vec<f64>, f64)| Race::new(space, &start, merit, self.study.seed);
        let mut races: Vec<Race> = starts.into_iter().map(new).collect();
        let num_rounds = races.len().next_power_of_two().ilog2() as usize + 1;
        let done = AtomicUsize::new(0);
        for round in 0..num_rounds {
            let end = total * (round + 1) / num_rounds;
            while done.load(Ordering::Relaxed) < end && races.iter().any(|r| r.evolution.step() > SETTLED_STEP) {
                self.next_generation(&mut races, reference, spaces, &done, state)?;
            }
            races.sort_by(|a, b| b.best.total_cmp(&a.best).then(a.space.cmp(&b.space)));
            races.truncate(races.len().div_ceil(2));
        }
        Ok(())
    }

    /// One generation of every structure that has not settled.
    fn next_generation(
        &self,
        races: &mut [Race],
        reference: &Reference,
        spaces: &[Subspace],
        done: &AtomicUsize,
        state: &mut State,
    ) -> Result<(), SearchError> {
        let mut batch: Vec<(usize, Vec<f64>)> = Vec::new();
        for (index, race) in races.iter_mut().enumerate().filter(|(_, r)| r.evolution.step() > SETTLED_STEP) {
            let points = race.generation(self, &spaces[race.space]);
            batch.extend(points.into_iter().map(|point| (index, point)));
        }
        // A generation without a makeable point counts, so that the search ends.
        done.fetch_add(usize::from(batch.is_empty()), Ordering::Relaxed);
        let best = state.history.last().copied();
        let total = self.study.budget.evolve;
        let races_read = &*races;
        let results: Vec<Option<Attempt>> = batch
            .par_iter()
            .map(|(race, point)| {
                let attempt = self.estimated(&spaces[races_read[*race].space].specimen(point));
                let count = done.fetch_add(1, Ordering::Relaxed) + 1;
                (self.progress)(&Progress { stage: "evolve", done: count.min(total), total, best });
                attempt
            })
            .collect();
        let mut merits = vec![Vec::new(); races.len()];
        let mut was_stopped = false;
        for ((race, point), result) in batch.into_iter().zip(results) {
            let space = races[race].space;
            let specimen = spaces[space].specimen(&point);
            let merit = match result {
                None => {
                    was_stopped = true;
                    continue;
                }
                Some(Ok(evaluated)) => {
                    let mut judged = reference.judge(&evaluated);
                    state.add((space, &point), specimen, reference, &judged, "evolve");
                    judged.margins.iter_mut().for_each(|m| *m -= RESERVE);
                    reference.merit(&judged)
                }
                Some(Err(cause)) => {
                    state.fail(&specimen, &cause);
                    f64::NEG_INFINITY
                }
            };
            races[race].best = races[race].best.max(merit);
            merits[race].push((merit, point));
        }
        if was_stopped {
            return Err(state.stopped(self.study, "evolve"));
        }
        for (race, mut points) in races.iter_mut().zip(merits) {
            points.sort_by(|a: &(f64, Vec<f64>), b| b.0.total_cmp(&a.0));
            let ranked: Vec<Vec<f64>> = points.into_iter().map(|(_, point)| point).collect();
            race.evolution.learn(&ranked);
        }
        Ok(())
    }
}
