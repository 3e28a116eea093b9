//! Follows an array until the results of all its tasks are there.

use super::array::{ArrayJob, write_whole};
use super::commands::{Scheduler, TaskState};
use super::error::SlurmError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::Duration;

/// Polls in a row at which a task must be seen to be over before it is started again: shared file systems show
/// another node's writes late.
const POLLS_BEFORE_RESTART: usize = 2;
/// Last lines of a log that an error shows.
const LOG_LINES: usize = 8;

/// How far a task's results are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TaskProgress {
    /// Results there.
    pub done: usize,
    /// Of.
    pub total: usize,
}

/// How to follow.
#[derive(Clone, Copy, Debug)]
pub struct FollowSettings {
    /// Time between looks.
    pub poll: Duration,
    /// How often a task that gets no further is started again.
    pub max_restarts: usize,
    /// Cancel the jobs when interrupted, instead of leaving them to work on.
    pub cancel_jobs: bool,
}

/// What a follower sees.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Following<'a> {
    /// A job was submitted for these tasks.
    Submitted {
        /// Its number.
        job: &'a str,
        /// Its tasks.
        tasks: &'a [usize],
    },
    /// Jobs of an earlier run of the command are still active.
    Rejoined {
        /// Tasks that they work at.
        tasks: usize,
    },
    /// A task was put back into the queue.
    Requeued {
        /// Its job.
        job: &'a str,
        /// The task.
        task: usize,
        /// How it had ended.
        state: &'a str,
    },
    /// Results so far.
    Progress(TaskProgress),
}

/// Looks, half a second apart, at cancelled jobs that have not ended yet. (Slurm's grace before it kills is 30 s by
/// default.)
const MAX_LOOKS_AT_CANCELLED: usize = 120;

/// The jobs submitted for an array, kept beside the script so that the command can be run again and go on.
#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Jobs {
    /// Job of each task, the latest.
    job_of_task: BTreeMap<usize, String>,
}

struct Watched {
    polls_over: usize,
    attempts: usize,
    done_at_start: usize,
}

/// Submits the tasks that are not finished, unless an earlier run's jobs are at them, and waits until `progress_of`
/// says that every task has all its results. `pause` sleeps.
///
/// # Errors
/// [`SlurmError`].
pub fn follow(
    job: &ArrayJob,
    tasks: &[usize],
    settings: &FollowSettings,
    progress_of: &dyn Fn(usize) -> Result<TaskProgress, String>,
    on_event: &dyn Fn(&Following),
    is_cancelled: &(dyn Fn() -> bool + Sync),
    pause: &dyn Fn(Duration),
) -> Result<(), SlurmError> {
    let scheduler = Scheduler;
    let read = |task: usize| progress_of(task).map_err(|message| SlurmError::Results { message });
    let record = job.folder.join("jobs.json");
    let mut jobs: Jobs =
        std::fs::read_to_string(&record).ok().and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default();
    let mut open: BTreeMap<usize, Watched> = BTreeMap::new();
    let mut finished = TaskProgress { done: 0, total: 0 };
    for &task in tasks {
        let p = read(task)?;
        if p.done < p.total {
            open.insert(task, Watched { polls_over: 0, attempts: 0, done_at_start: p.done });
        } else {
            finished = TaskProgress { done: finished.done + p.done, total: finished.total + p.total };
        }
    }
    let states = all_states(&scheduler, &jobs, &open)?.unwrap_or_default();
    let idle: Vec<usize> =
        open.keys().copied().filter(|t| !matches!(states.get(t), Some(TaskState::Active | TaskState::Held))).collect();
    if idle.len() < open.len() {
        on_event(&Following::Rejoined { tasks: open.len() - idle.len() });
    }
    submit(job, &idle, &scheduler, &mut jobs, on_event)?;
    loop {
        let mut sum = finished;
        let mut over = Vec::new();
        for &task in open.keys() {
            let p = read(task)?;
            sum = TaskProgress { done: sum.done + p.done, total: sum.total + p.total };
            if p.done >= p.total {
                over.push((task, p));
            }
        }
        on_event(&Following::Progress(sum));
        for (task, p) in over {
            open.remove(&task);
            finished = TaskProgress { done: finished.done + p.done, total: finished.total + p.total };
        }
        if open.is_empty() {
            return Ok(());
        }
        if is_cancelled() {
            return Err(interrupted(&scheduler, &jobs, &open, settings.cancel_jobs, pause));
        }
        // A controller that does not answer is waited for.
        if let Some(states) = all_states(&scheduler, &jobs, &open)? {
            restart_lost(job, settings, &mut jobs, &mut open, &states, &read, on_event)?;
        }
        let slice = Duration::from_millis(100).min(settings.poll);
        let mut waited = Duration::ZERO;
        while waited < settings.poll && !is_cancelled() {
            pause(slice);
            waited += slice;
        }
    }
}

