//! `POST /v1/sweeps`: many evaluations, split in tasks over all workers.
//!
//! Either a list of `evaluations`, or a `base` evaluation and `vary`: JSON pointers into it with the values to try, all
//! combinations, the last pointer fastest.

use super::evaluations::{EvaluationRequest, Evaluations, plan_evaluation};
use super::{JobKind, Plan, RunContext, RunError, SizeLimits, json_bytes};
use crate::provenance::VERSION;
use crate::sensitivity::{Evaluation, evaluate};
use crate::service::problem::{Problem, parse};
use crate::service::store::TaskResult;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// One thing that a sweep varies.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SweepAxis {
    /// JSON pointer into `base`, such as `/specimen/holes/0/diameter_mm`.
    #[schema(pattern = "^/", max_length = 200)]
    pub pointer: String,
    /// Values to try.
    #[schema(value_type = Vec<serde_json::Value>, min_items = 1, max_items = 10000)]
    pub values: Vec<serde_json::Value>,
}

/// Body of a sweep: `evaluations`, or `base` and `vary`.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SweepRequest {
    /// Free name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 200)]
    pub name: Option<String>,
    /// The evaluations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 10000)]
    pub evaluations: Option<Vec<EvaluationRequest>>,
    /// The evaluation that is varied.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub base: Option<EvaluationRequest>,
    /// What is varied.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_items = 8)]
    pub vary: Option<Vec<SweepAxis>>,
}

/// One evaluation of a sweep's result.
#[derive(Serialize, Deserialize)]
struct Entry {
    index: usize,
    request: serde_json::Value,
    #[serde(skip_serializing_if = "Option::is_none")]
    evaluation: Option<serde_json::Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    problem: Option<Problem>,
}

/// The evaluations of a sweep with the pointers of their requests.
fn expand(body: &serde_json::Value, limits: &SizeLimits) -> Result<Vec<(String, serde_json::Value)>, Problem> {
    let request: SweepRequest = parse(body)?;
    let to_value = |e: &EvaluationRequest| serde_json::to_value(e).map_err(|e| Problem::new("internal", e.to_string()));
    let too_many = |pointer: &str, count: usize| {
        Problem::at(pointer, format!("{count} evaluations; give 1 to {}", limits.max_tasks))
    };
    match (&request.evaluations, &request.base) {
        (Some(list), None) if request.vary.is_none() => {
            if list.is_empty() || list.len() > limits.max_tasks {
                return Err(too_many("/evaluations", list.len()));
            }
            list.iter().enumerate().map(|(i, e)| Ok((format!("/evaluations/{i}"), to_value(e)?))).collect()
        }
        (None, Some(base)) => {
            let axes = request.vary.unwrap_or_default();
            let count = axes.iter().fold(1usize, |n, a| n.saturating_mul(a.values.len()));
            if count == 0 || count > limits.max_tasks {
                return Err(too_many("/vary", count));
            }
            let base = to_value(base)?;
            (0..count)
                .map(|number| {
                    let mut value = base.clone();
                    let mut rest = number;
                    for (index, axis) in axes.iter().enumerate().rev() {
                        let choice = axis.values[rest % axis.values.len()].clone();
                        rest /= axis.values.len();
                        let slot = value.pointer_mut(&axis.pointer).ok_or_else(|| {
                            Problem::at(
                                format!("/vary/{index}/pointer"),
                                format!("{} is not in base; write the field out there", axis.pointer),
                            )
                        })?;
                        *slot = choice;
                    }
                    Ok(("/base".to_string(), value))
                })
                .collect()
        }
        _ => Err(Problem::at("", "give either evaluations, or base and vary")),
    }
}

/// The kind.
pub struct Sweeps;

impl JobKind for Sweeps {
    fn name(&self) -> &'static str {
        "sweeps"
    }

    fn plan(&self, body: &serde_json::Value, limits: &SizeLimits) -> Result<Plan, Problem> {
        let title = body.get("name").and_then(|n| n.as_str()).unwrap_or("sweep").to_string();
        let mut tasks = Vec::new();
        for (pointer, value) in expand(body, limits)? {
            let request: EvaluationRequest = parse(&value)?;
            let mut task = plan_evaluation(&request, &pointer, limits)?;
            // Only numbers are kept: a full evaluation's key is looked up too.
            task.cache_key.push_str(super::super::store::NUMBERS_ONLY);
            tasks.push(task);
        }
        Ok(Plan { title, tasks, has_gather: true })
    }

    fn run(&self, input: &serde_json::Value, context: &RunContext) -> Result<TaskResult, RunError> {
        Evaluations::numbers(input, context)
    }

    fn gather(
        &self,
        body: &serde_json::Value,
        results: Vec<Result<serde_json::Value, Problem>>,
    ) -> Result<TaskResult, RunError> {
        let all = SizeLimits { max_elements: usize::MAX, max_tasks: usize::MAX };
        let entries: Vec<Entry> = expand(body, &all)?
            .into_iter()
            .zip(results)
            .enumerate()
            .map(|(index, ((_, request), result))| match result {
                Ok(evaluation) => Entry { index, request, evaluation: Some(evaluation), problem: None },
                Err(problem) => Entry { index, request, evaluation: None, problem: Some(problem) },
            })
            .collect();
        let table = table(&entries);
        let result = serde_json::json!({ "schema": "evaluation-list/1", "version": VERSION, "evaluations": entries });
        Ok(TaskResult {
            result: json_bytes(&result)?,
            artefacts: vec![("table.csv".into(), "text/csv".into(), table.into_bytes())],
        })
    }
}

impl Evaluations {
    /// An evaluation's numbers without pictures.
    pub(super) fn numbers(input: &serde_json::Value, context: &RunContext) -> Result<TaskResult, RunError> {
        let request: EvaluationRequest = parse(input)?;
        let options = super::evaluations::options_of(&request)?;
        let cancelled = || (context.is_cancelled)();
        let (evaluation, _) = evaluate(
            &request.specimen,
            &request.material,
            &super::scan_of(request.scan),
            &super::evaluations::drives_of(&request),
            &options,
            &cancelled,
        )
        .map_err(|e| if cancelled() { RunError::Stopped } else { Problem::new("no-solution", e.to_string()).into() })?;
        Ok(TaskResult { result: json_bytes(&evaluation)?, artefacts: Vec::new() })
    }
}

/// One line per evaluation and drive.
fn table(entries: &[Entry]) -> String {
    let mut text = String::from("index,specimen,drive_mm,force_n,num_voxels,median_stretch,problem\n");
    for entry in entries {
        let name = entry.request.pointer("/specimen/name").and_then(|n| n.as_str()).unwrap_or_default();
        let name = name.replace('"', "\"\"");
        if let Some(problem) = &entry.problem {
            text += &format!("{},\"{name}\",,,,,\"{}\"\n", entry.index, problem.detail.replace('"', "\"\""));
        }
        let evaluation: Option<Evaluation> = entry.evaluation.as_ref().and_then(|e| Evaluation::deserialize(e).ok());
        for step in evaluation.iter().flat_map(|e| &e.steps) {
            text += &format!(
                "{},\"{name}\",{},{},{},{},\n",
                entry.index, step.drive_mm, step.force_n, step.num_voxels, step.median_stretch
            );
        }
    }
    text
}
