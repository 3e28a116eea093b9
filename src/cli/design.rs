//! `lambdak design`.

use super::error::CliError;
use super::job_command::{Asked, run_asked};
use super::results::default_path;
use super::slurm::SlurmArguments;
use super::{Common, design_slurm, input};
use crate::design::Study;
use clap::Args;
use std::path::PathBuf;
use std::time::Duration;

/// Name of the command and of its kind of job.
const COMMAND: &str = "design";

#[derive(Args)]
pub(super) struct DesignArguments {
    /// Study file (study/1).
    study: PathBuf,
    /// Seed [default: the study's].
    #[arg(long)]
    seed: Option<u64>,
    /// Skip the verification by calibration on synthetic noisy scans.
    #[arg(long)]
    no_verify: bool,
    /// Start afresh even where a checkpoint exists.
    #[arg(long)]
    restart: bool,
    /// Stop after this many minutes, as by Ctrl-C: what was found is written, the same command goes on.
    #[arg(long, value_name = "MINUTES", allow_hyphen_values = true)]
    time_limit: Option<f64>,
    #[command(flatten)]
    slurm: SlurmArguments,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(a: &DesignArguments) -> Result<(), CliError> {
    super::start_threads(&a.common)?;
    let limit = time_limit(a.time_limit)?;
    let source = a.study.display().to_string();
    let mut asked =
        Asked { kind: COMMAND, request: input::read_study(&a.study)?, sources: vec![(String::new(), source)] };
    if let Some(seed) = a.seed {
        asked.set("seed", seed, "--seed");
    }
    if a.no_verify {
        asked.set("verification/is_on", false, "--no-verify");
    }
    let folder = default_path(a.common.out.as_deref(), &a.study, COMMAND);
    if a.slurm.array.slurm {
        // The job checks the study; what is left is to read it.
        asked.job()?;
        let study = Study::from_request(&asked.request).map_err(|errors| asked.explained(&errors))?;
        let (folder, seed) = design_slurm::search_on_cluster(&a.slurm, &study, &folder, &a.common)?;
        asked.set("seed", seed, "--seed");
        let common = Common { json: a.common.json, out: Some(folder), threads: a.common.threads };
        return run_asked(&asked, &common, &a.study, COMMAND, limit);
    }
    let checkpoint = folder.join("checkpoint.jsonl");
    if a.restart && !(a.common.json && a.common.out.is_none()) && checkpoint.exists() {
        std::fs::remove_file(&checkpoint).map_err(|source| CliError::Write { path: checkpoint, source })?;
    }
    run_asked(&asked, &a.common, &a.study, COMMAND, limit)?;
    for name in ["unfinished-design.json", "unfinished-best-specimen.json"] {
        // What a stopped run left is out of date now; it may not be there.
        let _ = std::fs::remove_file(folder.join(name));
    }
    Ok(())
}

/// The option as a duration.
fn time_limit(minutes: Option<f64>) -> Result<Option<Duration>, CliError> {
    let Some(minutes) = minutes else { return Ok(None) };
    if !(minutes > 0.0 && minutes <= 1e6) {
        let message = format!("{minutes} is not a number of minutes above 0 and at most 1000000");
        return Err(CliError::Option { option: "time-limit", message });
    }
    Ok(Some(Duration::from_secs_f64(60.0 * minutes)))
}
