//! Runs tasks: claims one, runs its library call on an own thread, keeps its lease alive, hands its result over.

use super::log;
use super::problem::Problem;
use super::recordings::{self, Space};
use super::signal::Signal;
use super::store::{Claimed, Finished, Store, StoreError, TaskResult};
use super::surroundings::StoredSurroundings;
use super::task::TaskInput;
use crate::job::{Failure, JobError, Outcome, kind_of_collection, run};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How a worker works.
#[derive(Clone, Debug)]
pub struct WorkerSettings {
    /// Name, unique among workers.
    pub name: String,
    /// Tasks at a time.
    pub slots: usize,
    /// How long a lease lasts; it is prolonged well before.
    pub lease: Duration,
    /// For checkpoints of running tasks.
    pub scratch: PathBuf,
}

/// How often progress is stored and a cancelled task noticed, at most.
const HEARTBEAT: Duration = Duration::from_millis(500);
/// How long an idle slot waits before it looks again.
const IDLE: Duration = Duration::from_millis(250);
/// A checkpoint is stored when it has changed, this often.
const CHECKPOINT: Duration = Duration::from_secs(3);
/// How long to wait when the storage does not answer.
const STORAGE_PAUSE: Duration = Duration::from_secs(1);

/// Starts a worker's slots; join them after its signal says stop.
pub fn start(store: &Arc<Store>, settings: &WorkerSettings, signal: &Arc<Signal>) -> Vec<std::thread::JoinHandle<()>> {
    (0..settings.slots.max(1))
        .filter_map(|slot| {
            let (store, settings, signal) = (store.clone(), settings.clone(), signal.clone());
            std::thread::Builder::new()
                .name(format!("slot-{slot}"))
                // Numerics recurse little, but pictures and parsers run here too.
                .stack_size(8 << 20)
                .spawn(move || run_slot(&store, &settings, &signal, slot))
                .inspect_err(|e| log::error("slot", &e.to_string()))
                .ok()
        })
        .collect()
}

fn run_slot(store: &Store, settings: &WorkerSettings, signal: &Signal, slot: usize) {
    let worker = format!("{}/{slot}", settings.name);
    let lease_ms = settings.lease.as_millis() as i64;
    let dead = Problem::new(
        "worker-lost",
        format!(
            "the task lost its worker {} times; it is put aside. Resume the job to try again",
            super::store::MAX_LOSSES
        ),
    )
    .to_json();
    let mut seen = Instant::now().checked_sub(Duration::from_secs(60)).unwrap_or_else(Instant::now);
    while !signal.is_stopping() {
        if slot == 0 && seen.elapsed() > Duration::from_secs(20) {
            seen = Instant::now();
            let _ = store.worker_seen(&settings.name, settings.slots);
        }
        match store.claim(&worker, lease_ms, &dead) {
            Ok(Some(task)) => {
                signal.running.fetch_add(1, Ordering::SeqCst);
                run_task(store, settings, signal, &worker, &task);
                signal.running.fetch_sub(1, Ordering::SeqCst);
            }
            Ok(None) => signal.wait(IDLE),
            Err(error) => {
                log::error("claim", &error.to_string());
                signal.wait(STORAGE_PAUSE);
            }
        }
    }
}

