//! `lambdak scan`.

use super::error::CliError;
use super::solve::{prepare_error, solve_error};
use super::{Common, Subject, input, interrupt, output};
use crate::acquisition::{
    AcquisitionError, KSpace, LoadProgram, ReconstructOptions, Reconstruction, Scan, ScanOptions, ScanResult, Window,
    reconstruct, scan,
};
use crate::fem::SolveOptions;
use crate::provenance::input_hash;
use crate::recording::{Filter, RecordingError, write_vectors};
use crate::report::{displacement_picture, raw_picture};
use clap::Args;
use std::path::Path;

#[derive(Args)]
pub(super) struct ScanArguments {
    #[command(flatten)]
    subject: Subject,
    /// Voxel size in mm: x,y,z.
    #[arg(long, default_value = "1,0.1875,0.75")]
    voxel: String,
    /// Offset of the grid from the specimen's centre in voxels: x,y,z (each from -1 to 1).
    #[arg(long, default_value = "0", allow_hyphen_values = true)]
    offset: String,
    /// Signal-to-noise ratio of a full voxel: one number or x,y,z [default: from --noise].
    #[arg(long, conflicts_with = "noise")]
    snr: Option<String>,
    /// Noise of a full voxel's displacement in mm, one standard deviation: one number or x,y,z.
    #[arg(long, default_value = "0.01")]
    noise: String,
    /// Displacement per phase in mm/rad: one number or x,y,z (a turn is 2π times this).
    #[arg(long, default_value = "0.15915494309189535")]
    mm_per_radian: String,
    /// Write wrapped phases and magnitudes instead of displacements.
    #[arg(long)]
    raw: bool,
    /// Filter on the displacements: none or hamming2.
    #[arg(long, default_value = "none")]
    filter: String,
    /// Part of k-space kept along each axis, above 0 up to 1: one number or x,y,z [default: all].
    #[arg(long)]
    kspace: Option<String>,
    /// Weight the kept part of k-space with a Hamming window.
    #[arg(long)]
    apodise: bool,
    /// Noise of the load cell's mean in N (slow drift), one standard deviation.
    #[arg(long, default_value_t = 0.02)]
    force_sd: f64,
    /// Seed of all noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    common: Common,
}

/// `none` or `hamming2`.
pub(super) fn filter(text: &str) -> Result<Filter, CliError> {
    match text {
        "none" => Ok(Filter::None),
        "hamming2" => Ok(Filter::Hamming2),
        other => Err(CliError::Option { option: "filter", message: format!("'{other}' is not none or hamming2") }),
    }
}

pub(super) fn run(a: &ScanArguments) -> Result<(), CliError> {
    super::start_threads(&a.common)?;
    let mut specimen = input::read_specimen(&a.subject.specimen)?;
    let material = input::read_material(a.subject.material.as_deref())?;
    if !a.subject.drive.is_empty() {
        specimen.drive_mm.clone_from(&a.subject.drive);
        specimen.validate().map_err(|e| CliError::Option { option: "drive", message: e.to_string() })?;
    }
    let filter = filter(&a.filter)?;
    if a.raw && filter != Filter::None {
        let message = "the filter belongs to displacements; leave out --raw or the filter".to_string();
        return Err(CliError::Option { option: "filter", message });
    }
    let mesh = input::mesh_options(&a.subject.mesh, &specimen, !a.subject.full)?;
    let options = scan_options(a, &specimen)?;
    let hash = input_hash(&serde_json::json!({
        "specimen": specimen, "material": material, "mesh": mesh, "scan": options, "filter": filter, "raw": a.raw,
    }));
    if !a.common.json {
        eprintln!("scanning {} at {} drives", specimen.name, specimen.drive_mm.len());
    }
    let id = format!("{}-seed-{}", a.subject.specimen.file_stem().unwrap_or_default().to_string_lossy(), options.seed);
    let mut made = scan(&id, &specimen, &material, &mesh, &SolveOptions::default(), &options, &interrupt::is_requested)
        .map_err(|e| acquisition_error(a, e))?;
    made.raw.notes = Some(serde_json::json!({
        "synthetic": { "program": format!("lambdak {}", crate::provenance::VERSION), "input_hash": hash, "seed": options.seed },
    }));
    let found = if a.raw {
        None
    } else {
        let settings = ReconstructOptions { filter, ..ReconstructOptions::default() };
        Some(reconstruct(&made.raw, &settings).map_err(|e| acquisition_error(a, e))?)
    };
    let result = ScanResult::new(&made, &options, found.as_ref(), hash).map_err(|e| acquisition_error(a, e))?;
    let folder = output::folder(a.common.out.as_deref(), a.common.json, &a.subject.specimen);
    if let Some(folder) = &folder {
        write_files(folder, &made, found.as_ref(), &result, &material)?;
    }
    if a.common.json {
        return output::print(&output::to_json(&result)?);
    }
    output::print(&summary(&specimen.name, &result, folder.as_deref()))
}

