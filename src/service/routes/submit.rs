//! Submitting jobs: one address per kind, with the schema of the kind's own request.

use crate::field::FieldError;
use crate::job::{Job, KINDS, Kind, RecordingOutline};
use crate::service::access::{Caller, Role, random_hex};
use crate::service::app::App;
use crate::service::body::{JsonBody, let_run_out, receive_json};
use crate::service::problem::Problem;
use crate::service::recordings::{Space, outline_of};
use crate::service::store::{Idempotency, NewJob, Submitted, sha256_hex};
use crate::service::task::{TaskLimits, tasks_of};
use crate::service::view::JobView;
use axum::Router;
use axum::extract::{Extension, Query, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::post;
use serde::{Deserialize, Serialize};
use serde_json::json;
use utoipa::openapi::schema::Schema;
use utoipa::openapi::{OpenApi, Paths, RefOr};
use utoipa::{PartialSchema, ToSchema};

async fn receive(app: App, caller: Caller, request: Request, kind: &'static Kind) -> Result<Response, Problem> {
    // Before the body: whoever may not submit need not send it.
    if let Err(problem) = caller.require(Role::Submit) {
        let_run_out(request.into_body());
        return Err(problem);
    }
    let query = request.uri().query().unwrap_or_default().to_string();
    let Query(query) = Query::<SubmitQuery>::try_from_uri(request.uri())
        .map_err(|e| Problem::new("invalid-parameter", format!("{query}: {}", e.body_text())))?;
    let body = receive_json(&app, request).await?;
    app.answer(&caller, app.limits.request_time, submit(&app, &caller, body, (kind, query.dry_run))).await
}

async fn submit(
    app: &App,
    caller: &Caller,
    body: JsonBody,
    (kind, is_dry_run): (&'static Kind, bool),
) -> Result<Response, Problem> {
    let key = idempotency_key(&body.headers)?;
    let value = body.value;
    let max_elements = caller.max_elements.unwrap_or(usize::MAX).min(app.limits.max_elements);
    let canonical = value.to_string();
    // The request is read once; from here on it is typed.
    let job = app.compute(&caller.share, move || kind.read(&value).map_err(Problem::from)).await?;
    let recordings = recordings_of(app, &job).await?;
    let inputs = job.inputs().into_iter().map(|wanted| wanted.name).collect();
    let most_seconds = app.limits.max_job_time.as_secs_f64();
    let limits = TaskLimits { max_elements, max_seconds: most_seconds, space: Space::of(app, caller) };
    let (title, tasks, has_gather, estimated_seconds) = app
        .compute(&caller.share, move || {
            job.check_size(&recordings, max_elements).map_err(|e| Problem::from(crate::job::JobError::TooBig(e)))?;
            let estimated_seconds = job.estimated_seconds(&recordings);
            check_cost(estimated_seconds, most_seconds)?;
            let (tasks, has_gather) = tasks_of(&job, limits).map_err(|e| Problem::new("internal", e.to_string()))?;
            Ok((job.title(), tasks, has_gather, estimated_seconds))
        })
        .await?;
    if is_dry_run {
        return Ok(
            axum::Json(Estimate { title, num_tasks: tasks.len(), estimated_seconds, most_seconds }).into_response()
        );
    }
    let id = random_hex::<16>().map_err(|e| Problem::new("internal", e.to_string()))?;
    let fingerprint = sha256_hex(format!("{}\n{canonical}", kind.collection).as_bytes());
    let idempotency = key.map(|key| Idempotency { key, fingerprint });
    let job = NewJob {
        id: id.clone(),
        kind: kind.collection.into(),
        owner: caller.name.clone(),
        title,
        body: canonical,
        inputs,
        tasks,
        has_gather,
    };
    let max_queued = app.limits.max_queued_tasks;
    let quota = caller.max_queued_tasks;
    let (submitted, row) = app
        .with_store(move |store| {
            let submitted = store.submit(&job, idempotency.as_ref(), max_queued, quota)?;
            let id = match &submitted {
                Submitted::Before(id) => id.clone(),
                _ => job.id.clone(),
            };
            Ok((submitted, store.job(&id)?))
        })
        .await?;
    if submitted == Submitted::KeyUsed {
        return Err(Problem::new("key-reused", "choose a new Idempotency-Key for a new request"));
    }
    let row = row.ok_or_else(|| Problem::new("not-found", "the job made under this Idempotency-Key is gone"))?;
    app.signal.wake();
    let location = format!("/v1/jobs/{}", row.id);
    Ok((StatusCode::ACCEPTED, [(header::LOCATION, location)], axum::Json(JobView::new(&row))).into_response())
}

/// What a job would take.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Estimate {
    /// Title.
    title: String,
    /// Tasks.
    #[schema(minimum = 0)]
    num_tasks: usize,
    /// Processor seconds, within a factor of about three; left out where they cannot be told before it runs.
    #[serde(skip_serializing_if = "Option::is_none")]
    estimated_seconds: Option<f64>,
    /// Most processor seconds that a job of this service may be estimated to take, and most seconds that one of its
    /// tasks may run.
    most_seconds: f64,
}

/// How a request is meant.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct SubmitQuery {
    /// Check the request and estimate its cost; start nothing.
    #[serde(default)]
    dry_run: bool,
}