/// Runs the work on this thread while another keeps the lease alive.
fn run_task(store: &Store, settings: &WorkerSettings, signal: &Signal, worker: &str, task: &Claimed) {
    let started = Instant::now();
    let path = settings.scratch.join(format!("{}-{}-{}", task.job_id, task.index, task.attempt));
    if let Ok(Some(bytes)) = store.checkpoint(task) {
        let _ = std::fs::write(&path, bytes);
    }
    let watch = Watch::default();
    let input = (!task.is_gather).then(|| serde_json::from_str::<TaskInput>(&task.input)).transpose();
    let (limit, space) = match &input {
        Ok(Some(input)) => (Duration::try_from_secs_f64(input.max_seconds).unwrap_or(Duration::MAX), Some(input.space)),
        _ => (Duration::MAX, None),
    };
    let outcome = std::thread::scope(|scope| {
        let keeper = scope.spawn(|| keep(store, settings, worker, task, &path, &watch));
        let surroundings = StoredSurroundings {
            store,
            is_cancelled: &|| {
                watch.is_lost.load(Ordering::Relaxed) || signal.is_stopping() || started.elapsed() > limit
            },
            progress: &watch.progress,
            checkpoint: &path,
            max_elements: usize::MAX,
        };
        let work = || run_job(store, task, input, surroundings);
        let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
        watch.is_done.store(true, Ordering::SeqCst);
        keeper.thread().unpark();
        outcome
    });
    let elapsed = started.elapsed();
    signal.busy_ms.fetch_add(elapsed.as_millis() as u64, Ordering::Relaxed);
    let outcome = outcome.unwrap_or_else(|_| {
        Err(JobError::Internal("the computation ended with a programming error; please report it".into()))
    });
    let outcome = outcome.map(|outcome| stored(store, task, outcome, space));
    let failed = |problem: Problem| {
        signal.failed.fetch_add(1, Ordering::Relaxed);
        let problem = problem.to_json();
        ("failed", until_stored(|| store.fail(task, worker, &problem)))
    };
    let (what, stored) = match outcome {
        Ok(Ok(result)) => {
            signal.finished.fetch_add(1, Ordering::Relaxed);
            ("finished", until_stored(|| store.finish(task, worker, &result)))
        }
        Ok(Err(problem)) => failed(problem),
        Err(JobError::Stopped { .. }) if started.elapsed() > limit && !signal.is_stopping() => {
            save_checkpoint(store, worker, task, &path);
            signal.failed.fetch_add(1, Ordering::Relaxed);
            let detail = format!(
                "the task ran for {:.1} h, as long as a task of this service may; resume the job to go on for as long \
                 again, or ask for less",
                limit.as_secs_f64() / 3600.0
            );
            let problem = Problem::new("time-limit", detail).to_json();
            ("time-limit", until_stored(|| store.fail(task, worker, &problem)))
        }
        Err(JobError::Stopped { .. }) => {
            save_checkpoint(store, worker, task, &path);
            ("stopped", until_stored(|| store.release(task, worker).map(|()| Finished::Taken)))
        }
        Err(error) => failed(error.into()),
    };
    let _ = std::fs::remove_file(&path);
    log::info(
        "task",
        &serde_json::json!({
            "job": task.job_id, "task": task.index, "attempt": task.attempt, "worker": worker, "outcome": what,
            "taken": matches!(stored, Ok(Finished::Taken)), "seconds": elapsed.as_secs_f64(),
            "storage_error": stored.err().map(|e| e.to_string()),
        }),
    );
    signal.wake();
}

/// Runs a task, or gathers the results of its job's tasks.
fn run_job(
    store: &Store,
    task: &Claimed,
    input: Result<Option<TaskInput>, serde_json::Error>,
    surroundings: StoredSurroundings,
) -> Result<Outcome, JobError> {
    let unreadable = |e: serde_json::Error| JobError::Internal(format!("the stored task cannot be read: {e}"));
    if let Some(input) = input.map_err(unreadable)? {
        let job = input.job()?;
        let surroundings = StoredSurroundings { max_elements: input.max_elements, ..surroundings };
        return match run(&job, &surroundings) {
            // A damaged checkpoint: the work starts afresh.
            Err(JobError::Checkpoint(_)) => {
                let _ = std::fs::remove_file(surroundings.checkpoint);
                run(&job, &surroundings)
            }
            ran => ran,
        };
    }
    let body: serde_json::Value = serde_json::from_str(&task.body).map_err(unreadable)?;
    let kind =
        kind_of_collection(&task.kind).ok_or_else(|| JobError::Internal(format!("no kind of job {}", task.kind)))?;
    let stored = store.task_results(&task.job_id).map_err(|e| JobError::Internal(e.to_string()))?;
    let result = |(result, problem): (Vec<u8>, String)| -> Result<Result<_, Failure>, serde_json::Error> {
        if problem.is_empty() {
            return Ok(Ok(serde_json::from_slice(&result)?));
        }
        let problem: Problem = serde_json::from_str(&problem)?;
        Ok(Err(Failure::from(&problem)))
    };
    let results = stored.into_iter().map(result).collect::<Result<Vec<_>, _>>().map_err(unreadable)?;
    kind.job(&body).map_err(JobError::Invalid)?.gather(results)
}

