//! `lambdak run`: any kind of job from a request as the service takes it.

use super::Common;
use super::error::CliError;
use super::input::read_json;
use super::job_command::{Asked, run_asked};
use crate::job::{KINDS, kind_of_collection, kind_of_command};
use clap::Args;
use std::path::PathBuf;

#[derive(Args)]
pub(super) struct RunArguments {
    /// Kind of job, as a command or as in the service's addresses: evaluate or evaluations, design or designs, …
    kind: String,
    /// File with the request (JSON), as it would be posted to the service; recordings are named by their folders.
    request: PathBuf,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(a: &RunArguments) -> Result<(), CliError> {
    super::start_threads(&a.common)?;
    let Some(kind) = kind_of_command(&a.kind).or_else(|| kind_of_collection(&a.kind)) else {
        let known: Vec<&str> = KINDS.iter().map(|k| k.command).collect();
        let message = format!("'{}' is not {}", a.kind, known.join(", "));
        return Err(CliError::Option { option: "kind", message });
    };
    let source = a.request.display().to_string();
    let asked = Asked { kind: kind.command, request: read_json(&a.request)?, sources: vec![(String::new(), source)] };
    run_asked(&asked, &a.common, &a.request, kind.command, None)
}
