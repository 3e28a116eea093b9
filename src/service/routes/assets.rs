//! The page's files, inside the binary.

use crate::service::app::App;
use axum::Router;
use axum::extract::Path;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;

macro_rules! asset {
    ($file:literal, $media:literal) => {
        ($file, $media, include_str!(concat!("../page/", $file)))
    };
}

/// Name, media type, content.
const ASSETS: &[(&str, &str, &str)] = &[
    asset!("index.html", "text/html; charset=utf-8"),
    asset!("docs.html", "text/html; charset=utf-8"),
    asset!("style.css", "text/css; charset=utf-8"),
    asset!("main.js", "text/javascript; charset=utf-8"),
    asset!("api.js", "text/javascript; charset=utf-8"),
    asset!("dom.js", "text/javascript; charset=utf-8"),
    asset!("numbers.js", "text/javascript; charset=utf-8"),
    asset!("words.js", "text/javascript; charset=utf-8"),
    asset!("field.js", "text/javascript; charset=utf-8"),
    asset!("titles.js", "text/javascript; charset=utf-8"),
    asset!("start.js", "text/javascript; charset=utf-8"),
    asset!("plan.js", "text/javascript; charset=utf-8"),
    asset!("plan_bar.js", "text/javascript; charset=utf-8"),
    asset!("plan_forms.js", "text/javascript; charset=utf-8"),
    asset!("study_forms.js", "text/javascript; charset=utf-8"),
    asset!("draft.js", "text/javascript; charset=utf-8"),
    asset!("check.js", "text/javascript; charset=utf-8"),
    asset!("live.js", "text/javascript; charset=utf-8"),
    asset!("editor.js", "text/javascript; charset=utf-8"),
    asset!("outline.js", "text/javascript; charset=utf-8"),
    asset!("hole.js", "text/javascript; charset=utf-8"),
    asset!("ligaments.js", "text/javascript; charset=utf-8"),
    asset!("section_drawing.js", "text/javascript; charset=utf-8"),
    asset!("sweep.js", "text/javascript; charset=utf-8"),
    asset!("jobs.js", "text/javascript; charset=utf-8"),
    asset!("job.js", "text/javascript; charset=utf-8"),
    asset!("progress.js", "text/javascript; charset=utf-8"),
    asset!("result.js", "text/javascript; charset=utf-8"),
    asset!("foreign.js", "text/javascript; charset=utf-8"),
    asset!("law.js", "text/javascript; charset=utf-8"),
    asset!("parts.js", "text/javascript; charset=utf-8"),
    asset!("figures.js", "text/javascript; charset=utf-8"),
    asset!("evaluation.js", "text/javascript; charset=utf-8"),
    asset!("design.js", "text/javascript; charset=utf-8"),
    asset!("evaluation_list.js", "text/javascript; charset=utf-8"),
    asset!("scan.js", "text/javascript; charset=utf-8"),
    asset!("calibration.js", "text/javascript; charset=utf-8"),
    asset!("diagnosis.js", "text/javascript; charset=utf-8"),
    asset!("next.js", "text/javascript; charset=utf-8"),
    asset!("plan_study.js", "text/javascript; charset=utf-8"),
    asset!("protocol_form.js", "text/javascript; charset=utf-8"),
    asset!("together.js", "text/javascript; charset=utf-8"),
    asset!("evidence.js", "text/javascript; charset=utf-8"),
    asset!("compare.js", "text/javascript; charset=utf-8"),
    asset!("recordings.js", "text/javascript; charset=utf-8"),
    asset!("look.js", "text/javascript; charset=utf-8"),
    asset!("recording_starters.js", "text/javascript; charset=utf-8"),
    asset!("drop.js", "text/javascript; charset=utf-8"),
    asset!("tar.js", "text/javascript; charset=utf-8"),
    asset!("zip.js", "text/javascript; charset=utf-8"),
    asset!("plot.js", "text/javascript; charset=utf-8"),
    asset!("lines.js", "text/javascript; charset=utf-8"),
    asset!("axis.js", "text/javascript; charset=utf-8"),
    asset!("colors.js", "text/javascript; charset=utf-8"),
    asset!("nifti.js", "text/javascript; charset=utf-8"),
    asset!("slices.js", "text/javascript; charset=utf-8"),
    asset!("view3d.js", "text/javascript; charset=utf-8"),
    asset!("frame3d.js", "text/javascript; charset=utf-8"),
    asset!("docs.js", "text/javascript; charset=utf-8"),
];

/// What the page may do: its own scripts and styles, its own service, nothing from elsewhere.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; \
                      connect-src 'self'; frame-src blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The page, its files and the documentation of the interface.
pub fn page() -> Router<App> {
    Router::new()
        .route("/", get(async |headers: HeaderMap| asset("index.html", &headers)))
        .route("/docs", get(async |headers: HeaderMap| asset("docs.html", &headers)))
        .route("/assets/{name}", get(async |Path(name): Path<String>, headers: HeaderMap| asset(&name, &headers)))
}

fn asset(name: &str, headers: &HeaderMap) -> Response {
    let Some((_, media_type, text)) = ASSETS.iter().find(|a| a.0 == name) else {
        return crate::service::problem::Problem::new("not-found", "the page has no such file").into_response();
    };
    let tag = format!("\"{}\"", &crate::service::store::sha256_hex(text.as_bytes())[..32]);
    let is_known = headers.get(header::IF_NONE_MATCH).is_some_and(|v| v.as_bytes() == tag.as_bytes());
    let mut answer = if is_known { StatusCode::NOT_MODIFIED.into_response() } else { (*text).into_response() };
    let out = answer.headers_mut();
    out.insert(header::CONTENT_TYPE, HeaderValue::from_static(media_type));
    out.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    out.insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY));
    if let Ok(value) = HeaderValue::from_str(&tag) {
        out.insert(header::ETAG, value);
    }
    answer
}
