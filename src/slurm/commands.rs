//! The scheduler's commands.

use super::error::SlurmError;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::Path;
use std::process::Command;

/// What the scheduler says of a task.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TaskState {
    /// Waiting or running.
    Active,
    /// Requeued and held; `scontrol release` lets it go on.
    Held,
    /// Cancelled by someone.
    Cancelled,
    /// Over, however it ended (`COMPLETED`, `FAILED`, `NODE_FAIL`, `TIMEOUT`, …).
    Ended(String),
}

impl TaskState {
    fn of(name: &str) -> TaskState {
        // sacct writes "CANCELLED by 0", squeue "CANCELLED".
        match name.split_whitespace().next().unwrap_or_default() {
            "PENDING" | "RUNNING" | "CONFIGURING" | "COMPLETING" | "SUSPENDED" | "REQUEUED" | "RESIZING"
            | "SIGNALING" | "STAGE_OUT" | "STOPPED" | "RESV_DEL_HOLD" => TaskState::Active,
            "REQUEUE_HOLD" | "REQUEUE_FED" | "SPECIAL_EXIT" => TaskState::Held,
            "CANCELLED" => TaskState::Cancelled,
            other => TaskState::Ended(other.into()),
        }
    }
}

/// The installed Slurm.
#[derive(Clone, Copy, Debug, Default)]
pub struct Scheduler;

impl Scheduler {
    /// Submits a script with its folder as working directory; returns the job's number.
    ///
    /// # Errors
    /// [`SlurmError`].
    pub fn submit(&self, script: &Path, folder: &Path) -> Result<String, SlurmError> {
        let chdir = folder.as_os_str();
        let out = run("sbatch", &[OsStr::new("--parsable"), OsStr::new("--chdir"), chdir, script.as_os_str()])?;
        // "number" or "number;cluster".
        let job = out.trim().split(';').next().unwrap_or_default().to_string();
        if !job.is_empty() && job.chars().all(|c| c.is_ascii_digit()) {
            return Ok(job);
        }
        Err(SlurmError::Refused {
            command: "sbatch",
            message: format!("it printed '{}' instead of a job number", out.trim()),
        })
    }

    /// State of each task of a job that the controller or the accounting still knows; `None` where the controller does
    /// not answer.
    ///
    /// # Errors
    /// [`SlurmError::NoCommand`].
    pub fn states(&self, job: &str) -> Result<Option<BTreeMap<usize, TaskState>>, SlurmError> {
        let asked = ["--noheader", "--array", "--states=all", "--format=%K|%T", "--jobs", job];
        match run("squeue", &asked.map(OsStr::new)) {
            Ok(text) => {
                let mut states = parse(&text);
                if states.is_empty() {
                    states = self.accounted(job);
                }
                Ok(Some(states))
            }
            // The controller forgets a job some minutes after its end.
            Err(SlurmError::Refused { message, .. }) if message.contains("Invalid job id") => {
                Ok(Some(self.accounted(job)))
            }
            Err(SlurmError::Refused { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// What the accounting knows; nothing where there is none.
    fn accounted(&self, job: &str) -> BTreeMap<usize, TaskState> {
        let asked = ["--noheader", "--parsable2", "--allocations", "--format=JobID,State", "--jobs", job];
        let text = run("sacct", &asked.map(OsStr::new)).unwrap_or_default();
        // "12_3|FAILED"
        let lines: Vec<&str> = text.lines().filter_map(|l| l.split_once('_').map(|(_, rest)| rest)).collect();
        parse(&lines.join("\n"))
    }

    /// Puts a task back into the queue; false where the controller will not.
    pub fn requeue(&self, job: &str, task: usize) -> bool {
        run("scontrol", &[OsStr::new("requeue"), OsStr::new(&format!("{job}_{task}"))]).is_ok()
    }

    /// Lets a held task go on; false where the controller will not.
    pub fn release(&self, job: &str, task: usize) -> bool {
        run("scontrol", &[OsStr::new("release"), OsStr::new(&format!("{job}_{task}"))]).is_ok()
    }

    /// Cancels a whole job.
    ///
    /// # Errors
    /// [`SlurmError`].
    pub fn cancel(&self, job: &str) -> Result<(), SlurmError> {
        run("scancel", &[OsStr::new(job)]).map(|_| ())
    }
}

/// Lines `task|STATE`; of several lines on one task an active one counts.
fn parse(text: &str) -> BTreeMap<usize, TaskState> {
    let mut states = BTreeMap::new();
    for line in text.lines() {
        let Some((task, state)) = line.trim().split_once('|') else { continue };
        let Ok(task) = task.parse::<usize>() else { continue };
        let state = TaskState::of(state.trim());
        if states.get(&task) != Some(&TaskState::Active) {
            states.insert(task, state);
        }
    }
    states
}

/// Standard output of a command that succeeds.
fn run(command: &'static str, arguments: &[&OsStr]) -> Result<String, SlurmError> {
    // The script's own options must not be overruled from the environment; Ctrl-C is this program's business, not
    // theirs.
    let output = Command::new(command)
        .args(arguments)
        .env_remove("SBATCH_ARRAY_INX")
        .env("SLURM_TIME_FORMAT", "standard")
        .stdin(std::process::Stdio::null())
        .output()
        .map_err(|source| SlurmError::NoCommand { command, source })?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    let message = String::from_utf8_lossy(&output.stderr).trim().to_string();
    Err(SlurmError::Refused { command, message })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_are_read() {
        let states =
            parse("1|RUNNING\n2|NODE_FAIL\n3|CANCELLED by 0\nN/A|PENDING\n4|REQUEUE_HOLD\n1|FAILED\n\n5|COMPLETED");
        assert_eq!(states[&1], TaskState::Active);
        assert_eq!(states[&2], TaskState::Ended("NODE_FAIL".into()));
        assert_eq!(states[&3], TaskState::Cancelled);
        assert_eq!(states[&4], TaskState::Held);
        assert_eq!(states[&5], TaskState::Ended("COMPLETED".into()));
        assert_eq!(states.len(), 5);
    }
}
