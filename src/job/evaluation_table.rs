//! The table of a sweep's evaluations: one row per evaluation and drive, one row for an evaluation that failed.

use super::Failure;
use super::evaluate::EvaluationRequest;
use crate::sensitivity::{Evaluation, EvaluationStep, PromisedSd};
use crate::sweep::{Cells, SweepTable, TableColumn};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// One evaluation of a sweep's result.
#[derive(Serialize, Deserialize, ToSchema)]
#[schema(as = ListedEvaluation)]
pub(super) struct Entry {
    /// Place in the list, from 0.
    pub index: usize,
    /// What was asked.
    #[schema(value_type = EvaluationRequest)]
    pub request: serde_json::Value,
    /// What was found; left out where it failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Evaluation>, nullable = false)]
    pub evaluation: Option<serde_json::Value>,
    /// Why it failed; left out where it did not.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub problem: Option<Failure>,
}

struct Row<'a> {
    entry: &'a Entry,
    evaluation: Option<&'a Evaluation>,
    step: Option<&'a EvaluationStep>,
}

/// The table; `pointers` are what was varied, each a column of its own.
pub(super) fn evaluation_table(entries: &[Entry], pointers: &[String]) -> SweepTable {
    let evaluations: Vec<Option<Evaluation>> =
        entries.iter().map(|e| e.evaluation.as_ref().and_then(|v| Evaluation::deserialize(v).ok())).collect();
    let mut rows = Vec::new();
    for (entry, evaluation) in entries.iter().zip(&evaluations) {
        match evaluation {
            Some(found) if !found.steps.is_empty() => {
                rows.extend(found.steps.iter().map(|step| Row { entry, evaluation: Some(found), step: Some(step) }));
            }
            _ => rows.push(Row { entry, evaluation: None, step: None }),
        }
    }
    let texts = |name: &str, get: &dyn Fn(&Row) -> Option<String>| TableColumn {
        name: name.into(),
        cells: Cells::Texts(rows.iter().map(get).collect()),
    };
    let integers = |name: &str, get: &dyn Fn(&Row) -> Option<usize>| TableColumn {
        name: name.into(),
        cells: Cells::Integers(rows.iter().map(|r| get(r).and_then(|v| i64::try_from(v).ok())).collect()),
    };
    let numbers = |name: String, get: &dyn Fn(&Row) -> Option<f64>| TableColumn {
        name,
        cells: Cells::Numbers(rows.iter().map(|r| get(r).filter(|v| v.is_finite())).collect()),
    };
    let mut columns = vec![
        integers("index", &|r| Some(r.entry.index)),
        texts("specimen", &|r| r.entry.request.pointer("/specimen/name").and_then(|n| n.as_str()).map(String::from)),
    ];
    for pointer in pointers {
        let of = |r: &Row| r.entry.request.pointer(pointer).cloned();
        let is_number = rows.iter().all(|r| of(r).is_some_and(|v| v.is_number()));
        columns.push(if is_number {
            numbers(pointer.clone(), &|r| of(r)?.as_f64())
        } else {
            texts(pointer, &|r| of(r).map(|v| v.to_string()))
        });
    }
    let step = |get: fn(&EvaluationStep) -> f64| move |r: &Row| r.step.map(get);
    columns.push(numbers("drive_mm".into(), &step(|s| s.drive_mm)));
    columns.push(numbers("force_n".into(), &step(|s| s.force_n)));
    if rows.iter().any(|r| r.step.is_some_and(|s| s.normal_force_n.is_some())) {
        columns.push(numbers("normal_force_n".into(), &|r| r.step?.normal_force_n));
    }
    columns.push(integers("num_voxels", &|r| r.step.map(|s| s.num_voxels)));
    columns.push(numbers("median_stretch".into(), &step(|s| s.median_stretch)));
    columns.push(numbers("median_mode".into(), &|r| r.step?.median_mode));
    columns.push(numbers("largest_principal_stretch".into(), &step(|s| s.largest_principal_stretch)));
    // Parameters in the order of the evaluation with most of them.
    let widest = evaluations.iter().flatten().max_by_key(|e| e.promised_sd.len());
    for parameter in widest.into_iter().flat_map(|e| &e.promised_sd).map(|p| p.parameter.clone()) {
        let find = |list: &[PromisedSd]| list.iter().find(|p| p.parameter == parameter).cloned();
        columns.push(numbers(format!("sensitivity_sum_{parameter}"), &|r| {
            r.step?.integrated_sensitivity.iter().find(|i| i.parameter == parameter).map(|i| i.sum)
        }));
        columns.push(numbers(format!("promised_sd_{parameter}"), &|r| find(&r.step?.promised_sd)?.value));
        columns.push(numbers(format!("relative_sd_{parameter}"), &|r| find(&r.step?.promised_sd)?.relative_sd));
        columns.push(numbers(format!("relative_sd_all_drives_{parameter}"), &|r| {
            find(&r.evaluation?.promised_sd)?.relative_sd
        }));
    }
    columns.push(texts("problem", &|r| r.entry.problem.as_ref().map(|p| p.detail.clone())));
    SweepTable { num_rows: rows.len(), columns }
}
