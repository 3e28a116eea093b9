//! What all stages of a search share: the study, its evaluations kept in the checkpoint, and where progress is told.

use super::aim::ObjectiveKind;
use super::checkpoint::Checkpoint;
use super::confirm::{Confirmed, confirm, estimate};
use super::evaluation_failure::EvaluationFailure;
use super::evaluator::{Evaluated, Evaluator};
use super::fidelity::Fidelity;
use super::objective::Reference;
use super::space::Subspace;
use super::study::Study;
use crate::provenance::input_hash;
use crate::sensitivity::{GridPlace, ScanSettings};
use crate::specimen::Specimen;

/// How far a search is.
#[derive(Clone, Debug)]
pub struct Progress {
    /// `base`, `explore`, `refine`, `propose`, `solid`, `rows`, `confirm`, `repair`, `scan`,
    /// `tolerances`, `verify`.
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
/// A confirmation, or why there is none; `None` where it was cancelled.
pub(super) type Confirmation = Option<Result<Confirmed, EvaluationFailure>>;

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
        self.estimated_in(&self.study.scan, specimen, fidelity)
    }

    /// The same in another scan than the study's.
    pub fn estimated_in(&self, scan: &ScanSettings, specimen: &Specimen, fidelity: Fidelity) -> Option<Attempt> {
        let key = self.key_of("estimate", scan, &serde_json::json!({ "specimen": specimen, "fidelity": fidelity }));
        let study = Study { scan: *scan, ..self.study.clone() };
        self.checkpoint.get_or(&key, || match estimate(&study, specimen, fidelity, &|| (self.is_cancelled)()) {
            Err(EvaluationFailure::Cancelled) => None,
            other => Some(other),
        })
    }

    /// A design's confirmation in a scan: from the checkpoint where it is known.
    pub fn confirmed_in(&self, scan: &ScanSettings, specimen: &Specimen) -> Confirmation {
        let key = self.key_of("confirm", scan, &serde_json::json!({ "specimen": specimen }));
        let study = Study { scan: *scan, ..self.study.clone() };
        self.checkpoint.get_or(&key, || match confirm(&study, specimen, &|| (self.is_cancelled)()) {
            Err(EvaluationFailure::Cancelled) => None,
            other => Some(other),
        })
    }

    /// Under which the checkpoint keeps what was found of a design in a scan.
    fn key_of(&self, kind: &str, scan: &ScanSettings, of_what: &serde_json::Value) -> String {
        let other = (*scan != self.study.scan).then_some(scan);
        input_hash(&serde_json::json!({ "kind": kind, "scan": other, "of": of_what }))
    }

    /// Whether the objective jumps where a row of voxels comes in at a free face: where it looks at voxels of a grid
    /// that lies on the middle of each specimen.
    pub fn jumps_by_rows(&self) -> bool {
        let looks_at_voxels = !matches!(self.study.objective.kind, ObjectiveKind::TellApart | ObjectiveKind::Detect);
        looks_at_voxels && self.study.scan.grid == GridPlace::Centred
    }

    /// The objective of `design` in `scan` over that of `base` in the study's if the grid lay anywhere, in place of on
    /// the middle of each: `None` where the study takes it to do so, where its objective does not look at voxels or
    /// asks for a diagnosis, or where it was cancelled.
    pub fn gain_anywhere(&self, base: &Specimen, design: &Specimen, scan: &ScanSettings) -> Option<f64> {
        if !self.jumps_by_rows() {
            return None;
        }
        let evaluated = |specimen: &Specimen, scan: &ScanSettings| {
            let anywhere = ScanSettings { grid: GridPlace::Anywhere, ..*scan };
            self.estimated_in(&anywhere, specimen, Fidelity::Fine)?.ok()
        };
        let (base, design) = (evaluated(base, &self.study.scan)?, evaluated(design, scan)?);
        let reference = Reference::new(self.study, self.evaluator.samples(), &base.responses);
        Some(reference.objective(&reference.judge(&design)).exp())
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
