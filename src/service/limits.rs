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
    /// Connections at a time, and of one address.
    pub max_connections: [usize; 2],
    /// Requests in work at a time, and of one caller. Bodies are received before, health is asked beside them.
    pub max_requests: [usize; 2],
    /// JSON bodies that come in at a time, and of one caller.
    pub max_bodies: [usize; 2],
    /// Uploads that come in at a time, and of one caller.
    pub max_upload_bodies: [usize; 2],
    /// Event streams at a time, and of one caller.
    pub max_streams: [usize; 2],
    /// Answers of more than 64 KiB that go out at a time, and to one caller.
    pub max_answers: [usize; 2],
    /// Least rate of a body that comes in and of an answer that goes out, bytes a second, after a first time without
    /// one.
    pub least_bytes_per_s: f64,
    /// That first time.
    pub body_grace: Duration,
    /// Tasks queued or running in all.
    pub max_queued_tasks: usize,
    /// Time for the work of a request, from its body's end to its answer's beginning.
    pub request_time: Duration,
    /// The same for an upload, which is read and kept.
    pub upload_time: Duration,
    /// Time for a client to send its request's head.
    pub head_time: Duration,
    /// Most elements of a mesh.
    pub max_elements: usize,
    /// Most time that a job may be estimated to take on one processor; and after which a task that still runs ends.
    pub max_job_time: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Limits {
            max_body_bytes: 4 << 20,
            max_upload_bytes: 512 << 20,
            max_uploads_bytes: 8 << 30,
            max_connections: [4096, 2048],
            max_requests: [512, 256],
            max_bodies: [256, 16],
            max_upload_bodies: [16, 2],
            max_streams: [1024, 256],
            max_answers: [128, 32],
            least_bytes_per_s: 16384.0,
            body_grace: Duration::from_secs(10),
            max_queued_tasks: 50_000,
            request_time: Duration::from_secs(30),
            upload_time: Duration::from_secs(600),
            head_time: Duration::from_secs(10),
            max_elements: 20_000,
            max_job_time: Duration::from_secs(4 * 3600),
        }
    }
}
