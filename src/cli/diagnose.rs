//! `lambdak diagnose`.

use super::curve_input::ColumnArguments;
use super::error::CliError;
use super::{Common, diagnose_curves, input, interrupt, output};
use crate::diagnosis::{
    Diagnosis, DiagnosisError, DiagnosisOptions, DiagnosisResult, TogetherResult, Verdict, diagnose, together,
};
use crate::provenance::input_hash;
use crate::recording::{ReadLimits, Recording, write_vectors};
use crate::report::{diagnosis_pictures, diagnosis_report, in_words, together_pictures, together_report};
use clap::Args;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Args)]
pub(super) struct DiagnoseArguments {
    /// Folders of recordings (mru-recording/1). Several are diagnosed one after the other and then looked at together.
    #[arg(required_unless_present = "curve")]
    recordings: Vec<PathBuf>,
    /// A load curve (CSV) of a homogeneous test in place of recordings: uniaxial=FILE, simple-shear=FILE, …; may be repeated.
    #[arg(long, value_name = "TEST=FILE", conflicts_with = "recordings")]
    curve: Vec<String>,
    /// Curves that are predicted, not fitted: names of files without folder and ending, comma-separated.
    #[arg(long, value_delimiter = ',', value_name = "NAME", requires = "curve")]
    keep_back: Vec<String>,
    /// Shape factor of a compressed cylinder, diameter / (4 height).
    #[arg(long, requires = "curve")]
    shape_factor: Option<f64>,
    #[command(flatten)]
    columns: ColumnArguments,
    /// The material as believed (ogden/1): its number of terms is the nominal one.
    #[arg(long)]
    material: Option<PathBuf>,
    /// Element size as a factor on the standard one (0.3 to 5).
    #[arg(long, default_value_t = DiagnosisOptions::default().mesh_factor)]
    mesh: f64,
    /// Displacement error that meshes may leave, mm rms at the largest drive [default: a thousandth of it].
    #[arg(long)]
    allowance: Option<f64>,
    /// Most causes.
    #[arg(long, default_value_t = DiagnosisOptions::default().max_causes)]
    max_causes: usize,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(a: &DiagnoseArguments) -> Result<(), CliError> {
    super::start_threads(&a.common)?;
    if !a.curve.is_empty() {
        let (out, stopped) = (a.common.out.as_deref(), &interrupt::is_requested);
        let columns = a.columns.options()?;
        return diagnose_curves::run(&a.curve, &a.keep_back, a.shape_factor, &columns, out, a.common.json, stopped);
    }
    let mut results: Vec<(DiagnosisResult, String, Diagnosis)> = Vec::new();
    let several = output::folder(a.common.out.as_deref(), a.common.json, Path::new("diagnoses"));
    for path in &a.recordings {
        let folder = if a.recordings.len() > 1 {
            several.as_ref().map(|f| f.join(path.file_name().unwrap_or_default()))
        } else {
            output::folder(a.common.out.as_deref(), a.common.json, path)
        };
        results.push(one(a, path, folder)?);
    }
    if let [(result, text, _)] = &results[..] {
        return output::print(&if a.common.json { output::to_json(result)? } else { text.clone() });
    }
    let list: Vec<&DiagnosisResult> = results.iter().map(|(r, _, _)| r).collect();
    let begin = Instant::now();
    let progress = |text: &str| eprintln!("{:7.1} s  all: {text}", begin.elapsed().as_secs_f64());
    let cases: Vec<(&str, &Diagnosis)> = results.iter().map(|(r, _, d)| (&*r.recording, d)).collect();
    let found = match together(&cases, a.mesh, &progress, &interrupt::is_requested) {
        Ok(found) => Some(found),
        Err(DiagnosisError::Solve(e)) if interrupt::is_requested() => return Err(super::solve::solve_error(e)),
        Err(error) => {
            // What each recording told stands.
            eprintln!("the recordings cannot be looked at together: {error}");
            None
        }
    };
    let all = serde_json::json!({ "schema": "diagnoses/1", "diagnoses": list, "together": found });
    if let Some(folder) = several {
        output::write_file(&folder, "diagnoses.json", output::to_json(&all)?.as_bytes())?;
        if let Some(found) = &found {
            let specimen = &cases[0].1.observed.specimen;
            let page = together_report(found, &list, specimen).to_html();
            output::write_file(&folder, "together.html", page.as_bytes())?;
            for (name, svg) in together_pictures(found, &list, specimen) {
                output::write_file(&folder, &format!("{name}.svg"), svg.as_bytes())?;
            }
        }
    }
    if a.common.json {
        return output::print(&output::to_json(&all)?);
    }
    let texts: Vec<&str> = results.iter().map(|(_, t, _)| &**t).collect();
    output::print(&format!("{}\n{}", texts.join("\n"), together_text(&list, found.as_ref())))
}

/// Whether the recordings agree: causes of each, materials side by side, the one material, and what each says of the others.
fn together_text(results: &[&DiagnosisResult], found: Option<&TogetherResult>) -> String {
    let mut text = String::from("all recordings        verdict, causes; material with the causes\n");
    for r in results {
        let causes: Vec<&str> = r.causes.iter().map(|c| &*c.name).collect();
        let parameters: Vec<String> = r
            .material_parameters
            .iter()
            .map(|p| {
                let half = p.interval_95.map_or(f64::NAN, |[a, b]| 0.5 * (b - a));
                format!("{} {:.3} ± {:.3}", p.name, p.value, half)
            })
            .collect();
        text += &format!("  {:<18} {:?} [{}]; {}\n", r.recording, r.verdict, causes.join(", "), parameters.join(", "));
    }
    let Some(found) = found else { return text };
    text += &format!("\none material for all: {}\n", in_words(&found.one_material));
    for p in &found.material_parameters {
        let interval = p.interval_95.map_or("not bounded by the data".into(), |[a, b]| format!("{a:.4} to {b:.4}"));
        text += &format!("  {:<40} {:>10.4}   {interval}\n", p.name, p.value);
    }
    for c in &found.common_causes {
        text += &format!("\none size for all of '{}': {}\n", c.description, in_words(&c.agreement));
        for p in &c.parameters {
            let interval = p.interval_95.map_or("not bounded by the data".into(), |[a, b]| format!("{a:.4} to {b:.4}"));
            text += &format!("  {:<40} {:>10.4}   {interval}\n", p.name, p.value);
        }
    }
    text += "\npredicted by each other  mm rms and largest error of a force: nominal -> with the causes\n";
    for p in &found.predictions {
        let displacement =
            p.displacement_rms_mm.map_or("no equilibrium".into(), |b| format!("{:.4} -> {:.4}", b.before, b.after));
        let force = p
            .force_relative
            .map_or("no force".into(), |b| format!("{:.2} -> {:.2} %", 100.0 * b.before, 100.0 * b.after));
        text += &format!("  {:<18} by {:<18} {displacement}; {force}\n", p.to, p.from);
    }
    text
}

/// Diagnoses one recording, writes its files, and gives its result and a summary.
fn one(
    a: &DiagnoseArguments,
    path: &Path,
    folder: Option<PathBuf>,
) -> Result<(DiagnosisResult, String, Diagnosis), CliError> {
    let bad = |message: String| CliError::Input { path: path.into(), message };
    let recording = Recording::read(path, &ReadLimits::default()).map_err(|e| bad(e.to_string()))?;
    let prior = match &a.material {
        Some(path) => Some(input::read_material(Some(path))?),
        None => None,
    };
    let options = DiagnosisOptions {
        mesh_factor: a.mesh,
        allowance_mm: a.allowance,
        prior,
        max_causes: a.max_causes,
        ..DiagnosisOptions::default()
    };
    let begin = Instant::now();
    let progress = |text: &str| eprintln!("{:7.1} s  {text}", begin.elapsed().as_secs_f64());
    let found = diagnose(&recording, &options, &progress, &interrupt::is_requested).map_err(|e| match e {
        DiagnosisError::Solve(e) => super::solve::solve_error(e),
        DiagnosisError::Setting { .. } => CliError::Option { option: "mesh", message: e.to_string() },
        other => bad(other.to_string()),
    })?;
    let inputs = serde_json::json!({
        "recording": recording.id,
        "specimen": recording.specimen,
        "steps": recording.steps.iter().map(|s| (s.drive_mm, s.force_n)).collect::<Vec<_>>(),
        "checksum_mm": recording.steps.iter().flat_map(|s| &s.displacement).flatten().filter(|x| x.is_finite()).sum::<f64>(),
        "mesh": options.mesh_factor,
        "allowance_mm": options.allowance_mm,
        "material": options.prior,
        "max_causes": options.max_causes,
    });
    let result = DiagnosisResult::new(&found, &recording.id, input_hash(&inputs));
    if let Some(folder) = folder {
        output::write_file(&folder, "diagnosis.json", output::to_json(&result)?.as_bytes())?;
        output::write_file(&folder, "report.html", diagnosis_report(&found, &result).to_html().as_bytes())?;
        for (name, svg) in diagnosis_pictures(&found) {
            output::write_file(&folder, &format!("{name}.svg"), svg.as_bytes())?;
        }
        // Residual maps on the compared grid, measured minus predicted.
        for (name, fitted) in [("before", &found.nominal), ("after", &found.corrected)] {
            let mask = &found.observed.mask;
            for (n, field) in fitted.residual.displacement.iter().enumerate() {
                let vectors = mask.spread(field, [f64::NAN; 3]);
                write_vectors(&folder, &format!("residual_{name}_{}.nii.gz", n + 1), &mask.grid, &vectors)
                    .map_err(|e| bad(e.to_string()))?;
            }
        }
    }
    let text = summary(&result, &found);
    Ok((result, text, found))
}

fn summary(r: &DiagnosisResult, d: &Diagnosis) -> String {
    let verdict = match r.verdict {
        Verdict::NoMismatch => "no mismatch beyond noise and meshes",
        Verdict::Explained => "explained",
        Verdict::ExplainedAmbiguously => "explained, but not by one cause alone",
        Verdict::Unexplained => "unexplained: something is left that no cause in the registry explains",
    };
    let mut text = format!("{}: {verdict}\n", r.recording);
    for c in &r.causes {
        text += &format!("\n{} ({:?}): {}\n", c.name, c.category, c.description);
        for p in &c.parameters {
            let interval = p.interval_95.map_or("not bounded by the data".into(), |[a, b]| format!("{a:.4} to {b:.4}"));
            text += &format!("  {:<40} {:>10.4}   {interval}\n", p.name, p.value);
        }
        if let Some(l) = &c.location {
            text += &format!("  at the {}: centre {:.1?} mm, extent {:.1?} mm\n", l.region, l.center_mm, l.extent_mm);
        }
        text += &format!("  evidence {:.0}, explains {:.4} mm rms\n", c.evidence, c.effect_rms_mm);
    }
    for c in &r.alternatives {
        let what =
            if r.verdict == Verdict::Unexplained { "tried, and no explanation" } else { "not told apart from it" };
        text += &format!("\n{what}: {} ({})\n", c.name, c.description);
        if let Some(e) = c.experiments.first() {
            text += &format!(
                "  a further step at {:.2} mm would tell it apart by {:.1} standard deviations\n",
                e.drive_mm, e.distance_sd
            );
        }
    }
    text += &format!(
        "\nchi2 per datum      {:.4} -> {:.4}\nmisfit beyond noise {:.4} -> {:.4} mm rms (allowance {:.4})\nkept back           {:.4} -> {:.4} mm rms\n",
        r.chi2_per_datum.before,
        r.chi2_per_datum.after,
        r.structured_rms_mm.before,
        r.structured_rms_mm.after,
        r.allowance_mm,
        r.kept_back_rms_mm.before,
        r.kept_back_rms_mm.after
    );
    if let Some(m) = &r.modulus_against_belief {
        text += &format!("\n{}\n", m.in_words());
    }
    text += "\nmaterial            nominal model -> with the causes\n";
    for p in d.corrected.material.parameters() {
        let before = if d.nominal.material.parameters().contains(&p) {
            format!("{:.3}", d.nominal.material.value(p))
        } else {
            "-".into()
        };
        text += &format!("  {:<10} {before:>12} -> {:.3}\n", p.name(), d.corrected.material.value(p));
    }
    text
}
