//! Receiving a request's body: within its caller's share, no slower than a least rate, and before the request takes the
//! place in work that others need, too.

use super::access::Caller;
use super::app::App;
use super::limits::Limits;
use super::problem::Problem;
use super::quota::{Entered, Quota};
use crate::file::{MemoryLimit, ReadingMemory, json_bytes};
use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderMap, header};
use http_body_util::BodyExt;
use serde_json::Value;
use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::sync::Arc;
use tokio::time::Instant;

/// What is read, at most, of a body that is refused, and for how long.
const REFUSED_BYTES: usize = 8 << 20;
const REFUSED_TIME: std::time::Duration = std::time::Duration::from_secs(3);

/// Bodies that are refused at a time and still read for a moment.
static REFUSED: tokio::sync::Semaphore = tokio::sync::Semaphore::const_new(64);

/// Reads on for a moment what nobody wants: a connection that ends with unread bytes is reset, and the answer with it.
pub fn let_run_out(mut body: Body) {
    let Ok(permit) = REFUSED.try_acquire() else { return };
    tokio::spawn(async move {
        let _permit = permit;
        let mut left = REFUSED_BYTES;
        let read = async {
            while let Some(Ok(frame)) = body.frame().await {
                left = left.saturating_sub(frame.data_ref().map_or(0, |data| data.len()));
                if left == 0 {
                    break;
                }
            }
        };
        let _ = tokio::time::timeout(REFUSED_TIME, read).await;
    });
}

/// A JSON body with the memory that it holds.
pub struct JsonBody {
    /// The body.
    pub value: Value,
    /// The request's headers.
    pub headers: HeaderMap,
    /// Given back when the request has been answered.
    _memory: ReadingMemory,
}

/// A body as it comes in.
struct Incoming<'a> {
    body: Body,
    limits: &'a Limits,
    begin: Instant,
    num_bytes: usize,
    max_bytes: usize,
    _entered: Entered,
}

impl<'a> Incoming<'a> {
    fn new(request: Request, limits: &'a Limits, quota: &Arc<Quota>, max_bytes: usize) -> Result<Self, Problem> {
        let promised = request.headers().get(header::CONTENT_LENGTH).and_then(|v| v.to_str().ok()?.parse().ok());
        let caller = share_of(&request);
        let body = request.into_body();
        let entered = if promised.is_some_and(|length: usize| length > max_bytes) {
            Err(too_long(max_bytes))
        } else {
            quota.enter(&caller).map_err(Problem::from)
        };
        match entered {
            Ok(_entered) => Ok(Incoming { body, limits, begin: Instant::now(), num_bytes: 0, max_bytes, _entered }),
            Err(problem) => {
                let_run_out(body);
                Err(problem)
            }
        }
    }

    /// The next bytes; none at the end.
    async fn next(&mut self) -> Result<Option<axum::body::Bytes>, Problem> {
        loop {
            // What has come so far pays for the time until now.
            let paid = self.num_bytes as f64 / self.limits.least_bytes_per_s;
            let deadline = self.begin + self.limits.body_grace + std::time::Duration::from_secs_f64(paid);
            let Ok(frame) = tokio::time::timeout_at(deadline, self.body.frame()).await else {
                let message = format!(
                    "{} bytes came in {:.0} s; send at least {:.0} bytes a second",
                    self.num_bytes,
                    self.begin.elapsed().as_secs_f64(),
                    self.limits.least_bytes_per_s
                );
                return Err(Problem::new("too-slow", message));
            };
            let Some(frame) = frame else { return Ok(None) };
            let frame = frame.map_err(|_| Problem::new("invalid-parameter", "the body ended too early"))?;
            let Ok(data) = frame.into_data() else { continue };
            self.num_bytes += data.len();
            if self.num_bytes > self.max_bytes {
                return Err(too_long(self.max_bytes));
            }
            return Ok(Some(data));
        }
    }
}

fn share_of(request: &Request) -> String {
    request.extensions().get::<Caller>().map(|caller| caller.share.clone()).unwrap_or_default()
}

fn too_long(max_bytes: usize) -> Problem {
    Problem::new("too-large", format!("the body has more than {max_bytes} bytes, the most that is taken here"))
}

/// Receives and parses a JSON body.
///
/// # Errors
/// `unsupported-media-type`, `too-large`, `too-slow`, `invalid-json`, `too-many-requests`, `busy`.
pub async fn receive_json(app: &App, request: Request) -> Result<JsonBody, Problem> {
    let headers = request.headers().clone();
    let media_type = headers.get(header::CONTENT_TYPE).and_then(|v| v.to_str().ok()).unwrap_or_default();
    let essence = media_type.split(';').next().unwrap_or_default().trim();
    if !essence.eq_ignore_ascii_case("application/json") {
        let_run_out(request.into_body());
        return Err(Problem::new("unsupported-media-type", "send the body as Content-Type: application/json"));
    }
    let max_bytes = app.limits.max_body_bytes;
    let share = share_of(&request);
    let mut incoming = Incoming::new(request, &app.limits, &app.bodies, max_bytes)?;
    // A list that grows holds its old place beside the new one.
    let received = MemoryLimit::body(3 * max_bytes as u64).begin();
    let mut bytes = Vec::new();
    while let Some(data) = incoming.next().await? {
        received.take("a body", 3 * data.len() as u64)?;
        bytes.extend_from_slice(&data);
    }
    drop(incoming);
    app.compute(&share, move || {
        let memory = MemoryLimit::service_json().begin();
        // The request is held as it came, in its canonical form, and as what is stored of its tasks.
        memory.take("the body's values", json_bytes(&bytes).saturating_mul(3))?;
        let value = serde_json::from_slice(&bytes).map_err(|e| Problem::new("invalid-json", e.to_string()))?;
        drop(received);
        Ok(JsonBody { value, headers, _memory: memory })
    })
    .await
}

/// Streams a body into a file without a name, so that memory does not hold it.
///
/// # Errors
/// `too-large`, `too-slow`, `too-many-requests`.
pub async fn receive_file(app: &App, request: Request) -> Result<File, Problem> {
    let mut incoming = Incoming::new(request, &app.limits, &app.upload_bodies, app.limits.max_upload_bytes)?;
    let failed = super::recordings::scratch_failed;
    let name = super::access::random_hex::<8>().map_err(|e| Problem::new("internal", e.to_string()))?;
    let path = std::env::temp_dir().join(format!("lambdak-upload-{name}"));
    let mut options = std::fs::OpenOptions::new();
    options.read(true).write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let mut file = options.open(&path).map_err(failed)?;
    let _ = std::fs::remove_file(&path);
    while let Some(data) = incoming.next().await? {
        file = tokio::task::spawn_blocking(move || file.write_all(&data).map(|()| file))
            .await
            .map_err(|_| Problem::new("internal", "the request ended with a programming error; please report it"))?
            .map_err(failed)?;
    }
    file.seek(SeekFrom::Start(0)).map_err(failed)?;
    Ok(file)
}