/// An outcome as it is stored; a recording that the job made is kept for further jobs, where there is space for it.
fn stored(store: &Store, task: &Claimed, outcome: Outcome, space: Option<Space>) -> Result<TaskResult, Problem> {
    let recording = outcome.recording();
    if let Some(space) = space
        && !recording.is_empty()
    {
        let owner = store.job(&task.job_id)?.map(|row| row.owner).unwrap_or_default();
        recordings::keep(store, &owner, space, recording)?;
    }
    let artefact = |f: crate::job::File| (f.name, f.media_type.name().to_string(), f.bytes);
    Ok(TaskResult { result: outcome.result.into_bytes(), artefacts: outcome.files.into_iter().map(artefact).collect() })
}

/// A result is worth waiting for a storage that does not answer; the lease decides whether it is still wanted.
fn until_stored(store: impl Fn() -> Result<Finished, StoreError>) -> Result<Finished, StoreError> {
    for _ in 0..20 {
        match store() {
            Err(error) => {
                log::error("storage", &error.to_string());
                std::thread::sleep(STORAGE_PAUSE);
            }
            done => return done,
        }
    }
    store()
}

/// What a task's two threads share: the one that runs it and the one that keeps its lease alive.
#[derive(Default)]
struct Watch {
    /// The task is another's now.
    is_lost: AtomicBool,
    /// The work has ended.
    is_done: AtomicBool,
    /// Progress as JSON.
    progress: Mutex<String>,
}

/// Keeps the lease of a task alive, stores its progress and its checkpoint.
fn keep(store: &Store, settings: &WorkerSettings, worker: &str, task: &Claimed, path: &Path, watch: &Watch) {
    let Watch { is_lost, is_done, progress } = watch;
    let lease_ms = settings.lease.as_millis() as i64;
    let mut prolonged = Instant::now();
    let mut last_progress = String::new();
    let mut last_checkpoint = (Instant::now(), 0u64);
    loop {
        std::thread::park_timeout(HEARTBEAT.min(settings.lease / 4));
        if is_done.load(Ordering::SeqCst) {
            return;
        }
        let text = progress.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let text = if text == last_progress { String::new() } else { text };
        match store.heartbeat(task, worker, lease_ms, &text) {
            Ok(Finished::Taken) => prolonged = Instant::now(),
            Ok(Finished::NotOurs) => {
                is_lost.store(true, Ordering::SeqCst);
                return;
            }
            // Without an answer for a whole lease the task may be somebody else's.
            Err(_) if prolonged.elapsed() > settings.lease => {
                is_lost.store(true, Ordering::SeqCst);
                return;
            }
            Err(_) => {}
        }
        if !text.is_empty() {
            last_progress = text;
        }
        if last_checkpoint.0.elapsed() > CHECKPOINT {
            let length = std::fs::metadata(path).map_or(0, |m| m.len());
            if length != last_checkpoint.1 {
                save_checkpoint(store, worker, task, path);
            }
            last_checkpoint = (Instant::now(), length);
        }
    }
}

fn save_checkpoint(store: &Store, worker: &str, task: &Claimed, path: &Path) {
    if let Ok(bytes) = std::fs::read(path)
        && !bytes.is_empty()
        && let Err(error) = store.save_checkpoint(task, worker, &bytes)
    {
        log::error("checkpoint", &error.to_string());
    }
}
