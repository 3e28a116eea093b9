//! Evaluation list: many evaluations, split in parts over all workers.
//!
//! Either a list of `evaluations`, or a `base` evaluation and `vary`: JSON pointers into it with the values to try (all
//! combinations, the last pointer fastest), or with ranges that `sample` fills.

use super::evaluate::EvaluationRequest;
use super::evaluation_table::{Entry, evaluation_table};
use super::kind::work_key;
use super::{Context, Failure, JobError, Outcome, Part, PartKind, RecordingOutline, Request, ResultSchema, Run, cost};
use crate::field::FieldError;
use crate::field::schema::Seed;
use crate::file::json_bytes;
use crate::provenance::VERSION;
use crate::sweep::{latin_hypercube_points, to_parquet};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use utoipa::ToSchema;

/// Most evaluations of one list.
const MAX_EVALUATIONS: usize = 10_000;
/// Memory that all of them may take, bytes: a few characters, repeated ten thousand times, would take gigabytes.
const MAX_BYTES: u64 = 256 << 20;
/// Errors that are told at once; a list may have one in every entry.
const MAX_ERRORS: usize = 50;

/// One thing that is varied: `values`, or a `range` where there is a `sample`.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = SweepAxis)]
pub struct VariedField {
    /// JSON pointer into `base`, such as `/specimen/holes/0/diameter_mm`.
    #[schema(pattern = "^/", max_length = 200)]
    pub pointer: String,
    /// Values to try.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(value_type = Vec<serde_json::Value>, max_items = 10000)]
    pub values: Vec<Value>,
    /// Least and greatest value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 2, max_items = 2)]
    pub range: Option<[f64; 2]>,
}

/// A Latin hypercube over the ranges.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = SweepSample)]
pub struct RangeSample {
    /// Points.
    #[schema(minimum = 1, maximum = 10000)]
    pub count: usize,
    /// Seed; the same seed gives the same points.
    #[serde(default)]
    #[schema(value_type = Seed)]
    pub seed: u64,
}

/// Body of a list: `evaluations`, or `base` and `vary`.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = SweepRequest)]
pub struct EvaluationListRequest {
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
    pub base: Option<EvaluationRequest>,
    /// What is varied.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_items = 8)]
    pub vary: Option<Vec<VariedField>>,
    /// Points drawn from the ranges instead of all combinations of values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sample: Option<RangeSample>,
}

/// Where in the request an evaluation's content stands.
enum Origin {
    /// In the list.
    Listed(usize),
    /// In the base, but for what is varied: its pointers into the base, and the pointers of the values in the request.
    Varied(Vec<(String, String)>),
}

impl Origin {
    /// The pointer in the request of what is at `pointer` in the evaluation.
    fn locate(&self, pointer: &str) -> String {
        match self {
            Origin::Listed(index) => format!("/evaluations/{index}{pointer}"),
            Origin::Varied(fields) => {
                let within = fields.iter().find_map(|(field, value)| {
                    let rest = pointer.strip_prefix(field.as_str())?;
                    (rest.is_empty() || rest.starts_with('/')).then(|| format!("{value}{rest}"))
                });
                within.unwrap_or_else(|| format!("/base{pointer}"))
            }
        }
    }
}

/// A value of each varied field, with its pointer in the request.
type Point = Vec<(Value, String)>;

fn too_many(pointer: &str, count: usize) -> FieldError {
    FieldError::new(pointer, format!("{count} evaluations"), format!("1 to {MAX_EVALUATIONS} evaluations"))
}

/// Points of a Latin hypercube over the ranges.
fn sampled(fields: &[VariedField], sample: RangeSample) -> Result<Vec<Point>, FieldError> {
    if sample.count == 0 || sample.count > MAX_EVALUATIONS {
        return Err(too_many("/sample/count", sample.count));
    }
    let mut ranges = Vec::new();
    for (index, field) in fields.iter().enumerate() {
        match field.range {
            Some([low, high]) if low.is_finite() && high.is_finite() && low <= high && field.values.is_empty() => {
                ranges.push([low, high]);
            }
            found => {
                let allowed = "a range from a least to a greatest value, without values, where there is a sample";
                return Err(FieldError::new(format!("/vary/{index}/range"), json!(found), allowed));
            }
        }
    }
    let drawn = latin_hypercube_points(&ranges, sample.count, sample.seed);
    let named =
        |point: Vec<f64>| point.into_iter().enumerate().map(|(a, v)| (v.into(), format!("/vary/{a}/range"))).collect();
    Ok(drawn.into_iter().map(named).collect())
}

