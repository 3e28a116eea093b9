//! Diagnosis: where a recording and its nominal model differ, and what physics was left out.
//!
//! * [`diagnose()`] runs the stages of a diagnosis, each in a file of its own: it fits the nominal model, reads the
//!   load curve, corrects the mesh, questions the material, takes artefacts out of the image, adds causes round by
//!   round, and predicts data kept back.
//! * A *cause* changes a [`Scene`]; the [`Laboratory`] predicts what would be recorded of a scene, and how that changes
//!   with it.
//! * A misfit counts by its pattern and size: noise and what meshes may leave are in its weights ([`Metric`]).
//! * [`together()`] looks at several diagnosed recordings.
//! * [`detectable()`] says of a scan that is planned how small each cause may be and still be named.
//!
//! A new cause is a file in `causes` and a line in the registry there. A program on the library needs neither: it
//! implements [`Cause`], adds its cause to a [`Registry`] and calls [`diagnose_with`] (`examples/own_cause.rs`).

mod adding_causes;
mod artefacts;
mod balls;
mod candidate;
mod case;
mod cause;
mod cause_fit;
mod causes;
mod clusters;
mod conclusion;
mod cross_prediction;
mod detectable;
mod diagnose;
mod division;
mod elastic_table;
mod entry;
mod error;
mod evidence;
mod experiment;
mod fibre_map;
mod findings;
mod fit;
mod found;
mod further_term;
mod image;
mod inference;
mod interior;
mod interval;
mod jumps;
mod laboratory;
mod law_curves;
mod leftover;
mod load_curve;
mod load_effect;
mod load_history;
mod load_problem;
mod location;
mod maps;
mod material_cause;
mod memory_kernel;
mod mesh_error;
mod metric;
mod nominal;
mod noncentral;
mod options;
mod other_mesh;
mod outcome;
mod planned;
mod prior;
mod ranked;
mod registry;
mod result;
mod rounds;
mod scene;
mod score;
mod score_round;
mod search;
mod set_up;
mod stand_ins;
mod station;
mod supposed;
#[cfg(test)]
mod test_recordings;
mod thinning;
mod together;
mod trace;
mod trial;

pub use crate::rate::{BeforeAfter, Verdict};
pub use cause::{Category, Cause, CauseIdentity, CauseName, CauseParameter, Course};
pub use cause_fit::CauseFit;
pub use cross_prediction::CrossPrediction;
pub use detectable::{DETECTION_PROBABILITY, Detectable, detectable};
pub use diagnose::{diagnose, diagnose_with};
pub use division::Division;
pub use error::DiagnosisError;
pub use experiment::Experiment;
pub use found::{FoundCause, FoundParameter};
pub use interior::{InteriorTest, MisfitOrigin};
pub use laboratory::{Laboratory, Prediction};
pub use law_curves::{LawCurve, law_curves};
pub use leftover::Leftover;
pub use load_effect::{EffectParameter, FittedEffect, ForceChange, LoadEffect, LoadReadings};
pub use load_history::LoadHistoryFit;
pub use location::Location;
pub use maps::ScoreMap;
pub use mesh_error::MeshDefect;
pub use metric::Metric;
pub use options::DiagnosisOptions;
pub use outcome::Diagnosis;
pub use planned::PlannedScan;
pub use prior::{BulkPrior, FitSettings, ShearPrior};
pub use ranked::Ranked;
pub use registry::{Registry, answers, cause_names};
pub use result::{CauseResult, DiagnosisResult, ModulusAgainstBelief, ParameterResult, RankedResult};
pub use scene::{ImageChange, Jump, MovedCut, Scene};
pub use supposed::Supposed;
pub use together::{Agreement, CommonCause, TogetherResult, together};
pub use trace::Trace;
