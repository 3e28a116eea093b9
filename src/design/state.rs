//! What a search has seen, and what it takes from there into its next stage.

use super::candidate::Candidate;
use super::evaluation_failure::EvaluationFailure;
use super::objective::{Judged, Reference};
use super::search_error::SearchError;
use super::study::Study;
use super::unfinished::Unfinished;
use crate::specimen::Specimen;

/// A design on its way to confirmation.
#[derive(Clone, Debug)]
pub(super) struct Finalist {
    pub specimen: Specimen,
    /// Structure and vector.
    pub point: (usize, Vec<f64>),
    /// Whether they are kept at search fidelity.
    pub is_within_limits: bool,
}

/// What has been seen so far.
#[derive(Default)]
pub(super) struct State {
    pub candidates: Vec<Candidate>,
    /// Structure and vector of each candidate.
    points: Vec<(usize, Vec<f64>)>,
    /// What each candidate was judged.
    judged: Vec<Judged>,
    pub history: Vec<f64>,
    pub failures: Vec<String>,
    pub num_evaluations: usize,
}

impl State {
    pub fn add(
        &mut self,
        (space, vector): (usize, &[f64]),
        specimen: Specimen,
        reference: &Reference,
        judged: &Judged,
        stage: &str,
    ) {
        let objective = reference.objective(judged).exp();
        let is_within_limits = judged.margins.iter().all(|m| *m >= -1e-9);
        self.num_evaluations += 1;
        let best = self.history.last().copied().unwrap_or(0.0);
        self.history.push(if is_within_limits { best.max(objective) } else { best });
        self.points.push((space, vector.to_vec()));
        self.judged.push(judged.clone());
        self.candidates.push(Candidate {
            specimen,
            objective,
            merit: reference.merit(judged),
            is_within_limits,
            stage: stage.into(),
        });
    }

    pub fn fail(&mut self, specimen: &Specimen, cause: &EvaluationFailure) {
        self.num_evaluations += 1;
        self.failures.push(format!("{}: {cause}", specimen.name));
    }

    pub fn best_of_space(&self, space: usize) -> f64 {
        let merits = self.candidates.iter().zip(&self.points).filter(|(_, p)| p.0 == space).map(|(c, _)| c.merit);
        merits.fold(f64::NEG_INFINITY, f64::max)
    }

    /// Candidates by merit, best first.
    fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.candidates.len()).collect();
        order.sort_by(|a, b| self.candidates[*b].merit.total_cmp(&self.candidates[*a].merit).then(a.cmp(b)));
        order
    }

    /// The best candidates to refine, one of each structure as far as there are structures, best first.
    pub fn starts(&self, count: usize) -> Vec<(usize, Vec<f64>)> {
        let order = self.order();
        let mut starts: Vec<(usize, Vec<f64>)> = Vec::new();
        for per_structure in 1..=count.max(1) {
            let mut used = std::collections::HashMap::new();
            for &index in &order {
                let seen: &mut usize = used.entry(self.points[index].0).or_default();
                *seen += 1;
                if starts.len() < count && *seen == per_structure {
                    starts.push(self.points[index].clone());
                }
            }
        }
        starts
    }

    /// The `count` structures with the best designs, best first.
    pub fn best_structures(&self, count: usize) -> Vec<usize> {
        let mut found: Vec<usize> = Vec::new();
        for index in self.order() {
            let space = self.points[index].0;
            if found.len() < count && !found.contains(&space) {
                found.push(space);
            }
        }
        found
    }

    /// The designs of a structure and what they were judged, in order.
    pub fn seen_of(&self, space: usize) -> Vec<(&Vec<f64>, &Judged)> {
        let all = self.points.iter().zip(&self.judged);
        all.filter(|(point, _)| point.0 == space).map(|(point, judged)| (&point.1, judged)).collect()
    }

    /// What the first design was judged.
    pub fn first_judged(&self) -> Option<&Judged> {
        self.judged.first()
    }

    /// Designs to confirm: the best by merit, and the best of every number of holes, so that the report can say where
    /// holes help.
    pub fn finalists(&self, study: &Study) -> Vec<Finalist> {
        let mut chosen: Vec<usize> = Vec::new();
        let mut per_space = std::collections::HashMap::new();
        let mut by_count = std::collections::BTreeMap::new();
        for index in self.order() {
            // One design may come twice: sampled, and as the start of a refinement.
            let is_known = |&other: &usize| is_same(&self.candidates[other].specimen, &self.candidates[index].specimen);
            if chosen.iter().any(is_known) {
                continue;
            }
            by_count.entry(self.candidates[index].specimen.holes.len()).or_insert(index);
            let count: &mut usize = per_space.entry(self.points[index].0).or_default();
            // Near copies along one refinement teach nothing: four of a structure.
            if chosen.len() < study.budget.confirm && *count < 4 {
                *count += 1;
                chosen.push(index);
            }
        }
        for index in by_count.into_values() {
            if !chosen.contains(&index) {
                chosen.push(index);
            }
        }
        let finalist = |index: usize| Finalist {
            specimen: self.candidates[index].specimen.clone(),
            point: self.points[index].clone(),
            is_within_limits: self.candidates[index].is_within_limits,
        };
        chosen.into_iter().map(finalist).collect()
    }

    pub fn stopped(&self, study: &Study, stage: &str) -> SearchError {
        let unfinished = Unfinished::new(study, stage, &self.candidates, self.num_evaluations);
        SearchError::Stopped { unfinished: Box::new(unfinished) }
    }
}

/// Whether two designs differ by no more than a mould maker can see (1 µm).
fn is_same(a: &Specimen, b: &Specimen) -> bool {
    const TOLERANCE_MM: f64 = 1e-3;
    let near = |a: f64, b: f64| (a - b).abs() <= TOLERANCE_MM;
    let lengths = |s: &Specimen| {
        [s.block.length_mm, s.block.thickness_mm, s.block.width_mm, s.drive_mm.last().copied().unwrap_or(0.0)]
    };
    a.test == b.test
        && a.holes.len() == b.holes.len()
        && lengths(a).iter().zip(lengths(b)).all(|(a, b)| near(*a, b))
        && a.holes.iter().zip(&b.holes).all(|(a, b)| {
            a.axis == b.axis
                && near(a.diameter_mm, b.diameter_mm)
                && (0..2).all(|c| near(a.center_mm[c], b.center_mm[c]))
        })
}
