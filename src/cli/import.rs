//! `lambdak import`: raw phases, MATLAB files and point clouds become recordings of displacements.

use super::error::CliError;
use super::scan::{filter, recording_error};
use super::{Common, input, output};
use crate::acquisition::unwrap::{Method, UnwrapOptions};
use crate::acquisition::{Anchor, ReconstructOptions, StepReport, reconstruct};
use crate::file::{ReadError, read_text_limited};
use crate::provenance::VERSION;
use crate::recording::{
    ImportError, ImportOptions, LoadCurve, RawRecording, ReadLimits, Recording, RecordingError, mat, read_points,
    recording_from_mat, recording_from_points, write_vectors,
};
use crate::report::displacement_picture;
use crate::specimen::Specimen;
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};

#[derive(Args)]
pub(super) struct ImportArguments {
    /// A raw recording (folder or JSON file), MATLAB files (.mat), or point clouds (.csv, one per drive).
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Specimen file (specimen/1); needed for .mat and .csv.
    #[arg(long)]
    specimen: Option<PathBuf>,
    /// Drives in mm, comma-separated, one per step.
    #[arg(long, value_delimiter = ',')]
    drive: Vec<f64>,
    /// The files' unit of length: mm, m or um.
    #[arg(long, default_value = "mm")]
    unit: String,
    /// Axes along the indices of MATLAB arrays, such as y,z,x or -y,z,-x.
    #[arg(long, default_value = "y,z,x", allow_hyphen_values = true)]
    axes: String,
    /// Voxel size in mm: along the indices of MATLAB arrays, or x,y,z to average points in.
    #[arg(long)]
    voxel: Option<String>,
    /// Which of several separate regions of the mask, counted along the thickness from 1.
    #[arg(long)]
    region: Option<usize>,
    /// Filter: applied to raw phases after unwrapping; for other files the one that they went through.
    #[arg(long, default_value = "none")]
    filter: String,
    /// Noise of the displacement in mm, where known (.mat and .csv): one number or x,y,z.
    #[arg(long)]
    noise: Option<String>,
    /// Loading history (CSV: time_s,drive_mm,force_n).
    #[arg(long)]
    load: Option<PathBuf>,
    /// Unwrapping: margin, second-difference or least-squares.
    #[arg(long, default_value = "margin")]
    method: String,
    /// Keep voxels even where a second method finds another multiple of 2π.
    #[arg(long)]
    no_agreement: bool,
    /// Zero of the phase: whole-turns (phase zero is no displacement), fixed-plate (take off what the fixed plate shows), none.
    #[arg(long, default_value = "whole-turns")]
    anchor: String,
    #[command(flatten)]
    common: Common,
}

/// The result of an import.
#[derive(Serialize)]
struct ImportResult {
    schema: &'static str,
    version: &'static str,
    id: String,
    num_voxels: usize,
    noise_sd_mm: Option<[f64; 3]>,
    steps: Vec<ImportStep>,
}

#[derive(Serialize)]
struct ImportStep {
    drive_mm: f64,
    num_complete: usize,
    reconstruction: Option<StepReport>,
}

