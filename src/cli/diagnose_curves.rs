//! `lambdak diagnose --curve`: load curves of homogeneous tests without a recording.

use super::curve_input::read_curve;
use super::error::CliError;
use super::output;
use crate::homogeneous::{CsvOptions, HomogeneousTest};
use crate::provenance::{VERSION, input_hash};
use crate::rate::{LoadCurve, LoadCurveOptions, LoadCurveVerdict, analyse_load_curve};
use crate::report::load_curve_pictures;
use std::path::{Path, PathBuf};

/// Reads, analyses and writes; `curves` are TEST=FILE, `kept` names of files (without folder and ending) that are predicted.
pub(super) fn run(
    curves: &[String],
    kept: &[String],
    shape_factor: Option<f64>,
    columns: &CsvOptions,
    out: Option<&Path>,
    is_json: bool,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<(), CliError> {
    let mut loaded: Vec<LoadCurve> = Vec::new();
    let mut first: Option<PathBuf> = None;
    let mut found: Vec<&String> = Vec::new();
    for argument in curves {
        let Some((test, file)) = argument.split_once('=') else {
            let message = format!("'{argument}' is not TEST=FILE, such as uniaxial=loop.csv");
            return Err(CliError::Option { option: "curve", message });
        };
        let test = super::curves::test_of(test, "curve")?;
        let path = PathBuf::from(file);
        let curve = read_load_curve(&path, test, columns)?;
        let curve = LoadCurve { shape_factor, ..curve };
        let name = kept.iter().find(|k| **k == curve.name);
        found.extend(name);
        loaded.push(if name.is_some() { curve.kept_back() } else { curve });
        first.get_or_insert(path);
    }
    if let Some(missing) = kept.iter().find(|k| !found.contains(k)) {
        let message =
            format!("no curve is named '{missing}' (names are those of the files, without folder and ending)");
        return Err(CliError::Option { option: "keep-back", message });
    }
    let path = first.unwrap_or_default();
    let bad = |message: String| CliError::Input { path: path.clone(), message };
    let verdict =
        analyse_load_curve(&loaded, &LoadCurveOptions::default(), is_cancelled).map_err(|e| bad(e.to_string()))?;
    let hash = input_hash(&serde_json::json!({
        "curves": loaded.iter().map(|c| (&c.name, &c.time_s, &c.drive, &c.nominal_stress_kpa, c.num_fitted)).collect::<Vec<_>>(),
        "shape_factor": shape_factor,
    }));
    let mut result = serde_json::to_value(&verdict).map_err(|e| bad(e.to_string()))?;
    result["version"] = VERSION.into();
    result["input_hash"] = hash.into();
    if let Some(folder) = output::folder(out, is_json, &path) {
        output::write_file(&folder, "diagnosis.json", output::to_json(&result)?.as_bytes())?;
        for (name, svg) in load_curve_pictures(&verdict) {
            output::write_file(&folder, &format!("{name}.svg"), svg.as_bytes())?;
        }
    }
    output::print(&if is_json { output::to_json(&result)? } else { summary(&verdict) })
}

fn read_load_curve(path: &Path, test: HomogeneousTest, columns: &CsvOptions) -> Result<LoadCurve, CliError> {
    let csv = read_curve(path, test, columns)?;
    let bad = |message: String| CliError::Input { path: path.into(), message };
    if csv.is_displacement {
        return Err(bad("the drive is a displacement; give --length, or a column of stretch or strain".into()));
    }
    if csv.is_force {
        return Err(bad("the stress is a force; give --area, or a column of nominal stress".into()));
    }
    let mut order: Vec<usize> = (0..csv.drive.len()).collect();
    if !csv.time_s.is_empty() {
        // Some sources have rows out of order.
        order.sort_by(|&a, &b| csv.time_s[a].total_cmp(&csv.time_s[b]));
    }
    let pick = |v: &[f64]| order.iter().filter_map(|&i| v.get(i).copied()).collect::<Vec<_>>();
    let name = path.file_stem().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    LoadCurve::new(&name, test, &pick(&csv.time_s), &pick(&csv.drive), &pick(&csv.stress))
        .map_err(|e| bad(e.to_string()))
}

fn summary(v: &LoadCurveVerdict) -> String {
    let mut text = format!("{}\n", v.summary);
    for c in &v.causes {
        text += &format!("\n{} ({}): {}\n", c.name, c.category, c.model);
        for p in &c.parameters {
            let interval = p.interval_95.map_or("not bounded by the data".into(), |[a, b]| format!("{a:.4} to {b:.4}"));
            text += &format!("  {:<24} {:>10.4}   {interval}\n", p.name, p.value);
        }
        text += &format!("  BIC rises by {:.0} without it\n", c.delta_bic);
        if !c.ambiguous_with.is_empty() {
            text += &format!("  not told apart from: {}\n", c.ambiguous_with.join(", "));
        }
    }
    text += "\nerror, % of the curve's rms    elastic -> with the causes\n";
    for (list, note) in [(&v.fitted, ""), (&v.kept_back, " (predicted)")] {
        for m in list {
            let percent = |x: f64| 100.0 * x;
            text += &format!(
                "  {:<36} {:>7.2} -> {:.2}\n",
                format!("{}{note}", m.before.name),
                percent(m.before.relative_rms_error),
                percent(m.after.relative_rms_error)
            );
        }
    }
    let [before, after] = [&v.naive_material, &v.material].map(|m| m.initial_shear_modulus_kpa);
    text += &format!("\ninitial shear modulus {:.3} -> {:.3} kPa\n", before.value, after.value);
    text
}
