//! Other methods of search than the program's own, by which that one is judged. They share nothing with it but the
//! figures that designs are judged by. A design is one vector with components in [0, 1]: a number that chooses the
//! structure, and every variable that any structure has.

#![allow(dead_code)] // Each example uses a part.

use lambdak::design::{Fidelity, Reference, Study, Subspace, Variable, estimate, is_makeable, subspaces};
use lambdak::optimise::Evolution;
use lambdak::specimen::Specimen;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Weight of a difference between two designs, and probability that a component takes part: Storn and Price's.
const WEIGHT: f64 = 0.5;
const CROSSOVER: f64 = 0.9;
/// Standard deviation of the first designs of an evolution strategy, and that at which it starts elsewhere.
const STEPS: [f64; 2] = [0.3, 0.02];
/// Attempts at a design that can be made: they cost nothing.
const ATTEMPTS: usize = 200;

/// What is searched.
pub struct Space<'a> {
    pub study: &'a Study,
    structures: Vec<Subspace>,
    /// Every variable that any structure has.
    variables: Vec<Variable>,
}

impl<'a> Space<'a> {
    pub fn new(study: &'a Study) -> Space<'a> {
        let structures = subspaces(study);
        let mut variables: Vec<Variable> = Vec::new();
        for variable in structures.iter().flat_map(|s| &s.variables) {
            if !variables.contains(variable) {
                variables.push(*variable);
            }
        }
        Space { study, structures, variables }
    }

    /// The structure of a vector.
    pub fn structure(&self, genome: &[f64]) -> usize {
        ((genome[0] * self.structures.len() as f64) as usize).min(self.structures.len() - 1)
    }

    /// The design of a vector.
    pub fn design(&self, genome: &[f64]) -> Specimen {
        let structure = &self.structures[self.structure(genome)];
        let of_variable =
            |v: &Variable| self.variables.iter().position(|own| own == v).map_or(0.5, |at| genome[at + 1]);
        structure.specimen(&structure.variables.iter().map(of_variable).collect::<Vec<_>>())
    }

    /// A random design that can be made; `None` where none is found.
    pub fn random(&self, rng: &mut ChaCha8Rng) -> Option<Vec<f64>> {
        self.makeable(|| (0..=self.variables.len()).map(|_| rng.random::<f64>()).collect())
    }

    /// What `draw` gives, drawn again until it can be made; `None` where it never can.
    fn makeable(&self, mut draw: impl FnMut() -> Vec<f64>) -> Option<Vec<f64>> {
        let is_good = |g: &Vec<f64>| is_makeable(&self.design(g), &self.study.limits, self.study.scan.voxel_mm);
        (0..ATTEMPTS).map(|_| draw()).find(is_good)
    }
}

/// A design that was evaluated.
#[derive(Clone)]
pub struct Individual {
    pub genome: Vec<f64>,
    /// ln of the least gain less penalties on broken limits; −∞ without an equilibrium.
    pub merit: f64,
    /// The gain, within the limits.
    pub gain: Option<f64>,
}

/// Evaluations at one fidelity.
pub struct Judge<'a> {
    pub space: &'a Space<'a>,
    pub fidelity: Fidelity,
    pub reference: Reference<'a>,
}

impl Judge<'_> {
    /// Merit and gain of a design.
    pub fn judged(&self, design: &Specimen) -> (f64, Option<f64>) {
        let Ok(evaluated) = estimate(self.space.study, design, self.fidelity, &|| false) else {
            return (f64::NEG_INFINITY, None);
        };
        let judged = self.reference.judge(&evaluated);
        let is_within_limits = judged.margins.iter().all(|m| *m >= -1e-9);
        (self.reference.merit(&judged), is_within_limits.then(|| self.reference.objective(&judged).exp()))
    }

    pub fn evaluate(&self, genomes: Vec<Vec<f64>>) -> Vec<Individual> {
        let individual = |genome: Vec<f64>| {
            let (merit, gain) = self.judged(&self.space.design(&genome));
            Individual { genome, merit, gain }
        };
        genomes.into_par_iter().map(individual).collect()
    }

    /// Differential evolution (DE/rand/1/bin: Storn and Price, J. Global Optim. 11, 1997) from `population` until
    /// `budget` evaluations are spent: the last population, best first. `see` is told every generation.
    pub fn differential_evolution(
        &self,
        mut population: Vec<Individual>,
        budget: usize,
        rng: &mut ChaCha8Rng,
        see: &mut dyn FnMut(&[Individual]),
    ) -> Vec<Individual> {
        let num = population.len();
        let mut spent = 0;
        while spent + num <= budget {
            let trials: Vec<Vec<f64>> = (0..num)
                .map(|own| {
                    let child = self.space.makeable(|| trial(&population, own, rng));
                    child.unwrap_or_else(|| population[own].genome.clone())
                })
                .collect();
            spent += num;
            let trials = self.evaluate(trials);
            see(&trials);
            for (own, trial) in population.iter_mut().zip(trials) {
                if trial.merit >= own.merit {
                    *own = trial;
                }
            }
        }
        population.sort_by(|a, b| b.merit.total_cmp(&a.merit));
        population
    }

    /// Covariance matrix adaptation of the whole vector, the number that chooses the structure included, started anew
    /// from a random design where its steps have become small, until `budget` evaluations are spent. `see` is told
    /// every generation.
    pub fn covariance_adaptation(&self, budget: usize, rng: &mut ChaCha8Rng, see: &mut dyn FnMut(&[Individual])) {
        let mut spent = 0;
        while spent < budget {
            let Some(start) = self.space.random(rng) else { return };
            let mut evolution = Evolution::new(&start, STEPS[0]);
            while evolution.step() > STEPS[1] && spent < budget {
                let draw = |rng: &mut ChaCha8Rng| -> Vec<f64> {
                    evolution.draw(rng).into_iter().map(|x| x.clamp(0.0, 1.0)).collect()
                };
                let num = evolution.population().min(budget - spent);
                let genomes: Vec<_> = (0..num).filter_map(|_| self.space.makeable(|| draw(rng))).collect();
                // Nothing that can be made is left around it.
                if genomes.is_empty() {
                    break;
                }
                spent += genomes.len();
                let mut generation = self.evaluate(genomes);
                see(&generation);
                generation.sort_by(|a, b| b.merit.total_cmp(&a.merit));
                evolution.learn(&generation.into_iter().map(|i| i.genome).collect::<Vec<_>>());
            }
        }
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
