//! `lambdak evaluate`.

use super::error::CliError;
use super::solve::solve_error;
use super::{Common, Subject, input, interrupt, output};
use crate::report::{bar_pictures, histogram_picture, map_pictures};
use crate::sensitivity::{
    DriveSelection, Evaluation, EvaluationError, EvaluationMaps, EvaluationOptions, PartialVoxels, ScanSettings,
    evaluate,
};
use clap::Args;
use std::path::Path;

#[derive(Args)]
pub(super) struct EvaluateArguments {
    #[command(flatten)]
    subject: Subject,
    /// Evaluate at the drive that reaches this median stretch instead of at given drives.
    #[arg(long, conflicts_with = "drive")]
    median_stretch: Option<f64>,
    /// Voxel size in mm: x,y,z.
    #[arg(long, default_value = "1,0.1875,0.75")]
    voxel: String,
    /// Noise of the displacement in mm, one standard deviation: one number or x,y,z.
    #[arg(long, default_value = "0.05")]
    noise: String,
    /// Noise of the load cell in N, one standard deviation.
    #[arg(long, default_value_t = 0.02)]
    force_sd: f64,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(a: &EvaluateArguments) -> Result<(), CliError> {
    super::start_threads(&a.common)?;
    let specimen = input::read_specimen(&a.subject.specimen)?;
    let material = input::read_material(a.subject.material.as_deref())?;
    let scan = ScanSettings {
        voxel_mm: input::triple("voxel", &a.voxel)?,
        noise_sd_mm: input::triple("noise", &a.noise)?,
        force_sd_n: a.force_sd,
        partial_voxels: PartialVoxels::default(),
    };
    let drives = match a.median_stretch {
        Some(target) => DriveSelection::MedianStretch(target),
        None if a.subject.drive.is_empty() => DriveSelection::DriveMm(specimen.drive_mm.clone()),
        None => DriveSelection::DriveMm(a.subject.drive.clone()),
    };
    let options = EvaluationOptions {
        mesh: input::mesh_options(&a.subject.mesh, &specimen, !a.subject.full)?,
        ..EvaluationOptions::standard(&specimen)
    };
    if !a.common.json {
        eprintln!("evaluating {}", specimen.name);
    }
    let (evaluation, maps) = evaluate(&specimen, &material, &scan, &drives, &options, &interrupt::is_requested)
        .map_err(|e| evaluation_error(&a.subject.specimen, e))?;
    if let Some(folder) = output::folder(a.common.out.as_deref(), a.common.json, &a.subject.specimen) {
        write_files(&folder, &evaluation, &maps)?;
    }
    output::print(&if a.common.json { output::to_json(&evaluation)? } else { summary(&specimen.name, &evaluation) })
}

fn write_files(folder: &Path, evaluation: &Evaluation, maps: &EvaluationMaps) -> Result<(), CliError> {
    output::write_file(folder, "evaluation.json", output::to_json(evaluation)?.as_bytes())?;
    let panels: Vec<_> =
        maps.drives.iter().enumerate().map(|(index, d)| (format!("drive {:.2} mm", d.drive_mm), maps, index)).collect();
    output::write_file(folder, "histogram.svg", histogram_picture(&panels).as_bytes())?;
    for (name, svg) in map_pictures(maps).into_iter().chain(bar_pictures(evaluation)) {
        output::write_file(folder, &format!("{name}.svg"), svg.as_bytes())?;
    }
    Ok(())
}

pub(super) fn evaluation_error(path: &Path, error: EvaluationError) -> CliError {
    match error {
        EvaluationError::Solve(e) => solve_error(e),
        EvaluationError::MedianStretchNotReached { .. } => CliError::Numerics(error.to_string()),
        other => CliError::Input { path: path.into(), message: other.to_string() },
    }
}

/// The evaluation as text.
fn summary(name: &str, evaluation: &Evaluation) -> String {
    let mut text = format!("{name}\n");
    for step in &evaluation.steps {
        text += &format!(
            "\ndrive {} mm: force {:.3} N, {} voxels, median stretch {:.3}, largest {:.3}\n",
            step.drive_mm, step.force_n, step.num_voxels, step.median_stretch, step.largest_voxel_stretch
        );
        text += "  parameter   integrated sensitivity: sum   mean per voxel   volume integral (mm³)\n";
        for s in &step.integrated_sensitivity {
            text += &format!(
                "  {:<10} {:>29.1} {:>16.4} {:>23.1}\n",
                s.parameter, s.sum, s.mean_per_voxel, s.volume_integral
            );
        }
    }
    text += "\npromised standard deviations, all drives together\n";
    for p in &evaluation.promised_sd {
        text += &match (p.value, p.relative_sd) {
            (Some(sd), Some(relative)) => format!(
                "  {:<10} {:>12.4} ({:.2} %){}\n",
                p.parameter,
                sd,
                100.0 * relative,
                if p.identifiable { "" } else { "  not identifiable" }
            ),
            _ => format!("  {:<10} not determined by these data\n", p.parameter),
        };
    }
    text
}
