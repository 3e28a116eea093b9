//! Errors as RFC 9457 `application/problem+json`, with a stable `type` per cause and JSON pointers to offending fields.

use crate::field::{FieldError, in_lines};
use crate::file::MemoryError;
use crate::job::{Failure, JobError, Refusal};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Where in the request something is wrong.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct FieldProblem {
    /// The field.
    #[serde(flatten)]
    pub error: FieldError,
    /// What is wrong and what to change, in a sentence.
    pub detail: String,
}

impl From<FieldError> for FieldProblem {
    fn from(error: FieldError) -> Self {
        let detail = error.to_string();
        FieldProblem { detail, error }
    }
}

/// A problem (RFC 9457).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Problem {
    /// Stable name of the cause, `urn:lambdak:problem:…`.
    #[serde(rename = "type")]
    pub kind: String,
    /// The cause in words.
    pub title: String,
    /// HTTP status.
    #[schema(minimum = 400, maximum = 599)]
    pub status: u16,
    /// This case: the value, the limit, what to change.
    pub detail: String,
    /// Offending fields.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub errors: Vec<FieldProblem>,
    /// Seconds after which to try again.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub retry_after_s: Option<u32>,
}

/// Every cause: name, status, title. The names are stable.
pub const CATALOGUE: &[(&str, u16, &str)] = &[
    ("invalid-json", 400, "The body is not JSON"),
    ("invalid-parameter", 400, "A parameter is not usable"),
    ("schema-mismatch", 400, "The body does not fit the schema of its kind"),
    ("bad-host", 400, "The Host header names another server"),
    ("unauthorized", 401, "A valid token is needed"),
    ("forbidden", 403, "The token's role or the page's origin does not allow this"),
    ("not-found", 404, "There is no such thing here"),
    ("method-not-allowed", 405, "The method is not allowed here"),
    ("not-finished", 409, "The job has no result yet"),
    ("wrong-state", 409, "The job's state does not allow this"),
    ("key-reused", 409, "The Idempotency-Key was used with another request"),
    ("too-slow", 408, "The body came too slowly"),
    ("too-large", 413, "The body is too large"),
    ("unsupported-media-type", 415, "The content type is not supported"),
    ("invalid-input", 422, "The input fits its schema, and cannot be computed"),
    ("too-big-a-problem", 422, "The problem is larger than allowed"),
    ("too-costly", 422, "The job is estimated to take longer than allowed"),
    ("time-limit", 422, "The task ran for as long as a task may"),
    ("no-solution", 422, "The computation found no solution"),
    ("unsafe-upload", 422, "The upload is not a safe recording"),
    ("queue-full", 429, "The queue is full"),
    ("quota", 429, "The token's quota is used up"),
    ("too-many-requests", 429, "Too many requests at a time"),
    ("internal", 500, "The service failed"),
    ("worker-lost", 500, "The task ended its worker too often"),
    ("version-changed", 500, "The program changed while the job was unfinished"),
    ("busy", 503, "The service has no memory left for this now"),
    ("storage", 503, "The storage does not answer"),
    ("shutting-down", 503, "The service is shutting down"),
    ("no-space", 507, "The space for recordings is used up"),
    ("timeout", 504, "The request took too long"),
];

/// The cause for which the same request may succeed once others have ended.
pub const BUSY: &str = "busy";

impl Problem {
    /// Whether it has the cause of this name.
    pub fn is(&self, name: &str) -> bool {
        self.kind.strip_prefix("urn:lambdak:problem:") == Some(name)
    }

    /// A problem of the catalogue.
    pub fn new(name: &'static str, detail: impl Into<String>) -> Self {
        let (_, status, title) =
            CATALOGUE.iter().find(|entry| entry.0 == name).copied().unwrap_or(("internal", 500, "The service failed"));
        Problem {
            kind: format!("urn:lambdak:problem:{name}"),
            title: title.into(),
            status,
            detail: detail.into(),
            errors: Vec::new(),
            retry_after_s: None,
        }
    }

    /// `invalid-input` with all offending fields.
    pub fn invalid(errors: Vec<FieldError>) -> Self {
        Problem::at("invalid-input", errors)
    }

    /// `schema-mismatch` with all offending fields.
    pub fn misfit(errors: Vec<FieldError>) -> Self {
        Problem::at("schema-mismatch", errors)
    }

    fn at(name: &'static str, errors: Vec<FieldError>) -> Self {
        let detail = in_lines(&errors);
        Problem { errors: errors.into_iter().map(Into::into).collect(), ..Problem::new(name, detail) }
    }

    /// With a time after which to try again.
    pub fn after(mut self, seconds: u32) -> Self {
        self.retry_after_s = Some(seconds);
        self
    }

    /// As JSON text, for the storage.
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }
}

impl From<MemoryError> for Problem {
    fn from(error: MemoryError) -> Self {
        match error {
            MemoryError::TooMuch { .. } => Problem::new("too-large", error.to_string()),
            MemoryError::Stopped => Problem::new("timeout", error.to_string()),
            _ => Problem::new(BUSY, error.to_string()).after(5),
        }
    }
}

impl From<super::store::StoreError> for Problem {
    fn from(error: super::store::StoreError) -> Self {
        match error {
            super::store::StoreError::QueueFull { is_quota, .. } => {
                Problem::new(if is_quota { "quota" } else { "queue-full" }, error.to_string()).after(10)
            }
            other => {
                // What the database says may name hosts and files: it is for the log.
                super::log::error("storage", &other.to_string());
                Problem::new("storage", "the storage did not answer; try again").after(5)
            }
        }
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let mut response = (status, serde_json::to_vec(&self).unwrap_or_default()).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        if let Some(seconds) = self.retry_after_s {
            headers.insert(header::RETRY_AFTER, HeaderValue::from(seconds));
        }
        if self.status == 401 {
            headers.insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        response
    }
}

impl From<Refusal> for Problem {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::Misfit(errors) => Problem::misfit(errors),
            Refusal::Unfit(errors) => Problem::invalid(errors),
        }
    }
}

impl From<JobError> for Problem {
    fn from(error: JobError) -> Self {
        match error {
            JobError::Invalid(errors) => Problem::invalid(errors),
            JobError::TooBig(error) => {
                Problem { errors: vec![error.clone().into()], ..Problem::new("too-big-a-problem", error.to_string()) }
            }
            JobError::Unreadable { .. } => Problem::new("not-found", error.to_string()),
            JobError::NoSolution(message) => Problem::new("no-solution", message),
            other => Problem::new("internal", other.to_string()),
        }
    }
}

impl From<&Problem> for Failure {
    fn from(problem: &Problem) -> Self {
        Failure { detail: problem.detail.clone(), errors: problem.errors.iter().map(|e| e.error.clone()).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_known() {
        let mut names: Vec<_> = CATALOGUE.iter().map(|e| e.0).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), CATALOGUE.len());
        assert_eq!(Problem::new("quota", "").status, 429);
    }
}
