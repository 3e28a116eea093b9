//! Jobs: list, look, cancel, resume, follow.

use crate::job::kind_of_collection;
use crate::service::access::Caller;
use crate::service::app::App;
use crate::service::hub::Watched;
use crate::service::problem::Problem;
use crate::service::quota::Entered;
use crate::service::store::{JobFilter, Removed};
use crate::service::view::{JobEvent, JobList, JobState, JobView};
use axum::Json;
use axum::extract::{Extension, Path, Query, State};
use axum::http::{StatusCode, header};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use serde::Deserialize;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;
use utoipa::IntoParams;

/// Which jobs to list.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct ListQuery {
    /// Only of this kind.
    #[param(nullable = false)]
    kind: Option<String>,
    /// Only in this state.
    #[param(nullable = false)]
    state: Option<JobState>,
    /// Most.
    #[param(minimum = 1, maximum = 200, nullable = false)]
    limit: Option<usize>,
    /// `next` of the page before.
    #[param(max_length = 80, pattern = "^[0-9]{1,15}-[0-9a-f]{1,32}$", nullable = false)]
    before: Option<String>,
}

/// Jobs, newest first.
#[utoipa::path(get, path = "/v1/jobs", operation_id = "list_jobs", params(ListQuery), responses(
    (status = 200, description = "Jobs", body = JobList),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "jobs")]
pub(super) async fn list(
    State(app): State<App>,
    query: Result<Query<ListQuery>, axum::extract::rejection::QueryRejection>,
) -> Result<Json<JobList>, Problem> {
    let Query(query) = query.map_err(|e| Problem::new("invalid-parameter", e.body_text()))?;
    let limit = query.limit.unwrap_or(50);
    if !(1..=200).contains(&limit) {
        return Err(Problem::new("invalid-parameter", format!("limit is {limit}; it must be from 1 to 200")));
    }
    if let Some(kind) = &query.kind
        && kind_of_collection(kind).is_none()
    {
        return Err(Problem::new("invalid-parameter", "kind is not one of the kinds of jobs"));
    }
    let before = match &query.before {
        None => None,
        Some(text) => Some(
            text.split_once('-')
                .and_then(|(ms, id)| Some((ms.parse().ok()?, id.to_string())))
                .ok_or_else(|| Problem::new("invalid-parameter", "before is not the next of a page"))?,
        ),
    };
    let state = query.state.and_then(|s| serde_json::to_value(s).ok());
    let filter = JobFilter {
        kind: query.kind.unwrap_or_default(),
        state: state.and_then(|s| s.as_str().map(String::from)).unwrap_or_default(),
        before,
        limit,
    };
    let rows = app.with_store(move |store| store.jobs(&filter)).await?;
    let next = match rows.last() {
        Some(last) if rows.len() == limit => Some(format!("{}-{}", last.created_ms, last.id)),
        _ => None,
    };
    Ok(Json(JobList { jobs: rows.iter().map(JobView::new).collect(), next }))
}

/// The job, or `not-found`. Identifiers are 128 random bits.
pub(super) async fn find(app: &App, id: &str) -> Result<JobView, Problem> {
    let id = id.to_string();
    let row = app.with_store(move |store| store.job(&id)).await?;
    row.map(|row| JobView::new(&row)).ok_or_else(|| Problem::new("not-found", "there is no such job"))
}

/// One job.
#[utoipa::path(get, path = "/v1/jobs/{id}", operation_id = "get_job", params(("id" = String, Path, description = "Identifier")), responses(
    (status = 200, description = "The job", body = JobView),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "jobs")]
pub(super) async fn get(State(app): State<App>, Path(id): Path<String>) -> Result<Json<JobView>, Problem> {
    Ok(Json(find(&app, &id).await?))
}

/// Delete a job that has ended, with its results and files.
#[utoipa::path(delete, path = "/v1/jobs/{id}", operation_id = "delete_job", params(("id" = String, Path, description = "Identifier")), responses(
    (status = 204, description = "It is gone"),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "jobs")]
pub(super) async fn delete(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(id): Path<String>,
) -> Result<StatusCode, Problem> {
    caller.require_owner(&find(&app, &id).await?.owner, "job")?;
    match app.with_store(move |store| store.delete_job(&id)).await? {
        Removed::Gone => Ok(StatusCode::NO_CONTENT),
        Removed::Missing => Err(Problem::new("not-found", "there is no such job")),
        Removed::InUse => Err(Problem::new("wrong-state", "the job has not ended; cancel it first")),
    }
}

