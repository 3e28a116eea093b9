//! `POST /v1/sweeps`: many evaluations, split in tasks over all workers.
//!
//! Either a list of `evaluations`, or a `base` evaluation and `vary`: JSON pointers into it with the values to try (all
//! combinations, the last pointer fastest), or with ranges that `sample` fills.

use super::evaluations::{EvaluationRequest, Evaluations, plan_evaluation};
use super::sweep_table::{Entry, sweep_table};
use super::{JobKind, Plan, RunContext, RunError, SizeLimits, json_bytes};
use crate::provenance::VERSION;
use crate::sensitivity::evaluate;
use crate::service::problem::{Problem, parse};
use crate::service::store::TaskResult;
use crate::sweep::{latin_hypercube_points, to_parquet};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// One thing that a sweep varies: `values`, or a `range` where the sweep has a `sample`.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SweepAxis {
    /// JSON pointer into `base`, such as `/specimen/holes/0/diameter_mm`.
    #[schema(pattern = "^/", max_length = 200)]
    pub pointer: String,
    /// Values to try.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(value_type = Vec<serde_json::Value>, max_items = 10000)]
    pub values: Vec<serde_json::Value>,
    /// Least and greatest value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 2, max_items = 2)]
    pub range: Option<[f64; 2]>,
}

/// A Latin hypercube over the ranges.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SweepSample {
    /// Points.
    #[schema(minimum = 1, maximum = 10000)]
    pub count: usize,
    /// Seed; the same seed gives the same points.
    #[serde(default)]
    #[schema(minimum = 0)]
    pub seed: u64,
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
    /// Points drawn from the ranges instead of all combinations of values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub sample: Option<SweepSample>,
}

/// Where in the body an evaluation's content stands.
enum Origin {
    /// In the list.
    Listed(usize),
    /// In the base, but for the axes: their pointers into the base, and the pointers of the values in the body.
    Varied(Vec<(String, String)>),
}

impl Origin {
    /// The pointer in the body of what is at `pointer` in the evaluation.
    fn locate(&self, pointer: &str) -> String {
        match self {
            Origin::Listed(index) => format!("/evaluations/{index}{pointer}"),
            Origin::Varied(axes) => {
                let within = axes.iter().find_map(|(axis, value)| {
                    let rest = pointer.strip_prefix(axis.as_str())?;
                    (rest.is_empty() || rest.starts_with('/')).then(|| format!("{value}{rest}"))
                });
                within.unwrap_or_else(|| format!("/base{pointer}"))
            }
        }
    }
}

/// The combinations of an axis list: per point, per axis, the value and its pointer in the body.
fn points(
    axes: &[SweepAxis],
    sample: Option<SweepSample>,
    max: usize,
) -> Result<Vec<Vec<(serde_json::Value, String)>>, Problem> {
    let too_many = |pointer: &str, count: usize| Problem::at(pointer, format!("{count} evaluations; give 1 to {max}"));
    if let Some(sample) = sample {
        if sample.count == 0 || sample.count > max {
            return Err(too_many("/sample/count", sample.count));
        }
        let mut ranges = Vec::new();
        for (index, axis) in axes.iter().enumerate() {
            match axis.range {
                Some([low, high]) if low.is_finite() && high.is_finite() && low <= high && axis.values.is_empty() => {
                    ranges.push([low, high]);
                }
                _ => {
                    let detail = "a sample needs a range from a least to a greatest value, and no values";
                    return Err(Problem::at(format!("/vary/{index}/range"), detail));
                }
            }
        }
        let drawn = latin_hypercube_points(&ranges, sample.count, sample.seed);
        let named = |point: Vec<f64>| {
            point.into_iter().enumerate().map(|(a, v)| (v.into(), format!("/vary/{a}/range"))).collect()
        };
        return Ok(drawn.into_iter().map(named).collect());
    }
    if let Some(index) = axes.iter().position(|a| a.range.is_some()) {
        return Err(Problem::at(format!("/vary/{index}/range"), "a range needs sample with the number of points"));
    }
    let count = axes.iter().fold(1usize, |n, a| n.saturating_mul(a.values.len()));
    if count == 0 || count > max {
        return Err(too_many("/vary", count));
    }
    let point = |number: usize| {
        let mut rest = number;
        let mut chosen = Vec::with_capacity(axes.len());
        for (index, axis) in axes.iter().enumerate().rev() {
            let choice = rest % axis.values.len();
            rest /= axis.values.len();
            chosen.push((axis.values[choice].clone(), format!("/vary/{index}/values/{choice}")));
        }
        chosen.reverse();
        chosen
    };
    Ok((0..count).map(point).collect())
}

/// The evaluations of a sweep with where they stand in the body.
fn expand(body: &serde_json::Value, limits: &SizeLimits) -> Result<Vec<(Origin, serde_json::Value)>, Problem> {
    let request: SweepRequest = parse(body)?;
    let to_value = |e: &EvaluationRequest| serde_json::to_value(e).map_err(|e| Problem::new("internal", e.to_string()));
    let axes = request.vary.unwrap_or_default();
    match (&request.evaluations, &request.base) {
        (Some(list), None) if axes.is_empty() && request.sample.is_none() => {
            if list.is_empty() || list.len() > limits.max_tasks {
                let detail = format!("{} evaluations; give 1 to {}", list.len(), limits.max_tasks);
                return Err(Problem::at("/evaluations", detail));
            }
            list.iter().enumerate().map(|(i, e)| Ok((Origin::Listed(i), to_value(e)?))).collect()
        }
        (None, Some(base)) => {
            let base = to_value(base)?;
            for (index, axis) in axes.iter().enumerate() {
                if base.pointer(&axis.pointer).is_none() {
                    let detail = format!("{} is not in base; write the field out there", axis.pointer);
                    return Err(Problem::at(format!("/vary/{index}/pointer"), detail));
                }
            }
            let mut all = Vec::new();
            for point in points(&axes, request.sample, limits.max_tasks)? {
                let mut value = base.clone();
                let mut origin = Vec::with_capacity(axes.len());
                for (index, (axis, (choice, place))) in axes.iter().zip(point).enumerate() {
                    let slot = value.pointer_mut(&axis.pointer).ok_or_else(|| {
                        let detail = format!("{} is gone once an axis before it has its value", axis.pointer);
                        Problem::at(format!("/vary/{index}/pointer"), detail)
                    })?;
                    *slot = choice;
                    origin.push((axis.pointer.clone(), place));
                }
                all.push((Origin::Varied(origin), value));
            }
            Ok(all)
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
        for (origin, value) in expand(body, limits)? {
            let planned = parse(&value).and_then(|request: EvaluationRequest| plan_evaluation(&request, "", limits));
            let mut task = planned.map_err(|mut problem| {
                for error in &mut problem.errors {
                    error.pointer = origin.locate(&error.pointer);
                }
                problem
            })?;
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
        let request: SweepRequest = parse(body)?;
        let pointers: Vec<String> = request.vary.unwrap_or_default().into_iter().map(|a| a.pointer).collect();
        let table = sweep_table(&entries, &pointers);
        let parquet = to_parquet(&table).map_err(|e| Problem::new("internal", e.to_string()))?;
        let result = serde_json::json!({
            "schema": "evaluation-list/1", "version": VERSION, "varied": pointers, "evaluations": entries,
        });
        let artefacts = vec![
            ("table.csv".into(), "text/csv".into(), table.to_csv().into_bytes()),
            ("table.parquet".into(), "application/vnd.apache.parquet".into(), parquet),
        ];
        Ok(TaskResult { result: json_bytes(&result)?, artefacts })
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
