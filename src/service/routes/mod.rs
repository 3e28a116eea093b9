//! The addresses. Handlers only translate: request → library or storage → answer.

mod assets;
mod health;
mod jobs;
mod quick;
mod recordings;
mod results;
mod submit;

pub use assets::page;

use super::app::App;
use axum::Router;
use axum::body::Bytes;
use axum::response::{IntoResponse, Response};
use utoipa::OpenApi;
use utoipa::openapi::security::{Http, HttpAuthScheme, SecurityScheme};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

#[derive(OpenApi)]
#[openapi(
    info(
        title = "lambdak",
        description = "Plans, evaluates and sweeps full-field experiments on soft materials. Long work is a job: \
                       post it, follow `/v1/jobs/{id}` or its events, fetch its result and artefacts. Errors are \
                       RFC 9457 problems.",
        license(name = "MIT OR Apache-2.0")
    ),
    security((), ("token" = []))
)]
struct Document;

/// The routes and their OpenAPI document.
pub fn open_api() -> (Router<App>, String) {
    let (router, mut document) = OpenApiRouter::with_openapi(Document::openapi())
        .routes(routes!(recordings::list, recordings::upload))
        .routes(routes!(recordings::get, recordings::delete))
        .routes(routes!(recordings::files))
        .routes(routes!(recordings::file))
        .routes(routes!(jobs::list))
        .routes(routes!(jobs::get, jobs::delete))
        .routes(routes!(jobs::cancel))
        .routes(routes!(jobs::resume))
        .routes(routes!(jobs::events))
        .routes(routes!(results::result))
        .routes(routes!(results::request))
        .routes(routes!(results::artefacts))
        .routes(routes!(results::artefact))
        .routes(routes!(quick::check_specimen))
        .routes(routes!(quick::library))
        .routes(routes!(quick::me))
        .routes(routes!(health::alive))
        .routes(routes!(health::ready))
        .routes(routes!(health::metrics))
        .split_for_parts();
    document.info.version = crate::provenance::VERSION.into();
    let router = router.merge(submit::router());
    // The document is compared with the kept one by a test: a failure here cannot pass unseen.
    if let Err(error) = submit::describe(&mut document) {
        super::log::error("openapi", &error.to_string());
    }
    let components = document.components.get_or_insert_with(Default::default);
    components.add_security_scheme("token", SecurityScheme::Http(Http::new(HttpAuthScheme::Bearer)));
    let mut text = document.to_pretty_json().unwrap_or_default();
    text.push('\n');
    (router, text)
}

/// `/openapi.json`.
pub async fn document(text: Bytes) -> Response {
    ([(axum::http::header::CONTENT_TYPE, "application/json")], text).into_response()
}
