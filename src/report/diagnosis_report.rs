//! The report of a diagnosis: verdict, causes, what was left before and after, what was tested, the load curve, where a
//! misfit may come from.

use super::bars::{BarGroup, GroupedBars};
use super::color::ColorMap;
use super::curves::{CurveSeries, CurvesPlot};
use super::html::{Report, ReportHeader};
use super::html_parts::{CalloutKind, Column, Table};
use super::maps::{VoxelField, VoxelMaps};
use super::number::significant;
use crate::diagnosis::{CauseResult, Diagnosis, DiagnosisResult, ScoreMap, Trace, Verdict};

/// Pictures of a diagnosis: file name without ending, SVG.
pub fn diagnosis_pictures(d: &Diagnosis) -> Vec<(String, String)> {
    let last = d.observed.steps.len() - 1;
    let mut all = Vec::new();
    let residuals = [("before", &d.nominal.residual), ("after", &d.corrected.residual)];
    let ranges: Vec<f64> = (0..3).map(|c| 3.0 * d.observed.noise_sd_mm[c]).collect();
    for (name, residual) in residuals {
        all.push((format!("residual-{name}"), residual_maps(d, residual, last, &ranges, name)));
    }
    all.push(("evidence".into(), evidence_bars(d)));
    if let Some(load) = &d.load {
        let points = load.time_s.iter().zip(&load.measured_n).map(|(t, f)| [*t, *f]).collect();
        let plot = CurvesPlot {
            title: "The load curve: measured, with the effects found (full), without (dashed)".into(),
            x_label: "time (s)".into(),
            y_label: "force (N)".into(),
            series: vec![CurveSeries {
                name: "measured".into(),
                points,
                models: vec![load.force_n[1].clone(), load.force_n[0].clone()],
                is_predicted: false,
            }],
        };
        all.push(("load-curve".into(), plot.to_svg()));
    }
    for (n, (name, map)) in d.maps.iter().enumerate() {
        all.push((format!("map-{}", n + 1), significance_map(name, map)));
    }
    all
}

