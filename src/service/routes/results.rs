//! Results and artefacts.

use super::jobs::find;
use super::recordings::Binary;
use crate::job::MediaType;
use crate::service::answer::{Stored, stored};
use crate::service::app::App;
use crate::service::problem::Problem;
use crate::service::store::Store;
use crate::service::view::{ArtefactList, ArtefactView};
use axum::Json;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use utoipa::ToSchema;

/// A job's result; its schema is that of its kind, and added where all kinds are described.
#[derive(ToSchema)]
pub(super) struct JobResult;

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
    let job = app.with_store(move |store| store.job(&id)).await?;
    let job = job.ok_or_else(|| Problem::new("not-found", "there is no such job"))?;
    if job.result_sha.is_empty() {
        return Err(Problem::new("not-finished", format!("the job is {}; a result comes with success", job.state)));
    }
    let content = Stored { sha: job.result_sha, media_type: MediaType::Json.name().into(), name: None };
    stored(&app, &headers, &content).await
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
    // The name is compared with the list, never used as a path.
    let find = move |store: &Store| Ok(store.artefacts(&id)?.into_iter().find(|row| row.name == name));
    let row = app.with_store(find).await?.ok_or_else(|| Problem::new("not-found", "the job has no such file"))?;
    let content = Stored { sha: row.sha, media_type: row.media_type, name: Some(row.name) };
    let mut answer = stored(&app, &headers, &content).await?;
    if content.media_type == MediaType::Html.name() {
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
