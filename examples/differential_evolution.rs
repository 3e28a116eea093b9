//! The published design study searched by differential evolution, with ten times the evaluations that the study allows
//! itself: what `lambdak design` ends with is to be compared with what this finds (docs/design-study.md).
//!
//! Holes along the width are left out: with them it ends at designs near folding that have no equilibrium on the meshes of
//! a confirmation.
//!
//! ```text
//! cargo run --release --example differential_evolution [seed]
//! ```

mod searchers;

use lambdak::design::{
    Confirmed, Evaluator, Fidelity, Reference, Study, base_at_drive, block_in_brief, confirm, estimate, holes_in_brief,
};
use lambdak::specimen::{HoleAxis, Specimen};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use searchers::{Individual, Judge, Space};
use std::path::Path;

/// Evaluations over those of the study's budget.
const TIMES_THE_BUDGET: usize = 10;
/// Designs of a generation on the coarse mesh, and on the fine one.
const POPULATIONS: [usize; 2] = [60, 20];
/// Structures whose best design is confirmed.
const NUM_CONFIRMED: usize = 4;

type Anything<T> = Result<T, Box<dyn std::error::Error>>;

/// Puts a design in the place of the one of its structure that is worse.
fn keep_best_of_structure(space: &Space, best: &mut Vec<Individual>, seen: &Individual) {
    match best.iter_mut().find(|own| space.structure(&own.genome) == space.structure(&seen.genome)) {
        Some(own) if own.merit >= seen.merit => {}
        Some(own) => *own = seen.clone(),
        None => best.push(seen.clone()),
    }
}

/// Confirms a design as `lambdak design` does.
fn confirmed(study: &Study, design: &Specimen, base: &Confirmed) -> Anything<Confirmed> {
    let mut found = confirm(study, design, &|| false)?;
    found.compare(study, base);
    Ok(found)
}

fn main() -> Anything<()> {
    let seed: u64 = std::env::args().nth(1).map_or(Ok(1), |n| n.parse())?;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("geometries/studies");
    let mut study = Study::from_json(&std::fs::read_to_string(folder.join("two-hole-shear.json"))?, &folder)?;
    study.vary.axes = Some(vec![HoleAxis::Thickness]);
    let space = Space::new(&study);
    let evaluator = Evaluator::new(&study);
    let base = base_at_drive(&study);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut best: Vec<Individual> = Vec::new();
    let mut genomes: Vec<Vec<f64>> = (0..POPULATIONS[0]).filter_map(|_| space.random(&mut rng)).collect();
    let budgets = [study.budget.explore, study.budget.propose].map(|budget| TIMES_THE_BUDGET * budget);
    for ((fidelity, budget), population) in [Fidelity::Coarse, Fidelity::Fine].into_iter().zip(budgets).zip(POPULATIONS)
    {
        let at_base = estimate(&study, &base, fidelity, &|| false)?;
        let judge = Judge {
            space: &space,
            fidelity,
            reference: Reference::new(&study, evaluator.samples(), &at_base.responses),
        };
        genomes.truncate(population);
        best.clear();
        let mut spent = 0;
        let mut see = |generation: &[Individual]| {
            spent += generation.len();
            generation.iter().for_each(|seen| keep_best_of_structure(&space, &mut best, seen));
            best.sort_by(|a, b| b.merit.total_cmp(&a.merit));
            let leader = best.first().map_or(0.0, |b| b.merit.exp());
            eprintln!("{fidelity:?} mesh: {spent} of {budget} evaluations, best gain {leader:.4}");
        };
        let start = judge.evaluate(genomes);
        see(&start);
        let found = judge.differential_evolution(start, budget - population, &mut rng, &mut see);
        genomes = found.into_iter().map(|i| i.genome).collect();
    }
    let base = confirm(&study, &base, &|| false)?;
    for individual in best.iter().take(NUM_CONFIRMED) {
        let design = space.design(&individual.genome);
        let (block, holes) = (block_in_brief(&design), holes_in_brief(&design));
        match confirmed(&study, &design, &base) {
            Ok(found) => println!(
                "gain {:.3} +- {:.3}, {}: {block}, {holes}",
                found.objective,
                found.objective * found.mesh_relative_sd,
                if found.is_within_limits { "within the limits" } else { "breaks a limit" },
            ),
            Err(error) => println!("not confirmed ({error}): {block}, {holes}"),
        }
    }
    Ok(())
}
