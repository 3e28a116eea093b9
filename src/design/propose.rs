//! Proposals: the structures that did best in the samples are improved by what their designs so far have taught.
//!
//! What is believed of each structure's gains and margins ([`Belief`]) says where the next designs promise most, and
//! how much at most: an upper confidence bound (Srinivas et al., IEEE Trans. Inf. Theory 58 (2012) 3250), by which
//! structures compete for the next evaluations. So none is given up for a few poor samples while it may still hold the
//! best design, and none that cannot gets more. All structures race on the coarse mesh, where a design costs little;
//! the best of them then on the fine one, where the same processes learn what the coarse mesh got wrong.

use super::explore::is_makeable;
use super::fidelity::Fidelity;
use super::objective::{Judged, Reference};
use super::search_error::SearchError;
use super::search_run::{Attempt, Judge, Progress, SearchRun};
use super::space::Subspace;
use super::state::State;
use super::structure_problem::RESERVE;
use super::surrogate::Seen;
use super::trend::{Belief, SOLVED, Trend, values_of};
use crate::optimise::Evolution;
use crate::sensitivity::ScanSettings;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::sync::Arc;
use std::sync::atomic::{self, AtomicUsize};

/// How a race goes.
pub(super) struct RaceRules {
    /// Where it is told.
    pub stage: &'static str,
    /// Structures that compete.
    pub most_structures: usize,
    /// Designs that a structure proposes at once: by as many standard deviations each is the surrogate believed to be
    /// too low. The first takes what looks best, the last looks where little is known.
    optimism: &'static [f64],
    /// How many of the proposals of each optimism are evaluated at once.
    at_once: usize,
    /// Evaluations.
    pub total: usize,
    /// Evaluations that were made in the stage before, and all that it makes: for display only.
    pub counted: (usize, usize),
    /// The structures that race; the best of all where it is `None`.
    structures: Option<Vec<usize>>,
}

/// Part of the proposals that goes to the solid block, so that what holes do is told of the best one.
const PART_OF_SOLID: usize = 6;
/// The fewest proposals of the solid block, of those asked for.
const LEAST_OF_SOLID: usize = 8;

impl RaceRules {
    /// Of all structures, or of these, on the coarse mesh.
    pub fn of_samples(total: usize, structures: Option<Vec<usize>>, counted: (usize, usize)) -> RaceRules {
        let (stage, optimism) = ("explore", &[0.0, 1.0, 2.0]);
        RaceRules { stage, most_structures: usize::MAX, optimism, at_once: 2, total, counted, structures }
    }

    /// Of the best structures, on the fine mesh.
    pub fn of_proposals(total: usize) -> RaceRules {
        let (stage, optimism) = ("propose", &[0.0, 0.5, 1.0, 2.0]);
        RaceRules { stage, most_structures: 6, optimism, at_once: 1, total, counted: (0, total), structures: None }
    }

    /// Of the structures without holes, on the fine mesh, beside `proposals` of all.
    pub fn of_solid(proposals: usize, spaces: &[Subspace]) -> RaceRules {
        let solid = (0..spaces.len()).filter(|&s| spaces[s].structure.num_holes() == 0).collect();
        let total = (proposals / PART_OF_SOLID).max(LEAST_OF_SOLID).min(proposals);
        let (stage, optimism) = ("solid", &[0.0, 1.0]);
        let (counted, structures) = ((0, total), Some(solid));
        RaceRules { stage, most_structures: usize::MAX, optimism, at_once: 1, total, counted, structures }
    }
}

/// A proposal this close to a design seen, in ranges of the variables, teaches nothing new.
const NEAREST: f64 = 4e-3;
/// A structure of which so many designs, and more than were solved, have no equilibrium makes no more proposals: where
/// it promises most it does not stand the drive, and what it takes is missing where designs can be improved.
const FEWEST_FAILURES: usize = 4;
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
    /// What other structures teach of this one.
    trend: Option<Arc<Trend>>,
    /// Designs seen, their gains and margins, cut.
    seen: Vec<Seen>,
    values: Vec<Vec<f64>>,
    /// The best of them: of those solved as finely as proposals, if there are any.
    best: Best,
    /// What the designs were proposed by.
    belief: Option<Belief>,
    /// What it proposes by now: of each optimism one at most.
    proposals: Vec<Proposal>,
    /// Whether it has learnt something since.
    has_learnt: bool,
    /// Designs without an equilibrium.
    num_failed: usize,
}

