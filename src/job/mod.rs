//! What the program can be asked to do: one file per kind of job, the same for the command, the service and every other
//! door.
//!
//! A *request* says what is wanted (its fields, units, defaults and limits stand once, in its type; the command's
//! options, the OpenAPI document and the reference in the docs come from there). It is *checked*, which names
//! everything that is wrong with it at once, and then *run* in *surroundings* that hand it recordings, take its
//! progress, keep its checkpoint and may cancel it. The *outcome* is a result and files: the command writes them into a
//! folder, the service stores them.
//!
//! A new kind of job is one file here, with a type that implements [`Request`], and one line in [`KINDS`].

mod array_files;
mod calibrate;
mod compare;
mod cost;
mod curve_files;
mod curves;
pub mod defaults;
mod design;
mod design_pictures;
mod detectable;
mod diagnose;
mod error;
mod evaluate;
mod evaluation_list;
mod evaluation_table;
mod export_material;
mod export_model;
mod export_recording;
mod export_result;
mod import;
mod import_request;
mod import_result;
mod import_series;
mod input_use;
mod kind;
mod load_curves;
mod next;
mod outcome;
mod paper_tables;
mod part;
mod path_end;
mod proof;
mod quick_response;
mod reference;
mod registry;
mod request;
mod result_schema;
mod run;
mod scan;
mod schema;
#[cfg(test)]
mod schema_tests;
mod scratch;
mod solve;
mod subject;
mod summary;
mod surroundings;
mod sweep;
mod sweep_task;
mod uniaxial;

pub use cost::seconds_per_drive;
pub use error::{Failure, JobError};
pub use evaluate::EvaluationRequest;
pub use input_use::{InputForm, InputUse};
pub use kind::{Job, Kind, Refusal};
pub use next::NextRequest;
pub use outcome::{File, MediaType, Outcome, OutcomeError, identifier_of_contents, recording_identifier};
pub use part::{Part, PartKind};
pub use quick_response::{NoResponse, quick_response};
pub use reference::reference;
pub use registry::{KINDS, kind_of_collection, kind_of_command, kind_of_part, kind_of_task};
pub use request::{Context, RecordingOutline, Request, Run};
pub use result_schema::ResultSchema;
pub use run::{job_of_part, run};
pub use schema::{FieldForm, RequestField, RequestSchema};
pub use scratch::ScratchFolder;
pub use subject::unmeshable;
pub use surroundings::{Input, InputFile, Progress, Surroundings};
