//! The table: one row per task and drive, in the order of the tasks; a task that failed has one row.

use super::error::StoreError;
use super::store::Collected;
use super::study::SweepStudy;
use super::task::{Figures, Outcome, Task, tasks};
use crate::material::Parameter;
use crate::sensitivity::{EvaluationStep, PromisedSd};

/// Cells of a column; a missing one is null.
#[derive(Clone, Debug, PartialEq)]
pub enum Cells {
    /// Whole numbers.
    Integers(Vec<Option<i64>>),
    /// Numbers, all finite.
    Numbers(Vec<Option<f64>>),
    /// Words.
    Texts(Vec<Option<String>>),
}

/// One column.
#[derive(Clone, Debug, PartialEq)]
pub struct TableColumn {
    /// Name; ends in the unit where there is one.
    pub name: String,
    /// Its cells, one per row.
    pub cells: Cells,
}

/// The table of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepTable {
    /// The columns, all of one length.
    pub columns: Vec<TableColumn>,
    /// Rows.
    pub num_rows: usize,
}

/// One row's source.
struct Row<'a> {
    task: &'a Task,
    outcome: &'a Outcome,
    step: Option<(usize, &'a EvaluationStep)>,
}

impl Row<'_> {
    fn figures(&self) -> Option<&Figures> {
        match self.outcome {
            Outcome::Done(figures) => Some(figures),
            Outcome::Failed { .. } => None,
        }
    }
}

/// Unit suffix of a parameter: `_kpa` for κ and μ.
fn unit(parameter: Parameter) -> &'static str {
    if parameter.is_modulus() { "_kpa" } else { "" }
}

/// Unit suffix of S_ξ: 1 for moduli, kPa for α and others without a unit.
fn sensitivity_unit(parameter: Parameter) -> &'static str {
    if parameter.is_modulus() { "" } else { "_kpa" }
}

impl SweepTable {
    /// The table of a complete set of results.
    ///
    /// # Errors
    /// [`StoreError::Incomplete`].
    pub fn new(study: &SweepStudy, results: &Collected) -> Result<SweepTable, StoreError> {
        results.check_complete(study.num_tasks())?;
        let tasks = tasks(study);
        let mut rows: Vec<Row> = Vec::with_capacity(tasks.len());
        for task in &tasks {
            let Some(outcome) = results.outcomes.get(&task.index) else { continue };
            match outcome {
                Outcome::Done(figures) if !figures.steps.is_empty() => {
                    let steps = figures.steps.iter().enumerate();
                    rows.extend(steps.map(|step| Row { task, outcome, step: Some(step) }));
                }
                _ => rows.push(Row { task, outcome, step: None }),
            }
        }
        let mut columns = Vec::new();
        identification(study, &rows, &mut columns);
        responses(&rows, &mut columns);
        // Parameters of all materials, in the order of the one with most terms.
        let widest = study.materials.iter().max_by_key(|m| m.material.terms.len());
        for parameter in widest.map_or(Vec::new(), |m| m.material.parameters()) {
            of_parameter(parameter, &rows, &mut columns);
        }
        Ok(SweepTable { num_rows: rows.len(), columns })
    }

    /// Comma-separated values: a header, one line per row, missing cells empty, texts quoted where needed, numbers with
    /// the digits that read back to the same bits.
    pub fn to_csv(&self) -> String {
        let mut text: String = self.columns.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(",");
        text.push('\n');
        for row in 0..self.num_rows {
            for (index, column) in self.columns.iter().enumerate() {
                if index > 0 {
                    text.push(',');
                }
                match &column.cells {
                    Cells::Integers(v) => text.extend(v[row].map(|v| v.to_string())),
                    Cells::Numbers(v) => text.extend(v[row].map(shortest)),
                    Cells::Texts(v) => text.extend(v[row].as_deref().map(quoted)),
                }
            }
            text.push('\n');
        }
        text
    }

    /// A column by name.
    pub fn column(&self, name: &str) -> Option<&Cells> {
        self.columns.iter().find(|c| c.name == name).map(|c| &c.cells)
    }

    /// A column of numbers by name, missing cells as NaN; empty where there is none.
    pub fn numbers(&self, name: &str) -> Vec<f64> {
        match self.column(name) {
            Some(Cells::Numbers(v)) => v.iter().map(|v| v.unwrap_or(f64::NAN)).collect(),
            Some(Cells::Integers(v)) => v.iter().map(|v| v.map_or(f64::NAN, |v| v as f64)).collect(),
            _ => Vec::new(),
        }
    }
}

fn shortest(value: f64) -> String {
    // The shortest digits that read back; exponents only where they are shorter to read.
    if value != 0.0 && !(1e-5..1e15).contains(&value.abs()) { format!("{value:e}") } else { format!("{value}") }
}

fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\"").replace(['\n', '\r'], " "))
    } else {
        text.into()
    }
}

fn numbers(name: impl Into<String>, rows: &[Row], value: impl Fn(&Row) -> Option<f64>) -> TableColumn {
    let cells = rows.iter().map(|r| value(r).filter(|v| v.is_finite())).collect();
    TableColumn { name: name.into(), cells: Cells::Numbers(cells) }
}

