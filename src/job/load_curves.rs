//! Load curves: what an elastic material leaves out of load curves of homogeneous tests, without a recording.

use super::curve_files::{CurveColumns, TestCurve, add_material, needs_stress_and_stretch, unfit, unfit_curve};
use super::{Context, JobError, Outcome, Request, ResultSchema, Run, summary};
use crate::field::FieldError;
use crate::provenance::VERSION;
use crate::rate::{LoadCurve, LoadCurveError, LoadCurveOptions, LoadCurveVerdict, analyse_load_curve};
use crate::report::load_curve_pictures;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Body of a diagnosis of load curves.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct LoadCurvesRequest {
    /// Tests and their load curves.
    #[schema(min_items = 1, max_items = 64)]
    pub curves: Vec<TestCurve>,
    /// Shape factor of a compressed cylinder, diameter / (4 height).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e6)]
    pub shape_factor: Option<f64>,
    /// How columns are understood.
    #[serde(default)]
    pub columns: CurveColumns,
}

/// Result: the verdict with its provenance.
#[derive(Serialize)]
struct LoadCurvesResult<'a> {
    #[serde(flatten)]
    verdict: &'a LoadCurveVerdict,
    version: &'static str,
    input_hash: &'a str,
}

struct CheckedLoadCurves {
    curves: Vec<LoadCurve>,
}

impl LoadCurvesRequest {
    fn curve(&self, index: usize, entry: &TestCurve) -> Result<LoadCurve, FieldError> {
        let pointer = format!("/curves/{index}/csv");
        let Some(test) = entry.test.with_one_drive() else {
            let allowed = "a test with one drive: uniaxial, equibiaxial, pure_shear or simple_shear";
            let error = FieldError::new(format!("/curves/{index}/test"), entry.test.name(), allowed);
            return Err(error.remedy("fits to curves take biaxial tests; histories of them are not diagnosed"));
        };
        let csv = self.columns.read(&entry.csv, test, &pointer)?;
        needs_stress_and_stretch(csv.is_displacement, csv.is_force, &pointer)?;
        let mut order: Vec<usize> = (0..csv.drive.len()).collect();
        if !csv.time_s.is_empty() {
            // Some sources have rows out of order.
            order.sort_by(|&a, &b| csv.time_s[a].total_cmp(&csv.time_s[b]));
        }
        let pick = |v: &[f64]| order.iter().filter_map(|&i| v.get(i).copied()).collect::<Vec<_>>();
        let name = entry.name.clone().unwrap_or_else(|| entry.test.name().into());
        let curve = LoadCurve::new(&name, test, &pick(&csv.time_s), &pick(&csv.drive), &pick(&csv.stress)).map_err(
            |e| match &e {
                LoadCurveError::Curve(of_curve) => unfit_curve(&pointer, of_curve),
                _ => unfit(&pointer, &e),
            },
        )?;
        let curve = LoadCurve { shape_factor: self.shape_factor, ..curve };
        Ok(if entry.is_kept_back { curve.kept_back() } else { curve })
    }
}

impl Request for LoadCurvesRequest {
    const COMMAND: &'static str = "diagnose-curves";
    const COLLECTION: &'static str = "load-curve-diagnoses";
    const ABOUT: &'static str = "What an elastic material leaves out of load curves of homogeneous tests.";

    fn example() -> serde_json::Value {
        serde_json::json!({ "curves": [{ "test": "uniaxial", "name": "pull", "csv": super::defaults::example_history() }] })
    }

    fn result() -> ResultSchema {
        let further = [("version", "Version of the program."), ("input_hash", "SHA-256 of the request, hexadecimal.")];
        ResultSchema::with::<LoadCurveVerdict>("load_curve_diagnosis/1", &further)
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        let (mut curves, mut errors) = (Vec::new(), Vec::new());
        for (index, entry) in self.curves.iter().enumerate() {
            match self.curve(index, entry) {
                Ok(curve) => curves.push(curve),
                Err(error) => errors.push(error),
            }
        }
        if errors.is_empty() { Ok(Box::new(CheckedLoadCurves { curves })) } else { Err(errors) }
    }
}

impl Run for CheckedLoadCurves {
    fn title(&self) -> String {
        let names: Vec<&str> = self.curves.iter().map(|c| c.name.as_str()).collect();
        format!("diagnosis of {}", names.join(", "))
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        context.step("analyse", 0, 1);
        let verdict = analyse_load_curve(&self.curves, &LoadCurveOptions::default(), &|| context.is_cancelled())
            .map_err(|e| context.failed(&e))?;
        let result = LoadCurvesResult { verdict: &verdict, version: VERSION, input_hash: &context.input_hash };
        let mut outcome = Outcome::new("diagnosis.json", &result, summary::load_curves(&verdict))?;
        add_material(&mut outcome, &verdict.material.material(), false);
        outcome.add_pictures(load_curve_pictures(&verdict));
        Ok(outcome)
    }
}
