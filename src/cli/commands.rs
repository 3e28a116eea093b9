//! The commands that run a job from files and options, one table row each.

use super::error::CliError;
use super::flag::{Flag, Written};
use super::input::{read_json, read_study, read_table};
use super::job_command::{Asked, JobCommand, files, value, values};
use super::results::stem;
use crate::job::kind_of_command;
use clap::{Arg, ArgAction, ArgMatches, Command};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

use Written::{FaceSeen, JsonFile, MeshFactor, Off, OrAuto, TextFile};

/// The commands.
pub(super) static COMMANDS: &[JobCommand] = &[
    JobCommand { name: "solve", arguments: of_specimen, flags: SOLVE, fill: specimen },
    JobCommand { name: "evaluate", arguments: of_specimen, flags: EVALUATE, fill: specimen },
    JobCommand { name: "scan", arguments: of_specimen, flags: SCAN, fill: scanned },
    JobCommand { name: "import", arguments: of_files, flags: IMPORT, fill: imported },
    JobCommand { name: "calibrate", arguments: of_recordings, flags: CALIBRATE, fill: recordings },
    JobCommand { name: "diagnose", arguments: of_recordings_or_curves, flags: DIAGNOSE, fill: diagnosed },
    JobCommand { name: "next", arguments: of_campaign, flags: NEXT, fill: campaign },
    JobCommand { name: "curves", arguments: of_curves, flags: CURVES, fill: curves },
    JobCommand { name: "uniaxial", arguments: of_curve, flags: UNIAXIAL, fill: curve },
    JobCommand { name: "paper-tables", arguments: of_nothing, flags: PAPER_TABLES, fill: paper_tables },
    JobCommand { name: "prove-diagnosis", arguments: of_nothing, flags: PROOF, fill: proof },
];

/// What `lambdak export` writes: each with the word after `export`.
pub(super) static EXPORTS: &[(&str, JobCommand)] = &[
    (
        "material",
        JobCommand { name: "export-material", arguments: of_material, flags: EXPORT_MATERIAL, fill: exported_material },
    ),
    ("model", JobCommand { name: "export-model", arguments: of_specimen, flags: EXPORT_MODEL, fill: specimen }),
    (
        "recording",
        JobCommand {
            name: "export-recording",
            arguments: of_recording,
            flags: EXPORT_RECORDING,
            fill: exported_recording,
        },
    ),
];
const EXPORT_MODEL: &[Flag] = &[
    Flag::read("material", "material", JsonFile),
    Flag::of("drive", "drive_mm"),
    Flag::of("mesh", "mesh"),
    Flag::of("full", "is_whole"),
    Flag::of("format", "formats"),
];

const EXPORT_MATERIAL: &[Flag] =
    &[Flag::of("format", "formats"), Flag::of("stress-unit", "stress_unit"), Flag::of("name", "name")];
