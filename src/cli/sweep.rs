//! `lambdak sweep`.

use super::error::CliError;
use super::job_command::{Asked, leave};
use super::results::{ResultsFolder, default_path};
use super::slurm::{SlurmArguments, own_program, path_text, run_array};
use super::task_bar::TaskBar;
use super::{Common, input, interrupt, output};
use crate::slurm::TaskProgress;
use crate::sweep::{
    RunOptions, Shard, StoreError, SweepError, SweepProgress, SweepStudy, collect, read_shard, run as run_sweep,
    shard_path,
};
use clap::{Args, Subcommand};
use serde_json::Value;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;

/// Name of the command and of its kind of job.
const COMMAND: &str = "sweep";

#[derive(Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(super) struct SweepArguments {
    #[command(subcommand)]
    command: Option<SweepCommand>,
    /// Study file (sweep-study/1).
    #[arg(required = true)]
    study: Option<PathBuf>,
    /// Run one of several shards, such as 2/4; put them together with `lambdak sweep merge`.
    #[arg(long, value_name = "I/N", conflicts_with = "slurm")]
    shard: Option<String>,
    #[command(flatten)]
    slurm: SlurmArguments,
    #[command(flatten)]
    common: Common,
}

#[derive(Subcommand)]
enum SweepCommand {
    /// Put the shards of one or several folders together: table, result and report.
    Merge(MergeArguments),
}

#[derive(Args)]
struct MergeArguments {
    /// Folders with shards of one study.
    #[arg(required = true)]
    folders: Vec<PathBuf>,
    /// Print the result as JSON on stdout.
    #[arg(long)]
    json: bool,
    /// Folder for table and report [default: the first one].
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
}

pub(super) fn run(a: &SweepArguments) -> Result<(), CliError> {
    match (&a.command, &a.study) {
        (Some(SweepCommand::Merge(merge)), _) => run_merge(merge),
        (None, Some(path)) => run_study(a, path),
        // Without a subcommand clap asks for the study.
        (None, None) => Err(CliError::Option { option: "study", message: "name a study".into() }),
    }
}

fn run_study(a: &SweepArguments, path: &Path) -> Result<(), CliError> {
    super::start_threads(&a.common)?;
    let shard = match &a.shard {
        None => Shard::WHOLE,
        Some(text) => Shard::parse(text).ok_or_else(|| CliError::Option {
            option: "shard",
            message: format!("'{text}' is not I/N with 1 ≤ I ≤ N ≤ 100000, such as 2/4"),
        })?,
    };
    let study = read_study(path)?;
    // Results must outlive the run: unlike other commands, a sweep has a folder even with --json.
    let folder = default_path(a.common.out.as_deref(), path, COMMAND);
    ResultsFolder::open(folder.clone(), COMMAND)?;
    keep_study(&study, &folder)?;
    if a.slurm.array.slurm {
        run_on_cluster(a, &study, &folder)?;
    } else {
        run_here(&study, &folder, shard)?;
        if shard != Shard::WHOLE && collected(&study, &[&folder])?.check_complete(study.num_tasks()).is_err() {
            eprintln!("shard {shard} is complete; when all are: lambdak sweep merge {}", folder.display());
            return Ok(());
        }
    }
    finish(&study, &[&folder], &folder, a.common.json)
}

fn read_study(path: &Path) -> Result<SweepStudy, CliError> {
    let source = path.display().to_string();
    let asked = Asked { kind: COMMAND, request: input::read_study(path)?, sources: vec![(String::new(), source)] };
    asked.job()?;
    SweepStudy::from_request(&asked.request).map_err(|errors| asked.explained(&errors))
}

/// Keeps the study, with all that it names, beside its results; refuses a folder that has another one.
fn keep_study(study: &SweepStudy, folder: &Path) -> Result<(), CliError> {
    let path = folder.join("study.json");
    if path.exists() {
        let (found, expected) = (read_study(&path)?.hash(), study.hash());
        if found != expected {
            return Err(StoreError::OtherStudy { path, found, expected }.into());
        }
        return Ok(());
    }
    output::write_file(folder, "study.json", output::to_json(study)?.as_bytes()).map(|_| ())
}

