//! Results and artefacts.

use super::jobs::find;
use super::recordings::Binary;
use crate::service::app::App;
use crate::service::problem::Problem;
use crate::service::view::{ArtefactList, ArtefactView};
use axum::Json;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

/// An answer under its content's name: unchanged content is not sent twice.
fn content(headers: &HeaderMap, sha: &str, media_type: &str, bytes: Vec<u8>, name: Option<&str>) -> Response {
    let tag = format!("\"{sha}\"");
    let known = headers.get(header::IF_NONE_MATCH).and_then(|v| v.to_str().ok()).unwrap_or_default();
    let is_known = known.split(',').any(|t| t.trim().trim_start_matches("W/") == tag);
    let mut answer =
        if is_known { StatusCode::NOT_MODIFIED.into_response() } else { (StatusCode::OK, bytes).into_response() };
    let out = answer.headers_mut();
    if let Ok(value) = HeaderValue::from_str(&tag) {
        out.insert(header::ETAG, value);
    }
    out.insert(header::CACHE_CONTROL, HeaderValue::from_static("private, max-age=0, must-revalidate"));
    if !is_known && let Ok(value) = HeaderValue::from_str(media_type) {
        out.insert(header::CONTENT_TYPE, value);
    }
    if let Some(name) = name {
        // Names are the program's own: letters, digits, dots and hyphens.
        if let Ok(value) = HeaderValue::from_str(&format!("inline; filename=\"{name}\"")) {
            out.insert(header::CONTENT_DISPOSITION, value);
        }
    }
    answer
}

/// A job's result: what every one of them has, beside the fields of its own schema.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct JobResult {
    /// Which kind of result it is, with its version, such as `evaluation/1`.
    schema: String,
    /// Version of the program.
    version: String,
    /// SHA-256 of everything that went into it, hexadecimal; not in comparisons and lists.
    input_hash: Option<String>,
    /// The fields of the kind.
    #[serde(flatten)]
    fields: std::collections::BTreeMap<String, serde_json::Value>,
}

/// A job's result: `evaluation/1`, `design/1`, …
#[utoipa::path(get, path = "/v1/jobs/{id}/result", operation_id = "get_result", params(("id" = String, Path, description = "Identifier")), responses(
    (status = 200, description = "The result", body = JobResult, headers(("ETag" = String, description = "Of the content"))),
    (status = 304, description = "Unchanged"),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "results")]
pub(super) async fn result(
    State(app): State<App>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let found = app
        .with_store(move |store| {
            let Some(job) = store.job(&id)? else { return Ok(None) };
            let bytes = if job.result_sha.is_empty() { None } else { store.blob(&job.result_sha)? };
            Ok(Some((job, bytes)))
        })
        .await?;
    let Some((job, bytes)) = found else { return Err(Problem::new("not-found", "there is no such job")) };
    let Some(bytes) = bytes else {
        return Err(Problem::new("not-finished", format!("the job is {}; a result comes with success", job.state)));
    };
    Ok(content(&headers, &job.result_sha, "application/json", bytes, None))
}

/// The body that the job was made from.
#[utoipa::path(get, path = "/v1/jobs/{id}/request", operation_id = "get_request", params(("id" = String, Path, description = "Identifier")), responses(
    (status = 200, description = "The request", body = serde_json::Value),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "results")]
pub(super) async fn request(State(app): State<App>, Path(id): Path<String>) -> Result<Response, Problem> {
    let body = app.with_store(move |store| store.job_body(&id)).await?;
    let body = body.ok_or_else(|| Problem::new("not-found", "there is no such job"))?;
    Ok(([(header::CONTENT_TYPE, "application/json")], body).into_response())
}

/// The files that a job left.
#[utoipa::path(get, path = "/v1/jobs/{id}/artefacts", operation_id = "list_artefacts", params(("id" = String, Path, description = "Identifier")), responses(
    (status = 200, description = "The files", body = ArtefactList),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "results")]
pub(super) async fn artefacts(State(app): State<App>, Path(id): Path<String>) -> Result<Json<ArtefactList>, Problem> {
    let job = find(&app, &id).await?;
    let rows = app.with_store(move |store| store.artefacts(&id)).await?;
    let artefacts = rows
        .into_iter()
        .map(|row| ArtefactView {
            href: format!("/v1/jobs/{}/artefacts/{}", job.id, row.name),
            name: row.name,
            media_type: row.media_type,
            num_bytes: row.num_bytes,
            sha256: row.sha,
        })
        .collect();
    Ok(Json(ArtefactList { artefacts }))
}

/// One file.
#[utoipa::path(get, path = "/v1/jobs/{id}/artefacts/{name}", operation_id = "get_artefact", params(
    ("id" = String, Path, description = "Identifier"), ("name" = String, Path, description = "Name in the list"),
), responses(
    (status = 200, description = "The file", content(
        (String = "image/svg+xml"), (String = "text/html"), (String = "text/csv"), (String = "application/xml"),
        (String = "image/vnd.dxf"), (Binary = "application/gzip"), (Binary = "application/vnd.apache.parquet"), (Binary = "model/stl"), (serde_json::Value = "application/json"),
    )),
    (status = 304, description = "Unchanged"),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "results")]
pub(super) async fn artefact(
    State(app): State<App>,
    Path((id, name)): Path<(String, String)>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let found = app
        .with_store(move |store| {
            // The name is compared with the list, never used as a path.
            let Some(row) = store.artefacts(&id)?.into_iter().find(|row| row.name == name) else { return Ok(None) };
            let bytes = store.blob(&row.sha)?;
            Ok(bytes.map(|bytes| (row, bytes)))
        })
        .await?;
    let (row, bytes) = found.ok_or_else(|| Problem::new("not-found", "the job has no such file"))?;
    let mut answer = content(&headers, &row.sha, &row.media_type, bytes, Some(&row.name));
    if row.media_type == "text/html" {
        // A report is a page of its own: no scripts, nothing from elsewhere.
        answer.headers_mut().insert(
            header::CONTENT_SECURITY_POLICY,
            HeaderValue::from_static(
                "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox allow-popups",
            ),
        );
    }
    Ok(answer)
}
