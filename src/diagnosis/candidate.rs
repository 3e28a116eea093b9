//! A suspect that is worth a look.

use super::cause::Cause;
use std::sync::Arc;

/// A cause that may be fitted: where its fit starts and what it explains to first order.
#[derive(Clone)]
pub(super) struct Candidate {
    /// The cause.
    pub(super) cause: Arc<dyn Cause>,
    /// Values of its parameters at the start.
    pub(super) values: Vec<f64>,
    /// Fall of the deviance to first order.
    pub(super) score: f64,
}