const EXPORT_RECORDING: &[Flag] = &[Flag::of("raw", "is_raw"), Flag::of("format", "formats")];
const SOLVE: &[Flag] = &[
    Flag::read("material", "material", JsonFile),
    Flag::of("drive", "drive_mm"),
    Flag::of("mesh", "mesh"),
    Flag::of("full", "is_whole"),
    Flag::read("one-mesh", "has_discretisation", Off),
    Flag::of("fields", "fields"),
    Flag::of("arrays", "arrays"),
];
const EVALUATE: &[Flag] = &[
    Flag::read("material", "material", JsonFile),
    Flag::of("drive", "drive_mm"),
    Flag::of("mesh", "mesh"),
    Flag::of("full", "is_whole"),
    Flag::read("one-mesh", "has_discretisation", Off),
    Flag::of("median-stretch", "median_stretch"),
    Flag::of("voxel", "scan/voxel_mm"),
    Flag::of("grid", "scan/grid"),
    Flag::read("surface", "scan/surface", FaceSeen),
    Flag::of("noise", "scan/noise_sd_mm"),
    Flag::of("mm-per-radian", "scan/mm_per_radian"),
    Flag::of("force-sd", "scan/force_sd_n"),
    Flag::of("force-drives", "protocol/force_drive_mm"),
    Flag::of("force-gain-sd", "protocol/force_gain_sd"),
    Flag::of("force-zero-sd", "protocol/force_zero_sd_n"),
    Flag::of("drive-zero-sd", "protocol/drive_zero_sd_mm"),
    Flag::of("plate-tilt-sd", "protocol/plate_tilt_sd_deg"),
    Flag::of("blocks-scanned", "protocol/blocks_scanned"),
    Flag::of("scan-shares", "protocol/scan_share"),
    Flag::of("detect", "has_detectable"),
    Flag::of("arrays", "arrays"),
];
const SCAN: &[Flag] = &[
    Flag::read("material", "material", JsonFile),
    Flag::of("drive", "drive_mm"),
    Flag::of("sample", "sample"),
    Flag::of("mesh", "mesh"),
    Flag::of("full", "is_whole"),
    Flag::of("voxel", "voxel_mm"),
    Flag::read("surface", "surface", FaceSeen),
    Flag::of("offset", "offset_voxels"),
    Flag::of("snr", "snr"),
    Flag::of("noise", "noise_sd_mm"),
    Flag::of("mm-per-radian", "mm_per_radian"),
    Flag::of("raw", "is_raw"),
    Flag::of("filter", "filter"),
    Flag::of("kspace", "kspace/keep"),
    Flag::of("apodise", "kspace/is_apodised"),
    Flag::of("force-sd", "force_sd_n"),
    Flag::of("seed", "seed"),
];
const IMPORT: &[Flag] = &[
    Flag::read("specimen", "specimen", JsonFile),
    Flag::of("form", "form"),
    Flag::read("series", "series", JsonFile),
    Flag::of("phase-range", "phase_range"),
    Flag::of("raw", "is_raw"),
    Flag::of("drive", "drive_mm"),
    Flag::of("unit", "unit"),
    Flag::of("axes", "axes"),
    Flag::of("components", "components"),
    Flag::of("origin", "origin"),
    Flag::of("vectors", "vectors"),
    Flag::read("surface", "surface", FaceSeen),
    Flag::of("voxel", "voxel_mm"),
    Flag::of("region", "region"),
    Flag::of("filter", "filter"),
    Flag::of("noise", "noise_sd_mm"),
    Flag::read("load", "load_csv", TextFile),
    Flag::of("method", "method"),
    Flag::read("no-agreement", "needs_agreement", Off),
    Flag::of("anchor", "anchor"),
];
const CALIBRATE: &[Flag] = &[
    Flag::read("terms", "num_terms", OrAuto),
    Flag::of("law", "law"),
    Flag::of("rule", "rule"),
    Flag::of("decrement", "decrement"),
    Flag::of("objective", "objective"),
    Flag::of("boundary", "boundary"),
    Flag::of("force-drives", "protocol/force_drive_mm"),
    Flag::of("force-gain-sd", "protocol/force_gain_sd"),
    Flag::of("force-zero-sd", "protocol/force_zero_sd_n"),
    Flag::of("beta", "beta"),
    Flag::read("mesh", "mesh_factor", MeshFactor),
    Flag::read("one-mesh", "has_mesh_allowance", Off),
    Flag::of("starts", "num_starts"),
    Flag::of("end-margin", "end_margin_mm"),
    Flag::of("profile", "has_profiles"),
    Flag::of("contours", "has_contours"),
    Flag::of("arrays", "arrays"),
];
const DIAGNOSE: &[Flag] = &[
    Flag::read("material", "material", JsonFile),
    Flag::of("mesh", "mesh_factor"),
    Flag::of("allowance", "allowance_mm"),
    Flag::of("max-causes", "max_causes"),
    Flag::of("without", "without"),
    Flag::of("boundary", "boundary"),
];
const NEXT: &[Flag] = &[
    Flag::of("drive", "drive_mm"),
    Flag::of("drives", "num_drives"),
    Flag::read("terms", "num_terms", OrAuto),
    Flag::of("precision", "precision"),
    Flag::of("scan-minutes", "scan_minutes"),
    Flag::of("change-minutes", "change_minutes"),
    Flag::read("mesh", "mesh_factor", MeshFactor),
    Flag::read("no-mesh-correction", "has_mesh_correction", Off),
];
/// Options of commands that read curves.
const COLUMNS: [Flag; 6] = [
    Flag::of("drive-column", "columns/drive_column"),
    Flag::of("stress-column", "columns/stress_column"),
    Flag::of("stress-unit", "columns/stress_unit"),
    Flag::of("length", "columns/length_mm"),
    Flag::of("area", "columns/area_mm2"),
    Flag::of("turned", "columns/turned"),
];
/// The same of the second axis of biaxial tests.
const SECOND_COLUMNS: [Flag; 4] = [
    Flag::of("second-drive-column", "second_axis/drive_column"),
    Flag::of("second-stress-column", "second_axis/stress_column"),
    Flag::of("second-length", "second_axis/length_mm"),
    Flag::of("second-area", "second_axis/area_mm2"),
];
/// Options of fits to curves.
const FITS: [Flag; 5] = [
    Flag::of("law", "fit/law"),
    Flag::of("terms", "fit/max_terms"),
    Flag::of("bulk", "fit/bulk_kpa"),
    Flag::of("min-alpha-gap", "fit/min_alpha_gap"),
    Flag::of("all-branches", "fit/has_all_branches"),
];
const CURVES: &[Flag] = &[
    Flag::of("neo-hookean", "has_neo_hookean_term"),
    Flag::of("exact", "is_exact"),
    COLUMNS[0],
    COLUMNS[1],
    COLUMNS[2],
    COLUMNS[3],
    COLUMNS[4],
    COLUMNS[5],
    SECOND_COLUMNS[0],
    SECOND_COLUMNS[1],
    SECOND_COLUMNS[2],
    SECOND_COLUMNS[3],
    FITS[0],
    FITS[1],
    FITS[2],
    FITS[3],
    FITS[4],
];
const UNIAXIAL: &[Flag] = &[
    Flag::read("specimen", "specimen", JsonFile),
    Flag::of("mesh", "mesh"),
    COLUMNS[0],
    COLUMNS[1],
    COLUMNS[2],
    COLUMNS[3],
    COLUMNS[4],
    COLUMNS[5],
    FITS[0],
    FITS[1],
    FITS[2],
    FITS[3],
    FITS[4],
];
const PAPER_TABLES: &[Flag] = &[
    Flag::of("noise", "noise_sd_mm"),
    Flag::of("force-sd", "force_sd_n"),
    Flag::of("dumbbell-noise", "dumbbell_noise"),
    Flag::of("mesh", "mesh_factor"),
    Flag::of("seed", "seed"),
    Flag::of("beta", "beta"),
];
const PROOF: &[Flag] = &[
    Flag::of("per-cause", "per_cause"),
    Flag::of("several", "has_several"),
    Flag::of("recordings", "recordings"),
    Flag::of("controls", "controls"),
    Flag::of("unknown", "unknown"),
    Flag::of("seed", "seed"),
    Flag::of("mesh", "mesh_factor"),
    Flag::of("only", "only"),
];