/// The page.
pub fn diagnosis_report(d: &Diagnosis, r: &DiagnosisResult) -> Report {
    let header = ReportHeader {
        subtitle: format!("Diagnosis of recording {}", r.recording),
        program_version: r.version.clone(),
        input_hash: r.input_hash.clone(),
        seed: None,
        facts: vec![
            ("voxels compared".into(), d.observed.mask.num_voxels().to_string()),
            ("displacement unknowns".into(), r.num_unknowns.to_string()),
            ("equilibria solved".into(), r.num_solves.to_string()),
            (
                "noise per component".into(),
                format!(
                    "{} mm{}",
                    r.noise_sd_mm.map(|s| significant(s, 3)).join(", "),
                    if r.is_noise_estimated { " (estimated from the recording)" } else { "" }
                ),
            ),
            (
                "discretisation allowance".into(),
                format!("{} mm rms at the largest drive", significant(r.allowance_mm, 2)),
            ),
        ],
    };
    let mut page = Report::new(verdict_words(r.verdict), header);
    page.section("What was found");
    let names = r.causes.iter().map(|c| c.description.clone()).collect::<Vec<_>>().join("; ");
    match r.verdict {
        Verdict::NoMismatch => page.callout(
            CalloutKind::Finding,
            "No cause is named",
            "The nominal model explains the recording up to its noise and what meshes leave.",
        ),
        Verdict::Unexplained => page.callout(
            CalloutKind::Caution,
            "Something is left that no cause explains",
            &format!(
                "Misfit beyond noise: {} mm rms, most of it {}. {}",
                significant(r.structured_rms_mm.after, 2),
                r.left_at.as_ref().map_or("everywhere".into(), |l| format!("near {} mm", coordinates(l.center_mm))),
                if names.is_empty() { String::new() } else { format!("Partly explained by: {names}.") }
            ),
        ),
        Verdict::Explained => page.callout(CalloutKind::Finding, "Explained", &names),
        Verdict::ExplainedAmbiguously => page.callout(
            CalloutKind::Caution,
            "Explained, but not by one cause alone",
            &format!(
                "{names}. The data cannot tell this from: {}.",
                r.alternatives.iter().map(alternative).collect::<Vec<_>>().join("; ")
            ),
        ),
    };
    if let Some(m) = &r.modulus_against_belief {
        page.callout(CalloutKind::Caution, "Not as stiff as believed", &format!("It seems that {}.", m.in_words()));
    }
    for cause in &r.causes {
        page.subsection(&format!("{}: {}", cause.name, cause.description));
        if let Some(l) = &cause.location {
            page.paragraph(&format!(
                "At the {}, centre {} mm, extent {} mm.",
                l.region,
                coordinates(l.center_mm),
                coordinates(l.extent_mm)
            ));
        }
        page.table(&Table {
            columns: vec![
                Column::words("parameter"),
                Column::numbers("value", ""),
                Column::numbers("95 % interval", ""),
            ],
            rows: cause
                .parameters
                .iter()
                .map(|p| {
                    let interval = p.interval_95.map_or("not bounded by the data".into(), |[a, b]| {
                        format!("{} to {}", significant(a, 4), significant(b, 4))
                    });
                    vec![p.name.replace('_', " "), significant(p.value, 4), interval]
                })
                .collect(),
            note: format!(
                "Evidence {} (fall of the deviance); explains {} mm rms of displacement.",
                significant(cause.evidence, 3),
                significant(cause.effect_rms_mm, 2)
            ),
            ..Table::default()
        });
    }
    page.section("Before and after");
    page.table(&Table {
        columns: vec![Column::words(""), Column::numbers("nominal model", ""), Column::numbers("with the causes", "")],
        rows: vec![
            row("χ² per datum (1 is noise)", r.chi2_per_datum.before, r.chi2_per_datum.after),
            row("misfit beyond noise, mm rms", r.structured_rms_mm.before, r.structured_rms_mm.after),
            row("misfit on blocks kept back, mm rms", r.kept_back_rms_mm.before, r.kept_back_rms_mm.after),
        ],
        note: "Kept back: the fits see one colour of a chequerboard of voxel blocks and predict the other, in turn."
            .into(),
        ..Table::default()
    });
    page.table(&Table {
        caption: "The material: how wrong the lab would have been".into(),
        columns: vec![
            Column::words("parameter"),
            Column::numbers("nominal model", ""),
            Column::numbers("with the causes", ""),
            Column::numbers("95 % interval", ""),
        ],
        rows: r
            .material_parameters
            .iter()
            .zip(d.corrected.material.parameters())
            .map(|(p, parameter)| {
                let has = d.nominal.material.parameters().contains(&parameter);
                let before = if has { significant(d.nominal.material.value(parameter), 4) } else { "not used".into() };
                let interval = p
                    .interval_95
                    .map_or("not bounded".into(), |[a, b]| format!("{} to {}", significant(a, 4), significant(b, 4)));
                vec![p.name.clone(), before, significant(p.value, 4), interval]
            })
            .collect(),
        ..Table::default()
    });
    let pictures = diagnosis_pictures(d);
    for (name, svg) in &pictures {
        if name == "residual-before" {
            page.figure(svg, "Measured minus nominal model at the largest drive; colours saturate at three standard deviations of the noise.");
        } else if name == "residual-after" {
            page.figure(svg, "The same with the causes modelled.");
        } else if name == "load-curve" {
            page.section("Load curve");
            page.figure(svg, "Force over time; measured minus modelled below.");
        }
    }
    page.section("What was tested");
    for (name, svg) in &pictures {
        if name == "evidence" {
            page.figure(
                svg,
                "Fall of the deviance to first order (score test) and in a full nonlinear fit, of the first round.",
            );
        }
    }
    page.table(&Table {
        columns: vec![
            Column::numbers("round", ""),
            Column::words("cause"),
            Column::words("in words"),
            Column::numbers("score", ""),
            Column::numbers("full fit", "less ln n per parameter"),
        ],
        rows: r
            .ranked
            .iter()
            .map(|c| {
                vec![
                    c.round.to_string(),
                    c.name.clone(),
                    c.description.clone(),
                    significant(c.score, 3),
                    c.fitted.map_or(String::new(), |f| significant(f, 3)),
                ]
            })
            .collect(),
        ..Table::default()
    });
    page.section("Where a misfit may come from");
    page.paragraph(
        "Each part is tested alone, to first order, with the material free: signed square root of the fall of the deviance. \
         Values within ±3 are noise.",
    );
    for ((name, svg), (title, _)) in pictures.iter().filter(|p| p.0.starts_with("map-")).zip(&d.maps) {
        let _ = name;
        page.figure(svg, &format!("Significance of a change of the {title}."));
    }
    page
}