/// A design that a structure proposes.
struct Proposal {
    /// By which optimism, an index.
    optimism: usize,
    point: Vec<f64>,
    /// The merit that this optimism expects.
    expected: f64,
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

/// The merit of a design as it counts here: a little inside the limits.
fn merit_of(reference: &Reference, judged: &Judged) -> f64 {
    let mut kept = judged.clone();
    kept.margins.iter_mut().for_each(|m| *m -= RESERVE);
    reference.merit(&kept)
}

impl Race {
    fn of(run: &SearchRun, judge: &Judge, state: &State, spaces: &[Subspace], space: usize) -> Option<Race> {
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
        let values: Vec<Vec<f64>> = seen.iter().map(|(_, _, judged)| values_of(judged)).collect();
        let design = |(point, fidelity, _): (&Vec<f64>, Fidelity, _)| Seen { point: point.clone(), fidelity };
        let seen: Vec<Seen> = seen.into_iter().map(design).collect();
        let trend = Trend::of_others(state, spaces, space, run.study.scan).map(Arc::new);
        let belief = Belief::of(trend.clone(), &spaces[space], (&seen, &values), run.study.scan);
        let mut race = Race {
            space,
            fidelity: *fidelity,
            rng,
            seen,
            values,
            best,
            trend,
            belief,
            proposals: Vec::new(),
            has_learnt: true,
            num_failed: 0,
        };
        for (point, fidelity) in state.failed_of(space) {
            race.learn_failure(&spaces[space], point.clone(), fidelity);
        }
        Some(race)
    }

    /// Takes what the other structures have taught since.
    fn renew_trend(&mut self, state: &State, spaces: &[Subspace], scan: ScanSettings) {
        if self.trend.as_ref().is_none_or(|trend| trend.is_outdated(state))
            && let Some(trend) = Trend::of_others(state, spaces, self.space, scan)
        {
            self.trend = Some(Arc::new(trend));
            self.has_learnt = true;
        }
    }

    /// Proposes anew where something was learnt; nothing that was seen already.
    fn propose(
        &mut self,
        run: &SearchRun,
        (reference, like): (&Reference, &Judged),
        space: &Subspace,
        optimism: &[f64],
    ) {
        if !std::mem::replace(&mut self.has_learnt, false) {
            return;
        }
        self.proposals.clear();
        let num_solved = self.seen.len() - self.num_failed;
        if self.num_failed >= FEWEST_FAILURES.max(num_solved + 1) {
            return;
        }
        let known = (&self.seen[..], &self.values[..]);
        let Some(belief) = Belief::of(self.trend.clone(), space, known, run.study.scan) else { return };
        let fidelity = self.fidelity;
        for (index, optimism) in optimism.iter().enumerate() {
            let merit = |x: &[f64]| {
                let predicted = belief.predict(space, x, fidelity);
                let (gains, margins) = predicted.split_at(like.gains.len());
                let gains = gains.iter().map(|(mean, sd)| mean + optimism * sd).collect();
                let mut margins: Vec<f64> = margins.iter().map(|(mean, _)| *mean).collect();
                if fidelity == Fidelity::Coarse {
                    margins.push(belief.has_fine_equilibrium(space, x));
                }
                merit_of(reference, &Judged { gains, margins, ..like.clone() })
            };
            let Some((expected, point)) = self.climb(run, space, &merit) else { continue };
            let apart = |o: &Proposal| o.point.iter().zip(&point).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
            if belief.nearest(space, &point, fidelity) > NEAREST && self.proposals.iter().all(|o| apart(o) > NEAREST) {
                self.proposals.push(Proposal { optimism: index, point, expected });
            }
        }
        self.belief = Some(belief);
    }

    /// The makeable point of largest `merit`, from the best design seen.
    fn climb(&mut self, run: &SearchRun, space: &Subspace, merit: &dyn Fn(&[f64]) -> f64) -> Option<(f64, Vec<f64>)> {
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
        best
    }

