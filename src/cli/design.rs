//! `lambdak design`.

use super::error::CliError;
use super::progress::Bar;
use super::slurm::SlurmArguments;
use super::{Common, design_slurm, input, interrupt, output};
use crate::calibration::{ParameterSpread, VerifyOptions, verify_in_full};
use crate::design::{
    Checkpoint, DesignEntry, DesignResult, MaterialVerification, Progress, SearchError, Study, Unfinished,
    VerificationSettings, search, study_hash,
};
use crate::fem::ForwardModel;
use crate::material::Ogden;
use crate::mesh::MeshOptions;
use crate::provenance::input_hash;
use crate::report::{DesignPictures, deformed_picture, design_report, histogram_picture};
use crate::sensitivity::{DriveSelection, EvaluationOptions, evaluate_model};
use crate::specimen::{Specimen, to_dxf, to_stl, to_svg};
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

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
    #[arg(long, value_name = "MINUTES")]
    time_limit: Option<f64>,
    #[command(flatten)]
    slurm: SlurmArguments,
    #[command(flatten)]
    common: Common,
}

/// Files of a stopped run, beside its checkpoint.
const UNFINISHED: [&str; 2] = ["unfinished-design.json", "unfinished-best-specimen.json"];

pub(super) fn run(a: &DesignArguments) -> Result<(), CliError> {
    super::start_threads(&a.common)?;
    let folder_of_study = a.study.parent().unwrap_or(Path::new("."));
    let mut study = Study::from_json(&input::read_text(&a.study)?, folder_of_study)
        .map_err(|e| CliError::Input { path: a.study.clone(), message: e.to_string() })?;
    study.seed = a.seed.unwrap_or(study.seed);
    if a.no_verify {
        study.verification.is_on = false;
    }
    if a.slurm.array.slurm {
        let (folder, seed) = design_slurm::search_on_cluster(&a.slurm, &study, &a.study, &a.common)?;
        study.seed = seed;
        return run_search(&study, Some(&folder), false, a);
    }
    let folder = output::folder(a.common.out.as_deref(), a.common.json, &a.study);
    run_search(&study, folder.as_deref(), a.restart, a)
}

