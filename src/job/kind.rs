//! The kinds of jobs, and a job of any kind.

use super::request::{Context, InputForm, InputUse, Request, Run};
use super::schema::{RequestField, RequestSchema};
use super::{Failure, InputFile, JobError, Outcome, Progress, Surroundings};
use crate::field::FieldError;
use crate::provenance::{VERSION, input_hash};
use crate::recording::{RawRecording, ReadRecording};
use crate::specimen::Specimen;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::path::PathBuf;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::Schema;

/// The kinds that this program runs.
pub static KINDS: [Kind; 15] = [
    Kind::of::<super::solve::SolveRequest>(),
    Kind::of::<super::evaluate::EvaluationRequest>(),
    Kind::of::<super::evaluation_list::EvaluationListRequest>(),
    Kind::of::<super::scan::ScanRequest>(),
    Kind::of::<super::import::ImportRequest>(),
    Kind::of::<super::calibrate::CalibrationRequest>(),
    Kind::of::<super::diagnose::DiagnosisRequest>(),
    Kind::of::<super::load_curves::LoadCurvesRequest>(),
    Kind::of::<super::curves::CurvesRequest>(),
    Kind::of::<super::uniaxial::UniaxialRequest>(),
    Kind::of::<crate::design::Study>(),
    Kind::of::<crate::sweep::SweepStudy>(),
    Kind::of::<super::compare::CompareRequest>(),
    Kind::of::<super::paper_tables::PaperTablesRequest>(),
    Kind::of::<super::proof::ProofRequest>(),
];

/// A kind of job.
pub struct Kind {
    /// Name of the command.
    pub command: &'static str,
    /// Name in the service's addresses.
    pub collection: &'static str,
    /// What it does, in one sentence.
    pub about: &'static str,
    schema: fn() -> RequestSchema,
    components: fn() -> Vec<(String, RefOr<Schema>)>,
    schema_name: fn() -> Cow<'static, str>,
    checked: fn(&Value) -> Result<(Value, Box<dyn Run>), Vec<FieldError>>,
    cell: OnceLock<RequestSchema>,
}

/// Reads a request of type `R` whose fields fit its schema: its canonical form, with defaults written out, and itself ready to run.
fn checked<R: Request>(value: &Value) -> Result<(Value, Box<dyn Run>), Vec<FieldError>> {
    let request = R::read(value)?;
    let whole = |e: serde_json::Error| vec![FieldError::new("", e, "a request that JSON can hold")];
    let canonical = serde_json::to_value(&request).map_err(whole)?;
    Ok((canonical, request.check()?))
}

/// The schemas of a request and of everything that it refers to, by name.
fn components<R: Request>() -> Vec<(String, RefOr<Schema>)> {
    let mut parts = vec![(R::name().into_owned(), R::schema())];
    R::schemas(&mut parts);
    parts
}

impl Kind {
    pub(super) const fn of<R: Request>() -> Kind {
        Kind {
            command: R::COMMAND,
            collection: R::COLLECTION,
            about: R::ABOUT,
            schema: RequestSchema::of::<R>,
            components: components::<R>,
            schema_name: R::name,
            checked: checked::<R>,
            cell: OnceLock::new(),
        }
    }

    fn schema(&self) -> &RequestSchema {
        self.cell.get_or_init(self.schema)
    }

    /// The name of its requests' schema in the OpenAPI document.
    pub fn schema_name(&self) -> Cow<'static, str> {
        (self.schema_name)()
    }

    /// The schemas of its requests and of everything that they refer to, by name.
    pub fn schemas(&self) -> Vec<(String, RefOr<Schema>)> {
        (self.components)()
    }

    /// The fields of its requests.
    pub fn fields(&self) -> Vec<RequestField> {
        self.schema().fields()
    }

    /// A job from its request.
    ///
    /// # Errors
    /// Everything that is wrong with the request, each with its JSON pointer.
    pub fn job(&'static self, request: &Value) -> Result<Job, Vec<FieldError>> {
        let errors = self.schema().errors(request);
        if !errors.is_empty() {
            return Err(errors);
        }
        let (request, run) = (self.checked)(request)?;
        Ok(Job { kind: self, request, run })
    }
}

/// The kind whose command has this name.
pub fn kind_of_command(name: &str) -> Option<&'static Kind> {
    KINDS.iter().find(|kind| kind.command == name)
}

/// The kind with this name in the service's addresses.
pub fn kind_of_collection(name: &str) -> Option<&'static Kind> {
    KINDS.iter().find(|kind| kind.collection == name)
}

/// The kind of a task, which may be one that has no address.
pub fn kind_of_task(command: &str) -> Option<&'static Kind> {
    kind_of_command(command).or_else(|| Some(&super::sweep::TASK_KIND).filter(|kind| kind.command == command))
}

/// A part of a job that any worker may run.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// The kind of its request.
    pub kind: &'static Kind,
    /// Its request.
    pub request: Value,
}

impl PartialEq for Kind {
    fn eq(&self, other: &Kind) -> bool {
        self.command == other.command
    }
}

impl std::fmt::Debug for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.command)
    }
}

/// A checked request of any kind.
pub struct Job {
    /// Its kind.
    pub kind: &'static Kind,
    /// The request with defaults written out.
    pub request: Value,
    run: Box<dyn Run>,
}

impl Job {
    /// What the job is called in lists: at most 200 printable characters.
    pub fn title(&self) -> String {
        self.run.title().chars().filter(|c| !c.is_control()).take(200).collect()
    }

