//! Recordings: upload, list.

use crate::file::StopFlag;
use crate::job::ScratchFolder;
use crate::recording::ReadLimits;
use crate::service::access::{Caller, Role};
use crate::service::app::App;
use crate::service::body::receive_file;
use crate::service::problem::Problem;
use crate::service::recordings;
use crate::service::store::{Store, UploadRow};
use axum::Json;
use axum::extract::{Extension, Path, Request, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use std::fs::File;
use utoipa::ToSchema;

/// A recording.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct RecordingView {
    /// Identifier: a hash of its content.
    id: String,
    /// Its own name.
    title: String,
    /// Length of its files, bytes.
    num_bytes: i64,
    /// Milliseconds since 1970.
    created_ms: i64,
    /// What it holds: specimen, steps, grid.
    #[schema(value_type = Object)]
    summary: serde_json::Value,
}

impl From<UploadRow> for RecordingView {
    fn from(row: UploadRow) -> Self {
        RecordingView {
            summary: serde_json::from_str(&row.manifest).unwrap_or_else(|_| serde_json::json!({})),
            id: row.id,
            title: row.title,
            num_bytes: row.num_bytes,
            created_ms: row.created_ms,
        }
    }
}

/// Recordings, newest first.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct RecordingList {
    /// The recordings.
    recordings: Vec<RecordingView>,
}

/// The latest 200 recordings.
#[utoipa::path(get, path = "/v1/recordings", responses(
    (status = 200, description = "Recordings", body = RecordingList),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "recordings")]
pub(super) async fn list(State(app): State<App>) -> Result<Json<RecordingList>, Problem> {
    let rows = app.with_store(|store| store.uploads(200)).await?;
    Ok(Json(RecordingList { recordings: rows.into_iter().map(RecordingView::from).collect() }))
}

/// One recording.
#[utoipa::path(get, path = "/v1/recordings/{id}", params(("id" = String, Path, description = "Identifier")), responses(
    (status = 200, description = "The recording", body = RecordingView),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "recordings")]
pub(super) async fn get(State(app): State<App>, Path(id): Path<String>) -> Result<Json<RecordingView>, Problem> {
    let row = app.with_store(move |store| store.upload(&id)).await?;
    row.map(|row| Json(row.into())).ok_or_else(|| Problem::new("not-found", "there is no such recording"))
}

/// Upload a recording: a tar file of its folder. Its content is read and checked before it is kept.
#[utoipa::path(post, path = "/v1/recordings", request_body(content = String, content_type = "application/octet-stream"), responses(
    (status = 201, description = "Kept", body = RecordingView, headers(("Location" = String, description = "The recording"))),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "recordings")]
pub(super) async fn upload(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    request: Request,
) -> Result<Response, Problem> {
    caller.require(Role::Submit)?;
    if !request
        .headers()
        .get(header::CONTENT_TYPE)
        .is_some_and(|t| t == "application/x-tar" || t == "application/octet-stream")
    {
        return Err(Problem::new("unsupported-media-type", "send the recording's folder as application/x-tar"));
    }
    let max = app.limits.max_upload_bytes;
    let kept = app.with_store(Store::uploaded_bytes).await?;
    if usize::try_from(kept).unwrap_or(0) + max > app.limits.max_uploads_bytes {
        return Err(Problem::new("quota", "the recordings fill the service's space").after(3600));
    }
    let file = receive_file(&app, request).await?;
    app.answer(&caller, app.limits.upload_time, keep(&app, &caller, file)).await
}

/// Keeps an upload whose body has come.
async fn keep(app: &App, caller: &Caller, file: File) -> Result<Response, Problem> {
    let max = app.limits.max_upload_bytes;
    let owner = caller.name.clone();
    let store = app.store.clone();
    let row = app.read_upload(move |stop| keep_upload(&store, file, owner, (max, stop))).await?;
    let row = row.ok_or_else(|| Problem::new("internal", "the recording was not kept"))?;
    let location = format!("/v1/recordings/{}", row.id);
    Ok((StatusCode::CREATED, [(header::LOCATION, location)], Json(RecordingView::from(row))).into_response())
}

/// Takes the tar file apart, reads the recording, and keeps it.
fn keep_upload(
    store: &Store,
    file: std::fs::File,
    owner: String,
    (max, stop): (usize, StopFlag),
) -> Result<Option<UploadRow>, Problem> {
    let scratch = ScratchFolder::new().map_err(recordings::scratch_failed)?;
    let names = recordings::unpack(std::io::BufReader::new(file), scratch.path(), max)?;
    let mut limits = ReadLimits::upload();
    limits.memory.stop = stop;
    let upload = recordings::upload_of(scratch.path(), names, owner, &limits)?;
    // A file is held by its reader, by the statement and by the database when it is stored.
    let memory = limits.memory.begin();
    memory.take("the upload's largest file", 3 * upload.files.iter().map(|f| f.num_bytes).max().unwrap_or(0))?;
    store.put_upload(&upload)?;
    Ok(store.upload(&upload.id)?)
}
