//! Recordings: upload, list.

use crate::file::StopFlag;
use crate::job::{MediaType, ScratchFolder};
use crate::recording::ReadLimits;
use crate::service::access::{Caller, Role};
use crate::service::answer::{Stored, stored};
use crate::service::app::App;
use crate::service::body::{let_run_out, receive_file};
use crate::service::foreign;
use crate::service::problem::Problem;
use crate::service::recordings::{self, Space};
use crate::service::store::{KeptFile, Removed, Store, UploadRow};
use crate::service::tar::unpack;
use crate::service::view::{ArtefactList, ArtefactView};
use crate::specimen::Specimen;
use axum::Json;
use axum::extract::{Extension, Path, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
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
    /// Name of the token that uploaded it, or whose job made it.
    owner: String,
    /// Length of its files, bytes.
    num_bytes: i64,
    /// Milliseconds since 1970.
    created_ms: i64,
    /// What it holds.
    #[schema(value_type = RecordingSummary)]
    summary: serde_json::Value,
}

/// What a recording holds, as it is kept when it is uploaded.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct RecordingSummary {
    /// The specimen as drawn.
    specimen: Specimen,
    /// Voxels along x, y, z.
    #[schema(min_items = 3, max_items = 3)]
    shape: [usize; 3],
    /// Edges of a voxel, mm.
    #[schema(min_items = 3, max_items = 3)]
    voxel_mm: [f64; 3],
    /// Voxels of the mask.
    num_voxels: usize,
    /// Whether it holds raw phases; left out where it does not.
    #[schema(nullable = false)]
    is_raw: Option<bool>,
    /// Drives and forces.
    steps: Vec<StepSummary>,
}

/// A step of a recording.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct StepSummary {
    /// Drive, mm.
    drive_mm: f64,
    /// Force, N; null where it was not measured.
    force_n: Option<f64>,
}

/// Bytes as they are.
#[derive(Debug, ToSchema)]
#[schema(value_type = String, format = Binary)]
pub(super) struct Binary(#[allow(dead_code)] Vec<u8>);

impl From<UploadRow> for RecordingView {
    fn from(row: UploadRow) -> Self {
        RecordingView {
            summary: serde_json::from_str(&row.manifest).unwrap_or_else(|_| serde_json::json!({})),
            id: row.id,
            title: row.title,
            owner: row.owner,
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
#[utoipa::path(get, path = "/v1/recordings", operation_id = "list_recordings", responses(
    (status = 200, description = "Recordings", body = RecordingList),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "recordings")]
pub(super) async fn list(State(app): State<App>) -> Result<Json<RecordingList>, Problem> {
    let rows = app.with_store(|store| store.uploads(200)).await?;
    Ok(Json(RecordingList { recordings: rows.into_iter().map(RecordingView::from).collect() }))
}

/// One recording.
#[utoipa::path(get, path = "/v1/recordings/{id}", operation_id = "get_recording", params(("id" = String, Path, description = "Identifier")), responses(
    (status = 200, description = "The recording", body = RecordingView),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "recordings")]
pub(super) async fn get(State(app): State<App>, Path(id): Path<String>) -> Result<Json<RecordingView>, Problem> {
    let row = app.with_store(move |store| store.upload(&id)).await?;
    row.map(|row| Json(row.into())).ok_or_else(missing)
}

/// The files of a recording.
#[utoipa::path(get, path = "/v1/recordings/{id}/files", operation_id = "list_recording_files", params(("id" = String, Path, description = "Identifier")), responses(
    (status = 200, description = "The files", body = ArtefactList),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "recordings")]
pub(super) async fn files(State(app): State<App>, Path(id): Path<String>) -> Result<Json<ArtefactList>, Problem> {
    let key = id.clone();
    let files = app.with_store(move |store| store.upload_files(&key)).await?;
    if files.is_empty() {
        return Err(missing());
    }
    let view = |file: KeptFile| ArtefactView {
        href: format!("/v1/recordings/{id}/files/{}", file.name),
        media_type: media_type(&file.name).name().into(),
        name: file.name,
        num_bytes: file.num_bytes,
        sha256: file.sha,
    };
    Ok(Json(ArtefactList { artefacts: files.into_iter().map(view).collect() }))
}

/// One file of a recording.
#[utoipa::path(get, path = "/v1/recordings/{id}/files/{name}", operation_id = "get_recording_file", params(
    ("id" = String, Path, description = "Identifier"), ("name" = String, Path, description = "Name in the list"),
), responses(
    (status = 200, description = "The file", content(
        (Binary = "application/gzip"), (Binary = "application/octet-stream"), (String = "text/csv"),
        (serde_json::Value = "application/json"),
    )),
    (status = 304, description = "Unchanged"),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "recordings")]
