//! What all requests share: the state of handlers.

use super::access::Access;
use super::hub::Hub;
use super::limits::Limits;
use super::metrics::Metrics;
use super::problem::Problem;
use super::signal::Signal;
use super::store::{Store, StoreError};
use std::sync::Arc;
use tokio::sync::{Semaphore, watch};

/// What all requests share.
pub struct Shared {
    /// Jobs and results.
    pub store: Arc<Store>,
    /// Who may do what.
    pub access: Access,
    /// Limits.
    pub limits: Limits,
    /// Event streams.
    pub hub: Arc<Hub>,
    /// Counts.
    pub metrics: Metrics,
    /// Wakes this process's slots.
    pub signal: Arc<Signal>,
    /// True when the service is shutting down.
    pub stopping: watch::Receiver<bool>,
    /// One permit per request in work.
    pub requests: Semaphore,
    /// One permit per quick computation (meshing, drawing); numerics never run on the readers' threads.
    pub quick: Semaphore,
    /// Host names by which the service may be called; empty for any (then tokens are needed).
    pub hosts: Vec<String>,
}

/// The state of handlers.
pub type App = Arc<Shared>;

impl Shared {
    /// Runs storage work on a blocking thread.
    ///
    /// # Errors
    /// A [`Problem`] `storage`.
    pub async fn with_store<T: Send + 'static>(
        self: &Arc<Self>,
        work: impl FnOnce(&Store) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, Problem> {
        let store = self.store.clone();
        match tokio::task::spawn_blocking(move || work(&store)).await {
            Ok(result) => Ok(result?),
            Err(_) => Err(Problem::new("internal", "the request ended with a programming error; please report it")),
        }
    }

    /// Runs a quick computation on a blocking thread, few at a time.
    ///
    /// # Errors
    /// What `work` returns.
    pub async fn compute<T: Send + 'static>(
        self: &Arc<Self>,
        work: impl FnOnce() -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let _permit = self.quick.acquire().await.map_err(|_| Problem::new("shutting-down", "try again later"))?;
        match tokio::task::spawn_blocking(work).await {
            Ok(result) => result,
            Err(_) => Err(Problem::new("internal", "the request ended with a programming error; please report it")),
        }
    }
}
