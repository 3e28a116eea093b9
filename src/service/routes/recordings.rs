//! Recordings: upload, list.

use crate::service::access::{Caller, Role};
use crate::service::app::App;
use crate::service::problem::Problem;
use crate::service::recordings;
use crate::service::store::{NewUpload, Store, UploadRow};
use axum::Json;
use axum::body::Body;
use axum::extract::{Extension, Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use http_body_util::BodyExt;
use serde::Serialize;
use std::io::{Seek, SeekFrom, Write};
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
    headers: HeaderMap,
    body: Body,
) -> Result<Response, Problem> {
    caller.require(Role::Submit)?;
    if !headers.get(header::CONTENT_TYPE).is_some_and(|t| t == "application/x-tar" || t == "application/octet-stream") {
        return Err(Problem::new("unsupported-media-type", "send the recording's folder as application/x-tar"));
    }
    let max = app.limits.max_upload_bytes;
    let kept = app.with_store(Store::uploaded_bytes).await?;
    if usize::try_from(kept).unwrap_or(0) + max > app.limits.max_uploads_bytes {
        return Err(Problem::new("quota", "the recordings fill the service's space").after(3600));
    }
    let file = receive(body, max).await?;
    let owner = caller.name.clone();
    let upload = app.compute(move || checked(file, max, owner)).await?;
    let id = upload.id.clone();
    let row = app
        .with_store(move |store| {
            store.put_upload(&upload)?;
            store.upload(&id)
        })
        .await?;
    let row = row.ok_or_else(|| Problem::new("internal", "the recording was not kept"))?;
    let location = format!("/v1/recordings/{}", row.id);
    Ok((StatusCode::CREATED, [(header::LOCATION, location)], Json(RecordingView::from(row))).into_response())
}

/// Streams the body into a file without a name, so that memory does not hold it.
async fn receive(mut body: Body, max: usize) -> Result<std::fs::File, Problem> {
    let failed = |e: std::io::Error| Problem::new("internal", format!("scratch: {e}"));
    let name = crate::service::access::random_hex::<8>().map_err(|e| Problem::new("internal", e.to_string()))?;
    let path = std::env::temp_dir().join(format!("lambdak-upload-{name}"));
    let mut file = std::fs::OpenOptions::new().read(true).write(true).create_new(true).open(&path).map_err(failed)?;
    let _ = std::fs::remove_file(&path);
    let mut length = 0;
    while let Some(frame) = body.frame().await {
        let frame = frame.map_err(|_| Problem::new("invalid-parameter", "the body ended too early"))?;
        let Ok(data) = frame.into_data() else { continue };
        length += data.len();
        if length > max {
            return Err(Problem::new("too-large", format!("a recording has at most {max} bytes")));
        }
        file = tokio::task::spawn_blocking(move || file.write_all(&data).map(|()| file))
            .await
            .map_err(|_| Problem::new("internal", "scratch"))?
            .map_err(failed)?;
    }
    file.seek(SeekFrom::Start(0)).map_err(failed)?;
    Ok(file)
}

fn checked(file: std::fs::File, max: usize, owner: String) -> Result<NewUpload, Problem> {
    let files = recordings::unpack(std::io::BufReader::new(file), max)?;
    recordings::upload_of(files, owner)
}