fn of_nothing(command: Command) -> Command {
    command
}

fn paper_tables(_: &ArgMatches, _: &mut Asked) -> Result<PathBuf, CliError> {
    Ok("paper".into())
}

fn proof(_: &ArgMatches, _: &mut Asked) -> Result<PathBuf, CliError> {
    Ok("two-hole-shear".into())
}

fn of_material(command: Command) -> Command {
    command.arg(Arg::new("MATERIAL").help("Material file, such as the material.json of a fit").required(true))
}

fn exported_material(matches: &ArgMatches, asked: &mut Asked) -> Result<PathBuf, CliError> {
    let path = PathBuf::from(value(matches, "MATERIAL"));
    asked.set("material", read_json(&path)?, path.display().to_string());
    asked.set("name", stem(&path), path.display().to_string());
    Ok(path)
}

fn of_specimen(command: Command) -> Command {
    command.arg(Arg::new("SPECIMEN").help("Specimen file (specimen/1)").required(true))
}

fn specimen(matches: &ArgMatches, asked: &mut Asked) -> Result<PathBuf, CliError> {
    let path = PathBuf::from(value(matches, "SPECIMEN"));
    asked.set("specimen", read_json(&path)?, path.display().to_string());
    Ok(path)
}

fn scanned(matches: &ArgMatches, asked: &mut Asked) -> Result<PathBuf, CliError> {
    let path = specimen(matches, asked)?;
    asked.set("name", stem(&path), path.display().to_string());
    Ok(path)
}

