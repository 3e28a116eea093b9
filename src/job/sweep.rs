//! Sweep: a study of many designs, evaluated in parts.

use super::{
    Context, Failure, JobError, Outcome, Part, PartKind, RecordingOutline, Request, ResultSchema, Run, cost, summary,
};
use crate::field::FieldError;
use crate::report::sweep_report;
use crate::sweep::{
    Collected, Outcome as TaskOutcome, SweepResult, SweepStudy, SweepTable, TaskInputs, tasks, to_parquet,
};
use serde::Deserialize;
use serde_json::{Value, json};

impl Request for SweepStudy {
    const COMMAND: &'static str = "sweep";
    const COLLECTION: &'static str = "sweep-studies";
    const ABOUT: &'static str = "Many designs evaluated: a table of what each would tell.";

    fn example() -> serde_json::Value {
        super::defaults::spelled_out(
            include_str!("../../geometries/sweeps/bar-grid.json"),
            &super::defaults::uniaxial_bar(),
        )
    }

    fn result() -> ResultSchema {
        ResultSchema::of::<SweepResult>("sweep/1")
    }

    fn read(value: &Value) -> Result<SweepStudy, Vec<FieldError>> {
        SweepStudy::from_request(value)
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        Ok(Box::new(CheckedSweep(self)))
    }
}

struct CheckedSweep(SweepStudy);

impl Run for CheckedSweep {
    fn title(&self) -> String {
        self.0.name.clone()
    }

    fn parts(&self) -> Vec<Part> {
        let study = &self.0;
        let part = |task: crate::sweep::Task| {
            let TaskInputs { specimen, material, scan, mesh } = task.inputs(study);
            let inputs = json!({ "specimen": specimen, "material": material, "scan": scan, "mesh": mesh });
            Part { kind: PartKind::SweepTask, request: inputs, work_key: None }
        };
        tasks(study).into_iter().map(part).collect()
    }

    /// From the first, the middle and the last task: to mesh ten thousand specimens would take minutes.
    fn estimated_seconds(&self, _: &[RecordingOutline]) -> Option<f64> {
        let (study, all) = (&self.0, tasks(&self.0));
        let of = |index: usize| {
            let TaskInputs { specimen, scan, mesh, .. } = all.get(index)?.inputs(study);
            cost::seconds(&specimen, &mesh.options(&specimen), Some((scan.voxel_mm, None)), specimen.drive_mm.len())
        };
        cost::of_many(all.len(), of)
    }

    fn run(&self, _: &Context) -> Result<Outcome, JobError> {
        Err(JobError::Internal("a sweep runs in parts".into()))
    }

    fn gather(&self, results: Vec<Result<Value, Failure>>) -> Result<Outcome, JobError> {
        let study = &self.0;
        let failed = |e: &dyn std::fmt::Display| JobError::Internal(e.to_string());
        let mut collected = Collected::default();
        for (index, result) in results.into_iter().enumerate() {
            let outcome = match result {
                Ok(value) => TaskOutcome::deserialize(value).map_err(|e| failed(&e))?,
                Err(failure) => TaskOutcome::Failed { kind: "internal".into(), reason: failure.detail },
            };
            collected.outcomes.insert(index, outcome);
        }
        let table = SweepTable::new(study, &collected).map_err(|e| failed(&e))?;
        let result = SweepResult::new(study, &table);
        let mut outcome = Outcome::new("sweep.json", &result, summary::sweep(study, &result))?;
        outcome.add("table.csv", table.to_csv());
        outcome.add("table.parquet", to_parquet(&table).map_err(|e| failed(&e))?);
        outcome.add("report.html", sweep_report(&result, &table));
        Ok(outcome)
    }
}
