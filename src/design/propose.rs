//! Proposals: the structures that did best in the samples are improved by what their designs so far have taught.
//!
//! A [`Surrogate`] of each structure's gains and margins says where the next designs promise most; they are evaluated,
//! and it learns from them. Every round halves the structures that are left and doubles what each of them gets, until
//! one is left. All structures race on the coarse mesh, where a design costs little; the best of them then on the fine
//! one, whose surrogate corrects what the coarse one has taught.

use super::explore::is_makeable;
use super::fidelity::Fidelity;
use super::objective::{Judged, Reference};
use super::search_error::SearchError;
use super::search_run::{Attempt, Judge, Progress, SearchRun};
use super::space::Subspace;
use super::state::State;
use super::structure_problem::RESERVE;
use super::surrogate::{Seen, Surrogate};
use crate::optimise::Evolution;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::sync::atomic::{self, AtomicUsize};

/// How a race goes.
pub(super) struct RaceRules {
    /// Where it is told.
    pub stage: &'static str,
    /// Structures in the first round.
    pub most_structures: usize,
    /// Designs that a structure proposes at once: by as many standard deviations each is the surrogate believed to be
    /// too low. The first takes what looks best, the last looks where little is known.
    optimism: &'static [f64],
    /// Evaluations.
    pub total: usize,
    /// The structures that race; the best of all where it is `None`.
    structures: Option<Vec<usize>>,
}

/// Part of the proposals that goes to the solid block, so that what holes do is told of the best one.
const PART_OF_SOLID: usize = 6;
/// The fewest proposals of the solid block, of those asked for.
const LEAST_OF_SOLID: usize = 8;

impl RaceRules {
    /// Of all structures, on the coarse mesh.
    pub fn of_samples(total: usize) -> RaceRules {
        let (stage, optimism) = ("explore", &[0.0, 1.0]);
        RaceRules { stage, most_structures: usize::MAX, optimism, total, structures: None }
    }

    /// Of the best structures, on the fine mesh.
    pub fn of_proposals(total: usize) -> RaceRules {
        let (stage, optimism) = ("propose", &[0.0, 0.5, 1.0, 2.0]);
        RaceRules { stage, most_structures: 6, optimism, total, structures: None }
    }

    /// Of the structures without holes, on the fine mesh, beside `proposals` of all.
    pub fn of_solid(proposals: usize, spaces: &[Subspace]) -> RaceRules {
        let solid = (0..spaces.len()).filter(|&s| spaces[s].structure.num_holes() == 0).collect();
        let total = (proposals / PART_OF_SOLID).max(LEAST_OF_SOLID).min(proposals);
        RaceRules { stage: "solid", optimism: &[0.0, 1.0], total, structures: Some(solid), ..RaceRules::of_samples(0) }
    }
}

/// A proposal this close to a design seen, in ranges of the variables, teaches nothing new.
const NEAREST: f64 = 4e-3;
/// Values below this, and above its negative, are cut: of designs that are far too poor it does not matter by how much,
/// and the surrogate would bend for them.
const LOWEST: f64 = -0.7;
/// What the surrogate learns of whether a design has an equilibrium: this where it has one, its negative where not.
const SOLVED: f64 = 0.3;
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
    /// How finely proposals are solved.
    fidelity: Fidelity,
    rng: ChaCha8Rng,
    /// Designs seen, their gains and margins, cut.
    seen: Vec<Seen>,
    values: Vec<Vec<f64>>,
    /// The best of them: of those solved as finely as proposals, if there are any.
    best: Best,
    /// What the designs were proposed by.
    surrogate: Option<Surrogate>,
    /// Whether nothing new is proposed any more.
    is_settled: bool,
}

/// The best design of a race.
struct Best {
    /// Whether it was solved as finely as proposals are.
    is_as_fine: bool,
    merit: f64,
    point: Vec<f64>,
}