fn of_files(command: Command) -> Command {
    let help = "A raw recording (folder or JSON file), MATLAB files (.mat), point clouds (.csv, one per drive), NIfTI images \
                (.nii, .nii.gz), DICOM images (.dcm, .ima), or, with --form dicom or paravision, files and folders of a scanner";
    command.arg(files("FILE", "FILE", help))
}

fn imported(matches: &ArgMatches, asked: &mut Asked) -> Result<PathBuf, CliError> {
    let names = values(matches, "FILE");
    let first = PathBuf::from(names.first().cloned().unwrap_or_default());
    let ending = |name: &Path| name.extension().and_then(|e| e.to_str()).map(str::to_lowercase);
    let form = match ending(&first).as_deref() {
        Some("mat") => Some("matlab"),
        Some("csv") => Some("points"),
        Some("nii") => Some("nifti"),
        Some("dcm" | "ima") => Some("dicom"),
        Some("gz") if ending(&first.with_extension("")).as_deref() == Some("nii") => Some("nifti"),
        _ => None,
    };
    let stated = matches.get_one::<String>("form").map(String::as_str);
    match (stated.or(form), names.get(1)) {
        (Some(form), _) => {
            asked.set("form", form, "FILE");
            asked.set("name", stem(&first), "FILE");
            asked.set("files", names, "FILE");
        }
        (None, Some(second)) => {
            let message =
                "only one recording at a time; MATLAB files, point clouds, images and, with --form, the files of scanners \
                 may be several"
                    .into();
            return Err(CliError::Input { path: second.into(), message });
        }
        (None, None) => asked.set("recording", names[0].clone(), first.display().to_string()),
    }
    Ok(first)
}

fn of_recordings(command: Command) -> Command {
    command.arg(files("RECORDING", "RECORDING", "Folders of recordings (mru-recording/1); all are fitted together"))
}

fn recordings(matches: &ArgMatches, asked: &mut Asked) -> Result<PathBuf, CliError> {
    let names = values(matches, "RECORDING");
    let first = PathBuf::from(names.first().cloned().unwrap_or_default());
    asked.set("recordings", names, "RECORDING");
    Ok(first)
}

fn of_recording(command: Command) -> Command {
    command.arg(Arg::new("RECORDING").help("Folder of the recording (mru-recording/1)").required(true))
}

fn exported_recording(matches: &ArgMatches, asked: &mut Asked) -> Result<PathBuf, CliError> {
    let name = value(matches, "RECORDING");
    asked.set("recording", name.clone(), "RECORDING");
    Ok(PathBuf::from(name))
}

fn of_campaign(command: Command) -> Command {
    let help = "Study file (study/1): base specimen, drives, scan, protocol and limits of the candidates";
    let study = Arg::new("study").long("study").value_name("FILE").help(help).required(true);
    let help =
        "A further specimen that could be scanned (specimen/1), such as a design's best-specimen.json; may be repeated";
    let specimen = Arg::new("specimen").long("specimen").value_name("FILE").help(help).action(ArgAction::Append);
    let help = "Largest relative standard deviation of one parameter, in place of --precision; may be repeated";
    let precision = Arg::new("precision-of").long("precision-of").value_name("NAME=SD").help(help);
    of_recordings(command).arg(study).arg(specimen).arg(precision.action(ArgAction::Append))
}