/// Tasks that the scheduler has given up and that have results missing.
fn restart_lost(
    job: &ArrayJob,
    settings: &FollowSettings,
    jobs: &mut Jobs,
    open: &mut BTreeMap<usize, Watched>,
    states: &BTreeMap<usize, TaskState>,
    read: &dyn Fn(usize) -> Result<TaskProgress, SlurmError>,
    on_event: &dyn Fn(&Following),
) -> Result<(), SlurmError> {
    let mut again = Vec::new();
    for (&task, watched) in open.iter_mut() {
        let number = jobs.job_of_task.get(&task).cloned().unwrap_or_default();
        let state = match states.get(&task) {
            Some(TaskState::Active) => {
                watched.polls_over = 0;
                continue;
            }
            Some(TaskState::Held) => {
                Scheduler.release(&number, task);
                continue;
            }
            Some(TaskState::Cancelled) => "CANCELLED".to_string(),
            Some(TaskState::Ended(state)) => state.clone(),
            None => "no longer known to the controller".into(),
        };
        watched.polls_over += 1;
        if watched.polls_over < POLLS_BEFORE_RESTART {
            continue;
        }
        let now = read(task)?;
        if now.done >= now.total {
            continue;
        }
        if state == "CANCELLED" {
            return Err(SlurmError::Cancelled { job: number, task });
        }
        // A time limit that lets a task get on is no failure.
        watched.attempts = if now.done > watched.done_at_start { 1 } else { watched.attempts + 1 };
        watched.done_at_start = now.done;
        watched.polls_over = 0;
        if watched.attempts > settings.max_restarts {
            let log_path = job.log_path(task);
            let text = std::fs::read(&log_path).map(|b| String::from_utf8_lossy(&b).into_owned()).unwrap_or_default();
            let lines: Vec<&str> = text.lines().collect();
            let log = lines[lines.len().saturating_sub(LOG_LINES)..].join("\n");
            let attempts = watched.attempts;
            return Err(SlurmError::TaskFails { job: number, task, attempts, state, log_path, log });
        }
        on_event(&Following::Requeued { job: &number, task, state: &state });
        if !(states.contains_key(&task) && Scheduler.requeue(&number, task)) {
            again.push(task);
        }
    }
    submit(job, &again, &Scheduler, jobs, on_event)
}

fn submit(
    job: &ArrayJob,
    tasks: &[usize],
    scheduler: &Scheduler,
    jobs: &mut Jobs,
    on_event: &dyn Fn(&Following),
) -> Result<(), SlurmError> {
    if tasks.is_empty() {
        return Ok(());
    }
    let script = job.write_script(tasks)?;
    let number = scheduler.submit(&script, &job.folder)?;
    for &task in tasks {
        jobs.job_of_task.insert(task, number.clone());
    }
    // Numbers and strings always serialise.
    let text = serde_json::to_string_pretty(jobs).unwrap_or_default();
    write_whole(&job.folder.join("jobs.json"), &text)?;
    on_event(&Following::Submitted { job: &number, tasks });
    Ok(())
}

/// States of the open tasks, each in its latest job; `None` where the controller does not answer.
fn all_states(
    scheduler: &Scheduler,
    jobs: &Jobs,
    open: &BTreeMap<usize, Watched>,
) -> Result<Option<BTreeMap<usize, TaskState>>, SlurmError> {
    let mut by_job: BTreeMap<&str, BTreeMap<usize, TaskState>> = BTreeMap::new();
    let mut states = BTreeMap::new();
    for task in open.keys() {
        let Some(number) = jobs.job_of_task.get(task) else { continue };
        if !by_job.contains_key(number.as_str()) {
            match scheduler.states(number)? {
                None => return Ok(None),
                Some(found) => by_job.insert(number, found),
            };
        }
        if let Some(state) = by_job.get(number.as_str()).and_then(|s| s.get(task)) {
            states.insert(*task, state.clone());
        }
    }
    Ok(Some(states))
}

fn interrupted(
    scheduler: &Scheduler,
    jobs: &Jobs,
    open: &BTreeMap<usize, Watched>,
    cancel_jobs: bool,
    pause: &dyn Fn(Duration),
) -> SlurmError {
    let numbers: std::collections::BTreeSet<&String> = open.keys().filter_map(|t| jobs.job_of_task.get(t)).collect();
    let list = numbers.iter().map(|n| n.as_str()).collect::<Vec<_>>().join(" ");
    if !cancel_jobs {
        let message =
            format!("job {list} works on; run the same command again to follow it, or end it with: scancel {list}");
        return SlurmError::Interrupted { message };
    }
    for number in numbers {
        if let Err(error) = scheduler.cancel(number) {
            return error;
        }
    }
    // Jobs take a while to end; run again before that, the command would follow what is being cancelled.
    for _ in 0..MAX_LOOKS_AT_CANCELLED {
        let states = all_states(scheduler, jobs, open).ok().flatten();
        if states.is_some_and(|s| s.values().all(|t| !matches!(t, TaskState::Active | TaskState::Held))) {
            break;
        }
        pause(Duration::from_millis(500));
    }
    SlurmError::Interrupted { message: format!("job {list} was cancelled; run the same command again to go on") }
}