impl Best {
    /// `Greater` where this one is better: solved as finely as proposals, then of the larger merit.
    fn compare(&self, other: &Best) -> Ordering {
        self.is_as_fine.cmp(&other.is_as_fine).then(self.merit.total_cmp(&other.merit))
    }
}

/// Gains, then margins, cut; last, that there is an equilibrium.
fn values_of(judged: &Judged) -> Vec<f64> {
    let values = judged.gains.iter().chain(&judged.margins).map(|v| v.clamp(LOWEST, -LOWEST));
    values.chain([SOLVED]).collect()
}

/// The merit of a design as it counts here: a little inside the limits.
fn merit_of(reference: &Reference, judged: &Judged) -> f64 {
    let mut kept = judged.clone();
    kept.margins.iter_mut().for_each(|m| *m -= RESERVE);
    reference.merit(&kept)
}

impl Race {
    fn of(run: &SearchRun, judge: &Judge, state: &State, space: usize) -> Option<Race> {
        let Judge { fidelity, reference } = judge;
        let seen = state.seen_of(space);
        let of = |(point, solved, judged): &(&Vec<f64>, Fidelity, &Judged)| Best {
            is_as_fine: solved == fidelity,
            merit: merit_of(reference, judged),
            point: (*point).clone(),
        };
        let best = seen.iter().map(of).max_by(|a, b| a.compare(b))?;
        let mut rng = ChaCha8Rng::seed_from_u64(run.study.seed);
        let streams = if *fidelity == Fidelity::Coarse { FIRST_STREAM } else { 2 * FIRST_STREAM };
        rng.set_stream(streams + space as u64);
        let values = seen.iter().map(|(_, _, judged)| values_of(judged)).collect();
        let design = |(point, fidelity, _): (&Vec<f64>, Fidelity, _)| Seen { point: point.clone(), fidelity };
        let seen = seen.into_iter().map(design).collect();
        Some(Race { space, fidelity: *fidelity, rng, seen, values, best, surrogate: None, is_settled: false })
    }

    /// Designs that promise most; none where the surrogate has settled.
    fn proposals(
        &mut self,
        run: &SearchRun,
        (reference, like): (&Reference, &Judged),
        space: &Subspace,
        optimism: &[f64],
    ) -> Vec<Vec<f64>> {
        let mut found: Vec<Vec<f64>> = Vec::new();
        self.surrogate = Surrogate::fit(&self.seen, &self.values);
        let Some(surrogate) = self.surrogate.take() else { return found };
        let fidelity = self.fidelity;
        for optimism in optimism {
            let merit = |x: &[f64]| {
                let predicted = surrogate.predict(x, fidelity);
                let (gains, margins) = predicted.split_at(like.gains.len());
                let gains = gains.iter().map(|(mean, sd)| mean + optimism * sd).collect();
                let margins = margins.iter().map(|(mean, _)| *mean).collect();
                merit_of(reference, &Judged { gains, margins, ..like.clone() })
            };
            let point = self.climb(run, space, &merit);
            let is_new = |p: &[f64]| {
                let apart = |o: &Vec<f64>| o.iter().zip(p).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
                surrogate.nearest(p, fidelity) > NEAREST && found.iter().all(|o| apart(o) > NEAREST)
            };
            if let Some(point) = point.filter(|p| is_new(p)) {
                found.push(point);
            }
        }
        self.surrogate = Some(surrogate);
        found
    }