/// All combinations of the values, the last field fastest.
fn combined(fields: &[VariedField]) -> Result<Vec<Point>, FieldError> {
    if let Some(index) = fields.iter().position(|a| a.range.is_some()) {
        let error = FieldError::new(format!("/vary/{index}/range"), json!(fields[index].range), "left out");
        return Err(error.remedy("a range needs sample with the number of points"));
    }
    let count = fields.iter().fold(1usize, |n, a| n.saturating_mul(a.values.len()));
    if count == 0 || count > MAX_EVALUATIONS {
        return Err(too_many("/vary", count));
    }
    let point = |number: usize| {
        let mut rest = number;
        let mut chosen = Vec::with_capacity(fields.len());
        for (index, field) in fields.iter().enumerate().rev() {
            let choice = rest % field.values.len();
            rest /= field.values.len();
            chosen.push((field.values[choice].clone(), format!("/vary/{index}/values/{choice}")));
        }
        chosen.reverse();
        chosen
    };
    Ok((0..count).map(point).collect())
}

/// Whether `count` evaluations, each the base with a value of every field, can be held in memory.
fn check_memory(base: &Value, fields: &[VariedField], count: usize) -> Result<(), FieldError> {
    let bytes_of = |value: &Value| json_bytes(value.to_string().as_bytes());
    let largest = |field: &VariedField| field.values.iter().map(bytes_of).max().unwrap_or(0);
    let each = bytes_of(base) + fields.iter().map(largest).sum::<u64>();
    let all = each.saturating_mul(count as u64);
    if all <= MAX_BYTES {
        return Ok(());
    }
    let found = format!("{count} evaluations of {} kB of memory each", each / 1000);
    let error = FieldError::new("/base", found, format!("at most {} MB together", MAX_BYTES / 1_000_000));
    Err(error.remedy("try fewer points at a time, or give the base fewer drives"))
}

/// The evaluation in which `fields` have the values of `point`, and where its content stands.
fn varied(base: &Value, fields: &[VariedField], point: Point) -> Result<(Origin, Value), FieldError> {
    let mut value = base.clone();
    let mut origin = Vec::with_capacity(fields.len());
    for (index, (field, (choice, place))) in fields.iter().zip(point).enumerate() {
        let slot = value.pointer_mut(&field.pointer).ok_or_else(|| {
            let error = FieldError::new(format!("/vary/{index}/pointer"), &field.pointer, "a field of base");
            error.remedy("it is not there, or gone once a field before it has its value; write it out in base")
        })?;
        *slot = choice;
        origin.push((field.pointer.clone(), place));
    }
    Ok((Origin::Varied(origin), value))
}

impl EvaluationListRequest {
    /// The evaluations with where they stand in the request.
    fn expanded(&self) -> Result<Vec<(Origin, Value)>, FieldError> {
        let whole = |e: serde_json::Error| FieldError::new("", e, "a request that JSON can hold");
        let fields = self.vary.as_deref().unwrap_or_default();
        match (&self.evaluations, &self.base) {
            (Some(list), None) if fields.is_empty() && self.sample.is_none() => {
                if list.is_empty() || list.len() > MAX_EVALUATIONS {
                    return Err(too_many("/evaluations", list.len()));
                }
                let listed = |(i, e)| Ok((Origin::Listed(i), serde_json::to_value(e).map_err(whole)?));
                list.iter().enumerate().map(listed).collect()
            }
            (None, Some(base)) => {
                let base = serde_json::to_value(base).map_err(whole)?;
                let points = match self.sample {
                    Some(sample) => sampled(fields, sample)?,
                    None => combined(fields)?,
                };
                check_memory(&base, fields, points.len())?;
                points.into_iter().map(|point| varied(&base, fields, point)).collect()
            }
            _ => Err(FieldError::new("", "neither of the two forms", "either evaluations, or base and vary")),
        }
    }
}

impl Request for EvaluationListRequest {
    const COMMAND: &'static str = "evaluate-list";
    const COLLECTION: &'static str = "sweeps";
    const ABOUT: &'static str = "Many evaluations: a list, or one that is varied; a table of what each would tell.";

    fn example() -> serde_json::Value {
        serde_json::json!({ "name": "diameters", "base": EvaluationRequest::example(), "vary": [{ "pointer": "/specimen/holes/0/diameter_mm", "values": [3.0, 4.0] }] })
    }

