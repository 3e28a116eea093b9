//! What a search has seen, and what it takes from there into its next stage.

use super::candidate::Candidate;
use super::evaluation_failure::EvaluationFailure;
use super::fidelity::Fidelity;
use super::objective::Judged;
use super::search_error::SearchError;
use super::search_run::Judge;
use super::study::Study;
use super::unfinished::Unfinished;
use crate::specimen::Specimen;

/// Designs of one structure that are confirmed at most.
const MOST_OF_A_STRUCTURE: usize = 2;
/// Designs of a structure that are tried on the fine mesh until one has an equilibrium.
pub(super) const MOST_FINE_FAILURES: usize = 2;

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
    /// How finely each candidate was solved.
    fidelities: Vec<Fidelity>,
    /// Largest objective within limits after each evaluation, of the candidates solved as finely.
    pub history: Vec<f64>,
    pub failures: Vec<String>,
    /// Structure and vector of designs that could not be solved, and how finely they were to be.
    failed: Vec<(usize, Vec<f64>, Fidelity)>,
    pub num_evaluations: usize,
}

impl State {
    pub fn add(
        &mut self,
        (space, vector): (usize, &[f64]),
        specimen: Specimen,
        judge: &Judge,
        judged: &Judged,
        stage: &str,
    ) {
        let reference = &judge.reference;
        let objective = reference.objective(judged).exp();
        let is_within_limits = judged.margins.iter().all(|m| *m >= -1e-9);
        self.num_evaluations += 1;
        let is_as_before = self.fidelities.last() == Some(&judge.fidelity);
        let best = self.history.last().copied().filter(|_| is_as_before).unwrap_or(0.0);
        self.history.push(if is_within_limits { best.max(objective) } else { best });
        self.fidelities.push(judge.fidelity);
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

    /// A design that could not be solved; `of` where it was searched for: its structure and vector, and how finely it
    /// was to be solved.
    pub fn fail(&mut self, specimen: &Specimen, of: Option<(usize, &[f64], Fidelity)>, cause: &EvaluationFailure) {
        self.num_evaluations += 1;
        self.failed.extend(of.map(|(space, vector, fidelity)| (space, vector.to_vec(), fidelity)));
        self.failures.push(format!("{}: {cause}", specimen.name));
    }

    /// The best design within the limits, of those that were solved as finely as the last one.
    pub fn leader(&self) -> Option<Specimen> {
        let fidelity = self.fidelities.last()?;
        let counts = |index: &usize| self.fidelities[*index] == *fidelity && self.candidates[*index].is_within_limits;
        let objective = |index: &usize| self.candidates[*index].objective;
        let best = (0..self.candidates.len()).filter(counts).max_by(|a, b| objective(a).total_cmp(&objective(b)));
        best.map(|index| self.candidates[index].specimen.clone())
    }

    /// Candidates by merit, best first; those that were solved finely before others.
    fn order(&self) -> Vec<usize> {
        let is_coarse = |index: &usize| self.fidelities[*index] == Fidelity::Coarse;
        let merit = |index: &usize| self.candidates[*index].merit;
        let mut order: Vec<usize> = (0..self.candidates.len()).collect();
        order.sort_by(|a, b| is_coarse(a).cmp(&is_coarse(b)).then(merit(b).total_cmp(&merit(a))).then(a.cmp(b)));
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

    /// The `count` structures with the best designs, best first; last those of which no design could be solved finely
    /// although it was tried. Structures are compared by coarse designs, which most have been improved by.
    pub fn best_structures(&self, count: usize) -> Vec<usize> {
        let is_fine = |index: usize| self.fidelities[index] == Fidelity::Fine;
        // Of every structure: whether it fails finely, its best coarse (else fine) merit.
        let mut of_structures: Vec<(usize, bool, f64)> = Vec::new();
        for index in self.order().into_iter().rev() {
            let space = self.points[index].0;
            let has_coarse = of_structures.iter().any(|s| s.0 == space);
            if is_fine(index) && has_coarse {
                continue;
            }
            of_structures.retain(|s| s.0 != space);
            of_structures.push((space, self.fine_failures(space) > 0, self.candidates[index].merit));
        }
        of_structures.sort_by(|a, b| a.1.cmp(&b.1).then(b.2.total_cmp(&a.2)).then(a.0.cmp(&b.0)));
        of_structures.into_iter().take(count).map(|s| s.0).collect()
    }

    /// How many designs of a structure were to be solved finely and could not be; none where one could.
    fn fine_failures(&self, space: usize) -> usize {
        if self.seen_of(space).iter().any(|(_, fidelity, _)| *fidelity == Fidelity::Fine) {
            return 0;
        }
        self.failed_of(space).filter(|(_, fidelity)| *fidelity == Fidelity::Fine).count()
    }

    /// Whether a structure has so often failed on the fine mesh that it is no longer improved on the coarse one.
    pub fn is_given_up(&self, space: usize) -> bool {
        self.fine_failures(space) >= MOST_FINE_FAILURES
    }

    /// The best design of the structures that `counts` admits, with its structure.
    pub fn best_among(&self, counts: &dyn Fn(usize) -> bool) -> Option<&(usize, Vec<f64>)> {
        self.order().into_iter().map(|index| &self.points[index]).find(|(space, _)| counts(*space))
    }

    /// The designs of a structure, how finely they were solved and what they were judged, in order.
    pub fn seen_of(&self, space: usize) -> Vec<(&Vec<f64>, Fidelity, &Judged)> {
        let of_space = (0..self.points.len()).filter(|&index| self.points[index].0 == space);
        of_space.map(|index| (&self.points[index].1, self.fidelities[index], &self.judged[index])).collect()
    }

    /// The designs of a structure that could not be solved, and how finely they were to be, in order.
    pub fn failed_of(&self, space: usize) -> impl Iterator<Item = (&Vec<f64>, Fidelity)> {
        self.failed.iter().filter(move |f| f.0 == space).map(|(_, vector, fidelity)| (vector, *fidelity))
    }

    /// The best design of a structure that is still to be solved finely, if none of it was: the best of those that lie
    /// at least `apart` from what failed.
    pub fn to_check(&self, space: usize, apart: f64) -> Option<&(usize, Vec<f64>)> {
        if self.seen_of(space).iter().any(|(_, fidelity, _)| *fidelity == Fidelity::Fine) {
            return None;
        }
        let are_far = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt() >= apart;
        let failed: Vec<&Vec<f64>> = self
            .failed_of(space)
            .filter(|(_, fidelity)| *fidelity == Fidelity::Fine)
            .map(|(vector, _)| vector)
            .collect();
        let mut of_space = self.order().into_iter().map(|index| &self.points[index]).filter(|(of, _)| *of == space);
        of_space.find(|(_, point)| failed.iter().all(|f| are_far(f, point)))
    }

    /// Designs that were solved, of all structures.
    pub fn num_seen(&self) -> usize {
        self.points.len()
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
            // Near copies teach nothing, and what one mesh praises in a structure a finer one may not keep.
            if chosen.len() < study.budget.confirm && *count < MOST_OF_A_STRUCTURE {
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
pub(super) fn is_same(a: &Specimen, b: &Specimen) -> bool {
    const TOLERANCE_MM: f64 = 1e-3;
    let near = |a: f64, b: f64| (a - b).abs() <= TOLERANCE_MM;
    let is_same_sample = |a: &Specimen, b: &Specimen| {
        let lengths = |s: &Specimen| [s.block.length_mm, s.block.thickness_mm, s.block.width_mm, s.block.wedge_mm];
        let gauge = |s: &Specimen| {
            s.outline.dumbbell().map_or([0.0; 3], |d| [d.gauge_width_mm, d.gauge_length_mm, d.fillet_radius_mm])
        };
        a.holes.len() == b.holes.len()
            && lengths(a).iter().zip(lengths(b)).all(|(a, b)| near(*a, b))
            && gauge(a).iter().zip(gauge(b)).all(|(a, b)| near(*a, b))
            && a.holes.iter().zip(&b.holes).all(|(a, b)| {
                a.axis == b.axis
                    && near(a.diameter_mm, b.diameter_mm)
                    && (0..2).all(|c| near(a.center_mm[c], b.center_mm[c]))
                    && near(a.difference_mm(b), 0.0)
            })
    };
    let (of_a, of_b) = (a.samples(), b.samples());
    a.test == b.test
        && a.drive_mm.len() == b.drive_mm.len()
        && a.drive_mm.iter().zip(&b.drive_mm).all(|(a, b)| near(*a, *b))
        && near(a.precompression_mm, b.precompression_mm)
        && of_a.len() == of_b.len()
        && of_a.iter().zip(&of_b).all(|(a, b)| is_same_sample(a, b))
}
