//! `lambdak serve`.

use super::error::CliError;
use crate::service::access::{Role, add_token};
use crate::service::limits::Limits;
use crate::service::{ServeError, ServeOptions, serve};
use clap::Args;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

#[derive(Args)]
pub(super) struct ServeArguments {
    /// Address and port; port 0 takes a free one.
    #[arg(long, default_value = "127.0.0.1:8080", value_name = "ADDRESS:PORT")]
    listen: SocketAddr,
    /// Folder for the queue and results.
    #[arg(long, value_name = "FOLDER", default_value = "lambdak-data")]
    data: PathBuf,
    /// postgres://… instead of SQLite in the data folder; then any number of workers may help.
    #[arg(long, value_name = "ADDRESS")]
    database: Option<String>,
    /// File of tokens (tokens/1); needed on any address but this machine's own.
    #[arg(long, value_name = "FILE")]
    tokens: Option<PathBuf>,
    /// Add a token NAME:ROLE (read, submit or admin) to --tokens, print it once and end.
    #[arg(long, value_name = "NAME:ROLE", requires = "tokens")]
    add_token: Option<String>,
    /// Tasks at a time [default: one per core; 0 leaves all to workers].
    #[arg(long)]
    slots: Option<usize>,
    /// Threads of all tasks together [default: one per core].
    #[arg(long)]
    threads: Option<usize>,
    /// Seconds after which a silent worker's task is given to another.
    #[arg(long, default_value_t = 30, value_parser = clap::value_parser!(u64).range(2..=3600))]
    lease_s: u64,
    /// Most hours of one processor that a job may be estimated to take, and of a clock that one task may run.
    #[arg(long, default_value_t = 4.0, value_name = "HOURS")]
    max_job_hours: f64,
    /// Delete ended jobs and recordings after so many days [default: never].
    #[arg(long, value_name = "DAYS", value_parser = clap::value_parser!(u64).range(1..=36500))]
    keep: Option<u64>,
    /// Most tasks queued or running.
    #[arg(long, default_value_t = 50_000)]
    max_queued: usize,
}

/// One slot per core.
pub(super) fn default_slots(slots: Option<usize>) -> Result<usize, CliError> {
    match slots {
        None => Ok(std::thread::available_parallelism().map_or(1, std::num::NonZero::get)),
        Some(n) if n <= 256 => Ok(n),
        Some(n) => Err(CliError::Option { option: "slots", message: format!("{n} is not from 0 to 256") }),
    }
}

/// From a second to a year.
fn job_time(hours: f64) -> Result<Duration, CliError> {
    if (1.0 / 3600.0..=8766.0).contains(&hours) {
        return Ok(Duration::from_secs_f64(3600.0 * hours));
    }
    let message = format!("{hours} hours is not from a second (0.000278) to a year (8766)");
    Err(CliError::Option { option: "max-job-hours", message })
}

pub(super) fn service_error(error: ServeError) -> CliError {
    match error {
        ServeError::TokensNeeded { .. } | ServeError::Listen { .. } => {
            CliError::Option { option: "listen", message: error.to_string() }
        }
        ServeError::Tokens(_) => CliError::Option { option: "tokens", message: error.to_string() },
        other => CliError::Option { option: "data/--database", message: other.to_string() },
    }
}

pub(super) fn run(a: &ServeArguments) -> Result<(), CliError> {
    if let (Some(text), Some(path)) = (&a.add_token, &a.tokens) {
        return make_token(text, path);
    }
    super::start_thread_pool(a.threads)?;
    let options = ServeOptions {
        listen: a.listen,
        data: a.data.clone(),
        database: a.database.clone(),
        tokens: a.tokens.clone(),
        slots: default_slots(a.slots)?,
        limits: Limits {
            max_queued_tasks: a.max_queued,
            max_job_time: job_time(a.max_job_hours)?,
            ..Limits::default()
        },
        lease: Duration::from_secs(a.lease_s),
        keep: a.keep.map(|days| Duration::from_secs(86400 * days)),
    };
    serve(&options, &|address| {
        let _ = super::output::print(&format!("http://{address}/\n"));
    })
    .map_err(service_error)
}

fn make_token(text: &str, path: &std::path::Path) -> Result<(), CliError> {
    let bad =
        || CliError::Option { option: "add-token", message: format!("'{text}' is not NAME:ROLE, such as anna:submit") };
    let (name, role) = text.rsplit_once(':').ok_or_else(bad)?;
    let role = match role {
        "read" => Role::Read,
        "submit" => Role::Submit,
        "admin" => Role::Admin,
        _ => return Err(bad()),
    };
    let is_plain =
        (1..=64).contains(&name.len()) && name.bytes().all(|b| b.is_ascii_alphanumeric() || b"-_.@".contains(&b));
    if !is_plain {
        return Err(bad());
    }
    let secret =
        add_token(path, name, role).map_err(|e| CliError::Option { option: "tokens", message: e.to_string() })?;
    super::output::print(&format!("{secret}\n"))
}
