//! Tells event streams of changed jobs. One query serves all streams: the storage numbers its changes.

use super::log;
use super::store::Store;
use super::view::JobView;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::watch;

/// How often the storage is asked.
const PERIOD: Duration = Duration::from_millis(250);

/// What a stream sees last of a job; `None` before the first change.
pub type Watched = watch::Receiver<Option<Arc<JobView>>>;

/// The streams' subscriptions by job.
#[derive(Default)]
pub struct Hub {
    jobs: Mutex<HashMap<String, watch::Sender<Option<Arc<JobView>>>>>,
}

impl Hub {
    /// Changes of a job from now on.
    pub fn subscribe(&self, job: &str) -> Watched {
        let mut jobs = self.jobs.lock().unwrap_or_else(PoisonError::into_inner);
        jobs.entry(job.into()).or_insert_with(|| watch::channel(None).0).subscribe()
    }

    fn publish(&self, view: JobView) {
        let mut jobs = self.jobs.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(sender) = jobs.get(&view.id)
            && sender.send(Some(Arc::new(view.clone()))).is_err()
        {
            // The last stream is gone.
            jobs.remove(&view.id);
        }
    }

    fn forget_unwatched(&self) {
        self.jobs.lock().unwrap_or_else(PoisonError::into_inner).retain(|_, sender| sender.receiver_count() > 0);
    }

    fn has_streams(&self) -> bool {
        !self.jobs.lock().unwrap_or_else(PoisonError::into_inner).is_empty()
    }
}

/// Runs until the service stops.
pub async fn run(hub: Arc<Hub>, store: Arc<Store>, mut stopping: watch::Receiver<bool>) {
    let mut last: Option<i64> = None;
    loop {
        tokio::select! {
            () = tokio::time::sleep(PERIOD) => {}
            _ = stopping.wait_for(|is_stopping| *is_stopping) => return,
        }
        hub.forget_unwatched();
        if !hub.has_streams() {
            last = None;
            continue;
        }
        let from = store.clone();
        let since = last;
        let found = tokio::task::spawn_blocking(move || match since {
            // Streams read a job once after they subscribe, so changes before the first look are not missed.
            None => from.last_revision().map(|r| (r, Vec::new())),
            Some(since) => {
                from.jobs_changed_since(since).map(|list| (list.last().map_or(since, |row| row.revision), list))
            }
        })
        .await;
        match found {
            Ok(Ok((revision, rows))) => {
                // One period's changes may lie between a first look and a stream's first read: look at them again.
                last = Some(if since.is_none() { (revision - 50).max(0) } else { revision });
                for row in &rows {
                    hub.publish(JobView::new(row));
                }
            }
            Ok(Err(error)) => log::error("events", &error.to_string()),
            Err(_) => return,
        }
    }
}
