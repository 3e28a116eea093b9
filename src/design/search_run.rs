//! What all stages of a search share: the study, its evaluations kept in the checkpoint, and where progress is told.

use super::checkpoint::Checkpoint;
use super::confirm::estimate;
use super::evaluation_failure::EvaluationFailure;
use super::evaluator::{Evaluated, Evaluator};
use super::fidelity::Fidelity;
use super::objective::Reference;
use super::space::Subspace;
use super::study::Study;
use crate::provenance::input_hash;
use crate::specimen::Specimen;

/// How far a search is.
#[derive(Clone, Debug)]
pub struct Progress {
    /// `base`, `explore`, `refine`, `propose`, `solid`, `confirm`, `repair`, `verify`.
    pub stage: &'static str,
    /// Finished in this stage.
    pub done: usize,
    /// Of.
    pub total: usize,
    /// Largest objective so far (gain over the base), of designs within the limits.
    pub best: Option<f64>,
    /// The design that reached it.
    pub leader: Option<Specimen>,
}

/// Receives progress; called from several threads.
pub type ProgressSink<'a> = &'a (dyn Fn(&Progress) + Sync);

/// An evaluation, or why there is none.
pub(super) type Attempt = Result<Evaluated, EvaluationFailure>;

/// What designs are judged by: gains over the base, both solved at one fidelity.
pub(super) struct Judge<'a> {
    pub fidelity: Fidelity,
    pub reference: Reference<'a>,
}

/// A search at work.
pub(super) struct SearchRun<'a> {
    pub study: &'a Study,
    pub evaluator: Evaluator<'a>,
    pub checkpoint: &'a Checkpoint,
    pub is_cancelled: &'a (dyn Fn() -> bool + Sync),
    pub progress: ProgressSink<'a>,
}

impl SearchRun<'_> {
    /// What a design is judged by in the search: from the checkpoint where it is known. `None` where it was cancelled.
    pub fn estimated(&self, specimen: &Specimen, fidelity: Fidelity) -> Option<Attempt> {
        let key = input_hash(&serde_json::json!({ "specimen": specimen, "kind": "estimate", "fidelity": fidelity }));
        self.checkpoint.get_or(&key, || match estimate(self.study, specimen, fidelity, &|| (self.is_cancelled)()) {
            Err(EvaluationFailure::Cancelled) => None,
            other => Some(other),
        })
    }

    /// The evaluation of a design in integrals in place of voxels, with gradients where `subspace` is given: from the
    /// checkpoint where it is known. `None` where it was cancelled.
    pub fn evaluated(&self, specimen: &Specimen, subspace: Option<&Subspace>) -> Option<Attempt> {
        let kind = if subspace.is_some() { "gradient" } else { "value" };
        let key = input_hash(&serde_json::json!({ "specimen": specimen, "kind": kind }));
        self.checkpoint.get_or(&key, || match self.evaluator.evaluate(specimen, subspace, &|| (self.is_cancelled)()) {
            Err(EvaluationFailure::Cancelled) => None,
            other => Some(other),
        })
    }
}
