//! The page of a sweep: what the variables do, which designs trade information against force, what failed.

use super::{
    CalloutKind, Column, MainEffect, MainEffectsPlot, ParallelAxis, ParallelPlot, ParetoPlot, ParetoPoint, PointKind,
    Report, ReportHeader, Table, significant,
};
use crate::material::Parameter;
use crate::sweep::{Cells, SweepResult, SweepTable};
use std::collections::BTreeMap;

/// Rows of the list of best designs.
const BEST_ROWS: usize = 10;

/// Rows of one material at its designs' largest drives.
struct Selection<'a> {
    table: &'a SweepTable,
    rows: Vec<usize>,
}

impl Selection<'_> {
    fn numbers(&self, name: &str) -> Vec<f64> {
        let all = self.table.numbers(name);
        self.rows.iter().map(|&r| all.get(r).copied().unwrap_or(f64::NAN)).collect()
    }
}

/// The report of a finished sweep; `table` is that of `result`.
pub fn sweep_report(result: &SweepResult, table: &SweepTable) -> String {
    let study = &result.study;
    let header = ReportHeader {
        subtitle: format!("{} designs × {} materials", study.num_points(), study.materials.len()),
        program_version: result.version.clone(),
        input_hash: result.input_hash.clone(),
        seed: Some(study.seed),
        facts: vec![
            ("Base specimen".into(), study.base.name.clone()),
            ("Tasks".into(), result.num_tasks.to_string()),
            ("Tasks that failed".into(), result.num_failed.to_string()),
        ],
    };
    let mut page = Report::new(study.name.clone(), header);
    let texts = |name: &str| match table.column(name) {
        Some(Cells::Texts(v)) => v.clone(),
        _ => Vec::new(),
    };
    let (materials, tasks) = (texts("material"), table.numbers("task"));
    for material in &study.materials {
        // The last row of a task is that of its largest drive.
        let rows = (0..table.num_rows)
            .filter(|&r| materials.get(r).is_some_and(|m| m.as_deref() == Some(material.name.as_str())))
            .filter(|&r| r + 1 == table.num_rows || tasks[r + 1] > tasks[r])
            .collect();
        let names: Vec<String> = material.material.shear_parameters().map(|p| p.name()).collect();
        section(&mut page, result, &material.name, &names, &Selection { table, rows });
    }
    failures(&mut page, &texts("failure_kind"), &texts("failure_reason"), &tasks);
    page.to_html()
}

/// Worst relative standard deviation of the parameters, all drives together; NaN where one is undetermined.
fn worst_relative_sd(selection: &Selection, names: &[String]) -> Vec<f64> {
    let columns: Vec<Vec<f64>> =
        names.iter().map(|n| selection.numbers(&format!("relative_sd_all_drives_{n}"))).collect();
    let worst = |i: usize| {
        columns.iter().map(|c| c[i]).fold(0.0, |a: f64, b| if b.is_nan() || a.is_nan() { f64::NAN } else { a.max(b) })
    };
    (0..selection.rows.len()).map(worst).collect()
}

fn section(page: &mut Report, result: &SweepResult, material: &str, names: &[String], selection: &Selection) {
    page.section(&format!("Material \"{material}\""));
    let force = selection.numbers("force_n");
    let worst: Vec<f64> = worst_relative_sd(selection, names).iter().map(|v| 100.0 * v).collect();
    let worst_label = "worst relative standard deviation / %";
    let front = pareto_front(&force, &worst);
    let order = best_first(&worst);
    if let Some(&best) = order.first() {
        page.callout(
            CalloutKind::Finding,
            "Smallest worst standard deviation",
            &format!(
                "Design {} promises every μ and α to {} % or better, at {} N.",
                selection.numbers("design")[best],
                significant(worst[best], 3),
                significant(force[best], 3)
            ),
        );
    }
    let variables: Vec<(String, Vec<f64>)> =
        result.study.variables.iter().map(|v| (label(&v.name), selection.numbers(&v.name))).collect();
    let mut axes: Vec<ParallelAxis> =
        variables.iter().map(|(label, values)| ParallelAxis { label: label.clone(), values: values.clone() }).collect();
    axes.push(ParallelAxis { label: "force / N".into(), values: force.clone() });
    axes.push(ParallelAxis { label: worst_label.into(), values: worst.clone() });
    page.figure(
        &ParallelPlot { title: "Every design".into(), axes }.to_svg(),
        "Each line is a design at its largest drive; the colour is the last axis. Designs that failed have no line.",
    );
    let mut responses = vec![(worst_label.to_string(), worst.clone()), ("force / N".into(), force.clone())];
    for name in names {
        let unit = if Parameter::named(name).is_some_and(Parameter::is_modulus) { "" } else { "_kpa" };
        let column = format!("sensitivity_sum_{name}{unit}");
        responses.push((label(&column), selection.numbers(&column)));
    }
    for (response_label, response) in responses {
        let effects = variables
            .iter()
            .map(|(label, values)| MainEffect { label: label.clone(), values: values.clone() })
            .collect();
        let title = format!("Main effects on {}", response_label.split(" / ").next().unwrap_or_default());
        page.figure(
            &MainEffectsPlot { title, response_label, response, effects }.to_svg(),
            "Points: designs. Line: means over equal values, or over groups of neighbouring ones.",
        );
    }
    let points = (0..force.len()).map(|i| ParetoPoint {
        x: force[i],
        y: worst[i],
        label: if front[i] { format!("{}", selection.numbers("design")[i]) } else { String::new() },
        kind: if front[i] { PointKind::Front } else { PointKind::Dominated },
    });
    page.figure(
        &ParetoPlot {
            title: "Precision against force".into(),
            x_label: "force / N".into(),
            y_label: worst_label.into(),
            is_log_y: true,
            points: points.collect(),
            ..ParetoPlot::default()
        }
        .to_svg(),
        "Designs on the front carry their number: no other one has both less force and a smaller standard deviation.",
    );
    page.table(&best_table(result, selection, &order, &force, &worst));
}

