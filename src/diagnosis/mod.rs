//! Diagnosis: where a recording and its nominal model differ, and what physics was left out.
//!
//! * [`diagnose()`] fits the nominal model, tests every cause of the registry ([`causes`]) to first order, fits the leading ones
//!   in full with the material free, adds them one by one, and predicts data that were kept back.
//! * A misfit counts by its pattern and size: noise and what meshes leave are in its weights.

pub mod causes;
mod diagnose;
mod error;
mod experiment;
mod fibre_map;
mod fit;
mod found;
mod laboratory;
mod leftover;
mod load_history;
mod maps;
mod memory_kernel;
mod mesh_error;
mod metric;
mod result;
mod scene;
mod score;
mod together;
mod trace;
mod work;

pub use diagnose::{Diagnosis, DiagnosisOptions, Ranked, Verdict, diagnose, scene_of_fit};
pub use error::DiagnosisError;
pub use experiment::Experiment;
pub use fit::{BulkPrior, FitSettings, Fitted, Member, Supposed, fit, fit_members, shear_modulus};
pub use found::FoundCause;
pub use laboratory::{Laboratory, Prediction};
pub use leftover::Leftover;
pub use load_history::{ElasticTable, FittedEffect, LoadEffect, LoadHistoryFit, fit_load_history};
pub use maps::{Division, ScoreMap};
pub use memory_kernel::{KernelState, MemoryKernel};
pub use metric::Metric;
pub use result::{BeforeAfter, CauseResult, DiagnosisResult, ModulusAgainstBelief, ParameterResult, RankedResult};
pub use scene::{ImageChange, Jump, Scene};
pub use score::{Score, ScoreTest};
pub use together::{Agreement, CommonCause, CrossPrediction, TogetherResult, together};
pub use trace::Trace;