fn run_here(study: &SweepStudy, folder: &Path, shard: Shard) -> Result<(), CliError> {
    let bar = TaskBar::new();
    // Timings are no result: they stand in a file of their own, and where it cannot be written, nowhere.
    let timings_path = folder.join(format!("timings-{}-of-{}.csv", shard.index, shard.count));
    let timings = Mutex::new(OpenOptions::new().create(true).append(true).open(timings_path).ok());
    let done = run_sweep(
        study,
        folder,
        &RunOptions {
            shard,
            progress: &|p: &SweepProgress| bar.show(p.done, p.resumed, p.failed, p.total),
            observe: &|task, evaluate| {
                let start = Instant::now();
                let outcome = evaluate();
                if let Ok(mut file) = timings.lock()
                    && let Some(file) = file.as_mut()
                {
                    let _ = writeln!(file, "{},{:.4}", task.index, start.elapsed().as_secs_f64());
                }
                outcome
            },
            is_cancelled: &interrupt::is_requested,
        },
    );
    bar.clear();
    match done {
        Ok(_) => Ok(()),
        Err(e @ SweepError::Stopped { .. }) => {
            Err(CliError::Interrupted(format!("{e}. Run the same command again to go on from {}", folder.display())))
        }
        Err(SweepError::Store(e)) => Err(e.into()),
        Err(other) => Err(CliError::Numerics(other.to_string())),
    }
}

/// One shard per array task; each writes its own file.
fn run_on_cluster(a: &SweepArguments, study: &SweepStudy, folder: &Path) -> Result<(), CliError> {
    let absolute = std::fs::canonicalize(folder).map_err(|source| CliError::Read { path: folder.into(), source })?;
    let count = a.slurm.array.tasks;
    let threads = a.common.threads.unwrap_or(1);
    let command = vec![
        own_program()?,
        "sweep".into(),
        path_text(&absolute.join("study.json"))?,
        "--out".into(),
        path_text(&absolute)?,
        "--shard".into(),
        format!("{{task}}/{count}"),
        "--threads".into(),
        threads.to_string(),
    ];
    let (hash, num_tasks) = (study.hash(), study.num_tasks());
    let before = collected(study, &[folder])?;
    // A task's results: those of earlier runs, however they were divided, and those in its own file by now.
    let progress_of = |index: usize| -> Result<TaskProgress, String> {
        let shard = Shard { index, count };
        let path = shard_path(&absolute, shard);
        let own = if path.exists() { Some(read_shard(&path, &hash).map_err(|e| e.to_string())?) } else { None };
        let is_there =
            |t: &usize| before.outcomes.contains_key(t) || own.as_ref().is_some_and(|c| c.outcomes.contains_key(t));
        let done = shard.tasks(num_tasks).filter(is_there).count();
        Ok(TaskProgress { done, total: shard.tasks(num_tasks).count() })
    };
    let resumed = before.outcomes.len();
    let bar = TaskBar::new();
    let shown = run_array(&a.slurm, &study.name, &absolute, command, threads, &progress_of, &|p| {
        bar.show(p.done, resumed, 0, p.total);
    });
    bar.clear();
    shown
}

fn collected(study: &SweepStudy, folders: &[&Path]) -> Result<crate::sweep::Collected, CliError> {
    Ok(collect(folders, &study.hash())?)
}

fn run_merge(a: &MergeArguments) -> Result<(), CliError> {
    let folders: Vec<&Path> = a.folders.iter().map(PathBuf::as_path).collect();
    let study = read_study(&folders[0].join("study.json"))?;
    for folder in &folders[1..] {
        let path = folder.join("study.json");
        let (found, expected) = (read_study(&path)?.hash(), study.hash());
        if found != expected {
            return Err(StoreError::OtherStudy { path, found, expected }.into());
        }
    }
    if collected(&study, &folders)?.shards.is_empty() {
        return Err(StoreError::Empty { path: folders[0].into() }.into());
    }
    finish(&study, &folders, a.out.as_deref().unwrap_or(folders[0]), a.json)
}

/// Table, result and report of a complete sweep.
fn finish(study: &SweepStudy, folders: &[&Path], out: &Path, is_json: bool) -> Result<(), CliError> {
    let results = collected(study, folders)?;
    results.check_complete(study.num_tasks())?;
    let asked = Asked { kind: COMMAND, request: json(study)?, sources: Vec::new() };
    let outcomes = results.outcomes.values().map(json).collect::<Result<Vec<_>, CliError>>()?;
    let gathered = asked.job()?.gather(outcomes.into_iter().map(Ok).collect());
    let outcome = gathered.map_err(|e| asked.failure(e, None))?;
    leave(&outcome, Some(&ResultsFolder::open(out.to_path_buf(), COMMAND)?), is_json)
}

fn json<T: serde::Serialize>(value: &T) -> Result<Value, CliError> {
    serde_json::to_value(value).map_err(|e| CliError::Numerics(e.to_string()))
}
