//! Answers that are not small: they hold a place of their caller until they have been sent, and go out in pieces, so
//! that slow readers hold neither memory without bound nor the places of others.

use super::access::Caller;
use super::app::App;
use super::problem::Problem;
use super::quota::Entered;
use super::store::Store;
use axum::body::{Body, Bytes};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use hyper::body::{Body as _, Frame, SizeHint};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};

/// Most bytes of an answer that takes no place, and of a piece of one that does.
const PIECE_BYTES: usize = 64 << 10;

/// A body that goes out in pieces, with the place that it holds.
struct Pieces {
    body: Body,
    /// What has come of the body and has not gone out.
    rest: Bytes,
    _entered: Entered,
}

impl hyper::body::Body for Pieces {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        while self.rest.is_empty() {
            match ready!(Pin::new(&mut self.body).poll_frame(context)) {
                Some(Ok(frame)) => match frame.into_data() {
                    Ok(data) => self.rest = data,
                    Err(other) => return Poll::Ready(Some(Ok(other))),
                },
                end => return Poll::Ready(end),
            }
        }
        let count = self.rest.len().min(PIECE_BYTES);
        Poll::Ready(Some(Ok(Frame::data(self.rest.split_to(count)))))
    }

    fn is_end_stream(&self) -> bool {
        self.rest.is_empty() && self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        let (mut hint, rest) = (self.body.size_hint(), self.rest.len() as u64);
        if let Some(upper) = hint.upper() {
            hint.set_upper(upper + rest);
        }
        hint.set_lower(hint.lower() + rest);
        hint
    }
}

/// The answer as it is sent: one that is not small takes a place of its caller until it has gone out. Event streams
/// have places of their own.
pub fn placed(app: &App, caller: &Caller, answer: Response) -> Response {
    let is_events = answer.headers().get(header::CONTENT_TYPE).is_some_and(|t| t == "text/event-stream");
    let is_small = answer.body().size_hint().upper().is_some_and(|length| length <= PIECE_BYTES as u64);
    if is_events || is_small {
        return answer;
    }
    match app.answers.enter(&caller.share) {
        Ok(_entered) => answer.map(|body| Body::new(Pieces { body, rest: Bytes::new(), _entered })),
        Err(full) => Problem::from(full).into_response(),
    }
}

/// Something that is stored under its content's name.
pub struct Stored {
    /// SHA-256 of the content, hexadecimal.
    pub sha: String,
    /// Media type.
    pub media_type: String,
    /// Under which name it is saved.
    pub name: Option<String>,
}

/// Sends what is stored, part by part; a caller who has it already is told so.
///
/// # Errors
/// `not-found` where it is gone, `storage`.
pub async fn stored(app: &App, headers: &HeaderMap, content: &Stored) -> Result<Response, Problem> {
    let tag = format!("\"{}\"", content.sha);
    let known = headers.get(header::IF_NONE_MATCH).and_then(|v| v.to_str().ok()).unwrap_or_default();
    let is_known = known.split(',').any(|t| t.trim().trim_start_matches("W/") == tag);
    let sha = content.sha.clone();
    let look = move |store: &Store| Ok((store.blob_length(&sha)?, store.blob_part(&sha, 0)?.unwrap_or_default()));
    let (length, first) = app.with_store(look).await?;
    let length = length.ok_or_else(|| Problem::new("not-found", "it has been deleted"))?;
    let mut answer = if is_known {
        StatusCode::NOT_MODIFIED.into_response()
    } else if first.len() as u64 == length {
        first.into_response()
    } else {
        let mut answer = rest_of(app.store.clone(), content.sha.clone(), first).into_response();
        answer.headers_mut().insert(header::CONTENT_LENGTH, HeaderValue::from(length));
        answer
    };
    let out = answer.headers_mut();
    let value = |text: &str| HeaderValue::from_str(text).ok();
    if let Some(tag) = value(&tag) {
        out.insert(header::ETAG, tag);
    }
    out.insert(header::CACHE_CONTROL, HeaderValue::from_static("private, max-age=0, must-revalidate"));
    if let Some(media_type) = value(&content.media_type).filter(|_| !is_known) {
        out.insert(header::CONTENT_TYPE, media_type);
    }
    // Names are the program's own, or were checked: letters, digits, dots, hyphens and underscores.
    if let Some(name) = content.name.as_ref().and_then(|name| value(&format!("inline; filename=\"{name}\""))) {
        out.insert(header::CONTENT_DISPOSITION, name);
    }
    Ok(answer)
}

/// A body of several parts, of which the first has been read; each further one is read when it is wanted.
fn rest_of(store: Arc<Store>, sha: String, first: Vec<u8>) -> Body {
    let begin = (store, sha, Some(first), 0i64);
    Body::from_stream(stream::try_unfold(begin, |(store, sha, first, part)| async move {
        let bytes = match first {
            Some(bytes) => Some(bytes),
            None => {
                let (from, name) = (store.clone(), sha.clone());
                let read = tokio::task::spawn_blocking(move || from.blob_part(&name, part));
                read.await.map_err(std::io::Error::other)?.map_err(std::io::Error::other)?
            }
        };
        // Where it is deleted meanwhile the connection ends before the length that was promised.
        Ok::<_, std::io::Error>(bytes.map(|bytes| (Bytes::from(bytes), (store, sha, None, part + 1))))
    }))
}