    /// The makeable point of largest `merit`, from the best design seen.
    fn climb(&mut self, run: &SearchRun, space: &Subspace, merit: &dyn Fn(&[f64]) -> f64) -> Option<Vec<f64>> {
        let (limits, voxel_mm) = (&run.study.limits, run.study.scan.voxel_mm);
        let mut best: Option<(f64, Vec<f64>)> = None;
        for step in FIRST_STEPS {
            let mut evolution = Evolution::new(&self.best.point, step);
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

    /// Learns what became of a proposal. Of one without an equilibrium the rest is supposed as predicted, so that a
    /// wall of failures does not bend what is known beside it.
    fn learn(&mut self, reference: &Reference, point: Vec<f64>, judged: Option<&Judged>) {
        let failed = || {
            let predicted = self.surrogate.as_ref().map(|s| s.predict(&point, self.fidelity)).unwrap_or_default();
            let mut values: Vec<f64> = predicted.into_iter().map(|(mean, _)| mean).collect();
            values.pop();
            values.push(-SOLVED);
            values
        };
        self.values.push(judged.map_or_else(failed, values_of));
        if let Some(judged) = judged {
            let merit = merit_of(reference, judged);
            let found = Best { is_as_fine: true, merit, point: point.clone() };
            if found.compare(&self.best).is_gt() {
                self.best = found;
            }
        }
        self.seen.push(Seen { point, fidelity: self.fidelity });
    }
}

impl SearchRun<'_> {
    /// Improves the best structures of `state`, judged by `judge`.
    pub(super) fn race(
        &self,
        rules: &RaceRules,
        judge: &Judge,
        spaces: &[Subspace],
        state: &mut State,
    ) -> Result<(), SearchError> {
        let total = rules.total;
        let mut races: Vec<Race> = Vec::new();
        if total > 0 {
            let best = match &rules.structures {
                Some(structures) => structures.clone(),
                None => state.best_structures(rules.most_structures),
            };
            races.extend(best.into_iter().filter_map(|space| Race::of(self, judge, state, space)));
        }
        let Some(like) = state.first_judged().filter(|_| !races.is_empty()).cloned() else { return Ok(()) };
        let num_rounds = races.len().next_power_of_two().ilog2() as usize + 1;
        let done = AtomicUsize::new(0);
        for round in 0..num_rounds {
            let end = total * (round + 1) / num_rounds;
            while done.load(atomic::Ordering::Relaxed) < end && races.iter().any(|r| !r.is_settled) {
                self.evaluate_proposals(&mut races, (rules, judge, &like), spaces, &done, state)?;
            }
            races.sort_by(|a, b| b.best.compare(&a.best).then(a.space.cmp(&b.space)));
            races.truncate(races.len().div_ceil(2));
        }
        Ok(())
    }

    /// The next proposals of every structure that has not settled, evaluated and learnt from.
    fn evaluate_proposals(
        &self,
        races: &mut [Race],
        (rules, judge, like): (&RaceRules, &Judge, &Judged),
        spaces: &[Subspace],
        done: &AtomicUsize,
        state: &mut State,
    ) -> Result<(), SearchError> {
        let reference = &judge.reference;
        let proposed: Vec<Vec<Vec<f64>>> = races
            .par_iter_mut()
            .map(|r| {
                if r.is_settled {
                    Vec::new()
                } else {
                    r.proposals(self, (reference, like), &spaces[r.space], rules.optimism)
                }
            })
            .collect();
        let mut batch: Vec<(usize, Vec<f64>)> = Vec::new();
        for (index, (race, points)) in races.iter_mut().zip(proposed).enumerate() {
            race.is_settled = points.is_empty();
            batch.extend(points.into_iter().map(|point| (index, point)));
        }
        let (best, leader) = (state.history.last().copied(), state.leader());
        let total = rules.total;
        let places: Vec<usize> = races.iter().map(|r| r.space).collect();
        let results: Vec<Option<Attempt>> = batch
            .par_iter()
            .map(|(race, point)| {
                let attempt = self.estimated(&spaces[places[*race]].specimen(point), judge.fidelity);
                let done = (done.fetch_add(1, atomic::Ordering::Relaxed) + 1).min(total);
                (self.progress)(&Progress { stage: rules.stage, done, total, best, leader: leader.clone() });
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
                    state.add((space, &point), specimen, judge, &judged, rules.stage);
                    Some(judged)
                }
                Some(Err(cause)) => {
                    state.fail(&specimen, &cause);
                    None
                }
            };
            races[race].learn(reference, point, judged.as_ref());
        }
        if was_stopped { Err(state.stopped(self.study, rules.stage)) } else { Ok(()) }
    }
}