fn integers(name: &str, rows: &[Row], value: impl Fn(&Row) -> Option<usize>) -> TableColumn {
    let cells = rows.iter().map(|r| value(r).and_then(|v| i64::try_from(v).ok())).collect();
    TableColumn { name: name.into(), cells: Cells::Integers(cells) }
}

fn texts(name: &str, rows: &[Row], value: impl Fn(&Row) -> Option<String>) -> TableColumn {
    TableColumn { name: name.into(), cells: Cells::Texts(rows.iter().map(value).collect()) }
}

/// What the row is of: task, design, material, variables, success, drive.
fn identification(study: &SweepStudy, rows: &[Row], columns: &mut Vec<TableColumn>) {
    columns.push(integers("task", rows, |r| Some(r.task.index)));
    columns.push(integers("design", rows, |r| Some(r.task.point)));
    columns.push(texts("material", rows, |r| Some(study.materials[r.task.material].name.clone())));
    for (index, variable) in study.variables.iter().enumerate() {
        columns.push(numbers(variable.name.clone(), rows, |r| r.task.values.get(index).copied()));
    }
    let failure = |r: &Row| match r.outcome {
        Outcome::Failed { kind, reason } => Some((kind.clone(), reason.clone())),
        Outcome::Done(_) => None,
    };
    columns.push(texts("status", rows, |r| Some(if failure(r).is_some() { "failed" } else { "done" }.into())));
    columns.push(texts("failure_kind", rows, |r| failure(r).map(|f| f.0)));
    columns.push(texts("failure_reason", rows, |r| failure(r).map(|f| f.1)));
    columns.push(integers("step", rows, |r| r.step.map(|s| s.0)));
    columns.push(numbers("step_drive_mm", rows, |r| r.step.map(|s| s.1.drive_mm)));
}

fn responses(rows: &[Row], columns: &mut Vec<TableColumn>) {
    columns.push(numbers("force_n", rows, |r| r.step.map(|s| s.1.force_n)));
    columns.push(numbers("normal_force_n", rows, |r| r.step.and_then(|s| s.1.normal_force_n)));
    columns.push(numbers("volume_mm3", rows, |r| r.figures().map(|f| f.volume_mm3)));
    columns.push(integers("num_voxels", rows, |r| r.step.map(|s| s.1.num_voxels)));
    columns.push(integers("num_voxels_without_mode", rows, |r| r.step.map(|s| s.1.num_voxels_without_mode)));
    columns.push(numbers("median_stretch", rows, |r| r.step.map(|s| s.1.median_stretch)));
    columns.push(numbers("median_mode", rows, |r| r.step.and_then(|s| s.1.median_mode)));
    columns.push(numbers("largest_voxel_stretch", rows, |r| r.step.map(|s| s.1.largest_voxel_stretch)));
    columns.push(numbers("largest_principal_stretch", rows, |r| r.step.map(|s| s.1.largest_principal_stretch)));
    columns.push(numbers("condition_number_all_drives", rows, |r| r.figures().and_then(|f| f.condition_number)));
    columns.push(integers("num_unknowns", rows, |r| r.figures().map(|f| f.num_unknowns)));
    columns.push(texts("evaluation_hash", rows, |r| r.figures().map(|f| f.input_hash.clone())));
}

fn of_parameter(parameter: Parameter, rows: &[Row], columns: &mut Vec<TableColumn>) {
    let name = parameter.name();
    if parameter != Parameter::Kappa {
        let unit = sensitivity_unit(parameter);
        let find =
            |r: &Row| r.step.and_then(|s| s.1.integrated_sensitivity.iter().find(|i| i.parameter == name).cloned());
        columns.push(numbers(format!("sensitivity_sum_{name}{unit}"), rows, |r| find(r).map(|i| i.sum)));
        columns.push(numbers(format!("sensitivity_mean_per_voxel_{name}{unit}"), rows, |r| {
            find(r).map(|i| i.mean_per_voxel)
        }));
        columns.push(numbers(format!("sensitivity_volume_integral_{name}{unit}_mm3"), rows, |r| {
            find(r).map(|i| i.volume_integral)
        }));
    }
    let unit = unit(parameter);
    let find = |list: Option<&Vec<PromisedSd>>| list.and_then(|l| l.iter().find(|p| p.parameter == name)).cloned();
    let own = |r: &Row| find(r.step.map(|s| &s.1.promised_sd));
    let all = |r: &Row| find(r.figures().map(|f| &f.promised_sd));
    columns.push(numbers(format!("promised_sd_{name}{unit}"), rows, |r| own(r)?.value));
    columns.push(numbers(format!("relative_sd_{name}"), rows, |r| own(r)?.relative_sd));
    columns.push(numbers(format!("promised_sd_all_drives_{name}{unit}"), rows, |r| all(r)?.value));
    columns.push(numbers(format!("relative_sd_all_drives_{name}"), rows, |r| all(r)?.relative_sd));
}
