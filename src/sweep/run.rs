//! Runs a shard's tasks on all threads; each result is on disk before the next is begun.

use super::error::{StoreError, SweepError};
use super::shard::Shard;
use super::store::{ShardWriter, collect};
use super::study::SweepStudy;
use super::task::{Outcome, Task, tasks};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// How far a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SweepProgress {
    /// Tasks of this shard with a result.
    pub done: usize,
    /// Of these, taken from earlier runs.
    pub resumed: usize,
    /// Of those done by this run, failed.
    pub failed: usize,
    /// Tasks of this shard.
    pub total: usize,
}

/// Called around an evaluation with its task; returns what is kept of it.
pub type Observe<'a> = &'a (dyn Fn(&Task, &dyn Fn() -> Option<Outcome>) -> Option<Outcome> + Sync);

/// Who listens to a run.
pub struct RunOptions<'a> {
    /// Which tasks.
    pub shard: Shard,
    /// Receives progress: once at the start, then after every task, from several threads.
    pub progress: &'a (dyn Fn(&SweepProgress) + Sync),
    /// Called around every evaluation with its task; returns what is kept of it. For timings, which are no result.
    pub observe: Observe<'a>,
    /// Whether to stop.
    pub is_cancelled: &'a (dyn Fn() -> bool + Sync),
}

/// What a run did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SweepRun {
    /// Tasks computed by this run.
    pub computed: usize,
    /// Tasks taken from earlier runs.
    pub resumed: usize,
}

/// Evaluates the tasks of a shard that have no result in `folder` yet, single-threaded each, on all threads of the
/// pool. The next task is taken by the next free thread, so that all threads work until the tasks run out.
///
/// # Errors
/// [`SweepError::Store`] at the first result that cannot be written, [`SweepError::Stopped`].
pub fn run(study: &SweepStudy, folder: &Path, options: &RunOptions) -> Result<SweepRun, SweepError> {
    let hash = study.hash();
    let num_tasks = study.num_tasks();
    let writer = ShardWriter::open(folder, options.shard, &hash, num_tasks)?;
    let known = collect(&[folder], &hash)?.outcomes;
    let all = tasks(study);
    let total = options.shard.tasks(num_tasks).count();
    let todo: Vec<&Task> =
        all.iter().filter(|t| options.shard.holds(t.index) && !known.contains_key(&t.index)).collect();
    let resumed = total - todo.len();
    let (next, computed, failed) = (AtomicUsize::new(0), AtomicUsize::new(0), AtomicUsize::new(0));
    let is_broken = AtomicBool::new(false);
    let kept: Mutex<(ShardWriter, Option<StoreError>)> = Mutex::new((writer, None));
    let report = || {
        (options.progress)(&SweepProgress {
            done: resumed + computed.load(Ordering::Relaxed),
            resumed,
            failed: failed.load(Ordering::Relaxed),
            total,
        });
    };
    report();
    let stop = || is_broken.load(Ordering::Relaxed) || (options.is_cancelled)();
    let work = || {
        while !stop() {
            let Some(task) = todo.get(next.fetch_add(1, Ordering::Relaxed)) else { break };
            let Some(outcome) = (options.observe)(task, &|| guarded(study, task, &stop)) else { break };
            let is_failure = matches!(outcome, Outcome::Failed { .. });
            // A poisoned lock means that another thread died while writing: what the file then holds is checked when
            // read.
            let mut kept = kept.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            if kept.1.is_some() {
                break;
            }
            if let Err(error) = kept.0.append(task.index, outcome) {
                is_broken.store(true, Ordering::Relaxed);
                kept.1 = Some(error);
                break;
            }
            computed.fetch_add(1, Ordering::Relaxed);
            failed.fetch_add(usize::from(is_failure), Ordering::Relaxed);
            report();
        }
    };
    rayon::scope(|scope| {
        for _ in 0..rayon::current_num_threads().min(todo.len()) {
            scope.spawn(|_| work());
        }
    });
    let (_, error) = kept.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some(error) = error {
        return Err(error.into());
    }
    let computed = computed.into_inner();
    if resumed + computed < total {
        return Err(SweepError::Stopped { done: resumed + computed, total });
    }
    Ok(SweepRun { computed, resumed })
}

/// A panic is a fault of the program, not of the sweep: it is recorded like any other failure, and the rest goes on.
fn guarded(study: &SweepStudy, task: &Task, stop: &(dyn Fn() -> bool + Sync)) -> Option<Outcome> {
    let evaluated = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| task.evaluate(study, stop)));
    evaluated.unwrap_or_else(|cause| {
        let text = cause.downcast_ref::<String>().cloned();
        let text = text.or_else(|| cause.downcast_ref::<&str>().map(|s| (*s).to_string()));
        Some(Outcome::Failed { kind: "internal".into(), reason: text.unwrap_or_else(|| "unknown cause".into()) })
    })
}
