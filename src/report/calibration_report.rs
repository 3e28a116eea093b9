//! The page of a calibration: what was found, how sure, and where model and data differ.

use super::calibration_curves::{force_picture, stress_picture};
use super::{
    CalloutKind, ColorMap, Column, ContourPanel, ContourPlot, CorrelationPlot, Line, LinePlot, Report, ReportHeader,
    Table, VoxelField, VoxelMaps, residual_histogram, significant, symbol_of_parameter,
};
use crate::calibration::{Calibration, CalibrationResult, Contour, Observed};
use crate::material::Parameter;

/// The pictures by name (SVG), and the page that holds them.
pub fn calibration_report(
    found: &Calibration,
    result: &CalibrationResult,
    observed: &[Observed],
) -> (Vec<(String, String)>, Report) {
    let mut pictures = Vec::new();
    let mut report = Report::new(
        format!("Calibration: {}", result.recordings.join(", ")),
        ReportHeader {
            subtitle: format!("{} Ogden term{}", result.num_terms, if result.num_terms == 1 { "" } else { "s" }),
            program_version: result.version.clone(),
            input_hash: result.input_hash.clone(),
            seed: None,
            facts: vec![
                ("minimised".into(), result.objective.minimised.clone()),
                ("numbers compared".into(), result.objective.num_data.to_string()),
            ],
        },
    );
    report.section("Estimate");
    report.table(&parameters(result));
    if let Some(shear) = &result.initial_shear_modulus_kpa {
        let interval =
            shear.interval_95.map_or("open".into(), |[a, b]| format!("{} to {}", significant(a, 4), significant(b, 4)));
        report.paragraph(&format!(
            "Initial shear modulus ½ Σ μα = {} kPa, 95 % interval {interval}.",
            significant(shear.value, 4)
        ));
    }
    report.paragraph(&format!(
        "χ² per datum {}; the paper's loss ℓ_u + βℓ_F = {} with ℓ_u = {}, ℓ_F = {}, β = {}.",
        significant(result.chi2_per_datum, 4),
        significant(result.objective.paper_loss, 4),
        significant(result.loss_u, 4),
        result.loss_f.map_or("not available".into(), |l| significant(l, 3)),
        significant(result.objective.beta, 2)
    ));
    for note in &result.notes {
        report.callout(CalloutKind::Caution, "Note", note);
    }
    let stress = stress_picture(found);
    let mut of_material = vec![(
        stress.clone(),
        "Nominal stress of the estimate in homogeneous tests, up to the stretch that 99 of 100 voxels stay below. Bands: what the \
         noise leaves uncertain, 95 %.",
    )];
    pictures.push(("stress-stretch".to_string(), stress));
    if let Some(force) = force_picture(found, observed, &result.recordings) {
        of_material.push((force.clone(), "Forces of all samples together, and data − model."));
        pictures.push(("force-drive".to_string(), force));
    }
    report.figures(&of_material);
    report.section("Number of terms");
    report.table(&terms(result));
    let s = &result.term_selection;
    report.paragraph(&format!(
        "BIC takes {}, the F-test {}, the paper's decrement {}. Decided by: {}.",
        s.by_bic, s.by_f_test, s.by_decrement, s.decided_by
    ));
    report.section("Where model and data differ");
    for (r, recording) in observed.iter().enumerate() {
        let Some(last) = recording.steps.len().checked_sub(1) else { continue };
        let svg = residual_maps(found, recording, r, last).to_svg();
        let name = result.recordings.get(r).cloned().unwrap_or_default();
        report.figure(
            &svg,
            &format!(
                "{name}, {} mm: data, model, and data − model over the noise's standard deviation.",
                significant(recording.steps[last].drive_mm, 3)
            ),
        );
        pictures.push((format!("residuals-{}", r + 1), svg));
    }
    let histogram = residual_histogram("Residuals", &whitened(found, observed)).to_svg();
    let mut beside = vec![(
        histogram.clone(),
        "Residuals of all voxels and drives over the noise's standard deviation, per component.",
    )];
    pictures.push(("residual-histogram".to_string(), histogram));
    // A fit that starts where it ends has no steps to show.
    if found.fit.history.len() > 1 {
        let convergence = convergence(found).to_svg();
        let caption = "The objective above its last value over the accepted steps of the last fit.";
        beside.push((convergence.clone(), caption));
        pictures.push(("convergence".to_string(), convergence));
    }
    report.figures(&beside);
    report.section("Uncertainty");
    let correlation = CorrelationPlot {
        title: "Correlation of the estimates".into(),
        labels: result.parameters.iter().map(|p| symbol_of_parameter(&p.name)).collect(),
        values: result.correlation.iter().flatten().map(|c| c.unwrap_or(f64::NAN)).collect(),
    }
    .to_svg();
    report.figure(&correlation, "Correlation under the noise.");
    pictures.push(("correlation".to_string(), correlation));
    if !result.profiles.is_empty() {
        let lines = result
            .profiles
            .iter()
            .map(|p| {
                let middle =
                    p.values.iter().zip(&p.chi2_increase).min_by(|a, b| a.1.total_cmp(b.1)).map_or(1.0, |m| *m.0);
                Line {
                    name: symbol_of_parameter(&p.parameter),
                    points: p
                        .values
                        .iter()
                        .zip(&p.chi2_increase)
                        .map(|(v, d)| [100.0 * (v / middle - 1.0), *d])
                        .collect(),
                    has_marks: true,
                    ..Line::default()
                }
            })
            .collect();
        let plot = LinePlot {
            title: "Profile likelihood".into(),
            x_label: "change of the held parameter, %".into(),
            y_label: "increase of χ²".into(),
            is_log: false,
            lines,
        };
        let svg = plot.to_svg();
        report.figure(&svg, "One parameter held, all others refitted; 3.84 bounds the 95 % interval.");
        pictures.push(("profiles".into(), svg));
    }
    if !result.contours.is_empty() {
        let svg = contour_plot(found, &result.contours).to_svg();
        report.section("Losses around the estimate");
        report.figure(&svg, "ℓ_u, ℓ_F and ℓ = ℓ_u + βℓ_F over two parameters each, the others at the estimate. Lines at 1.01, 1.1, 1.5, 3, 10 and 100 times the smallest value.");
        pictures.push(("contours".into(), svg));
    }
    (pictures, report)
}

