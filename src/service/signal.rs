//! What wakes and stops the slots of a worker, and what they count.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

/// Wakes idle slots and stops all.
#[derive(Default)]
pub struct Signal {
    is_stopping: AtomicBool,
    generation: Mutex<u64>,
    changed: Condvar,
    /// Tasks finished, for metrics.
    pub finished: AtomicU64,
    /// Tasks failed, for metrics.
    pub failed: AtomicU64,
    /// Milliseconds of tasks run, for metrics.
    pub busy_ms: AtomicU64,
    /// Tasks running now.
    pub running: AtomicU64,
}

impl Signal {
    /// There may be new work.
    pub fn wake(&self) {
        let mut generation = self.generation.lock().unwrap_or_else(PoisonError::into_inner);
        *generation += 1;
        self.changed.notify_all();
    }

    /// Running tasks keep their checkpoints and go back into the queue.
    pub fn stop(&self) {
        self.is_stopping.store(true, Ordering::SeqCst);
        self.wake();
    }

    pub(super) fn is_stopping(&self) -> bool {
        self.is_stopping.load(Ordering::SeqCst)
    }

    pub(super) fn wait(&self, time: Duration) {
        let generation = self.generation.lock().unwrap_or_else(PoisonError::into_inner);
        let _unused = self.changed.wait_timeout(generation, time);
    }
}
