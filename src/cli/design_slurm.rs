//! `lambdak design --slurm`: searches from several seeds as a job array, of which the best is taken.
//!
//! A search decides each round from the one before, so that it does not split into independent tasks; whole searches
//! do. Each seed's search is the one that `lambdak design --seed` runs, to the bit, and the winner does not depend on
//! which ends first.

use super::error::CliError;
use super::slurm::{SlurmArguments, own_program, path_text, run_array};
use super::task_bar::TaskBar;
use super::{Common, input, output};
use crate::design::{DesignResult, Study, study_hash};
use crate::slurm::TaskProgress;
use std::path::{Path, PathBuf};

/// Runs a search for each of the seeds `study.seed`, `study.seed` + 1, … as array tasks. Returns the folder and the
/// seed of the one with the largest objective, of equal ones the smallest seed.
pub(super) fn search_on_cluster(
    a: &SlurmArguments,
    study: &Study,
    folder: &Path,
    common: &Common,
) -> Result<(PathBuf, u64), CliError> {
    let kept = folder.join("study.json");
    let text = study_text(study)?;
    if kept.exists() {
        if input::read_text(&kept)? != text {
            let message = "it belongs to another study; choose another --out folder or restore the study".into();
            return Err(CliError::Input { path: kept, message });
        }
    } else {
        output::write_file(folder, "study.json", text.as_bytes())?;
    }
    let folder = std::fs::canonicalize(folder).map_err(|source| CliError::Read { path: folder.into(), source })?;
    let threads = common.threads.unwrap_or(1);
    // bash adds the task's number to the first seed.
    let program = own_program()?;
    let inner = format!(
        "seed=$(({} + $2 - 1)); exec \"$0\" design \"$1/study.json\" --seed \"$seed\" --no-verify --threads {threads} --out \"$1/seed-$seed\"",
        study.seed
    );
    let command = vec!["bash".into(), "-c".into(), inner, program, path_text(&folder)?, "{task}".into()];
    let seed_of = |task: usize| study.seed.wrapping_add(task as u64 - 1);
    let progress_of = |task: usize| -> Result<TaskProgress, String> {
        let done = found(study, &folder, seed_of(task)).map_err(|e| e.to_string())?.is_some();
        Ok(TaskProgress { done: usize::from(done), total: 1 })
    };
    let bar = TaskBar::new();
    let ran = run_array(a, &study.name, &folder, command, threads, &progress_of, &|p| bar.show(p.done, 0, 0, p.total));
    bar.clear();
    ran?;
    let mut best: Option<(f64, u64)> = None;
    for task in 1..=a.array.tasks {
        let seed = seed_of(task);
        let Some(result) = found(study, &folder, seed)? else { continue };
        eprintln!("seed {seed}: objective {:.4} ({})", result.best.objective, result.best.specimen.name);
        if best.is_none_or(|(objective, _)| result.best.objective > objective) {
            best = Some((result.best.objective, seed));
        }
    }
    let Some((objective, seed)) = best else { return Err(CliError::Cluster("no search left a result".into())) };
    eprintln!("best: seed {seed} with {objective:.4}; its result is verified now");
    Ok((folder.join(format!("seed-{seed}")), seed))
}

/// The study with all that it names, as a file that nodes can read without the others.
fn study_text(study: &Study) -> Result<String, CliError> {
    let mut value = serde_json::to_value(study).map_err(|e| CliError::Numerics(e.to_string()))?;
    if let Some(object) = value.as_object_mut() {
        object.insert("schema".into(), "study/1".into());
    }
    output::to_json(&value)
}

/// The result of one seed's search; none where it has not ended.
fn found(study: &Study, folder: &Path, seed: u64) -> Result<Option<DesignResult>, CliError> {
    let path = folder.join(format!("seed-{seed}")).join("design.json");
    if !path.exists() {
        return Ok(None);
    }
    let result: DesignResult = serde_json::from_str(&input::read_text(&path)?)
        .map_err(|e| CliError::Input { path: path.clone(), message: e.to_string() })?;
    // The hash holds the seed; the search's tasks run without the verification.
    let mut own = study.clone();
    own.seed = seed;
    let with = study_hash(&own);
    own.verification.is_on = false;
    if result.input_hash == with || result.input_hash == study_hash(&own) {
        return Ok(Some(result));
    }
    let message = "it is the result of another study or version; choose another --out folder".into();
    Err(CliError::Input { path, message })
}