fn check_cost(estimated_seconds: Option<f64>, most_seconds: f64) -> Result<(), Problem> {
    match estimated_seconds {
        Some(seconds) if seconds > most_seconds => {
            let hours = |seconds: f64| seconds / 3600.0;
            let detail = format!(
                "the job would take about {:.1} h of one processor (limit: {:.1} h); ask for fewer drives or evaluations, \
                 a coarser mesh or larger voxels, or have the service started with a larger --max-job-hours",
                hours(seconds),
                hours(most_seconds)
            );
            Err(Problem::new("too-costly", detail))
        }
        _ => Ok(()),
    }
}

fn idempotency_key(headers: &HeaderMap) -> Result<Option<String>, Problem> {
    let Some(value) = headers.get("idempotency-key") else { return Ok(None) };
    match value.to_str() {
        Ok(key) if (1..=200).contains(&key.len()) && key.bytes().all(|b| b.is_ascii_graphic()) => Ok(Some(key.into())),
        _ => Err(Problem::new(
            "invalid-parameter",
            "Idempotency-Key must have 1 to 200 printable ASCII characters, and no space",
        )),
    }
}

/// What is known of the recordings that a job reads; that there are such recordings is checked on the way.
async fn recordings_of(app: &App, job: &Job) -> Result<Vec<RecordingOutline>, Problem> {
    let mut outlines = Vec::new();
    for wanted in job.inputs() {
        let name = wanted.name.clone();
        let row = app.with_store(move |store| store.upload(&name)).await?;
        let missing = || {
            let error = FieldError::new(wanted.pointer, wanted.name, "the identifier of an uploaded recording");
            Problem::invalid(vec![error.remedy("upload it first")])
        };
        outlines.extend(outline_of(&row.ok_or_else(missing)?.manifest));
    }
    Ok(outlines)
}

/// Says which kinds the list of jobs can be asked for.
///
/// # Errors
/// Where a schema is none that OpenAPI knows.
fn describe_filter(document: &mut OpenApi) -> Result<(), serde_json::Error> {
    let names: Vec<&str> = KINDS.iter().map(|kind| kind.collection).collect();
    let schema: RefOr<Schema> = serde_json::from_value(json!({ "type": "string", "enum": names }))?;
    let list = document.paths.paths.get_mut("/v1/jobs").and_then(|path| path.get.as_mut());
    for parameter in list.and_then(|list| list.parameters.as_mut()).into_iter().flatten() {
        if let RefOr::T(parameter) = parameter
            && parameter.name == "kind"
        {
            parameter.schema = Some(schema.clone());
        }
    }
    Ok(())
}

