//! The service as an axum router, and what every request passes through.

use super::access::{Caller, random_hex};
use super::answer::placed;
use super::app::App;
use super::body::let_run_out;
use super::problem::Problem;
use super::{log, routes};
use axum::Router;
use axum::body::Bytes;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::sync::Arc;
use std::time::Instant;

/// The address of the other end of a connection.
#[derive(Clone, Debug)]
pub struct Peer(pub Arc<str>);

/// The whole service.
pub fn router(app: App) -> Router {
    let (api, document) = routes::open_api();
    let document = Bytes::from(document);
    api.route("/openapi.json", axum::routing::get(move || routes::document(document.clone())))
        .merge(routes::page())
        .fallback(not_found)
        .method_not_allowed_fallback(not_allowed)
        .layer(axum::middleware::from_fn_with_state(app.clone(), guard))
        .with_state(app)
}

async fn not_found() -> Problem {
    Problem::new("not-found", "no such address; /openapi.json lists them")
}

async fn not_allowed() -> Problem {
    Problem::new("method-not-allowed", "the header Allow lists what is allowed here")
}

static REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// Every request passes here: identity, origin, limits, time, log, metrics, headers of the answer.
async fn guard(State(app): State<App>, mut request: Request, next: Next) -> Response {
    let started = Instant::now();
    let id = request_id(request.headers());
    let method = request.method().clone();
    let path = request.uri().path().to_string();
    let route = request.extensions().get::<MatchedPath>().map_or("(none)", MatchedPath::as_str).to_string();
    let is_page = is_public(&path);
    let address = request.extensions().get::<Peer>().map_or_else(|| "".into(), |peer| peer.0.clone());
    let caller = check(&app, request.headers(), &method, if is_page { None } else { Some(&address) });
    let mut name = String::new();
    let answer = match caller {
        Err(problem) => {
            let_run_out(request.into_body());
            problem.into_response()
        }
        Ok(caller) => {
            name.clone_from(&caller.name);
            request.extensions_mut().insert(caller.clone());
            let answer = run(&app, request, next, &caller, is_page).await;
            if is_page { answer } else { placed(&app, &caller, answer) }
        }
    };
    finish(&app, answer, &Served { id, method, route, path, caller: name, started })
}

/// What needs no token: the page's own files, its document, and whether the service lives. They hold no data.
fn is_public(path: &str) -> bool {
    !path.starts_with("/v1/") && path != "/metrics"
}

/// Runs a request. The page and health need no place among the requests in work; a request with a body takes its place
/// once the body has come (`Shared::answer`), any other one here.
async fn run(app: &App, request: Request, next: Next, caller: &Caller, is_page: bool) -> Response {
    if is_page {
        return next.run(request).await;
    }
    if *app.stopping.borrow() {
        let_run_out(request.into_body());
        return Problem::new("shutting-down", "the service is shutting down; try again").after(5).into_response();
    }
    if *request.method() == Method::POST {
        return next.run(request).await;
    }
    let answered = app.answer(caller, app.limits.request_time, async { Ok(next.run(request).await) }).await;
    answered.unwrap_or_else(Problem::into_response)
}

