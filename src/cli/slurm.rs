//! Options that send a command to a Slurm cluster.

use super::error::CliError;
use super::interrupt;
use crate::slurm::{ArrayJob, FollowSettings, Following, Resources, SlurmError, TaskProgress, follow};
use clap::Args;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What an array asks for.
#[derive(Args)]
pub(super) struct ArrayArguments {
    /// Run as a job array on the Slurm cluster, through the installed sbatch.
    #[arg(long)]
    pub slurm: bool,
    /// Slurm: partition [default: the cluster's].
    #[arg(long, requires = "slurm")]
    pub partition: Option<String>,
    /// Slurm: time limit of a task, as sbatch reads it.
    #[arg(long, requires = "slurm")]
    pub time: Option<String>,
    /// Slurm: memory of a task, as sbatch reads it.
    #[arg(long, requires = "slurm")]
    pub mem: Option<String>,
    /// Slurm: account to charge.
    #[arg(long, requires = "slurm")]
    pub account: Option<String>,
    /// Slurm: tasks of the array.
    #[arg(long, requires = "slurm", default_value_t = 4)]
    pub tasks: usize,
    /// Slurm: a further option of sbatch, such as --slurm-option=--qos=low.
    #[arg(long, requires = "slurm", value_name = "OPTION", allow_hyphen_values = true)]
    pub slurm_option: Vec<String>,
}

impl ArrayArguments {
    /// The array of `command` (with `{task}` for the task's number) with its files in `folder`.
    pub(super) fn job(
        &self,
        name: &str,
        folder: PathBuf,
        command: Vec<String>,
        threads: usize,
    ) -> Result<ArrayJob, CliError> {
        if !(1..=100_000).contains(&self.tasks) {
            let message = format!("{} is not from 1 to 100000", self.tasks);
            return Err(CliError::Option { option: "tasks", message });
        }
        let resources = Resources {
            partition: self.partition.clone(),
            time: self.time.clone(),
            memory: self.mem.clone(),
            account: self.account.clone(),
            threads,
            others: self.slurm_option.clone(),
        };
        Ok(ArrayJob { name: format!("lambdak-{name}"), folder, command, resources })
    }
}

/// An array that is followed to its end.
#[derive(Args)]
pub(super) struct SlurmArguments {
    #[command(flatten)]
    pub array: ArrayArguments,
    /// Slurm: seconds between two looks at the queue.
    #[arg(long, requires = "slurm", default_value_t = 5.0)]
    pub poll: f64,
    /// Slurm: how often a task that gets no further is started again.
    #[arg(long, requires = "slurm", default_value_t = 3)]
    pub restarts: usize,
    /// Slurm: Ctrl-C cancels the jobs [default: they work on, and the same command follows them again].
    #[arg(long, requires = "slurm")]
    pub cancel: bool,
}

/// Runs `command` (with `{task}` for the task's number) as an array in `folder` and waits for its results.
pub(super) fn run_array(
    a: &SlurmArguments,
    name: &str,
    folder: &Path,
    command: Vec<String>,
    threads: usize,
    progress_of: &dyn Fn(usize) -> Result<TaskProgress, String>,
    on_progress: &dyn Fn(TaskProgress),
) -> Result<(), CliError> {
    if !(0.05..=3600.0).contains(&a.poll) {
        return Err(CliError::Option { option: "poll", message: format!("{} is not from 0.05 to 3600", a.poll) });
    }
    let job = a.array.job(name, folder.join("slurm"), command, threads)?;
    let settings =
        FollowSettings { poll: Duration::from_secs_f64(a.poll), max_restarts: a.restarts, cancel_jobs: a.cancel };
    let say = |event: &Following| match event {
        Following::Submitted { job, tasks } => eprintln!("submitted job {job}: {} array tasks", tasks.len()),
        Following::Rejoined { tasks } => eprintln!("following {tasks} array tasks submitted before"),
        Following::Requeued { job, task, state } => {
            eprintln!("array task {task} of job {job} was lost ({state}); requeued")
        }
        Following::Progress(p) => on_progress(*p),
    };
    let tasks: Vec<usize> = (1..=a.array.tasks).collect();
    follow(&job, &tasks, &settings, progress_of, &say, &interrupt::is_requested, &std::thread::sleep)
        .map_err(cluster_error)
}

/// What went wrong with a cluster, for the command line.
pub(super) fn cluster_error(error: SlurmError) -> CliError {
    match error {
        SlurmError::Interrupted { message } => CliError::Interrupted(message),
        SlurmError::Write { path, source } => CliError::Write { path, source },
        SlurmError::BadValue { .. } => CliError::Option { option: "slurm", message: error.to_string() },
        other => CliError::Cluster(other.to_string()),
    }
}

/// This program, for the nodes.
pub(super) fn own_program() -> Result<String, CliError> {
    let path: PathBuf =
        std::env::current_exe().map_err(|e| CliError::Cluster(format!("the path of this program is unknown: {e}")))?;
    path_text(&path)
}

/// A path as text of a script.
pub(super) fn path_text(path: &Path) -> Result<String, CliError> {
    path.to_str().map(str::to_string).ok_or_else(|| CliError::Input {
        path: path.into(),
        message: "the path is not Unicode; a script cannot hold it".into(),
    })
}
