//! What a stopped search has found so far.

use super::candidate::Candidate;
use super::study::Study;
use super::study_hash::study_hash;
use crate::provenance::VERSION;
use serde::{Deserialize, Serialize};

/// A search that was stopped (`unfinished-design/1`). Nothing in it is confirmed or verified.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unfinished {
    /// Always `unfinished-design/1`.
    pub schema: String,
    /// Always false.
    pub is_finished: bool,
    /// Name of the study.
    pub name: String,
    /// Where it stopped: `base`, `explore`, `refine`, `confirm`, `repair` or `verify`.
    pub stage: String,
    /// What the figures are worth, in words.
    pub note: String,
    /// The best design within the limits; null where none was found yet.
    pub best: Option<Candidate>,
    /// The best of every other number of holes, best first.
    pub others: Vec<Candidate>,
    /// Designs evaluated.
    pub num_evaluations: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// Version of the program.
    pub version: String,
    /// SHA-256 of the study, hexadecimal.
    pub input_hash: String,
}

impl Unfinished {
    /// Of a study stopped in `stage` with these candidates.
    pub fn new(study: &Study, stage: &str, candidates: &[Candidate], num_evaluations: usize) -> Unfinished {
        let mut order: Vec<&Candidate> = candidates.iter().filter(|c| c.is_within_limits).collect();
        // Stable: of equals the first seen stays first.
        order.sort_by(|a, b| b.objective.total_cmp(&a.objective));
        let best = order.first().map(|c| (*c).clone());
        let mut counts: Vec<usize> = best.iter().map(|b| b.specimen.holes.len()).collect();
        let mut others = Vec::new();
        for candidate in order {
            let count = candidate.specimen.holes.len();
            if !counts.contains(&count) {
                counts.push(count);
                others.push(candidate.clone());
            }
        }
        Unfinished {
            schema: "unfinished-design/1".into(),
            is_finished: false,
            name: study.name.clone(),
            stage: stage.into(),
            note:
                "The search was stopped. These are the best designs seen so far, on the coarse mesh of the search: not \
                   confirmed on the fine mesh, not verified."
                    .into(),
            best,
            others,
            num_evaluations,
            seed: study.seed,
            version: VERSION.into(),
            input_hash: study_hash(study),
        }
    }

    /// The best so far in a phrase.
    pub fn summary(&self) -> String {
        match &self.best {
            None => format!("stopped after {} evaluations; no design within the limits yet", self.num_evaluations),
            Some(best) => format!(
                "stopped after {} evaluations; best so far: {} with a gain of {:.3} (unfinished, not confirmed)",
                self.num_evaluations, best.specimen.name, best.objective
            ),
        }
    }
}
