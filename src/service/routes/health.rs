//! Whether the service lives, whether it can work, what it counts.

use crate::service::access::{Caller, Role};
use crate::service::app::App;
use crate::service::problem::Problem;
use crate::service::store::Store;
use axum::extract::{Extension, State};
use axum::http::header;
use axum::response::{IntoResponse, Response};
use std::time::{Duration, Instant};

/// The process lives.
#[utoipa::path(get, path = "/healthz", operation_id = "get_alive", responses(
    (status = 200, description = "It lives", body = String, content_type = "text/plain"),
), tag = "health")]
pub(super) async fn alive() -> &'static str {
    "ok\n"
}

/// How long what was found of the storage holds.
const FRESH: Duration = Duration::from_secs(5);

/// The storage answers, takes what is written, and the service is not shutting down.
#[utoipa::path(get, path = "/readyz", operation_id = "get_ready", responses(
    (status = 200, description = "Ready", body = String, content_type = "text/plain"),
    (status = "default", description = "Not ready", body = Problem, content_type = "application/problem+json"),
), tag = "health")]
pub(super) async fn ready(State(app): State<App>) -> Result<&'static str, Problem> {
    if *app.stopping.borrow() {
        return Err(Problem::new("shutting-down", "the service is shutting down").after(5));
    }
    // One look serves all who ask within a few seconds.
    let mut last = app.ready.lock().await;
    let found = match last.as_ref() {
        Some((at, found)) if at.elapsed() < FRESH => found.clone(),
        _ => {
            let found = app.with_store(Store::check_ready).await;
            *last = Some((Instant::now(), found.clone()));
            found
        }
    };
    let unready = |_| Problem::new("storage", "the storage does not answer, or its disk is full").after(5);
    found.map(|()| "ready\n").map_err(unready)
}

/// Counts in Prometheus' text format (role admin).
#[utoipa::path(get, path = "/metrics", operation_id = "get_metrics", responses(
    (status = 200, description = "Counts", body = String, content_type = "text/plain"),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "health")]
pub(super) async fn metrics(State(app): State<App>, Extension(caller): Extension<Caller>) -> Result<Response, Problem> {
    caller.require(Role::Admin)?;
    let shared = app.clone();
    let text = app.with_store(move |store| Ok(shared.metrics.to_text(store, &shared.signal, &shared.now()))).await?;
    Ok(([(header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8")], text).into_response())
}