pub(super) fn run(a: &ImportArguments) -> Result<(), CliError> {
    super::start_threads(&a.common)?;
    let limits = ReadLimits::default();
    let first = &a.files[0];
    let kind = first.extension().and_then(|e| e.to_str()).map(str::to_lowercase);
    let (mut recording, sd, reports) = match kind.as_deref() {
        Some("mat") => (from_mat(a, &limits)?, vec![], vec![]),
        Some("csv") => (from_csv(a, &limits)?, vec![], vec![]),
        _ => {
            one_file(a)?;
            from_raw(a, &limits)?
        }
    };
    if let Some(path) = &a.load {
        let text = input::read_text(path)?;
        let load = LoadCurve::from_csv(&text, path).map_err(|e| bad(path, &e))?;
        recording.load = Some(load);
    }
    let folder = match (&a.common.out, a.common.json) {
        (None, false) => Some(Path::new("results").join(format!("{}-imported", recording.id))),
        (out, _) => out.clone(),
    };
    if let Some(folder) = &folder {
        if overwrites(first, folder) {
            let message = "the folder holds the file that is imported; choose another".to_string();
            return Err(CliError::Option { option: "out", message });
        }
        recording.write(folder).map_err(recording_error)?;
        for (n, sd) in sd.iter().enumerate() {
            write_vectors(folder, &format!("sd_{}.nii.gz", n + 1), &recording.grid, sd).map_err(recording_error)?;
        }
        for n in 0..recording.steps.len() {
            let name = format!("displacement_{}.svg", n + 1);
            output::write_file(folder, &name, displacement_picture(&recording, n).as_bytes())?;
        }
    }
    let mut reports = reports.into_iter();
    let is_complete = |u: &&[f64; 3]| u.iter().all(|x| x.is_finite());
    let result = ImportResult {
        schema: "import/1",
        version: VERSION,
        id: recording.id.clone(),
        num_voxels: recording.num_voxels(),
        noise_sd_mm: recording.noise_sd_mm,
        steps: recording
            .steps
            .iter()
            .map(|s| ImportStep {
                drive_mm: s.drive_mm,
                num_complete: s.displacement.iter().filter(is_complete).count(),
                reconstruction: reports.next(),
            })
            .collect(),
    };
    if let Some(folder) = &folder {
        output::write_file(folder, "import.json", output::to_json(&result)?.as_bytes())?;
    }
    output::print(&if a.common.json { output::to_json(&result)? } else { summary(&result, folder.as_deref()) })
}

fn overwrites(input: &Path, folder: &Path) -> bool {
    let input = if input.is_dir() { Some(input) } else { input.parent() };
    let same = |p: &Path| p.canonicalize().ok();
    input.and_then(same).is_some_and(|i| same(folder).is_some_and(|f| f == i))
}

fn bad(path: &Path, error: &dyn std::fmt::Display) -> CliError {
    CliError::Input { path: path.into(), message: error.to_string() }
}

fn one_file(a: &ImportArguments) -> Result<(), CliError> {
    match a.files.get(1) {
        None => Ok(()),
        Some(second) => Err(bad(second, &"only one recording at a time; point clouds alone may be several files")),
    }
}

type FromRaw = (Recording, Vec<Vec<[f64; 3]>>, Vec<StepReport>);

fn from_raw(a: &ImportArguments, limits: &ReadLimits) -> Result<FromRaw, CliError> {
    let path = &a.files[0];
    let mut raw = RawRecording::read(path, limits).map_err(|e| match e {
        RecordingError::NotRaw { .. } => bad(path, &"this recording already holds displacements"),
        other => bad(path, &other),
    })?;
    if let Some(specimen) = &a.specimen {
        raw.specimen = input::read_specimen(specimen)?;
    }
    let option = |option, value: &str, expected: &str| CliError::Option {
        option,
        message: format!("'{value}' is not {expected}"),
    };
    let method = match a.method.as_str() {
        "margin" => Method::Margin,
        "second-difference" => Method::SecondDifference,
        "least-squares" => Method::LeastSquares,
        other => return Err(option("method", other, "margin, second-difference or least-squares")),
    };
    let anchor = match a.anchor.as_str() {
        "whole-turns" => Anchor::WholeTurns,
        "fixed-plate" => Anchor::FixedPlate,
        "none" => Anchor::None,
        other => return Err(option("anchor", other, "whole-turns, fixed-plate or none")),
    };
    let unwrap = UnwrapOptions { method, needs_agreement: !a.no_agreement, ..UnwrapOptions::default() };
    let settings = ReconstructOptions { unwrap, anchor, filter: filter(&a.filter)? };
    let found = reconstruct(&raw, &settings).map_err(|e| CliError::Numerics(e.to_string()))?;
    Ok((found.recording, found.sd_mm, found.steps))
}

