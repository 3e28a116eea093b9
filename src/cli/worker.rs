//! `lambdak worker`.

use super::error::CliError;
use super::serve::{default_slots, service_error};
use super::slurm::{ArrayArguments, cluster_error, own_program, path_text};
use crate::service::{WorkerOptions, work};
use crate::slurm::Scheduler;
use clap::Args;
use std::path::PathBuf;
use std::time::Duration;

/// Where the database's address is taken from without `--database`: it may hold a password, which other users of a
/// machine would see in a command line.
const ADDRESS: &str = "LAMBDAK_DATABASE";
/// How long a cluster's worker waits for work unless told otherwise, s.
const IDLE_ON_A_CLUSTER: u64 = 60;

#[derive(Args)]
pub(super) struct WorkerArguments {
    /// The service's database, postgres://… [default: the environment's LAMBDAK_DATABASE].
    #[arg(long, value_name = "ADDRESS")]
    database: Option<String>,
    /// Tasks at a time [default: one per core].
    #[arg(long)]
    slots: Option<usize>,
    /// Threads of all tasks together [default: one per core].
    #[arg(long)]
    threads: Option<usize>,
    /// Seconds after which this worker's task is given to another when it is silent.
    #[arg(long, default_value_t = 30, value_parser = clap::value_parser!(u64).range(2..=3600))]
    lease_s: u64,
    /// End after so many seconds without a task [default: never; 60 with --slurm].
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(1..=86400))]
    idle_exit_s: Option<u64>,
    /// Slurm: folder of the script and the logs, the same on all nodes.
    #[arg(long, requires = "slurm", default_value = "lambdak-workers")]
    folder: PathBuf,
    #[command(flatten)]
    array: ArrayArguments,
}

pub(super) fn run(a: &WorkerArguments) -> Result<(), CliError> {
    let database = a.database.clone().or_else(|| std::env::var(ADDRESS).ok()).ok_or_else(|| CliError::Option {
        option: "database",
        message: format!("give the service's database, here or in {ADDRESS}"),
    })?;
    if a.array.slurm {
        return submit(a, &database);
    }
    super::start_thread_pool(a.threads)?;
    let options = WorkerOptions {
        database,
        slots: default_slots(a.slots)?.max(1),
        lease: Duration::from_secs(a.lease_s),
        idle_exit: a.idle_exit_s.map(Duration::from_secs),
    };
    work(&options).map_err(service_error)
}

/// Workers as a job array: they take what is queued and end when nothing is left.
fn submit(a: &WorkerArguments, database: &str) -> Result<(), CliError> {
    let write = |source| CliError::Write { path: a.folder.clone(), source };
    std::fs::create_dir_all(&a.folder).map_err(write)?;
    let folder = std::fs::canonicalize(&a.folder).map_err(write)?;
    // The address stands in a file that only this user can read, not in a command line.
    let address = folder.join("database");
    write_private(&address, database).map_err(|source| CliError::Write { path: address.clone(), source })?;
    let threads = a.threads.unwrap_or(1).max(1);
    let inner = format!(
        "{ADDRESS}=\"$(cat \"$1\")\" exec \"$0\" worker --slots {} --threads {threads} --lease-s {} --idle-exit-s {}",
        a.slots.unwrap_or(threads).max(1),
        a.lease_s,
        a.idle_exit_s.unwrap_or(IDLE_ON_A_CLUSTER),
    );
    let command = vec!["bash".into(), "-c".into(), inner, own_program()?, path_text(&address)?];
    let job = a.array.job("workers", folder, command, threads)?;
    let tasks: Vec<usize> = (1..=a.array.tasks).collect();
    let script = job.write_script(&tasks).map_err(cluster_error)?;
    let number = Scheduler.submit(&script, &job.folder).map_err(cluster_error)?;
    super::output::print(&format!("{number}\n"))?;
    eprintln!("submitted job {number}: {} workers; end them with: scancel {number}", tasks.len());
    Ok(())
}

/// Writes a file that only its owner can read.
fn write_private(path: &std::path::Path, text: &str) -> std::io::Result<()> {
    use std::io::Write;
    let mut options = std::fs::OpenOptions::new();
    options.write(true).create(true).truncate(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options.open(path)?.write_all(text.as_bytes())
}