fn scan_options(a: &ScanArguments, specimen: &crate::specimen::Specimen) -> Result<ScanOptions, CliError> {
    let mm_per_radian = input::triple("mm-per-radian", &a.mm_per_radian)?;
    let snr = match &a.snr {
        Some(text) => input::triple("snr", text)?,
        None => {
            let noise = input::triple("noise", &a.noise)?;
            if let Some(bad) = noise.iter().find(|n| !(**n > 0.0)) {
                return Err(CliError::Option { option: "noise", message: format!("{bad} mm is not positive") });
            }
            [0, 1, 2].map(|axis| mm_per_radian[axis] / noise[axis])
        }
    };
    let kspace = match (&a.kspace, a.apodise) {
        (None, false) => None,
        (keep, is_apodised) => Some(KSpace {
            keep: keep.as_ref().map_or(Ok([1.0; 3]), |k| input::triple("kspace", k))?,
            window: if is_apodised { Window::Hamming } else { Window::None },
        }),
    };
    let voxel_mm = input::triple("voxel", &a.voxel)?;
    let offset = input::triple("offset", &a.offset)?;
    let grid = ScanOptions::grid_around(specimen, voxel_mm, 3, offset)
        .map_err(|e| CliError::Option { option: "voxel", message: e.to_string() })?;
    let load = LoadProgram { drift_sd_n: a.force_sd, ..LoadProgram::default() };
    Ok(ScanOptions { grid, mm_per_radian, snr, kspace, load, seed: a.seed })
}

fn write_files(
    folder: &Path,
    made: &Scan,
    found: Option<&Reconstruction>,
    result: &ScanResult,
    material: &crate::material::Ogden,
) -> Result<(), CliError> {
    match found {
        None => made.raw.write(folder).map_err(recording_error)?,
        Some(found) => {
            found.recording.write(folder).map_err(recording_error)?;
            for (n, sd) in found.sd_mm.iter().enumerate() {
                let name = format!("sd_{}.nii.gz", n + 1);
                write_vectors(folder, &name, &found.recording.grid, sd).map_err(recording_error)?;
            }
        }
    }
    let truth = serde_json::json!({ "material": material, "scan": result });
    output::write_file(folder, "scan.json", output::to_json(&truth)?.as_bytes())?;
    for n in 0..made.raw.steps.len() {
        let name = format!("raw_{}.svg", n + 1);
        output::write_file(folder, &name, raw_picture(&made.raw, n).as_bytes())?;
        if let Some(found) = found {
            let name = format!("displacement_{}.svg", n + 1);
            output::write_file(folder, &name, displacement_picture(&found.recording, n).as_bytes())?;
        }
    }
    Ok(())
}

/// A recording that could not be written; what cannot be read is told by the caller with its path.
pub(super) fn recording_error(error: RecordingError) -> CliError {
    match error {
        RecordingError::File { path, source } => CliError::Write { path, source },
        other => CliError::Numerics(other.to_string()),
    }
}

fn acquisition_error(a: &ScanArguments, error: AcquisitionError) -> CliError {
    match error {
        AcquisitionError::Prepare(e) => prepare_error(&a.subject, e),
        AcquisitionError::Solve(e) => solve_error(e),
        AcquisitionError::Value { .. } | AcquisitionError::Voxel(_) => {
            CliError::Option { option: "voxel, --snr, --noise, --kspace or --force-sd", message: error.to_string() }
        }
        AcquisitionError::Cancelled => CliError::Interrupted("nothing was written".into()),
        other => CliError::Numerics(other.to_string()),
    }
}

fn summary(name: &str, result: &ScanResult, folder: Option<&Path>) -> String {
    let mut text = format!("{name}: {} voxels, seed {}\n", result.num_voxels, result.seed);
    let list = |sd: [f64; 3]| sd.map(|x| format!("{x:.4}")).join(", ");
    if let Some(sd) = result.noise_at_full_signal_mm {
        text += &format!("noise at full signal (x, y, z): {} mm\n", list(sd));
    }
    if let Some(sd) = result.noise_sd_mm {
        text += &format!("noise of the displacements, estimated: {} mm\n", list(sd));
    }
    text += "\n  drive mm   force N   true N   axis    kept  low signal  disputed  inconsistent  unconnected   rms error mm\n";
    for step in &result.steps {
        let force = step.force_n.map_or("-".into(), |f| format!("{f:.4}"));
        text += &format!("{:>10.3} {force:>9} {:>8.4}", step.drive_mm, step.true_force_n);
        match (&step.reconstruction, &step.error) {
            (Some(report), Some(errors)) => {
                for (a, (c, e)) in report.components.iter().zip(errors).enumerate() {
                    if a > 0 {
                        text += &" ".repeat(29);
                    }
                    text += &format!(
                        "   {:<4} {:>7} {:>11} {:>9} {:>13} {:>12} {:>14.5}{}{}\n",
                        ["x", "y", "z"][a],
                        c.num_kept,
                        c.num_low_signal,
                        c.num_disputed,
                        c.num_inconsistent,
                        c.num_unconnected,
                        e.rms_mm,
                        if e.num_wrong_turns > 0 {
                            format!("  {} a turn off", e.num_wrong_turns)
                        } else {
                            String::new()
                        },
                        if c.anchor.is_ambiguous { "  whole turns uncertain" } else { "" },
                    );
                }
            }
            _ => text += "   raw phases\n",
        }
    }
    if let Some(folder) = folder {
        text += &format!(
            "\nrecording: {} (recording.json, images, load.csv, scan.json with the truth, pictures)\n",
            folder.display()
        );
    }
    text
}