/// Searches, verifies and writes; takes up a checkpoint in `folder`.
fn run_search(study: &Study, folder: Option<&Path>, is_restart: bool, a: &DesignArguments) -> Result<(), CliError> {
    let checkpoint = match folder {
        None => Checkpoint::in_memory(),
        Some(folder) => {
            std::fs::create_dir_all(folder).map_err(|source| CliError::Write { path: folder.into(), source })?;
            let path = folder.join("checkpoint.jsonl");
            if is_restart && path.exists() {
                std::fs::remove_file(&path).map_err(|source| CliError::Write { path: path.clone(), source })?;
            }
            // The search does not depend on the verification: a search without it can be verified later.
            let searched = Study { verification: VerificationSettings::default(), ..study.clone() };
            Checkpoint::open(&path, &study_hash(&searched))
                .map_err(|e| CliError::Input { path, message: e.to_string() })?
        }
    };
    if checkpoint.num_resumed() > 0 {
        eprintln!("resuming: {} evaluations taken from the checkpoint", checkpoint.num_resumed());
    }
    let started = std::time::Instant::now();
    let limit = time_limit(a.time_limit)?;
    let is_stopped = || interrupt::is_requested() || limit.is_some_and(|limit| started.elapsed() >= limit);
    let bar = Bar::new();
    let found = match search(study, &checkpoint, &|p| bar.show(p), &is_stopped) {
        Ok(found) => found,
        Err(SearchError::Stopped { unfinished }) => {
            bar.clear();
            return Err(stop(&unfinished, folder));
        }
        Err(other) => {
            bar.clear();
            return Err(CliError::Numerics(other.to_string()));
        }
    };
    let Some(mut result) = DesignResult::new(study, &found) else {
        return Err(CliError::Numerics("nothing was confirmed".into()));
    };
    if study.verification.is_on {
        match verify_both(study, &result, &checkpoint, &bar, &is_stopped)? {
            Some(verified) => result.add_verification(verified),
            None => {
                bar.clear();
                return Err(stop(&found.unfinished(study, "verify"), folder));
            }
        }
    }
    bar.clear();
    if let Some(message) = checkpoint.write_failure() {
        eprintln!("lambdak: the checkpoint could not be written to the end ({message}); the result is complete");
    }
    if let Some(folder) = folder {
        output::write_file(folder, "design.json", output::to_json(&result)?.as_bytes())?;
        write_report(study, &result, folder)?;
        output::write_file(folder, "best-specimen.json", best_specimen(&result).to_json().as_bytes())?;
        for name in UNFINISHED {
            // What a stopped run left is out of date now; it may not be there.
            let _ = std::fs::remove_file(folder.join(name));
        }
    }
    output::print(&if a.common.json { output::to_json(&result)? } else { summary(&result, folder) })
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

/// Writes what a stopped run has found, marked as unfinished; the error that ends the run.
fn stop(unfinished: &Unfinished, folder: Option<&Path>) -> CliError {
    let Some(folder) = folder else {
        // Nothing is on disk: the caller of --json gets it all the same.
        return match output::to_json(unfinished).and_then(|json| output::print(&json)) {
            Err(error) => error,
            Ok(()) => CliError::Interrupted(unfinished.summary()),
        };
    };
    let written = output::to_json(unfinished).and_then(|json| {
        output::write_file(folder, UNFINISHED[0], json.as_bytes())?;
        if let Some(best) = &unfinished.best {
            let mut specimen = best.specimen.clone();
            specimen.name = format!("{} (unfinished search for: {})", specimen.name, unfinished.name);
            output::write_file(folder, UNFINISHED[1], specimen.to_json().as_bytes())?;
        }
        Ok(())
    });
    match written {
        Err(error) => error,
        Ok(()) => CliError::Interrupted(format!(
            "{}. What was found is in {}; run the same command again to go on",
            unfinished.summary(),
            folder.join(UNFINISHED[0]).display()
        )),
    }
}

/// The page, and what the mould maker needs.
fn write_report(study: &Study, result: &DesignResult, folder: &Path) -> Result<(), CliError> {
    let pictures = pictures(study, result)?;
    output::write_file(folder, "report.html", design_report(result, &pictures).as_bytes())?;
    let best = best_specimen(result);
    output::write_file(folder, "best-specimen.svg", to_svg(&best).as_bytes())?;
    output::write_file(folder, "best-specimen.dxf", to_dxf(&best).as_bytes())?;
    let stl = to_stl(&best).map_err(|e| CliError::Numerics(e.to_string()))?;
    output::write_file(folder, "best-specimen.stl", &stl)?;
    Ok(())
}

/// Base and best once more, for the pictures that need fields.
fn pictures(study: &Study, result: &DesignResult) -> Result<DesignPictures, CliError> {
    let material = &study.materials[0].material;
    let mut evaluated = Vec::new();
    let mut deformed = Vec::new();
    for (label, specimen) in [("base", &result.base.specimen), ("best", &result.best.specimen)] {
        let options =
            EvaluationOptions { mesh: MeshOptions::search(specimen), ..EvaluationOptions::standard(specimen) };
        let failed = |e: &dyn std::fmt::Display| CliError::Numerics(format!("pictures: {e}"));
        let mut model = ForwardModel::of_specimen(specimen, &options.mesh).map_err(|e| failed(&e))?;
        let drives = DriveSelection::DriveMm(specimen.drive_mm.clone());
        let (_, maps) = evaluate_model(&mut model, specimen, material, &study.scan, &drives, &options, &|| false)
            .map_err(|e| failed(&e))?;
        if let Some(state) = maps.equilibria.last() {
            let svg = deformed_picture(&model, material, state).map_err(|e| failed(&e))?;
            deformed.push((svg, format!("{label}: {}", specimen.name)));
        }
        evaluated.push((label, maps));
    }
    let panels: Vec<_> = evaluated.iter().map(|(label, maps)| ((*label).to_string(), maps, 0)).collect();
    Ok(DesignPictures { histogram: histogram_picture(&panels), deformed })
}

/// The winner under a name of its own.
fn best_specimen(result: &DesignResult) -> Specimen {
    let mut specimen = result.best.specimen.clone();
    specimen.name = format!("{} (designed for: {})", specimen.name, result.name);
    specimen
}

/// Both specimens with every material, `None` where it was stopped. What is done is kept in the checkpoint.
fn verify_both(
    study: &Study,
    result: &DesignResult,
    checkpoint: &Checkpoint,
    bar: &Bar,
    is_stopped: &(dyn Fn() -> bool + Sync),
) -> Result<Option<Vec<MaterialVerification>>, CliError> {
    let draws = study.verification.draws;
    let total = 2 * study.materials.len() * draws;
    let done = AtomicUsize::new(0);
    let mut error = None;
    let mut of = |specimen: &Specimen, material: &Ogden| -> Option<(Vec<ParameterSpread>, Option<String>)> {
        let options = VerifyOptions::new(specimen, draws, study.seed);
        let before = done.load(Ordering::Relaxed);
        let on_draw = || {
            let count = done.fetch_add(1, Ordering::Relaxed) + 1;
            bar.show(&Progress { stage: "verify", done: count, total, best: Some(result.best.objective) });
        };
        let key = input_hash(&serde_json::json!({
            "specimen": specimen, "material": material, "kind": "verification", "truth_mesh": options.truth_mesh,
            "fit_mesh": options.fit_mesh, "max_iterations": options.fit.max_iterations,
        }));
        let verified = checkpoint.get_or(&key, || {
            match verify_in_full(specimen, material, &study.scan, &options, &on_draw, is_stopped) {
                Ok(found) => {
                    let reason = found.fits.iter().find_map(|fit| fit.as_ref().err().map(ToString::to_string));
                    Some((found.spreads, reason))
                }
                Err(e) => {
                    error = Some(e);
                    None
                }
            }
        });
        done.store(before + draws, Ordering::Relaxed);
        verified
    };
    let mut verified = Vec::new();
    for prior in &study.materials {
        let best = of(&result.best.specimen, &prior.material);
        let base = best.as_ref().and_then(|_| of(&result.base.specimen, &prior.material));
        match (best, base) {
            (Some((best, best_failure)), Some((base, base_failure))) => {
                let material = prior.name.clone();
                verified.push(MaterialVerification { material, best, base, best_failure, base_failure });
            }
            _ if is_stopped() => return Ok(None),
            _ => {
                let cause = error.map_or_else(String::new, |e| e.to_string());
                return Err(CliError::Numerics(format!("verification: {cause}")));
            }
        }
    }
    Ok(Some(verified))
}

/// The result as text.
fn summary(result: &DesignResult, folder: Option<&Path>) -> String {
    let mut text = format!("{}\n\n", result.name);
    for sentence in &result.findings {
        text += &format!("* {sentence}\n");
    }
    text += "\n  design                                     drive mm   force N   gain   closest limit\n";
    let line = |label: &str, e: &DesignEntry| {
        format!(
            "  {:<42} {:>8.2} {:>9.2} {:>6.3}   {}\n",
            label,
            e.specimen.drive_mm.last().copied().unwrap_or(0.0),
            e.force_n(),
            e.objective,
            if e.is_within_limits { e.closest_limit.clone() } else { format!("not kept: {}", e.not_kept()) }
        )
    };
    text += &line("base", &result.base);
    for (index, entry) in result.ranked.iter().take(8).enumerate() {
        text += &line(&format!("{}. {}", index + 1, entry.specimen.name), entry);
    }
    text += "\n  gains of the best over the base (above 1: better)\n";
    text += "  material     parameter   integrated sensitivity   promised standard deviation\n";
    for g in &result.best.gains {
        let show = |v: Option<f64>| v.map_or("-".into(), |v| format!("{v:.3}"));
        text += &format!(
            "  {:<12} {:<11} {:>22} {:>29}\n",
            g.material,
            g.parameter,
            show(g.integrated_sensitivity),
            show(g.promised_sd)
        );
    }
    for v in &result.verification_by_material {
        text += &format!("\n  verification on synthetic noisy scans, material \"{}\"\n", v.material);
        text += "  specimen   parameter        truth         mean     found sd   promised sd   ratio   draws\n";
        for (label, list) in [("best", &v.best), ("base", &v.base)] {
            for p in list {
                let show = |v: Option<f64>, digits: usize| {
                    v.filter(|v| v.is_finite()).map_or("-".into(), |v| format!("{v:.digits$}"))
                };
                let ratio = p.promised_sd.map(|sd| p.found_sd / sd);
                text += &format!(
                    "  {:<10} {:<10} {:>11.4} {:>12} {:>12} {:>13} {:>7} {:>7}\n",
                    label,
                    p.parameter,
                    p.truth,
                    show(Some(p.mean), 4),
                    show(Some(p.found_sd), 4),
                    show(p.promised_sd, 4),
                    show(ratio, 2),
                    p.draws
                );
            }
        }
    }
    for sentence in result.verification_failures() {
        text += &format!("\n* {sentence}\n");
    }
    if let Some(folder) = folder {
        text += &format!("\nreport: {}\n", folder.join("report.html").display());
    }
    text
}