fn campaign(matches: &ArgMatches, asked: &mut Asked) -> Result<PathBuf, CliError> {
    recordings(matches, asked)?;
    let study = PathBuf::from(value(matches, "study"));
    asked.set("study", read_study(&study)?, study.display().to_string());
    let names = values(matches, "specimen");
    if !names.is_empty() {
        let specimens = names.iter().map(|name| read_json(Path::new(name))).collect::<Result<Vec<Value>, _>>()?;
        asked.set("specimens", specimens, "--specimen");
    }
    for text in values(matches, "precision-of") {
        let parsed = text.split_once('=').and_then(|(name, sd)| Some((name, sd.parse::<f64>().ok()?)));
        let Some((name, sd)) = parsed else {
            let message = format!("'{text}' is not NAME=SD, such as alpha_2=0.05");
            return Err(CliError::Option { option: "precision-of", message });
        };
        let all = &mut asked.request["precision_by_parameter"];
        all[name] = sd.into();
        asked.sources.push(("/precision_by_parameter".into(), "--precision-of".into()));
    }
    Ok(study)
}

fn of_recordings_or_curves(command: Command) -> Command {
    let help = "Folders of recordings (mru-recording/1). Several are diagnosed one after the other and then looked at together";
    let recordings = Arg::new("RECORDING").help(help).num_args(1..).required_unless_present("curve");
    let help = "A load curve (CSV) of a homogeneous test in place of recordings: uniaxial=FILE, simple-shear=FILE, …; \
                may be repeated";
    let curve = Arg::new("curve").long("curve").value_name("TEST=FILE").help(help).conflicts_with("RECORDING");
    let help = "Curves that are predicted, not fitted: names of files without folder and ending, comma-separated";
    let kept = Arg::new("keep-back").long("keep-back").value_name("NAME").help(help).requires("curve");
    let command = command
        .arg(recordings)
        .arg(curve.action(ArgAction::Append))
        .arg(kept.value_delimiter(',').action(ArgAction::Append));
    // The options of load curves alone.
    LOAD_CURVES.iter().fold(command, |command, flag| {
        let fields = kind_of_command(LOAD_CURVES_KIND).map(|kind| kind.fields()).unwrap_or_default();
        match fields.iter().find(|f| f.name == flag.field) {
            Some(field) => command.arg(flag.arg(field).requires("curve")),
            None => command,
        }
    })
}

/// What `diagnose --curve` asks for.
const LOAD_CURVES_KIND: &str = "diagnose-curves";
const LOAD_CURVES: [Flag; 7] =
    [Flag::of("shape-factor", "shape_factor"), COLUMNS[0], COLUMNS[1], COLUMNS[2], COLUMNS[3], COLUMNS[4], COLUMNS[5]];

fn diagnosed(matches: &ArgMatches, asked: &mut Asked) -> Result<PathBuf, CliError> {
    let curves = values(matches, "curve");
    if curves.is_empty() {
        let names = values(matches, "RECORDING");
        let first = PathBuf::from(names.first().cloned().unwrap_or_default());
        match &names[..] {
            [name] => asked.set("recording", name.clone(), name.clone()),
            _ => asked.set("recordings", names, "RECORDING"),
        }
        return Ok(first);
    }
    asked.kind = LOAD_CURVES_KIND;
    let kept = values(matches, "keep-back");
    let mut found = Vec::new();
    let first = read_curves(&curves, "curve", asked, &mut |name, _| {
        let is_kept = kept.iter().any(|k| k == name);
        found.push(name.to_string());
        is_kept
    })?;
    if let Some(missing) = kept.iter().find(|k| !found.contains(k)) {
        let message =
            format!("no curve is named '{missing}' (names are those of the files, without folder and ending)");
        return Err(CliError::Option { option: "keep-back", message });
    }
    let fields = kind_of_command(LOAD_CURVES_KIND).map(|kind| kind.fields()).unwrap_or_default();
    for flag in LOAD_CURVES {
        asked.sources.push((format!("/{}", flag.field), format!("--{}", flag.name)));
        flag.apply(&fields, matches, &mut asked.request)?;
    }
    Ok(first)
}