fn optional(value: Option<f64>, digits: usize) -> String {
    value.map_or("–".into(), |v| significant(v, digits))
}

fn parameters(result: &CalibrationResult) -> Table {
    let rows = result
        .parameters
        .iter()
        .map(|p| {
            let end = |v: Option<f64>| v.map_or("open".to_string(), |v| significant(v, 5));
            let value = if p.identifiable { optional(p.value, 5) } else { "not identifiable".into() };
            vec![
                symbol_of_parameter(&p.name),
                value,
                optional(p.sd, 3),
                format!("{} to {}", end(p.interval_95[0]), end(p.interval_95[1])),
                significant(p.mesh_error, 2),
                significant(p.possible_shift, 2),
            ]
        })
        .collect();
    Table {
        caption: "Parameters (κ and μ in kPa)".into(),
        columns: vec![
            Column::words("parameter"),
            Column::numbers("estimate", ""),
            Column::numbers("sd", "noise"),
            Column::numbers("95 % interval", ""),
            Column::numbers("mesh", "may shift by"),
            Column::numbers("misfit", "may shift by"),
        ],
        rows,
        emphasised_rows: vec![],
        note: "The interval adds noise, the mesh's error and the largest shift that a structured misfit could hide."
            .into(),
    }
}

fn terms(result: &CalibrationResult) -> Table {
    let s = &result.term_selection;
    let rows = s
        .rows
        .iter()
        .map(|r| {
            vec![
                r.num_terms.to_string(),
                significant(r.chi2, 7),
                significant(1e3 * r.paper_loss, 4),
                significant(r.initial_shear_modulus_kpa, 4),
                optional(r.f_value, 3),
                optional(r.f_p_value, 2),
                optional(r.bic_change, 3),
                optional(r.decrement.map(|d| 1e3 * d), 2),
                format!("{} of {}", r.num_agreeing, r.num_starts),
                r.degeneracies.join("; "),
            ]
        })
        .collect();
    Table {
        caption: "Fits with 1, 2, … terms".into(),
        columns: vec![
            Column::numbers("terms", ""),
            Column::numbers("χ²", ""),
            Column::numbers("ℓ", "× 1000"),
            Column::numbers("μ", "kPa"),
            Column::numbers("F", ""),
            Column::numbers("p of F", ""),
            Column::numbers("BIC change", ""),
            Column::numbers("decrement", "× 1000"),
            Column::numbers("starts", "that agree"),
            Column::words("degenerate"),
        ],
        rows,
        emphasised_rows: s.rows.iter().position(|r| r.num_terms == s.chosen).into_iter().collect(),
        note: "A negative BIC change keeps the term.".into(),
    }
}

