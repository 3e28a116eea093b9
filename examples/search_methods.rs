//! What the program's own search and three other methods find of the published block with the same number of
//! evaluations: `geometries/studies/two-hole-shear-one-term.json` from ten seeds (docs/design-search.md).
//!
//! ```text
//! cargo run --release --example search_methods -- [SEEDS]
//! ```
//!
//! The other methods spend the study's whole budget on its coarse mesh; the program's own spends a part of it on the
//! fine one. What each has found is compared on the fine one.

mod searchers;

use lambdak::design::{
    Checkpoint, Evaluator, Fidelity, Progress, Reference, SearchError, Study, base_at_drive, estimate, search,
};
use lambdak::specimen::Specimen;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use searchers::{Individual, Judge, Space};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Designs of a generation of differential evolution.
const POPULATION: usize = 16;

type Anything<T> = Result<T, Box<dyn std::error::Error + Send + Sync>>;

#[derive(Clone, Copy, Debug)]
enum Method {
    Random,
    DifferentialEvolution,
    CovarianceAdaptation,
    Own,
}

/// The best design within the limits so far.
#[derive(Default)]
struct Leader {
    gain: f64,
    design: Option<Specimen>,
    spent: usize,
    /// After half of the evaluations.
    halfway: Option<Specimen>,
}

impl Leader {
    fn see(&mut self, space: &Space, budget: usize, generation: &[Individual]) {
        for individual in generation {
            if let Some(gain) = individual.gain.filter(|g| *g > self.gain) {
                (self.gain, self.design) = (gain, Some(space.design(&individual.genome)));
            }
            self.spent += 1;
            if 2 * self.spent <= budget {
                self.halfway = self.design.clone();
            }
        }
    }
}

/// What a method has found after half of the study's evaluations and after all of them.
fn found(method: Method, judge: &Judge, seed: u64) -> Anything<[Option<Specimen>; 2]> {
    let Judge { space, .. } = judge;
    let budget = space.study.budget.explore + space.study.budget.propose;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut leader = Leader::default();
    let mut see = |generation: &[Individual]| leader.see(space, budget, generation);
    match method {
        Method::Random => {
            let genomes = (0..budget).filter_map(|_| space.random(&mut rng)).collect();
            see(&judge.evaluate(genomes));
        }
        Method::DifferentialEvolution => {
            let genomes = (0..POPULATION).filter_map(|_| space.random(&mut rng)).collect();
            let start = judge.evaluate(genomes);
            see(&start);
            judge.differential_evolution(start, budget - POPULATION, &mut rng, &mut see);
        }
        Method::CovarianceAdaptation => judge.covariance_adaptation(budget, &mut rng, &mut see),
        Method::Own => return of_own_search(space.study, seed),
    }
    Ok([leader.halfway, leader.design])
}

/// The same of the program's own search, which is stopped before it confirms.
fn of_own_search(study: &Study, seed: u64) -> Anything<[Option<Specimen>; 2]> {
    let study = Study { seed, ..study.clone() };
    let (explore, propose) = (study.budget.explore, study.budget.propose);
    let leaders: Mutex<[Option<Specimen>; 2]> = Mutex::default();
    let is_over = AtomicBool::new(false);
    let see = |progress: &Progress| {
        let spent = match progress.stage {
            "base" => return,
            "explore" => progress.done,
            "propose" => explore + progress.done,
            _ => return is_over.store(true, Ordering::Relaxed),
        };
        let mut leaders = leaders.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if 2 * spent <= explore + propose {
            leaders[0] = progress.leader.clone();
        }
        leaders[1] = progress.leader.clone();
    };
    match search(&study, &Checkpoint::in_memory(), &see, &|| is_over.load(Ordering::Relaxed)) {
        Ok(_) | Err(SearchError::Stopped { .. }) => Ok(leaders.into_inner().unwrap_or_default()),
        Err(error) => Err(error.into()),
    }
}

fn main() -> Anything<()> {
    let num_seeds: u64 = std::env::args().nth(1).map_or(Ok(10), |n| n.parse())?;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("geometries/studies");
    let study = Study::from_json(&std::fs::read_to_string(folder.join("two-hole-shear-one-term.json"))?, &folder)?;
    let space = Space::new(&study);
    let evaluator = Evaluator::new(&study);
    let base = base_at_drive(&study);
    let at_base = [Fidelity::Coarse, Fidelity::Fine].map(|fidelity| estimate(&study, &base, fidelity, &|| false));
    let [coarse, fine] = at_base;
    let (coarse, fine) = (coarse?, fine?);
    let judge = |fidelity, at_base: &_| Judge {
        space: &space,
        fidelity,
        reference: Reference::new(&study, evaluator.samples(), at_base),
    };
    let (coarse, fine) = (judge(Fidelity::Coarse, &coarse.responses), judge(Fidelity::Fine, &fine.responses));
    let budget = study.budget.explore + study.budget.propose;
    println!("| method | after {} evaluations | after {budget} |", budget / 2);
    println!("|---|---|---|");
    for method in [Method::Random, Method::DifferentialEvolution, Method::CovarianceAdaptation, Method::Own] {
        let of_seed = |seed: u64| -> Anything<[f64; 2]> {
            // A design that breaks a limit on the fine mesh, or has no equilibrium there, is not found.
            let gain = |design: Option<Specimen>| design.and_then(|d| fine.judged(&d).1).unwrap_or(0.0);
            Ok(found(method, &coarse, seed)?.map(gain))
        };
        let gains: Vec<[f64; 2]> = (1..=num_seeds).into_par_iter().map(of_seed).collect::<Result<_, _>>()?;
        let told = [0, 1].map(|n| {
            let mut sorted: Vec<f64> = gains.iter().map(|g| g[n]).collect();
            sorted.sort_by(f64::total_cmp);
            let median = 0.5 * (sorted[(sorted.len() - 1) / 2] + sorted[sorted.len() / 2]);
            format!("{median:.3} ({:.3} to {:.3})", sorted[0], sorted[sorted.len() - 1])
        });
        println!("| {method:?} | {} | {} |", told[0], told[1]);
    }
    Ok(())
}