/// Cancel a job; what its search has found so far is kept for a resume.
#[utoipa::path(post, path = "/v1/jobs/{id}/cancel", operation_id = "cancel_job", params(("id" = String, Path, description = "Identifier")), responses(
    (status = 200, description = "The job", body = JobView),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "jobs")]
pub(super) async fn cancel(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(id): Path<String>,
) -> Result<Json<JobView>, Problem> {
    let _entered = app.enter(&caller)?;
    let job = find(&app, &id).await?;
    caller.require_owner(&job.owner, "job")?;
    if job.state.has_ended() && job.state != JobState::Cancelled {
        return Err(Problem::new("wrong-state", "the job has ended; there is nothing to cancel"));
    }
    let key = id.clone();
    app.with_store(move |store| store.cancel(&key)).await?;
    Ok(Json(find(&app, &id).await?))
}

/// Put a failed or cancelled job back into the queue; it goes on where it was.
#[utoipa::path(post, path = "/v1/jobs/{id}/resume", operation_id = "resume_job", params(("id" = String, Path, description = "Identifier")), responses(
    (status = 200, description = "The job", body = JobView),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "jobs")]
pub(super) async fn resume(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(id): Path<String>,
) -> Result<Json<JobView>, Problem> {
    let _entered = app.enter(&caller)?;
    let job = find(&app, &id).await?;
    caller.require_owner(&job.owner, "job")?;
    let key = id.clone();
    if !app.with_store(move |store| store.resume(&key)).await? {
        return Err(Problem::new("wrong-state", "only failed and cancelled jobs can be resumed"));
    }
    app.signal.wake();
    Ok(Json(find(&app, &id).await?))
}

struct Following {
    job: String,
    watched: Watched,
    last: i64,
    first: Option<Arc<JobView>>,
    has_ended: bool,
    stopping: tokio::sync::watch::Receiver<bool>,
    _entered: Entered,
}

/// The job's changes as server-sent events `job`, each a whole job; ends when the job has. Poll `/v1/jobs/{id}` instead
/// where streams do not pass.
#[utoipa::path(get, path = "/v1/jobs/{id}/events", operation_id = "follow_job", params(("id" = String, Path, description = "Identifier")), responses(
    (status = 200, description = "Events", body = JobEvent, content_type = "text/event-stream"),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "jobs")]
pub(super) async fn events(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(id): Path<String>,
) -> Result<Response, Problem> {
    let entered = app.streams.enter(&caller.share)?;
    // Subscribed before it is read: no change is missed between.
    let watched = app.hub.subscribe(&id);
    let first = find(&app, &id).await?;
    let start = Following {
        job: id,
        watched,
        last: -1,
        first: Some(Arc::new(first)),
        has_ended: false,
        stopping: app.stopping.clone(),
        _entered: entered,
    };
    let events = stream::unfold(start, next_event);
    let keep_alive = KeepAlive::new().interval(Duration::from_secs(15)).text("still here");
    let mut answer = Sse::new(events).keep_alive(keep_alive).into_response();
    answer.headers_mut().insert(header::CACHE_CONTROL, header::HeaderValue::from_static("no-store"));
    Ok(answer)
}

async fn next_event(mut state: Following) -> Option<(Result<Event, Infallible>, Following)> {
    if state.has_ended {
        return None;
    }
    loop {
        let view = match state.first.take() {
            Some(view) => Some(view),
            None => {
                let (watched, stopping) = (&mut state.watched, &mut state.stopping);
                tokio::select! {
                    changed = watched.changed() => {
                        if changed.is_err() {
                            return None;
                        }
                        watched.borrow_and_update().clone()
                    }
                    _ = stopping.wait_for(|s| *s) => None,
                }
            }
        };
        let Some(view) = view else {
            if *state.stopping.borrow() {
                state.has_ended = true;
                let event = Event::default().event("shutdown").data(format!("{{\"id\":\"{}\"}}", state.job));
                return Some((Ok(event), state));
            }
            continue;
        };
        if view.revision <= state.last {
            continue;
        }
        state.last = view.revision;
        state.has_ended = view.state.has_ended();
        let data = serde_json::to_string(view.as_ref()).unwrap_or_default();
        let event = Event::default().event("job").id(view.revision.to_string()).data(data);
        return Some((Ok(event), state));
    }
}
