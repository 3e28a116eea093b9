//! Limits of the service.

use std::time::Duration;

/// Limits of the service.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Longest JSON body, bytes.
    pub max_body_bytes: usize,
    /// Longest upload, bytes, packed and unpacked alike.
    pub max_upload_bytes: usize,
    /// Uploads in all, bytes.
    pub max_uploads_bytes: usize,
    /// Requests in work at a time.
    pub max_requests: usize,
    /// Event streams at a time.
    pub max_streams: usize,
    /// Tasks queued or running in all.
    pub max_queued_tasks: usize,
    /// Time for a request that is no stream or upload.
    pub request_time: Duration,
    /// Time for a client to send its request's head.
    pub head_time: Duration,
    /// Most elements of a mesh.
    pub max_elements: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Limits {
            max_body_bytes: 4 << 20,
            max_upload_bytes: 512 << 20,
            max_uploads_bytes: 8 << 30,
            max_requests: 512,
            max_streams: 1024,
            max_queued_tasks: 50_000,
            request_time: Duration::from_secs(30),
            head_time: Duration::from_secs(10),
            max_elements: 20_000,
        }
    }
}
