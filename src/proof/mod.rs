//! Proof of the diagnosis: recordings with a hidden, randomly drawn cause, made by code of its own on meshes of its
//! own, and how the diagnosis fares on them.
//!
//! * [`draw_cause`]: a cause, its place, size, material and noise, from a seed.
//! * [`fn@conceal`]: the recording, from triangular prisms where the diagnosis has hexahedra, with sharp edges where it
//!   has smooth ones, a remeshed specimen where it moves nodes, and force histories of another model.
//! * [`prove`]: diagnoses each and scores cause, place and intervals; [`Proof`] sums up.

mod conceal;
mod detection;
mod draw;
mod experiment;
mod history;
mod options;
mod own_effect;
mod result;
mod score;
mod several;
mod several_answer;
mod several_result;
mod summary;
mod truths;

pub use conceal::{ConcealError, Concealed, conceal};
pub use detection::DetectionCurve;
pub use draw::{Hidden, HiddenCause, draw_cause};
pub use experiment::{Experiment, draw_harmless, draw_several, draw_with_unknown};
pub use options::ProofOptions;
pub use result::{CauseSummary, FirstNamed, Proof, Scored};
pub use score::{num_recordings, prove, score_one};
pub use several::{
    SeveralOptions, prove_several, score_answer, score_experiment, several_experiments, specimen_of, sum_up,
    unknown_cause,
};
pub use several_answer::{Answer, AnsweredCause};
pub use several_result::{CauseOfSeveral, CauseScore, ExperimentKind, SeveralProof, SeveralScored};
