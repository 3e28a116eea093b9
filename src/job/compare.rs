//! Compare: whether results are the same as, better or worse than others.

use super::{Context, JobError, Outcome, Request, ResultSchema, Run};
use crate::compare::{
    CompareError, CompareOptions, Comparison, Subject, compare, subject_of, to_junit, to_markdown, to_text,
};
use crate::field::FieldError;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

/// A result and what it is compared with.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ComparedPair {
    /// Name in the output.
    #[schema(max_length = 500)]
    pub name: String,
    /// The result (evaluation/1, sweep/1 or design/1) that is compared with.
    #[schema(value_type = Object)]
    pub base: Value,
    /// The result that is judged.
    #[schema(value_type = Object)]
    pub current: Value,
}

/// Body of a comparison.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CompareRequest {
    /// The results.
    #[schema(min_items = 1, max_items = 10000)]
    pub pairs: Vec<ComparedPair>,
    /// Relative change up to which a figure counts as the same.
    #[serde(default = "relative_tolerance")]
    #[schema(minimum = 0.0, maximum = 1e9, default = relative_tolerance)]
    pub relative_tolerance: f64,
    /// Count every change beyond the tolerance as worse, improvements too.
    #[serde(default)]
    pub is_strict: bool,
    /// Compare evaluations of different specimens with the same scan and parameters.
    #[serde(default)]
    pub across_inputs: bool,
}

fn relative_tolerance() -> f64 {
    CompareOptions::default().relative_tolerance
}

/// Result (`comparison/1`).
#[derive(Serialize, ToSchema)]
struct CompareResult<'a> {
    schema: &'static str,
    relative_tolerance: f64,
    is_strict: bool,
    is_worse: bool,
    comparisons: &'a [Comparison],
}

struct CheckedCompare {
    request: CompareRequest,
    subjects: Vec<(String, Subject, Subject)>,
}

impl Request for CompareRequest {
    const COMMAND: &'static str = "compare";
    const COLLECTION: &'static str = "comparisons";
    const ABOUT: &'static str = "Whether a result is the same as, better or worse than another one.";

    fn example() -> serde_json::Value {
        let result = |force_n: f64| {
            serde_json::json!({
                "schema": "sweep/1", "version": crate::provenance::VERSION, "input_hash": "", "study": crate::sweep::SweepStudy::example(),
                "num_tasks": 1, "num_failed": 0, "columns": ["task", "status", "force_n"], "rows": [[0, "done", force_n]],
            })
        };
        serde_json::json!({ "pairs": [{ "name": "before and after", "base": result(5.0), "current": result(5.1) }] })
    }

    fn result() -> ResultSchema {
        ResultSchema::of::<CompareResult>("comparison/1")
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        let (mut subjects, mut errors) = (Vec::new(), Vec::new());
        for (index, pair) in self.pairs.iter().enumerate() {
            let mut read = |value: &Value, side: &str| {
                let unfit = |e: CompareError| {
                    let error = FieldError::new(format!("/pairs/{index}/{side}"), &pair.name, "a result");
                    errors.push(error.remedy(e.to_string()));
                };
                subject_of(pair.name.as_ref(), value).map_err(unfit).ok()
            };
            if let (Some(base), Some(current)) = (read(&pair.base, "base"), read(&pair.current, "current")) {
                subjects.push((pair.name.clone(), base, current));
            }
        }
        if errors.is_empty() { Ok(Box::new(CheckedCompare { request: self, subjects })) } else { Err(errors) }
    }
}

impl Run for CheckedCompare {
    fn title(&self) -> String {
        format!("comparison of {} results", self.subjects.len())
    }

    fn run(&self, _: &Context) -> Result<Outcome, JobError> {
        let CompareRequest { relative_tolerance, is_strict, across_inputs, .. } = self.request;
        let options = CompareOptions { relative_tolerance, is_strict, across_inputs };
        let mut comparisons: Vec<Comparison> = Vec::new();
        for (index, (name, base, current)) in self.subjects.iter().enumerate() {
            comparisons.push(compare(name, base, current, &options).map_err(|e| {
                let error = FieldError::new(format!("/pairs/{index}"), name, "two results that can be compared");
                JobError::from(error.remedy(e.to_string()))
            })?);
        }
        let is_worse = comparisons.iter().any(|c| c.is_worse);
        let result = CompareResult {
            schema: "comparison/1",
            relative_tolerance,
            is_strict,
            is_worse,
            comparisons: &comparisons,
        };
        let mut outcome = Outcome::new("comparison.json", &result, to_text(&comparisons))?;
        outcome.add("comparison.xml", to_junit(&comparisons));
        outcome.add("comparison.md", to_markdown(&comparisons));
        if is_worse {
            let count: usize = comparisons.iter().map(|c| c.num_worse).sum();
            let strict = if is_strict { " or otherwise changed" } else { "" };
            outcome.is_worse = Some(format!("{count} figures are worse than those compared with{strict}"));
        }
        Ok(outcome)
    }
}
