//! What all requests share: the state of handlers.

use super::access::{Access, Caller};
use super::hub::Hub;
use super::limits::Limits;
use super::metrics::Metrics;
use super::problem::Problem;
use super::quota::{Entered, Full, Quota};
use super::signal::Signal;
use super::store::{Store, StoreError};
use super::turns::Turns;
use crate::file::StopFlag;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
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
    /// Requests in work.
    pub requests: Arc<Quota>,
    /// JSON bodies that come in.
    pub bodies: Arc<Quota>,
    /// Uploads that come in.
    pub upload_bodies: Arc<Quota>,
    /// Event streams.
    pub streams: Arc<Quota>,
    /// Answers that are not small and go out.
    pub answers: Arc<Quota>,
    /// Turns for quick computations (parsing, meshing, drawing); numerics never run on the readers' threads.
    pub quick: Turns,
    /// One permit per upload that is read.
    pub uploads: Arc<Semaphore>,
    /// What was found last of the storage, and when.
    pub ready: tokio::sync::Mutex<Option<(Instant, Result<(), Problem>)>>,
    /// Host names by which the service may be called; empty for any (then tokens are needed).
    pub hosts: Vec<String>,
}

/// Stops a reading when it is dropped: with the handler that waited for it.
struct StopWhenDropped(StopFlag);

impl Drop for StopWhenDropped {
    fn drop(&mut self) {
        self.0.stop();
    }
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

    /// What is counted at this moment: name, help and value for the metrics.
    pub fn now(&self) -> [(&'static str, &'static str, usize); 5] {
        [
            ("lambdak_requests_in_flight", "Requests in work.", self.requests.count()),
            ("lambdak_bodies", "JSON bodies coming in.", self.bodies.count()),
            ("lambdak_upload_bodies", "Uploads coming in.", self.upload_bodies.count()),
            ("lambdak_streams", "Open event streams.", self.streams.count()),
            ("lambdak_answers", "Answers of more than 64 KiB going out.", self.answers.count()),
        ]
    }

    /// A place among the requests in work.
    ///
    /// # Errors
    /// `too-many-requests`.
    pub fn enter(&self, caller: &Caller) -> Result<Entered, Problem> {
        self.requests.enter(&caller.share).map_err(|full: Full| {
            self.metrics.turned_away.fetch_add(1, Ordering::Relaxed);
            full.into()
        })
    }

    /// Does the work of a request whose body has come: in a place of its own, and within its time.
    ///
    /// # Errors
    /// `too-many-requests`, `timeout`, what `work` returns.
    pub async fn answer<T>(
        &self,
        caller: &Caller,
        time: Duration,
        work: impl Future<Output = Result<T, Problem>>,
    ) -> Result<T, Problem> {
        let _entered = self.enter(caller)?;
        let timeout = |_| Err(Problem::new("timeout", "the request took too long"));
        tokio::time::timeout(time, work).await.unwrap_or_else(timeout)
    }

    /// Reads an upload on a blocking thread, one at a time. When the caller has left, the flag that `work` is given
    /// says so, and it ends at its next look.
    ///
    /// # Errors
    /// What `work` returns.
    pub async fn read_upload<T: Send + 'static>(
        self: &Arc<Self>,
        work: impl FnOnce(StopFlag) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let permit = self.uploads.clone().acquire_owned().await;
        let permit = permit.map_err(|_| Problem::new("shutting-down", "try again later"))?;
        let stop = StopFlag::default();
        let left = StopWhenDropped(stop.clone());
        let read = tokio::task::spawn_blocking(move || {
            // Held until the work has really ended, whether or not somebody waits for it.
            let _permit = permit;
            work(stop)
        });
        let result = read.await;
        drop(left);
        result.unwrap_or_else(|_| {
            Err(Problem::new("internal", "the request ended with a programming error; please report it"))
        })
    }

    /// Runs a quick computation of a caller on a blocking thread, few at a time, one of each caller.
    ///
    /// # Errors
    /// What `work` returns.
    pub async fn compute<T: Send + 'static>(
        self: &Arc<Self>,
        share: &str,
        work: impl FnOnce() -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let turn = self.quick.take(share).await.ok_or_else(|| Problem::new("shutting-down", "try again later"))?;
        let counted = move || {
            // Held until the work has really ended, whether or not somebody waits for it.
            let _turn = turn;
            work()
        };
        match tokio::task::spawn_blocking(counted).await {
            Ok(result) => result,
            Err(_) => Err(Problem::new("internal", "the request ended with a programming error; please report it")),
        }
    }
}