/// Who calls from `address`; the page's own files are anybody's, and have none.
fn check(app: &App, headers: &HeaderMap, method: &Method, address: Option<&str>) -> Result<Caller, Problem> {
    let mut hosts = headers.get_all(header::HOST).iter();
    let host = hosts.next().and_then(|h| h.to_str().ok());
    if hosts.next().is_some() {
        return Err(Problem::new("bad-host", "there are several Host headers"));
    }
    if !app.hosts.is_empty() {
        // A page of another site that resolves to this machine still carries its own name.
        let name = host.map(|h| h.rsplit_once(':').map_or(h, |(n, p)| if p.ends_with(']') { h } else { n }));
        if !name.is_some_and(|n| app.hosts.iter().any(|known| known.eq_ignore_ascii_case(n))) {
            return Err(Problem::new("bad-host", "call the service by the address it listens on"));
        }
    }
    if headers.contains_key(header::TRANSFER_ENCODING) && headers.contains_key(header::CONTENT_LENGTH) {
        return Err(Problem::new("invalid-parameter", "Content-Length and Transfer-Encoding exclude each other"));
    }
    let text = |name: &str| headers.get(name).and_then(|v| v.to_str().ok());
    let is_reading = matches!(*method, Method::GET | Method::HEAD | Method::OPTIONS);
    // Browsers that do not say where a page comes from in Sec-Fetch-Site name its origin.
    let is_foreign = match (text("sec-fetch-site"), text("origin")) {
        (Some(site), _) => !matches!(site, "same-origin" | "none"),
        (None, Some(origin)) => origin.split_once("://").map(|(_, name)| name) != host,
        (None, None) => false,
    };
    if !is_reading && is_foreign {
        return Err(Problem::new("forbidden", "pages of other origins may not change anything here"));
    }
    match address {
        None => Ok(Caller {
            name: String::new(),
            share: String::new(),
            role: super::access::Role::Read,
            max_queued_tasks: None,
            max_elements: None,
            max_recordings_bytes: None,
        }),
        Some(address) => app.access.caller(text("authorization"), address),
    }
}

/// The client's id where it is short and plain, else a random one.
fn request_id(headers: &HeaderMap) -> String {
    let given = headers.get(&REQUEST_ID).and_then(|v| v.to_str().ok()).unwrap_or_default();
    let is_plain = (1..=64).contains(&given.len())
        && given.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'_' || b == b'.');
    if is_plain { given.into() } else { random_hex::<8>().unwrap_or_else(|_| "0".into()) }
}

/// A request that was served.
struct Served {
    id: String,
    method: Method,
    /// The route's pattern.
    route: String,
    path: String,
    /// Name of the token; empty where there was none.
    caller: String,
    started: Instant,
}

fn finish(app: &App, mut answer: Response, served: &Served) -> Response {
    let Served { id, method, route, path, caller, started } = served;
    // axum's own refusals (a body that is too long, say) become problems too.
    let is_plain_error = answer.status().as_u16() >= 400
        && answer.headers().get(header::CONTENT_TYPE).is_none_or(|t| t != "application/problem+json");
    if is_plain_error {
        let name = match answer.status().as_u16() {
            404 => "not-found",
            405 => "method-not-allowed",
            413 => "too-large",
            415 => "unsupported-media-type",
            500.. => "internal",
            _ => "invalid-parameter",
        };
        let allow = answer.headers().get(header::ALLOW).cloned();
        answer = Problem::new(name, "see the document at /openapi.json").into_response();
        if let Some(allow) = allow {
            answer.headers_mut().insert(header::ALLOW, allow);
        }
    }
    let status = answer.status().as_u16();
    let seconds = started.elapsed().as_secs_f64();
    app.metrics.count(method.as_str(), route, status, seconds);
    if !path.starts_with("/healthz") && !path.starts_with("/readyz") {
        log::info(
            "request",
            &serde_json::json!({
                "id": id, "method": method.as_str(), "route": route, "path": path, "status": status,
                "seconds": seconds, "caller": caller,
            }),
        );
    }
    let headers = answer.headers_mut();
    if let Ok(value) = HeaderValue::from_str(id) {
        headers.insert(REQUEST_ID.clone(), value);
    }
    for (name, value) in [
        ("x-content-type-options", "nosniff"),
        ("x-frame-options", "DENY"),
        ("referrer-policy", "no-referrer"),
        ("cross-origin-resource-policy", "same-origin"),
    ] {
        headers.insert(HeaderName::from_static(name), HeaderValue::from_static(value));
    }
    headers
        .entry("content-security-policy")
        .or_insert(HeaderValue::from_static("default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox"));
    headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
    answer
}