    /// What it reads beyond the request.
    pub fn inputs(&self) -> Vec<InputUse> {
        self.run.inputs()
    }

    /// A key that equal work of this version of the program shares, and whether the result is numbers alone, which the files of
    /// an equal job with files answer too.
    pub fn work_key(&self) -> (String, bool) {
        let (content, is_numbers_only) = self.run.equal_work().unwrap_or_else(|| (self.request.clone(), false));
        let key = input_hash(&json!({ "kind": self.kind.command, "version": VERSION, "content": content }));
        (key, is_numbers_only)
    }

    /// Whether its meshes have at most `max_elements` elements; `specimens` are those of its recordings.
    ///
    /// # Errors
    /// The field that decides, with the number of elements.
    pub fn check_size(&self, specimens: &[Specimen], max_elements: usize) -> Result<(), FieldError> {
        self.run.check_size(specimens, max_elements)
    }

    /// The parts into which the work divides; empty for work that does not divide.
    pub fn parts(&self) -> Vec<Part> {
        self.run.parts()
    }

    /// Puts the results of the parts together, in their order.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn gather(&self, results: Vec<Result<Value, Failure>>) -> Result<Outcome, JobError> {
        Ok(Outcome { input_hash: self.hash_of(&self.request), ..self.run.gather(results)? })
    }

    /// SHA-256 of the kind, the canonical request and the content of every file that the job reads, hexadecimal.
    ///
    /// # Errors
    /// [`JobError`] where a file cannot be read.
    pub fn input_hash(&self, surroundings: &dyn Surroundings) -> Result<String, JobError> {
        Ok(self.context(surroundings)?.input_hash)
    }

    /// Reads what the request names. It is known by its content, not by where it lies: in the hash its name gives way to its
    /// digest.
    fn context<'a>(&self, surroundings: &'a dyn Surroundings) -> Result<Context<'a>, JobError> {
        let mut canonical = self.request.clone();
        let (mut recordings, mut raw_recordings, mut files) = (Vec::new(), Vec::new(), Vec::new());
        for wanted in self.run.inputs() {
            let digest = match wanted.form {
                InputForm::Displacements => {
                    let read = surroundings.recording(&wanted.name)?;
                    let digest = read.digest.clone();
                    recordings.push(read);
                    digest
                }
                InputForm::RawPhases => {
                    let read = surroundings.raw_recording(&wanted.name)?;
                    raw_recordings.push(read.recording);
                    read.digest
                }
                InputForm::File => {
                    let found = surroundings.file(&wanted.name)?;
                    files.push(found.path);
                    found.digest
                }
            };
            if let Some(slot) = canonical.pointer_mut(&wanted.pointer) {
                *slot = digest.into();
            }
        }
        let input_hash = self.hash_of(&canonical);
        Ok(Context { surroundings, input_hash, recordings, raw_recordings, files })
    }

    fn hash_of(&self, canonical: &Value) -> String {
        input_hash(&json!({ "kind": self.kind.command, "request": canonical }))
    }

    /// Reads what the request names, hashes what goes in, and does the work.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn run(&self, surroundings: &dyn Surroundings) -> Result<Outcome, JobError> {
        let parts = self.run.parts();
        if !parts.is_empty() {
            return self.run_parts(&parts, surroundings);
        }
        let context = self.context(surroundings)?;
        let outcome = self.run.run(&context)?;
        Ok(Outcome { input_hash: context.input_hash, ..outcome })
    }

    /// Runs all parts on all threads and gathers their results.
    fn run_parts(&self, parts: &[Part], surroundings: &dyn Surroundings) -> Result<Outcome, JobError> {
        use rayon::prelude::*;
        let done = AtomicUsize::new(0);
        let results: Vec<Result<Value, Failure>> = parts
            .par_iter()
            .with_max_len(1)
            .map(|part| {
                let found = part.job().and_then(|job| job.run(&Quiet(surroundings)));
                let count = done.fetch_add(1, Ordering::Relaxed) + 1;
                surroundings.progress(&Progress::new("evaluate", count, parts.len()));
                let value = |outcome: Outcome| serde_json::from_str(&outcome.result);
                match found {
                    Ok(outcome) => value(outcome).map_err(|e| Failure::from(&JobError::Internal(e.to_string()))),
                    Err(error) => Err(Failure::from(&error)),
                }
            })
            .collect();
        if surroundings.is_cancelled() { Err(JobError::stopped()) } else { self.gather(results) }
    }
}

impl Part {
    /// The part, ready to run.
    ///
    /// # Errors
    /// [`JobError::Invalid`].
    pub fn job(&self) -> Result<Job, JobError> {
        self.kind.job(&self.request).map_err(JobError::Invalid)
    }
}

/// The surroundings of a part: its own progress and checkpoints are of no interest.
struct Quiet<'a>(&'a dyn Surroundings);

impl Surroundings for Quiet<'_> {
    fn recording(&self, name: &str) -> Result<ReadRecording, JobError> {
        self.0.recording(name)
    }

    fn raw_recording(&self, name: &str) -> Result<ReadRecording<RawRecording>, JobError> {
        self.0.raw_recording(name)
    }

    fn file(&self, name: &str) -> Result<InputFile, JobError> {
        self.0.file(name)
    }

    fn progress(&self, _: &Progress) {}

    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }

    fn checkpoint(&self, _: &str) -> Option<PathBuf> {
        None
    }

    fn max_elements(&self) -> usize {
        self.0.max_elements()
    }
}
