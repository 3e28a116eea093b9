//! The published design study searched by differential evolution, with ten times the evaluations that the study allows
//! itself: what `lambdak design` ends with is to be compared with what this finds (docs/design-study.md).
//!
//! The method (DE/rand/1/bin: Storn and Price, J. Global Optim. 11, 1997) shares nothing with the program's own search
//! but the figures that designs are judged by. A design is one vector: a number that chooses the structure, and every
//! variable that any structure has. Holes along the width are left out: with them it ends at designs near folding that
//! have no equilibrium on the meshes of a confirmation.
//!
//! ```text
//! cargo run --release --example differential_evolution [seed]
//! ```

use lambdak::design::{
    Confirmed, Evaluator, Fidelity, Reference, Study, Subspace, Variable, base_at_drive, block_in_brief, confirm,
    estimate, holes_in_brief, is_makeable, subspaces,
};
use lambdak::specimen::{HoleAxis, Specimen};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::path::Path;

/// Evaluations over those of the study's budget.
const TIMES_THE_BUDGET: usize = 10;
/// Designs of a generation on the coarse mesh, and on the fine one.
const POPULATIONS: [usize; 2] = [60, 20];
/// Weight of a difference between two designs, and probability that a component takes part: Storn and Price's.
const WEIGHT: f64 = 0.5;
const CROSSOVER: f64 = 0.9;
/// Attempts at a design that can be made: they cost nothing.
const ATTEMPTS: usize = 200;
/// Structures whose best design is confirmed.
const NUM_CONFIRMED: usize = 4;

type Anything<T> = Result<T, Box<dyn std::error::Error>>;

/// What is searched.
struct Space<'a> {
    study: &'a Study,
    structures: Vec<Subspace>,
    /// Every variable that any structure has.
    variables: Vec<Variable>,
}

impl<'a> Space<'a> {
    fn new(study: &'a Study) -> Space<'a> {
        let structures = subspaces(study);
        let mut variables: Vec<Variable> = Vec::new();
        for variable in structures.iter().flat_map(|s| &s.variables) {
            if !variables.contains(variable) {
                variables.push(*variable);
            }
        }
        Space { study, structures, variables }
    }

    /// The structure of a vector with components in [0, 1].
    fn structure(&self, genome: &[f64]) -> usize {
        ((genome[0] * self.structures.len() as f64) as usize).min(self.structures.len() - 1)
    }

    /// The design of a vector.
    fn design(&self, genome: &[f64]) -> Specimen {
        let structure = &self.structures[self.structure(genome)];
        let of_variable =
            |v: &Variable| self.variables.iter().position(|own| own == v).map_or(0.5, |at| genome[at + 1]);
        structure.specimen(&structure.variables.iter().map(of_variable).collect::<Vec<_>>())
    }

    /// What `draw` gives, drawn again until it can be made; `None` where it never can.
    fn makeable(&self, mut draw: impl FnMut() -> Vec<f64>) -> Option<Vec<f64>> {
        let is_good = |g: &Vec<f64>| is_makeable(&self.design(g), &self.study.limits, self.study.scan.voxel_mm);
        (0..ATTEMPTS).map(|_| draw()).find(is_good)
    }
}

/// A design that was evaluated.
#[derive(Clone)]
struct Individual {
    genome: Vec<f64>,
    /// ln of the least gain less penalties on broken limits; −∞ without an equilibrium.
    merit: f64,
}

/// Evaluations at one fidelity.
struct Judge<'a> {
    space: &'a Space<'a>,
    fidelity: Fidelity,
    reference: Reference<'a>,
}

impl Judge<'_> {
    fn evaluate(&self, genomes: Vec<Vec<f64>>) -> Vec<Individual> {
        let merit = |genome: &[f64]| {
            let design = self.space.design(genome);
            let evaluated = estimate(self.space.study, &design, self.fidelity, &|| false);
            evaluated.map_or(f64::NEG_INFINITY, |e| self.reference.merit(&self.reference.judge(&e)))
        };
        let individual = |genome: Vec<f64>| Individual { merit: merit(&genome), genome };
        genomes.into_par_iter().map(individual).collect()
    }

    /// Goes on from `population` until `budget` evaluations are spent: the population, and the best of each structure
    /// that was seen, both best first.
    fn evolve(
        &self,
        mut population: Vec<Individual>,
        budget: usize,
        rng: &mut ChaCha8Rng,
    ) -> (Vec<Individual>, Vec<Individual>) {
        let num = population.len();
        let mut spent = 0;
        let mut of_structures: Vec<Individual> = Vec::new();
        let mut keep = |seen: &Individual| {
            let structure = self.space.structure(&seen.genome);
            match of_structures.iter_mut().find(|own| self.space.structure(&own.genome) == structure) {
                Some(own) if own.merit >= seen.merit => {}
                Some(own) => *own = seen.clone(),
                None => of_structures.push(seen.clone()),
            }
        };
        population.iter().for_each(&mut keep);
        while spent + num <= budget {
            let trials: Vec<Vec<f64>> = (0..num)
                .map(|own| {
                    let child = self.space.makeable(|| trial(&population, own, rng));
                    child.unwrap_or_else(|| population[own].genome.clone())
                })
                .collect();
            spent += num;
            for (own, trial) in population.iter_mut().zip(self.evaluate(trials)) {
                keep(&trial);
                if trial.merit >= own.merit {
                    *own = trial;
                }
            }
            let best = population.iter().map(|i| i.merit).fold(f64::NEG_INFINITY, f64::max);
            eprintln!("{:?} mesh: {spent} of {budget} evaluations, best gain {:.4}", self.fidelity, best.exp());
        }
        population.sort_by(|a, b| b.merit.total_cmp(&a.merit));
        of_structures.sort_by(|a, b| b.merit.total_cmp(&a.merit));
        (population, of_structures)
    }
}

/// A trial vector: a third design moved by the weighted difference of two others, crossed with the design itself. A
/// component that leaves its range is drawn anew between the bound and where the design itself has it.
fn trial(population: &[Individual], own: usize, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let num = population.len();
    let mut others = [own; 3];
    for n in 0..3 {
        while others[n] == own || others[..n].contains(&others[n]) {
            others[n] = rng.random_range(0..num);
        }
    }
    let [a, b, c] = others.map(|n| &population[n].genome);
    let genome = &population[own].genome;
    let always = rng.random_range(0..genome.len());
    (0..genome.len())
        .map(|i| {
            if i != always && rng.random::<f64>() > CROSSOVER {
                return genome[i];
            }
            let moved = a[i] + WEIGHT * (b[i] - c[i]);
            let bound = moved.clamp(0.0, 1.0);
            if moved == bound { moved } else { bound + rng.random::<f64>() * (genome[i] - bound) }
        })
        .collect()
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
    let random = |rng: &mut ChaCha8Rng| (0..=space.variables.len()).map(|_| rng.random::<f64>()).collect::<Vec<_>>();
    let mut best: Vec<Individual> = Vec::new();
    let mut genomes: Vec<Vec<f64>> = (0..POPULATIONS[0]).filter_map(|_| space.makeable(|| random(&mut rng))).collect();
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
        let start = judge.evaluate(genomes);
        let (found, of_structures) = judge.evolve(start, budget - population, &mut rng);
        genomes = found.into_iter().map(|i| i.genome).collect();
        best = of_structures;
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