    /// Learns what became of a proposal.
    fn learn(&mut self, reference: &Reference, space: &Subspace, point: Vec<f64>, judged: Option<&Judged>) {
        self.has_learnt = true;
        let Some(judged) = judged else {
            return self.learn_failure(space, point, self.fidelity);
        };
        self.values.push(values_of(judged));
        let found = Best { is_as_fine: true, merit: merit_of(reference, judged), point: point.clone() };
        if found.compare(&self.best).is_gt() {
            self.best = found;
        }
        self.seen.push(Seen { point, fidelity: self.fidelity });
    }

    /// Of a design without an equilibrium the rest is supposed as predicted, so that a wall of failures does not bend
    /// what is known beside it.
    fn learn_failure(&mut self, space: &Subspace, point: Vec<f64>, fidelity: Fidelity) {
        let Some(belief) = &self.belief else { return };
        let mut values: Vec<f64> = belief.predict(space, &point, fidelity).into_iter().map(|(mean, _)| mean).collect();
        values.pop();
        values.push(-SOLVED);
        self.values.push(values);
        self.seen.push(Seen { point, fidelity });
        self.num_failed += 1;
    }

    /// Takes the proposal of an optimism out.
    fn take(&mut self, optimism: usize) -> Option<Vec<f64>> {
        let place = self.proposals.iter().position(|p| p.optimism == optimism)?;
        // What is left was proposed in the light of what this one will teach.
        self.has_learnt = true;
        Some(self.proposals.remove(place).point)
    }
}

/// The next designs, each with its race: what looks best of every race that has none solved as finely as proposals
/// are, else of every optimism those that promise most.
fn next_designs(races: &mut [Race], rules: &RaceRules) -> Vec<(usize, Vec<f64>)> {
    let mut designs: Vec<(usize, Vec<f64>)> = Vec::new();
    for (index, race) in races.iter_mut().enumerate() {
        if !race.best.is_as_fine {
            designs.extend(race.take(0).map(|point| (index, point)));
        }
    }
    if !designs.is_empty() {
        return designs;
    }
    for optimism in 0..rules.optimism.len() {
        let promise = |race: &Race| Some(race.proposals.iter().find(|p| p.optimism == optimism)?.expected);
        let mut ranked: Vec<(f64, usize)> =
            races.iter().enumerate().filter_map(|(index, race)| Some((promise(race)?, index))).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        for (_, index) in ranked.into_iter().take(rules.at_once) {
            designs.extend(races[index].take(optimism).map(|point| (index, point)));
        }
    }
    designs
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
            let is_given_up = |space: usize| judge.fidelity == Fidelity::Coarse && state.is_given_up(space);
            let racing = best.into_iter().filter(|space| !is_given_up(*space));
            races.extend(racing.filter_map(|space| Race::of(self, judge, state, spaces, space)));
        }
        let Some(like) = state.first_judged().filter(|_| !races.is_empty()).cloned() else { return Ok(()) };
        let done = AtomicUsize::new(0);
        let reference = &judge.reference;
        while done.load(atomic::Ordering::Relaxed) < total {
            races.par_iter_mut().for_each(|r| {
                r.renew_trend(state, spaces, self.study.scan);
                r.propose(self, (reference, &like), &spaces[r.space], rules.optimism);
            });
            let designs = next_designs(&mut races, rules);
            if designs.is_empty() {
                break;
            }
            self.evaluate_designs(&mut races, designs, (rules, judge), spaces, &done, state)?;
        }
        Ok(())
    }

    /// Designs of some races, evaluated and learnt from.
    fn evaluate_designs(
        &self,
        races: &mut [Race],
        designs: Vec<(usize, Vec<f64>)>,
        (rules, judge): (&RaceRules, &Judge),
        spaces: &[Subspace],
        done: &AtomicUsize,
        state: &mut State,
    ) -> Result<(), SearchError> {
        let reference = &judge.reference;
        let (best, leader) = (state.history.last().copied(), state.leader());
        let (before, total) = rules.counted;
        let places: Vec<usize> = races.iter().map(|r| r.space).collect();
        let results: Vec<Option<Attempt>> = designs
            .par_iter()
            .map(|(race, point)| {
                let attempt = self.estimated(&spaces[places[*race]].specimen(point), judge.fidelity);
                let done = (before + done.fetch_add(1, atomic::Ordering::Relaxed) + 1).min(total);
                (self.progress)(&Progress { stage: rules.stage, done, total, best, leader: leader.clone() });
                attempt
            })
            .collect();
        let mut was_stopped = false;
        for ((race, point), result) in designs.into_iter().zip(results) {
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
                    state.fail(&specimen, Some((space, &point, judge.fidelity)), &cause);
                    None
                }
            };
            races[race].learn(reference, &spaces[space], point, judged.as_ref());
        }
        if was_stopped { Err(state.stopped(self.study, rules.stage)) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn race(space: usize, is_as_fine: bool, expected: &[f64]) -> Race {
        let proposals = expected.iter().enumerate().map(|(optimism, &expected)| {
            let point = vec![space as f64, optimism as f64];
            Proposal { optimism, point, expected }
        });
        Race {
            space,
            fidelity: Fidelity::Fine,
            rng: ChaCha8Rng::seed_from_u64(1),
            seen: Vec::new(),
            values: Vec::new(),
            best: Best { is_as_fine, merit: 0.0, point: Vec::new() },
            belief: None,
            proposals: proposals.collect(),
            trend: None,
            has_learnt: false,
            num_failed: 0,
        }
    }

    /// What has no fine design gets one first; then what looks best is evaluated, and what could be best, of whatever
    /// structure.
    #[test]
    fn structures_compete_by_what_they_promise() {
        let rules = RaceRules { optimism: &[0.0, 2.0], ..RaceRules::of_proposals(9) };
        let mut races = vec![race(0, true, &[0.3, 0.4]), race(1, false, &[0.1, 0.2]), race(2, true, &[0.2, 0.9])];
        assert_eq!(next_designs(&mut races, &rules), [(1, vec![1.0, 0.0])]);
        // Only what lost a proposal proposes anew.
        assert_eq!(races.iter().map(|r| r.has_learnt).collect::<Vec<_>>(), [false, true, false]);
        races[1].best.is_as_fine = true;
        assert_eq!(next_designs(&mut races, &rules), [(0, vec![0.0, 0.0]), (2, vec![2.0, 1.0])]);
        assert_eq!(next_designs(&mut races, &rules), [(2, vec![2.0, 0.0]), (0, vec![0.0, 1.0])]);
        assert_eq!(next_designs(&mut races, &rules), [(1, vec![1.0, 1.0])]);
        assert!(next_designs(&mut races, &rules).is_empty());
    }

    /// A structure that fails more often than not leaves the evaluations to others until that changes.
    #[test]
    fn a_structure_that_keeps_failing_makes_no_more_proposals() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("geometries/studies");
        let text = std::fs::read_to_string(folder.join("uniaxial-bar.json")).expect("the study is there");
        let study = super::super::study::Study::from_json(&text, &folder).expect("the study is valid");
        let evaluator = super::super::evaluator::Evaluator::new(&study);
        let checkpoint = super::super::checkpoint::Checkpoint::in_memory();
        let run =
            SearchRun { study: &study, evaluator, checkpoint: &checkpoint, is_cancelled: &|| false, progress: &|_| {} };
        let (state, base) = (State::default(), super::super::search::base_at_drive(&study));
        let reference = run.in_integrals(&base, &state).expect("the base has an equilibrium");
        let spaces = super::super::space::subspaces(&study);
        let space = spaces.iter().find(|s| s.structure.num_holes() == 1).expect("the study has one hole");
        let n = space.variables.len();
        let evaluated = run.evaluated(&base, None).and_then(Result::ok).expect("it is evaluated");
        let judged = reference.judge(&evaluated);
        let mut race = race(0, false, &[]);
        race.best.point = vec![0.5; n];
        let at = |i: usize| vec![0.1 * i as f64; n];
        race.learn(&reference, space, at(0), Some(&judged));
        for failures in 1..=FEWEST_FAILURES {
            race.propose(&run, (&reference, &judged), space, &[0.0]);
            assert_eq!(race.proposals.len(), 1, "after {} failures", failures - 1);
            race.learn(&reference, space, at(failures), None);
        }
        for solved in 2..=FEWEST_FAILURES {
            race.propose(&run, (&reference, &judged), space, &[0.0]);
            assert!(race.proposals.is_empty(), "{} solved", solved - 1);
            race.learn(&reference, space, at(FEWEST_FAILURES + solved), Some(&judged));
        }
        race.propose(&run, (&reference, &judged), space, &[0.0]);
        assert_eq!(race.proposals.len(), 1);
    }
}