/// The addresses of all kinds.
pub(super) fn router() -> Router<App> {
    KINDS.iter().fold(Router::new(), |router, kind| {
        let handler = move |State(app): State<App>, Extension(caller): Extension<Caller>, request: Request| {
            receive(app, caller, request, kind)
        };
        router.route(&format!("/v1/{}", kind.collection), post(handler))
    })
}

/// Adds the addresses of all kinds, with their requests' schemas, to the document.
///
/// # Errors
/// Where a schema is none that OpenAPI knows.
pub(super) fn describe(document: &mut OpenApi) -> Result<(), serde_json::Error> {
    let components = document.components.get_or_insert_with(Default::default);
    components.schemas.insert(Estimate::name().into_owned(), Estimate::schema());
    let (mut paths, mut results) = (serde_json::Map::new(), Vec::new());
    for kind in &KINDS {
        let result = kind.result();
        results.extend(result.names.iter().map(|name| json!({ "$ref": format!("#/components/schemas/{name}") })));
        for name in result.names {
            let own = result.parts.iter().find(|part| part.0 == name).map(|part| part.1.clone());
            components.schemas.extend(own.map(|schema| (name, schema)));
        }
    }
    let own: Vec<String> = KINDS.iter().flat_map(|kind| kind.result().names).collect();
    for kind in &KINDS {
        let parts = kind.schemas().into_iter().chain(kind.result().parts);
        for (name, schema) in parts.filter(|(name, _)| !own.contains(name)) {
            let is_another = |known| serde_json::to_value(known).ok() != serde_json::to_value(&schema).ok();
            if components.schemas.get(&name).is_some_and(is_another) {
                return Err(serde::de::Error::custom(format!("two schemas are called {name}")));
            }
            components.schemas.insert(name, schema);
        }
        let problem = json!({ "application/problem+json": { "schema": { "$ref": "#/components/schemas/Problem" } } });
        let accepted = json!({ "application/json": { "schema": { "$ref": "#/components/schemas/JobView" } } });
        let key = json!({
            "name": "Idempotency-Key", "in": "header", "required": false,
            "description": "The same key gives the same job",
            "schema": { "type": "string", "minLength": 1, "maxLength": 200, "pattern": "^[!-~]+$" },
        });
        let dry_run = json!({
            "name": "dry_run", "in": "query", "required": false,
            "description": "Check the request and estimate its cost; start nothing",
            "schema": { "type": "boolean", "default": false },
        });
        let estimate = json!({ "application/json": { "schema": { "$ref": "#/components/schemas/Estimate" } } });
        let location = json!({ "description": "The job", "schema": { "type": "string" } });
        let operation = json!({ "post": {
            "tags": ["jobs"],
            "summary": kind.about,
            "operationId": format!("post_{}", kind.collection.replace('-', "_")),
            "parameters": [key, dry_run],
            "requestBody": {
                "required": true,
                "content": { "application/json": {
                    "schema": { "$ref": format!("#/components/schemas/{}", kind.schema_name()) },
                    "example": kind.example(),
                } },
            },
            "responses": {
                "200": { "description": "What it would take (dry_run)", "content": estimate },
                "202": { "description": "Accepted", "headers": { "Location": location }, "content": accepted },
                "default": { "description": "A problem", "content": problem },
            },
        } });
        paths.insert(format!("/v1/{}", kind.collection), operation);
    }
    let any =
        json!({ "description": "A job's result, by the kind of the job: `schema` says which.", "oneOf": results });
    components.schemas.insert("JobResult".into(), serde_json::from_value(any)?);
    let described: Paths = serde_json::from_value(paths.into())?;
    document.paths.paths.extend(described.paths);
    describe_filter(document)
}