fn options(a: &ImportArguments) -> Result<(Specimen, ImportOptions), CliError> {
    let Some(specimen) = &a.specimen else {
        let message = "a specimen file is needed: the file does not say what was scanned".to_string();
        return Err(CliError::Option { option: "specimen", message });
    };
    let unit_mm = match a.unit.as_str() {
        "mm" => 1.0,
        "m" => 1e3,
        "um" => 1e-3,
        other => {
            return Err(CliError::Option { option: "unit", message: format!("'{other}' is not mm, m or um") });
        }
    };
    let axes = ImportOptions::parse_axes(&a.axes).ok_or_else(|| CliError::Option {
        option: "axes",
        message: format!("'{}' does not name x, y and z once each, such as y,z,x or -y,z,-x", a.axes),
    })?;
    let options = ImportOptions {
        id: a.files[0].file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        unit_mm,
        axes,
        voxel_mm_by_index: a.voxel.as_deref().map(|v| input::triple("voxel", v)).transpose()?,
        region: a.region,
        drive_mm: a.drive.clone(),
        filter: filter(&a.filter)?,
        noise_sd_mm: a.noise.as_deref().map(|n| input::triple("noise", n)).transpose()?,
    };
    Ok((input::read_specimen(specimen)?, options))
}

fn from_mat(a: &ImportArguments, limits: &ReadLimits) -> Result<Recording, CliError> {
    let (specimen, options) = options(a)?;
    // Positions and masks may lie in files of their own.
    let mut variables = Vec::new();
    for path in &a.files {
        let found = mat::read_mat(path, limits.max_values).map_err(|e| match e {
            mat::MatError::Io(source) => CliError::Read { path: path.clone(), source },
            other => bad(path, &other),
        })?;
        variables.extend(found);
    }
    recording_from_mat(&variables, &specimen, &options).map_err(|e| bad(&a.files[0], &e))
}

fn from_csv(a: &ImportArguments, limits: &ReadLimits) -> Result<Recording, CliError> {
    let (specimen, options) = options(a)?;
    let mut steps = Vec::new();
    for path in &a.files {
        let text = read_text_limited(path, limits.max_file_bytes).map_err(|error| match error {
            ReadError::Io(source) => CliError::Read { path: path.clone(), source },
            other => bad(path, &other),
        })?;
        let max_points = usize::try_from(limits.max_values / 8).unwrap_or(usize::MAX);
        steps.push(read_points(&text, path, max_points).map_err(|e: ImportError| bad(path, &e))?);
    }
    let voxel = options.voxel_mm_by_index;
    recording_from_points(&steps, &specimen, voxel, &options).map_err(|e| bad(&a.files[0], &e))
}

fn summary(result: &ImportResult, folder: Option<&Path>) -> String {
    let mut text = format!("{}: {} voxels in the mask\n", result.id, result.num_voxels);
    if let Some(sd) = result.noise_sd_mm {
        text += &format!("noise (x, y, z): {} mm\n", sd.map(|x| format!("{x:.4}")).join(", "));
    }
    for step in &result.steps {
        text += &format!("\ndrive {} mm: {} voxels with all three components\n", step.drive_mm, step.num_complete);
        let Some(report) = &step.reconstruction else { continue };
        for (axis, c) in ["x", "y", "z"].iter().zip(&report.components) {
            text += &format!(
                "  {axis}: kept {} of {}; low signal {}, disputed {}, inconsistent {}, unconnected {}; sd {:.4} mm",
                c.num_kept,
                c.num_voxels,
                c.num_low_signal,
                c.num_disputed,
                c.num_inconsistent,
                c.num_unconnected,
                c.median_sd_mm
            );
            let show = |u: Option<f64>| u.map_or("not seen".into(), |u| format!("{u:.3} mm"));
            text += &format!(
                "; fixed plate {}, moved plate {}\n",
                show(c.anchor.fixed_plate_mm),
                show(c.anchor.moved_plate_mm)
            );
            if c.anchor.is_ambiguous {
                text += "     the whole turns are not certain: the fixed plate should be at zero (see --anchor)\n";
            }
        }
    }
    if let Some(folder) = folder {
        text += &format!("\nrecording: {}\n", folder.display());
    }
    text
}
