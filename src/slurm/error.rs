//! What can go wrong on a cluster.

use std::path::PathBuf;

/// Why an array did not finish.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SlurmError {
    /// A command is not there.
    #[error("cannot run {command}: {source}; is Slurm installed on this machine and on the PATH?")]
    NoCommand {
        /// The command.
        command: &'static str,
        /// Why.
        source: std::io::Error,
    },
    /// A command refused.
    #[error("{command} failed: {message}")]
    Refused {
        /// The command.
        command: &'static str,
        /// What it said.
        message: String,
    },
    /// A value cannot stand in a script.
    #[error("--{option} '{value}' has characters that do not belong there")]
    BadValue {
        /// The option.
        option: String,
        /// Its value.
        value: String,
    },
    /// A file of the array cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The results cannot be read.
    #[error("{message}")]
    Results {
        /// Why.
        message: String,
    },
    /// Someone cancelled a task.
    #[error(
        "array task {task} of job {job} was cancelled; what was computed is kept, run the same command again to go on"
    )]
    Cancelled {
        /// The job.
        job: String,
        /// The task.
        task: usize,
    },
    /// A task ends without a result again and again.
    #[error(
        "array task {task} of job {job} ended {attempts} times ({state}) without getting further; the end of {}:\n{log}",
        log_path.display()
    )]
    TaskFails {
        /// The job.
        job: String,
        /// The task.
        task: usize,
        /// Attempts.
        attempts: usize,
        /// State that the scheduler names.
        state: String,
        /// Its log.
        log_path: PathBuf,
        /// The log's end.
        log: String,
    },
    /// Ctrl-C.
    #[error("{message}")]
    Interrupted {
        /// What became of the jobs.
        message: String,
    },
}
