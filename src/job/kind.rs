//! What a kind of job is, and a job of any kind.

use super::input_use::InputUse;
use super::part::Part;
use super::request::{Context, RecordingOutline, Request, Run};
use super::schema::{RequestField, RequestSchema};
use super::{Failure, Input, JobError, Outcome, ResultSchema, Surroundings};
use crate::field::{FieldError, printable};
use crate::provenance::{VERSION, input_hash};
use serde_json::{Value, json};
use std::borrow::Cow;
use std::sync::OnceLock;
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::Schema;

/// A request in its canonical form, and ready to run.
type Checked = (Value, Box<dyn Run>);

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
    checked: fn(&Value) -> Result<Checked, Vec<FieldError>>,
    example: fn() -> Value,
    result: fn() -> ResultSchema,
    cell: OnceLock<RequestSchema>,
}

/// Reads a request of type `R` whose fields fit its schema: its canonical form, with defaults written out, and itself
/// ready to run.
fn checked<R: Request>(value: &Value) -> Result<Checked, Vec<FieldError>> {
    let request = R::read(value)?;
    let whole = |e: serde_json::Error| vec![FieldError::new("", e, "a request that JSON can hold")];
    let canonical = serde_json::to_value(&request).map_err(whole)?;
    Ok((canonical, request.check()?))
}

/// A key that equal work of this version of the program shares: the kind's command and what its work depends on.
pub(super) fn work_key(command: &str, content: Value) -> String {
    input_hash(&json!({ "kind": command, "version": VERSION, "content": content }))
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
            example: R::example,
            result: R::result,
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

    /// A request that shows what they are like.
    pub fn example(&self) -> Value {
        (self.example)()
    }

    /// What its results look like.
    pub fn result(&self) -> ResultSchema {
        (self.result)()
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
        self.read(request).map_err(|refusal| match refusal {
            Refusal::Misfit(errors) | Refusal::Unfit(errors) => errors,
        })
    }

    /// As [`job`](Self::job), and says of a request that is refused whether it fits the schema.
    ///
    /// # Errors
    /// [`Refusal`].
    pub fn read(&'static self, request: &Value) -> Result<Job, Refusal> {
        let errors = self.schema().errors(request);
        if !errors.is_empty() {
            return Err(Refusal::Misfit(errors));
        }
        let (canonical, run) = (self.checked)(&self.schema().settled(request)).map_err(Refusal::Unfit)?;
        Ok(Job { kind: self, request: request.clone(), canonical, run })
    }
}

/// Why a request is refused: everything that is wrong with it, each with its JSON pointer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// It does not fit the schema of its kind.
    Misfit(Vec<FieldError>),
    /// It fits, and cannot be computed.
    Unfit(Vec<FieldError>),
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
    /// The request as it was made.
    pub request: Value,
    /// The request with defaults written out: equal ones are written alike.
    canonical: Value,
    run: Box<dyn Run>,
}

impl Job {
    /// What the job is called in lists: at most 200 printable characters.
    pub fn title(&self) -> String {
        printable(&self.run.title(), 200)
    }

    /// What it reads beyond the request.
    pub fn inputs(&self) -> Vec<InputUse> {
        self.run.inputs()
    }

    /// A key that equal work of this version of the program shares, and whether the result is numbers alone, which the
    /// files of an equal job with files answer too.
    pub fn work_key(&self) -> (String, bool) {
        let (content, is_numbers_only) = self.run.equal_work().unwrap_or_else(|| (self.canonical.clone(), false));
        (work_key(self.kind.command, content), is_numbers_only)
    }

    /// Whether its meshes have at most `max_elements` elements, given what is known of its recordings.
    ///
    /// # Errors
    /// The field that decides, with the number of elements.
    pub fn check_size(&self, recordings: &[RecordingOutline], max_elements: usize) -> Result<(), FieldError> {
        self.run.check_size(recordings, max_elements)
    }

    /// About how many processor seconds it takes, given what is known of its recordings, where that can be told before
    /// it runs.
    pub fn estimated_seconds(&self, recordings: &[RecordingOutline]) -> Option<f64> {
        self.run.estimated_seconds(recordings)
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
        Ok(Outcome { input_hash: self.hash_of(&self.canonical), ..self.run.gather(results)? })
    }

    /// SHA-256 of the kind, the canonical request and the content of every file that the job reads, hexadecimal.
    ///
    /// # Errors
    /// [`JobError`] where a file cannot be read.
    pub fn input_hash(&self, surroundings: &dyn Surroundings) -> Result<String, JobError> {
        Ok(self.context(surroundings)?.input_hash)
    }

    /// Reads what the request names. It is known by its content, not by where it lies: in the hash its name gives way
    /// to its digest.
    fn context<'a>(&self, surroundings: &'a dyn Surroundings) -> Result<Context<'a>, JobError> {
        let mut canonical = self.canonical.clone();
        let (mut recordings, mut raw_recordings, mut files) = (Vec::new(), Vec::new(), Vec::new());
        let wanted = self.run.inputs();
        for (wanted, input) in wanted.iter().zip(surroundings.inputs(&wanted)?) {
            let digest = match input {
                Input::Displacements(read) => {
                    if let Some(surface) = read.recording.grid.surface.filter(|_| !self.run.takes_surfaces()) {
                        let found = format!("displacements of the face {}", surface.face.name());
                        let error = FieldError::new(&wanted.pointer, found, "a recording of the volume");
                        let remedy =
                            "what cameras see of a face can be calibrated and exported, and nothing else be made of it";
                        return Err(error.remedy(remedy).into());
                    }
                    let digest = read.digest.clone();
                    recordings.push(read);
                    digest
                }
                Input::RawPhases(read) => {
                    let digest = read.digest.clone();
                    raw_recordings.push(read);
                    digest
                }
                Input::File(found) => {
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

    /// Reads what the request names, hashes what goes in, and does work that does not divide ([`super::run()`] does any
    /// work).
    ///
    /// # Errors
    /// [`JobError`].
    pub(super) fn run_whole(&self, surroundings: &dyn Surroundings) -> Result<Outcome, JobError> {
        let context = self.context(surroundings)?;
        let outcome = self.run.run(&context)?;
        Ok(Outcome { input_hash: context.input_hash, ..outcome })
    }
}