    fn result() -> ResultSchema {
        ResultSchema::of::<EvaluationListResult>("evaluation-list/1")
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        let mut errors = Vec::new();
        let (mut evaluations, mut work_keys) = (Vec::new(), Vec::new());
        for (origin, value) in self.expanded().map_err(|e| vec![e])? {
            let checked = crate::field::read::<EvaluationRequest>(&value).map_err(|e| vec![e]);
            match checked.and_then(EvaluationRequest::checked) {
                Ok(checked) => {
                    evaluations.push(value);
                    work_keys.push(work_key(EvaluationRequest::COMMAND, checked.content()));
                }
                Err(found) => {
                    errors.extend(found.into_iter().map(|e| FieldError { pointer: origin.locate(&e.pointer), ..e }));
                }
            }
            if errors.len() >= MAX_ERRORS {
                break;
            }
        }
        if errors.is_empty() {
            Ok(Box::new(CheckedList { request: self, evaluations, work_keys }))
        } else {
            Err(errors)
        }
    }
}

/// Result (`evaluation-list/1`).
#[derive(Serialize, ToSchema)]
struct EvaluationListResult<'a> {
    schema: &'static str,
    version: &'static str,
    /// JSON pointers to what was varied.
    varied: &'a [String],
    /// The evaluations, in their order.
    evaluations: &'a [Entry],
}

struct CheckedList {
    request: EvaluationListRequest,
    evaluations: Vec<Value>,
    /// The key of equal work of each.
    work_keys: Vec<String>,
}

impl Run for CheckedList {
    fn title(&self) -> String {
        self.request.name.clone().unwrap_or_else(|| "sweep".into())
    }

    /// From the first, the middle and the last evaluation: to mesh ten thousand specimens would take minutes.
    fn estimated_seconds(&self, _: &[RecordingOutline]) -> Option<f64> {
        let of = |index: usize| {
            let request = crate::field::read::<EvaluationRequest>(self.evaluations.get(index)?).ok()?;
            request.checked().ok()?.estimated_seconds(&[])
        };
        cost::of_many(self.evaluations.len(), of)
    }

    fn parts(&self) -> Vec<Part> {
        let part = |(value, key): (&Value, &String)| {
            let mut request = value.clone();
            // Only numbers are kept.
            request["has_files"] = false.into();
            Part { kind: PartKind::Evaluation, request, work_key: Some(key.clone()) }
        };
        self.evaluations.iter().zip(&self.work_keys).map(part).collect()
    }

    fn run(&self, _: &Context) -> Result<Outcome, JobError> {
        Err(JobError::Internal("a list of evaluations runs in parts".into()))
    }

    fn gather(&self, results: Vec<Result<Value, Failure>>) -> Result<Outcome, JobError> {
        let entries: Vec<Entry> = self
            .evaluations
            .iter()
            .zip(results)
            .enumerate()
            .map(|(index, (request, result))| {
                let (evaluation, problem) = match result {
                    Ok(evaluation) => (Some(evaluation), None),
                    Err(problem) => (None, Some(problem)),
                };
                Entry { index, request: request.clone(), evaluation, problem }
            })
            .collect();
        let pointers: Vec<String> = self.request.vary.iter().flatten().map(|a| a.pointer.clone()).collect();
        let table = evaluation_table(&entries, &pointers);
        let parquet = to_parquet(&table).map_err(|e| JobError::Internal(e.to_string()))?;
        let result = EvaluationListResult {
            schema: "evaluation-list/1",
            version: VERSION,
            varied: &pointers,
            evaluations: &entries,
        };
        let num_failed = entries.iter().filter(|e| e.problem.is_some()).count();
        let text = format!("{}: {} evaluations, {num_failed} failed\n", self.title(), entries.len());
        let mut outcome = Outcome::new("evaluations.json", &result, text)?;
        outcome.add("table.csv", table.to_csv());
        outcome.add("table.parquet", parquet);
        Ok(outcome)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{job_of_part, kind_of_collection};

    /// What a part says of itself is what is found when it is read again, so that equal work is known as such whoever
    /// asks for it.
    #[test]
    fn parts_are_known_as_the_evaluations_that_they_are() {
        let list =
            kind_of_collection("sweeps").expect("a kind").job(&EvaluationListRequest::example()).expect("a sweep");
        let parts = list.parts();
        assert_eq!(parts.len(), 2);
        for part in &parts {
            let (key, is_numbers_only) = job_of_part(part).expect("an evaluation").work_key();
            assert_eq!((part.work_key.as_ref(), is_numbers_only), (Some(&key), true));
        }
        assert_ne!(parts[0].work_key, parts[1].work_key);
    }
}
