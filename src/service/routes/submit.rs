//! Submitting jobs.

use crate::service::access::{Caller, Role, random_hex};
use crate::service::app::App;
use crate::service::kinds::{
    CalibrationRequest, DiagnosisRequest, EvaluationRequest, ScanRequest, SizeLimits, StudySchema, SweepRequest,
    kind_named,
};
use crate::service::problem::Problem;
use crate::service::store::{Idempotency, NewJob, Submitted, sha256_hex};
use crate::service::view::JobView;
use crate::specimen::Specimen;
use axum::body::Bytes;
use axum::extract::{Extension, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;

/// Reads a JSON body.
pub(super) fn json_body(headers: &HeaderMap, body: &[u8]) -> Result<serde_json::Value, Problem> {
    let media_type = headers.get(header::CONTENT_TYPE).and_then(|v| v.to_str().ok()).unwrap_or_default();
    let essence = media_type.split(';').next().unwrap_or_default().trim();
    if !essence.eq_ignore_ascii_case("application/json") {
        return Err(Problem::new("unsupported-media-type", "send the body as Content-Type: application/json"));
    }
    serde_json::from_slice(body).map_err(|e| Problem::new("invalid-json", e.to_string()))
}

async fn submit(
    app: App,
    caller: Caller,
    headers: HeaderMap,
    body: Bytes,
    kind: &'static str,
) -> Result<Response, Problem> {
    caller.require(Role::Submit)?;
    let value = json_body(&headers, &body)?;
    let key = idempotency_key(&headers)?;
    let limits = SizeLimits {
        max_elements: caller.max_elements.unwrap_or(usize::MAX).min(app.limits.size.max_elements),
        ..app.limits.size
    };
    let job_kind = kind_named(kind).ok_or_else(|| Problem::new("internal", "no such kind of job"))?;
    let canonical = value.to_string();
    let wanted = job_kind.recordings(&value);
    let body = value.clone();
    let plan = app.compute(move || job_kind.plan(&body, &limits)).await?;
    for (pointer, recording) in wanted {
        let row = app.with_store(move |store| store.upload(&recording)).await?;
        let row = row.ok_or_else(|| Problem::at(pointer, "there is no such recording; upload it first"))?;
        let manifest: serde_json::Value = serde_json::from_str(&row.manifest).unwrap_or_default();
        if let Ok(specimen) = Specimen::deserialize(&manifest["specimen"]) {
            let body = value.clone();
            app.compute(move || job_kind.check_recording(&body, &specimen, &limits)).await?;
        }
    }
    let id = random_hex::<16>().map_err(|e| Problem::new("internal", e.to_string()))?;
    let fingerprint = sha256_hex(format!("{kind}\n{canonical}").as_bytes());
    let idempotency = key.map(|key| Idempotency { key, fingerprint });
    let job = NewJob {
        id: id.clone(),
        kind: kind.into(),
        owner: caller.name.clone(),
        title: plan.title.chars().filter(|c| !c.is_control()).take(200).collect(),
        body: canonical,
        tasks: plan.tasks,
        has_gather: plan.has_gather,
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

fn idempotency_key(headers: &HeaderMap) -> Result<Option<String>, Problem> {
    let Some(value) = headers.get("idempotency-key") else { return Ok(None) };
    match value.to_str() {
        Ok(key) if (1..=200).contains(&key.len()) => Ok(Some(key.into())),
        _ => Err(Problem::new("invalid-parameter", "Idempotency-Key must have 1 to 200 printable ASCII characters")),
    }
}

macro_rules! submission {
    ($name:ident, $path:literal, $kind:literal, $body:ty, $summary:literal) => {
        #[doc = $summary]
        #[utoipa::path(
            post,
            path = $path,
            request_body = $body,
            params(("Idempotency-Key" = Option<String>, Header, description = "The same key gives the same job", min_length = 1, max_length = 200, pattern = "^[!-~]+$")),
            responses(
                (status = 202, description = "Accepted", body = JobView, headers(("Location" = String, description = "The job"))),
                (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
            ),
            tag = "jobs"
        )]
        pub(super) async fn $name(
            State(app): State<App>,
            Extension(caller): Extension<Caller>,
            headers: HeaderMap,
            body: Bytes,
        ) -> Result<Response, Problem> {
            submit(app, caller, headers, body, $kind).await
        }
    };
}

submission!(post_evaluation, "/v1/evaluations", "evaluations", EvaluationRequest, "Evaluate a specimen.");
submission!(post_design, "/v1/designs", "designs", StudySchema, "Search for the best specimen of a study.");
submission!(post_sweep, "/v1/sweeps", "sweeps", SweepRequest, "Evaluate many specimens.");
submission!(post_scan, "/v1/scans", "scans", ScanRequest, "Scan a specimen synthetically; the result is a recording.");
submission!(
    post_calibration,
    "/v1/calibrations",
    "calibrations",
    CalibrationRequest,
    "Find the material from recordings."
);
submission!(
    post_diagnosis,
    "/v1/diagnoses",
    "diagnoses",
    DiagnosisRequest,
    "Find where a recording and its model differ, and why."
);
