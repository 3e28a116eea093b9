//! The search for a better specimen.

mod aim;
mod candidate;
mod checkpoint;
mod confirm;
mod detection;
mod disagreement;
mod entry;
mod evaluation_failure;
mod evaluator;
mod explore;
mod fidelity;
mod finals;
mod findings;
mod found_sizes;
#[cfg(test)]
mod grid_tests;
mod inline;
mod local;
mod material_samples;
mod objective;
mod propose;
mod recommendation;
mod response;
mod result;
mod rounding;
mod search;
mod search_error;
mod search_run;
#[cfg(test)]
mod search_tests;
mod shown;
mod space;
mod state;
mod structure;
mod structure_problem;
mod study;
mod study_check;
mod study_error;
mod study_file;
mod study_hash;
mod study_limits;
#[cfg(test)]
mod study_tests;
mod surrogate;
mod tell_apart;
mod ties;
mod trend;
mod unfinished;
mod words;

pub use aim::{Combine, Guard, Normalisation, Objective, ObjectiveKind};
pub use candidate::Candidate;
pub use checkpoint::{Checkpoint, CheckpointError};
pub use confirm::{Confirmed, CriterionValues, Gain, MaterialEvaluation, confirm, estimate};
pub use disagreement::Disagreement;
pub use entry::DesignEntry;
pub use evaluation_failure::EvaluationFailure;
pub use evaluator::{Evaluated, Evaluator};
pub use explore::{geometry_margins, is_makeable, sample};
pub use fidelity::Fidelity;
pub(crate) use inline::Inline;
pub use local::{Improved, LocalModel, LocalProblem, LocalSettings, improve};
pub use material_samples::{MaterialSample, sample_materials};
pub use objective::{Judged, Reference};
pub use recommendation::Recommendation;
pub use response::{Response, TEARING_FRACTION, tearing_stretch};
pub use result::{DesignResult, MaterialVerification, Verification};
pub use search::{Found, base_at_drive, search};
pub use search_error::SearchError;
pub use search_run::{Progress, ProgressSink};
pub use space::{Subspace, Variable, subspaces};
pub use structure::{Orbit, Structure};
pub use study::{
    AngleRange, Budget, CountRange, MaterialPrior, NotchedSide, OffsetRange, Range, Study, Vary, VaryHoleShapes,
    VarySample, VerificationSettings,
};
pub use study_error::StudyError;
pub use study_hash::study_hash;
pub use unfinished::Unfinished;
pub use words::{block_in_brief, holes_in_brief, plates_in_words};
