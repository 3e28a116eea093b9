//! The service as its users see it: jobs, results, errors, access.

#[path = "../service_common/mod.rs"]
mod service_common;

mod access;
mod costs;
mod deletion;
mod document;
mod evaluations;
mod jobs;
mod recordings;
mod sweeps;

use std::time::Duration;

/// How long a job may take on a busy machine.
const LONG: Duration = Duration::from_secs(600);