/// An alternative in words, with the experiment that would tell it apart.
fn alternative(cause: &CauseResult) -> String {
    let experiment = cause.experiments.first().map_or(String::new(), |e| {
        let (drive, distance) = (significant(e.drive_mm, 3), significant(e.distance_sd, 2));
        format!(" (a further step at {drive} mm would tell it apart by {distance} standard deviations)")
    });
    format!("{}{experiment}", cause.description)
}

fn row(name: &str, before: f64, after: f64) -> Vec<String> {
    vec![name.into(), significant(before, 4), significant(after, 4)]
}

fn coordinates(x: [f64; 3]) -> String {
    format!("({:.1}, {:.1}, {:.1})", x[0], x[1], x[2])
}

fn verdict_words(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::NoMismatch => "No mismatch beyond noise and meshes",
        Verdict::Explained => "A mismatch, explained",
        Verdict::ExplainedAmbiguously => "A mismatch with more than one explanation",
        Verdict::Unexplained => "A mismatch that is not explained",
    }
}

fn residual_maps(d: &Diagnosis, residual: &Trace, step: usize, ranges: &[f64], when: &str) -> String {
    let mask = &d.observed.mask;
    let fields = (0..3)
        .map(|c| {
            let values: Vec<f64> = residual.displacement[step].iter().map(|u| u[c]).collect();
            VoxelField {
                title: format!("measured − model, u_{} ({when})", ["x", "y", "z"][c]),
                unit: "mm".into(),
                values: mask.spread(&values, f64::NAN),
                map: ColorMap::Diverging,
                range: Some([-ranges[c], ranges[c]]),
            }
        })
        .collect();
    VoxelMaps { shape: mask.grid.shape, origin_mm: mask.grid.origin_mm, voxel_mm: mask.grid.voxel_mm, fields }.to_svg()
}

fn evidence_bars(d: &Diagnosis) -> String {
    let groups = d
        .ranked
        .iter()
        .filter(|r| r.round == 1)
        .take(12)
        .map(|r| BarGroup {
            label: r.description.chars().take(34).collect(),
            values: vec![r.score, r.fitted.unwrap_or(f64::NAN)],
        })
        .collect();
    GroupedBars {
        title: "Causes by what they would explain".into(),
        axis_label: "fall of the deviance".into(),
        series: vec!["score test".into(), "full fit".into()],
        groups,
        is_log: true,
        reference: None,
        missing_label: "not fitted".into(),
    }
    .to_svg()
}

fn significance_map(name: &str, map: &ScoreMap) -> String {
    let counts = map.division.counts;
    let voxel = [0, 1, 2].map(|a| 2.0 * map.division.half_mm[a] / counts[a] as f64);
    VoxelMaps {
        shape: counts,
        origin_mm: [0, 1, 2].map(|a| -map.division.half_mm[a] + 0.5 * voxel[a]),
        voxel_mm: voxel,
        fields: vec![VoxelField {
            title: name.into(),
            unit: "σ".into(),
            values: map.significance.clone(),
            map: ColorMap::Diverging,
            range: None,
        }],
    }
    .to_svg()
}
