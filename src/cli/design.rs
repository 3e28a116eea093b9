//! `lambdak design`.

use super::error::CliError;
use super::progress::Bar;
use super::slurm::SlurmArguments;
use super::{Common, design_slurm, input, interrupt, output};
use crate::calibration::{CalibrationError, ParameterSpread, VerifyOptions, verify};
use crate::design::{
    Checkpoint, DesignEntry, DesignResult, MaterialVerification, SearchError, Study, VerificationSettings, search,
    study_hash,
};
use crate::fem::ForwardModel;
use crate::mesh::MeshOptions;
use crate::report::{DesignPictures, deformed_picture, design_report, histogram_picture};
use crate::sensitivity::{DriveSelection, EvaluationOptions, evaluate_model};
use crate::specimen::{Specimen, to_dxf, to_stl, to_svg};
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

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
    #[command(flatten)]
    slurm: SlurmArguments,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(a: &DesignArguments) -> Result<(), CliError> {
    super::start_threads(&a.common)?;
    let folder_of_study = a.study.parent().unwrap_or(Path::new("."));
    let mut study = Study::from_json(&input::read_text(&a.study)?, folder_of_study)
        .map_err(|e| CliError::Input { path: a.study.clone(), message: e.to_string() })?;
    study.seed = a.seed.unwrap_or(study.seed);
    if a.no_verify {
        study.verification.is_on = false;
    }
    if a.slurm.slurm {
        let (folder, seed) = design_slurm::search_on_cluster(&a.slurm, &study, &a.study, &a.common)?;
        study.seed = seed;
        return run_search(&study, Some(&folder), false, a.common.json);
    }
    let folder = output::folder(a.common.out.as_deref(), a.common.json, &a.study);
    run_search(&study, folder.as_deref(), a.restart, a.common.json)
}

/// Searches, verifies and writes; takes up a checkpoint in `folder`.
fn run_search(study: &Study, folder: Option<&Path>, is_restart: bool, is_json: bool) -> Result<(), CliError> {
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
    let bar = Bar::new();
    let found = search(study, &checkpoint, &|p| bar.show(p), &interrupt::is_requested).map_err(|e| {
        bar.clear();
        search_error(e, folder)
    })?;
    let Some(mut result) = DesignResult::new(study, &found) else {
        return Err(CliError::Numerics("nothing was confirmed".into()));
    };
    if study.verification.is_on {
        let verified = verify_both(study, &result, &bar)?;
        result.add_verification(verified);
    }
    bar.clear();
    if let Some(message) = checkpoint.write_failure() {
        eprintln!("lambdak: the checkpoint could not be written to the end ({message}); the result is complete");
    }
    if let Some(folder) = folder {
        output::write_file(folder, "design.json", output::to_json(&result)?.as_bytes())?;
        write_report(study, &result, folder)?;
        output::write_file(folder, "best-specimen.json", best_specimen(&result).to_json().as_bytes())?;
    }
    output::print(&if is_json { output::to_json(&result)? } else { summary(&result, folder) })
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

fn search_error(error: SearchError, folder: Option<&Path>) -> CliError {
    match error {
        SearchError::Stopped { .. } => CliError::Interrupted(match folder {
            Some(folder) => format!("{error}. Run the same command again to go on from {}", folder.display()),
            None => error.to_string(),
        }),
        other => CliError::Numerics(other.to_string()),
    }
}

fn verify_both(study: &Study, result: &DesignResult, bar: &Bar) -> Result<Vec<MaterialVerification>, CliError> {
    let draws = study.verification.draws;
    let total = 2 * study.materials.len() * draws;
    let done = AtomicUsize::new(0);
    let of = |specimen: &Specimen, material: &crate::material::Ogden| -> Result<Vec<ParameterSpread>, CliError> {
        let options = VerifyOptions::new(specimen, draws, study.seed);
        let on_draw = || {
            let count = done.fetch_add(1, Ordering::Relaxed) + 1;
            bar.show(&crate::design::Progress {
                stage: "verify",
                done: count,
                total,
                best: Some(result.best.objective),
            });
        };
        verify(specimen, material, &study.scan, &options, &on_draw, &interrupt::is_requested).map_err(
            |e: CalibrationError| {
                if interrupt::is_requested() {
                    CliError::Interrupted("the search is kept; run the same command again to verify".into())
                } else {
                    CliError::Numerics(format!("verification: {e}"))
                }
            },
        )
    };
    study
        .materials
        .iter()
        .map(|prior| {
            Ok(MaterialVerification {
                material: prior.name.clone(),
                best: of(&result.best.specimen, &prior.material)?,
                base: of(&result.base.specimen, &prior.material)?,
            })
        })
        .collect()
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
            if e.is_within_limits { e.closest_limit.clone() } else { "breaks a limit or the guard".into() }
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
                let (promised, ratio) = match p.promised_sd {
                    Some(sd) => (format!("{sd:.4}"), format!("{:.2}", p.found_sd / sd)),
                    None => ("-".into(), "-".into()),
                };
                text += &format!(
                    "  {:<10} {:<10} {:>11.4} {:>12.4} {:>12.4} {:>13} {:>7} {:>7}\n",
                    label, p.parameter, p.truth, p.mean, p.found_sd, promised, ratio, p.draws
                );
            }
        }
    }
    if let Some(folder) = folder {
        text += &format!("\nreport: {}\n", folder.join("report.html").display());
    }
    text
}
