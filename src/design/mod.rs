//! The search for a better specimen.

mod aim;
mod checkpoint;
mod confirm;
mod explore;
mod finals;
mod findings;
#[cfg(test)]
mod grid_tests;
mod inline;
mod local;
mod objective;
mod problem;
mod response;
mod result;
mod search;
#[cfg(test)]
mod search_tests;
mod space;
mod state;
mod study;
mod study_check;
mod study_error;
mod study_file;
mod study_limits;
#[cfg(test)]
mod study_tests;
mod tell_apart;
mod unfinished;

pub use aim::{Combine, Guard, Normalisation, Objective, ObjectiveKind};
pub use checkpoint::{Checkpoint, CheckpointError};
pub use confirm::{Confirmed, CriterionValues, Gain, MaterialEvaluation, confirm};
pub use explore::{geometry_margins, is_makeable, sample};
pub use findings::Disagreement;
pub(crate) use inline::Inline;
pub use local::{Improved, LocalModel, LocalProblem, LocalSettings, improve};
pub use objective::{Judged, Reference};
pub use response::{
    Evaluated, EvaluationFailure, Evaluator, MaterialSample, Response, TEARING_FRACTION, sample_materials,
    tearing_stretch,
};
pub use result::{DesignEntry, DesignResult, MaterialVerification, Verification};
pub use search::{Found, Progress, ProgressSink, SearchError, base_at_drive, search, study_hash};
pub use space::{Orbit, Structure, Subspace, Variable, subspaces};
pub use state::Candidate;
pub use study::{Budget, CountRange, MaterialPrior, Range, Study, Vary, VerificationSettings};
pub use study_error::StudyError;
pub use unfinished::Unfinished;
