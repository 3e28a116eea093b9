//! `lambdak worker`.

use super::error::CliError;
use super::serve::{default_slots, service_error};
use crate::service::{WorkerOptions, work};
use clap::Args;
use std::time::Duration;

#[derive(Args)]
pub(super) struct WorkerArguments {
    /// The service's database, postgres://….
    #[arg(long, value_name = "ADDRESS")]
    database: String,
    /// Tasks at a time [default: one per core].
    #[arg(long)]
    slots: Option<usize>,
    /// Threads of all tasks together [default: one per core].
    #[arg(long)]
    threads: Option<usize>,
    /// Seconds after which this worker's task is given to another when it is silent.
    #[arg(long, default_value_t = 30, value_parser = clap::value_parser!(u64).range(2..=3600))]
    lease_s: u64,
}

pub(super) fn run(a: &WorkerArguments) -> Result<(), CliError> {
    super::start_thread_pool(a.threads)?;
    let options = WorkerOptions {
        database: a.database.clone(),
        slots: default_slots(a.slots)?.max(1),
        lease: Duration::from_secs(a.lease_s),
    };
    work(&options).map_err(service_error)
}
