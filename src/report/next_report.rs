//! The report of a job `next`: what to scan next, what it is worth, and what is known so far.

use super::bars::{BarGroup, GroupedBars};
use super::html::{Report, ReportHeader};
use super::html_parts::{CalloutKind, Column, Table};
use super::number::significant;
use super::symbol_of_parameter;
use crate::next::NextResult;

/// Pictures by name without ending, and the page; `study` is the study's name.
pub fn next_report(result: &NextResult, study: &str) -> (Vec<(String, String)>, Report) {
    let promised = promised(result);
    let header = ReportHeader {
        subtitle: "the next scan".into(),
        program_version: result.version.clone(),
        input_hash: result.input_hash.clone(),
        seed: None,
        facts: vec![("study".into(), study.into()), ("recordings".into(), result.recordings.join(", "))],
    };
    let mut page = Report::new("What to scan next", header);
    page.callout(CalloutKind::Finding, "What to scan next", &result.sentence);
    page.figure(
        &promised,
        "Relative standard deviation of every parameter now and after each candidate, the best first.",
    );
    page.table(&candidates(result));
    page.section("Known so far");
    page.table(&known(result));
    let [x, y, z] = result.misfit.structured_by_component_mm.map(|mm| significant(mm, 2));
    page.paragraph(&format!(
        "Misfit beyond noise, of means over boxes of voxels: {x}, {y} and {z} mm along x, y and z; of the forces {} %. \
         It counts as noise that neighbouring voxels and repeats share.",
        significant(100.0 * result.misfit.force_relative, 2)
    ));
    if !result.left_out.is_empty() {
        page.table(&Table {
            caption: "What may not be scanned".into(),
            columns: vec![Column::words("candidate"), Column::words("reason")],
            rows: result.left_out.iter().map(|l| vec![l.name.clone(), l.reason.clone()]).collect(),
            ..Table::default()
        });
    }
    page.list(&result.notes);
    (vec![("promised".into(), promised)], page)
}

/// Bars of the standard deviations, in per cent.
fn promised(result: &NextResult) -> String {
    let percent = |values: &[f64]| values.iter().map(|sd| 100.0 * sd).collect();
    let now: Vec<f64> = result.parameters.iter().map(|p| p.relative_sd).collect();
    let after = result.candidates.iter().enumerate().map(|(place, c)| {
        let mark = if place == 0 { "best: " } else { "" };
        BarGroup { label: format!("{mark}{}", c.name), values: percent(&c.promised_relative_sd) }
    });
    let asked: Vec<f64> = result.parameters.iter().filter_map(|p| p.precision).collect();
    GroupedBars {
        title: "What each scan promises".into(),
        axis_label: "relative standard deviation, %".into(),
        series: result.parameters.iter().map(|p| symbol_of_parameter(&p.name)).collect(),
        groups: std::iter::once(BarGroup { label: "now".into(), values: percent(&now) }).chain(after).collect(),
        is_log: false,
        reference: asked.into_iter().reduce(f64::min).map(|precision| 100.0 * precision),
        missing_label: "no equilibrium".into(),
    }
    .to_svg()
}

fn candidates(result: &NextResult) -> Table {
    let mut columns = vec![Column::words("candidate")];
    columns.extend(
        result.parameters.iter().map(|p| Column::numbers(format!("sd of {}", symbol_of_parameter(&p.name)), "%")),
    );
    columns.extend([
        Column::numbers("gain per minute", "nats/min"),
        Column::numbers("gain of all", "nats"),
        Column::numbers("beyond what was seen", "% of voxels"),
        Column::numbers("force", "N"),
        Column::numbers("time", "min"),
        Column::numbers("scans to the precision", ""),
    ]);
    let row = |c: &crate::next::CandidateResult| {
        let mut cells = vec![c.name.clone()];
        cells.extend(c.promised_relative_sd.iter().map(|sd| significant(100.0 * sd, 3)));
        cells.extend([
            significant(c.gain_per_minute, 3),
            significant(c.gain_of_all, 3),
            significant(100.0 * c.part_beyond, 2),
            significant(c.force_n, 3),
            significant(c.minutes, 3),
            c.num_scans_to_precision.map_or("–".into(), |n| n.to_string()),
        ]);
        cells
    };
    Table {
        caption: "Candidates, the best first".into(),
        columns,
        rows: result.candidates.iter().map(row).collect(),
        emphasised_rows: vec![0],
        note: format!("Averages over {} materials that the recordings leave possible.", result.num_materials),
    }
}

fn known(result: &NextResult) -> Table {
    let row = |p: &crate::next::NextParameter| {
        let [low, high] = p.interval_95.map(|end| significant(end, 4));
        vec![
            symbol_of_parameter(&p.name),
            significant(p.value, 5),
            significant(100.0 * p.relative_sd, 3),
            significant(100.0 * p.discretisation_relative_sd, 3),
            format!("{low} to {high}"),
            p.precision.map_or("–".into(), |precision| significant(100.0 * precision, 3)),
        ]
    };
    Table {
        caption: "The law fitted to all recordings".into(),
        columns: vec![
            Column::words("parameter"),
            Column::numbers("value", "kPa, 1"),
            Column::numbers("sd", "%"),
            Column::numbers("sd by the mesh", "%"),
            Column::numbers("95 % interval", ""),
            Column::numbers("asked", "%"),
        ],
        rows: result.parameters.iter().map(row).collect(),
        ..Table::default()
    }
}