/// Data, model and whitened residual of one drive.
fn residual_maps(found: &Calibration, recording: &Observed, index: usize, step: usize) -> VoxelMaps {
    let grid = &recording.mask.grid;
    let (measured, model) = (&recording.steps[step].displacement, found.fit.predicted(index, step));
    let spread = |value: &dyn Fn(usize) -> f64| {
        recording.mask.spread(&(0..model.len()).map(value).collect::<Vec<f64>>(), f64::NAN)
    };
    let field = |title: &str, unit: &str, values: Vec<f64>, map, range| VoxelField {
        title: title.into(),
        unit: unit.into(),
        values,
        map,
        range,
    };
    let mut fields = Vec::new();
    for (c, name) in ["x", "y", "z"].iter().enumerate().filter(|(c, _)| grid.measured()[*c]) {
        let from = |u: &dyn Fn(usize) -> f64| {
            (0..model.len())
                .map(u)
                .filter(|v| v.is_finite())
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)])
        };
        if c == 0 {
            let range = Some(from(&|v| model[v][c]));
            fields.push(field("data, u along x", "mm", spread(&|v| measured[v][c]), ColorMap::Viridis, range));
            fields.push(field("model, u along x", "mm", spread(&|v| model[v][c]), ColorMap::Viridis, range));
        }
        let sd = recording.noise_sd_mm[c];
        fields.push(field(
            &format!("(data − model) / noise, {name}"),
            "sd",
            spread(&|v| (measured[v][c] - model[v][c]) / sd),
            ColorMap::Diverging,
            Some([-4.0, 4.0]),
        ));
    }
    VoxelMaps { shape: grid.shape, origin_mm: grid.origin_mm, voxel_mm: grid.voxel_mm, fields }
}

fn whitened(found: &Calibration, observed: &[Observed]) -> Vec<(String, Vec<f64>)> {
    ["x", "y", "z"]
        .iter()
        .enumerate()
        .map(|(c, name)| {
            let mut values = Vec::new();
            for (r, recording) in observed.iter().enumerate() {
                // What is not measured leaves no residual.
                for (s, step) in recording.steps.iter().enumerate().filter(|_| recording.mask.grid.measured()[c]) {
                    let model = found.fit.predicted(r, s);
                    let of = |(m, u): (&[f64; 3], &[f64; 3])| (m[c] - u[c]) / recording.noise_sd_mm[c];
                    values.extend(step.displacement.iter().zip(model).map(of));
                }
            }
            (name.to_string(), values)
        })
        .filter(|(_, values)| !values.is_empty())
        .collect()
}

fn convergence(found: &Calibration) -> LinePlot {
    let last = found.fit.history.last().copied().unwrap_or(0.0);
    LinePlot {
        title: "Convergence".into(),
        x_label: "accepted step".into(),
        y_label: "objective above its last value".into(),
        is_log: true,
        lines: vec![Line {
            name: String::new(),
            points: found.fit.history.iter().enumerate().map(|(n, v)| [n as f64, v - last]).collect(),
            has_marks: true,
            ..Line::default()
        }],
    }
}

fn contour_plot(found: &Calibration, contours: &[Contour]) -> ContourPlot {
    let at = |name: &str| found.estimates.iter().find(|e| e.parameter.name() == name).map(|e| e.value);
    ContourPlot { panels: contour_panels(contours, &at) }
}

/// ℓ_u, ℓ_F and ℓ of every pair of parameters; `estimate_of` names the values to mark.
pub fn contour_panels(contours: &[Contour], estimate_of: &dyn Fn(&str) -> Option<f64>) -> Vec<ContourPanel> {
    let label = |name: &str| {
        let unit = if Parameter::named(name).is_some_and(Parameter::is_modulus) { ", kPa" } else { "" };
        format!("{}{unit}", symbol_of_parameter(name))
    };
    contours
        .iter()
        .flat_map(|c| {
            [("ℓ_u", &c.loss_u), ("ℓ_F", &c.loss_f), ("ℓ", &c.total)].map(|(title, values)| ContourPanel {
                title: title.into(),
                x_label: label(&c.parameters[0]),
                y_label: label(&c.parameters[1]),
                x: c.values[0].clone(),
                y: c.values[1].clone(),
                values: values.iter().map(|v| v.filter(|v| *v > 0.0).unwrap_or(f64::NAN)).collect(),
                is_log_x: Parameter::named(&c.parameters[0]) == Some(Parameter::Kappa),
                mark: estimate_of(&c.parameters[0]).zip(estimate_of(&c.parameters[1])).map(|(a, b)| [a, b]),
            })
        })
        .collect()
}