fn best_table(result: &SweepResult, selection: &Selection, order: &[usize], force: &[f64], worst: &[f64]) -> Table {
    let mut columns = vec![Column::numbers("Design", "")];
    columns.extend(result.study.variables.iter().map(|v| {
        let (name, unit) = split_unit(&v.name);
        Column::numbers(name, unit)
    }));
    columns.push(Column::numbers("Force", "N"));
    columns.push(Column::numbers("Worst relative standard deviation", "%"));
    let designs = selection.numbers("design");
    let variables: Vec<Vec<f64>> = result.study.variables.iter().map(|v| selection.numbers(&v.name)).collect();
    let row = |&i: &usize| {
        let mut cells = vec![format!("{}", designs[i])];
        cells.extend(variables.iter().map(|v| significant(v[i], 4)));
        cells.extend([significant(force[i], 4), significant(worst[i], 4)]);
        cells
    };
    Table {
        caption: "Designs with the smallest worst standard deviation".into(),
        columns,
        rows: order.iter().take(BEST_ROWS).map(row).collect(),
        ..Table::default()
    }
}

fn failures(page: &mut Report, kinds: &[Option<String>], reasons: &[Option<String>], tasks: &[f64]) {
    let mut by_kind: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
    for (row, kind) in kinds.iter().enumerate() {
        if let Some(kind) = kind {
            by_kind.entry(kind).or_insert((0, row)).0 += 1;
        }
    }
    if by_kind.is_empty() {
        return;
    }
    page.section("What failed");
    let row = |(kind, (count, first)): (&&str, &(usize, usize))| {
        let reason = reasons[*first].clone().unwrap_or_default();
        vec![(*kind).to_string(), count.to_string(), format!("{}", tasks[*first]), reason]
    };
    page.table(&Table {
        columns: vec![
            Column::words("Kind"),
            Column::numbers("Tasks", ""),
            Column::numbers("First task", ""),
            Column::words("Its reason"),
        ],
        rows: by_kind.iter().map(row).collect(),
        ..Table::default()
    });
}

/// Indices of finite values, smallest first.
fn best_first(values: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).filter(|&i| values[i].is_finite()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]).then(a.cmp(b)));
    order
}

/// Whether no other point is smaller in both.
fn pareto_front(x: &[f64], y: &[f64]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..x.len()).filter(|&i| x[i].is_finite() && y[i].is_finite()).collect();
    order.sort_by(|a, b| x[*a].total_cmp(&x[*b]).then(y[*a].total_cmp(&y[*b])).then(a.cmp(b)));
    let mut front = vec![false; x.len()];
    let mut smallest = f64::INFINITY;
    for i in order {
        front[i] = y[i] < smallest;
        smallest = smallest.min(y[i]);
    }
    front
}

/// `gap_mm` → (`gap`, `mm`).
fn split_unit(name: &str) -> (String, String) {
    for (suffix, unit) in [("_mm", "mm"), ("_kpa", "kPa"), ("_n", "N")] {
        if let Some(stem) = name.strip_suffix(suffix) {
            return (stem.replace('_', " "), unit.into());
        }
    }
    (name.replace('_', " "), String::new())
}

fn label(name: &str) -> String {
    let (stem, unit) = split_unit(name);
    if unit.is_empty() { stem } else { format!("{stem} / {unit}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_is_not_beaten() {
        let (x, y) = ([1.0, 2.0, 3.0, 2.0, f64::NAN], [5.0, 3.0, 4.0, 6.0, 0.0]);
        assert_eq!(pareto_front(&x, &y), [true, true, false, false, false]);
        assert_eq!(best_first(&[3.0, f64::NAN, 1.0]), [2, 0]);
    }

    #[test]
    fn units_are_split_off() {
        assert_eq!(label("hole_diameter_mm"), "hole diameter / mm");
        assert_eq!(label("sensitivity_sum_mu_1"), "sensitivity sum mu 1");
    }
}