/// Reads TEST=FILE arguments into the field `curves`; `is_kept_back` is asked with a curve's name and test. Gives the
/// first path.
fn read_curves(
    arguments: &[String],
    option: &'static str,
    asked: &mut Asked,
    is_kept_back: &mut dyn FnMut(&str, &str) -> bool,
) -> Result<PathBuf, CliError> {
    let mut curves: Vec<Value> = Vec::new();
    let mut first = None;
    for (index, argument) in arguments.iter().enumerate() {
        let Some((test, file)) = argument.split_once('=') else {
            let message = format!("'{argument}' is not TEST=FILE, such as uniaxial=ut.csv");
            return Err(CliError::Option { option, message });
        };
        let path = PathBuf::from(file);
        let unknown = || format!("'{test}' is not uniaxial, equibiaxial, pure-shear, simple-shear or biaxial");
        let test = test_named(test).ok_or_else(|| CliError::Option { option, message: unknown() })?;
        let name = stem(&path);
        let csv = read_table(&path)?;
        curves.push(json!({ "test": test, "name": name, "csv": csv, "is_kept_back": is_kept_back(&name, test) }));
        asked.sources.push((format!("/curves/{index}"), path.display().to_string()));
        first.get_or_insert(path);
    }
    super::flag::set(&mut asked.request, "curves", curves.into());
    Ok(first.unwrap_or_default())
}

/// The name of a test as requests spell it.
fn test_named(name: &str) -> Option<&'static str> {
    match name.replace('_', "-").as_str() {
        "uniaxial" => Some("uniaxial"),
        "equibiaxial" => Some("equibiaxial"),
        "pure-shear" | "planar" => Some("pure_shear"),
        "simple-shear" => Some("simple_shear"),
        "biaxial" => Some("biaxial"),
        _ => None,
    }
}

fn of_curves(command: Command) -> Command {
    let help = "Tests and their curves (CSV): uniaxial=FILE equibiaxial=FILE pure-shear=FILE simple-shear=FILE biaxial=FILE; \
                of one test there may be several";
    let kept = Arg::new("keep-back").long("keep-back").value_name("TEST").value_delimiter(',');
    let help_kept =
        "Tests, or files by their names without folder and ending, that are predicted, not fitted, comma-separated";
    let kept = kept.action(ArgAction::Append).help(help_kept);
    command.arg(files("CURVES", "TEST=FILE", help)).arg(kept)
}

fn curves(matches: &ArgMatches, asked: &mut Asked) -> Result<PathBuf, CliError> {
    let kept = values(matches, "keep-back");
    let mut found = vec![false; kept.len()];
    let path = read_curves(&values(matches, "CURVES"), "curves", asked, &mut |name, test| {
        let is_meant: Vec<bool> = kept.iter().map(|k| k == name || test_named(k) == Some(test)).collect();
        found.iter_mut().zip(&is_meant).for_each(|(found, is)| *found |= is);
        is_meant.contains(&true)
    })?;
    if let Some((missing, _)) = kept.iter().zip(&found).find(|(_, found)| !**found) {
        let message = format!(
            "'{missing}' is neither a test nor the name of a file (without folder and ending) among those given"
        );
        return Err(CliError::Option { option: "keep-back", message });
    }
    Ok(path)
}

fn of_curve(command: Command) -> Command {
    let help = "Curve (CSV): stretch or strain and nominal stress; or grip displacement and force of a dumb-bell";
    command.arg(Arg::new("CURVE").help(help).required(true))
}

fn curve(matches: &ArgMatches, asked: &mut Asked) -> Result<PathBuf, CliError> {
    let path = PathBuf::from(value(matches, "CURVE"));
    asked.set("csv", read_table(&path)?, path.display().to_string());
    asked.set("name", path.display().to_string(), path.display().to_string());
    Ok(path)
}