pub(super) async fn file(
    State(app): State<App>,
    Path((id, name)): Path<(String, String)>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    // The name is compared with the list, never used as a path.
    let find = move |store: &Store| Ok(store.upload_files(&id)?.into_iter().find(|file| file.name == name));
    let file = app.with_store(find).await?;
    let file = file.ok_or_else(|| Problem::new("not-found", "the recording has no such file"))?;
    let media_type = media_type(&file.name).name().into();
    stored(&app, &headers, &Stored { sha: file.sha, media_type, name: Some(file.name) }).await
}

/// What an uploaded file is sent as: what recordings are made of by its name, anything else as bytes.
fn media_type(name: &str) -> MediaType {
    match MediaType::of_name(name) {
        known @ (MediaType::Json | MediaType::Csv | MediaType::Nifti) => known,
        _ => MediaType::Binary,
    }
}

fn missing() -> Problem {
    Problem::new("not-found", "there is no such recording")
}

/// Delete a recording. Jobs that have ended keep their results.
#[utoipa::path(delete, path = "/v1/recordings/{id}", operation_id = "delete_recording", params(("id" = String, Path, description = "Identifier")), responses(
    (status = 204, description = "It is gone"),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "recordings")]
pub(super) async fn delete(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(id): Path<String>,
) -> Result<StatusCode, Problem> {
    let key = id.clone();
    let row = app.with_store(move |store| store.upload(&key)).await?.ok_or_else(missing)?;
    caller.require_owner(&row.owner, "recording")?;
    match app.with_store(move |store| store.delete_upload(&id)).await? {
        Removed::Gone => Ok(StatusCode::NO_CONTENT),
        Removed::Missing => Err(missing()),
        Removed::InUse => Err(Problem::new("wrong-state", "a job that has not ended reads it; cancel the job first")),
    }
}

/// Upload a recording: a tar file of its folder, or of files of another program (MATLAB, NIfTI, point clouds, a
/// scanner) beside `import.json`, the request of an import whose `files` are names among them. Its content is read and
/// checked before it is kept. The media type `application/x-tar` is taken, too.
#[utoipa::path(post, path = "/v1/recordings", operation_id = "upload_recording", request_body(content = Binary, content_type = "application/octet-stream", description = "A tar file of the recording's folder, or of foreign files and import.json"), responses(
    (status = 201, description = "Kept", body = RecordingView, headers(("Location" = String, description = "The recording"))),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "recordings")]
pub(super) async fn upload(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    request: Request,
) -> Result<Response, Problem> {
    if let Err(problem) = caller.require(Role::Submit) {
        let_run_out(request.into_body());
        return Err(problem);
    }
    if !request
        .headers()
        .get(header::CONTENT_TYPE)
        .is_some_and(|t| t == "application/x-tar" || t == "application/octet-stream")
    {
        return Err(Problem::new("unsupported-media-type", "send the recording's folder as application/x-tar"));
    }
    // Before the body: where there is no space at all nobody need send it.
    let promised = request.headers().get(header::CONTENT_LENGTH).and_then(|v| v.to_str().ok()?.parse().ok());
    let (store, owner, space) = (app.store.clone(), caller.name.clone(), Space::of(&app, &caller));
    let space =
        app.compute(&caller.share, move || recordings::check_space(&store, &owner, promised.unwrap_or(0), space)).await;
    if let Err(problem) = space {
        let_run_out(request.into_body());
        return Err(problem);
    }
    let file = receive_file(&app, request).await?;
    app.answer(&caller, app.limits.upload_time, keep(&app, &caller, file)).await
}

/// Keeps an upload whose body has come.
async fn keep(app: &App, caller: &Caller, file: File) -> Result<Response, Problem> {
    let max = (app.limits.max_upload_bytes, Space::of(app, caller));
    let owner = caller.name.clone();
    let store = app.store.clone();
    let row = app.read_upload(move |stop| keep_upload(&store, file, owner, (max, stop))).await?;
    let row = row.ok_or_else(|| Problem::new("internal", "the recording was not kept"))?;
    let location = format!("/v1/recordings/{}", row.id);
    Ok((StatusCode::CREATED, [(header::LOCATION, location)], Json(RecordingView::from(row))).into_response())
}

/// Takes the tar file apart, makes a recording of files of another program, reads the recording, and keeps it.
fn keep_upload(
    store: &Store,
    file: std::fs::File,
    owner: String,
    ((max, space), stop): ((usize, Space), StopFlag),
) -> Result<Option<UploadRow>, Problem> {
    let scratch = ScratchFolder::new().map_err(recordings::scratch_failed)?;
    let names = unpack(std::io::BufReader::new(file), scratch.path(), max)?;
    let mut limits = ReadLimits::upload();
    limits.memory.stop = stop;
    let made = foreign::recording_of(scratch.path(), &names, &limits)?;
    let (folder, names) = match &made {
        Some((folder, names)) => (folder.path(), names.clone()),
        None => (scratch.path(), names),
    };
    let upload = recordings::upload_of(folder, names, owner, &limits)?;
    recordings::put(store, &upload, space)?;
    Ok(store.upload(&upload.id)?)
}
