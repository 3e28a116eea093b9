//! Whether the service lives, whether it can work, what it counts.

use crate::service::access::{Caller, Role};
use crate::service::app::App;
use crate::service::problem::Problem;
use axum::extract::{Extension, State};
use axum::http::header;
use axum::response::{IntoResponse, Response};

/// The process lives.
#[utoipa::path(get, path = "/healthz", responses(
    (status = 200, description = "It lives", body = String, content_type = "text/plain"),
), tag = "health")]
pub(super) async fn alive() -> &'static str {
    "ok\n"
}

/// The storage answers and the service is not shutting down.
#[utoipa::path(get, path = "/readyz", responses(
    (status = 200, description = "Ready", body = String, content_type = "text/plain"),
    (status = "default", description = "Not ready", body = Problem, content_type = "application/problem+json"),
), tag = "health")]
pub(super) async fn ready(State(app): State<App>) -> Result<&'static str, Problem> {
    if *app.stopping.borrow() {
        return Err(Problem::new("shutting-down", "the service is shutting down").after(5));
    }
    if app.with_store(|store| Ok(store.is_ready())).await? {
        Ok("ready\n")
    } else {
        Err(Problem::new("storage", "the storage does not answer").after(5))
    }
}

/// Counts in Prometheus' text format (role admin).
#[utoipa::path(get, path = "/metrics", responses(
    (status = 200, description = "Counts", body = String, content_type = "text/plain"),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "health")]
pub(super) async fn metrics(State(app): State<App>, Extension(caller): Extension<Caller>) -> Result<Response, Problem> {
    caller.require(Role::Admin)?;
    let shared = app.clone();
    let text = app.with_store(move |store| Ok(shared.metrics.to_text(store, &shared.signal, shared.now()))).await?;
    Ok(([(header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8")], text).into_response())
}
