//! Next: which drive, protocol or specimen should be scanned next, and what that is worth.

use super::input_use::{InputForm, InputUse};
use super::request::RecordingOutline;
use super::subject::check_mesh;
use super::{Context, JobError, Outcome, Progress, Request, ResultSchema, Run, cost, defaults, summary};
use crate::calibration::{CalibrateOptions, Observed};
use crate::design::Study;
use crate::field::{FieldError, read};
use crate::mesh::{MeshOptions, MeshSize};
use crate::next::{NextError, NextOptions, NextResult, Plan, Precision, advise};
use crate::report::next_report;
use crate::specimen::Specimen;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// Body of a question for the next scan.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NextRequest {
    /// What has been recorded so far (mru-recording/1); all are fitted together.
    #[schema(min_items = 1, max_items = 20)]
    pub recordings: Vec<String>,
    /// The study (`study/1`): its base specimen, drives, scan, protocol and limits hold for the candidates.
    #[serde(deserialize_with = "study_of_request")]
    pub study: Study,
    /// Further specimens that could be scanned (`specimen/1`).
    #[serde(default)]
    #[schema(max_items = 20)]
    pub specimens: Vec<Specimen>,
    /// How far every specimen could be driven for a scan, mm, in the direction of its own drives; where left out,
    /// num_drives from the study's smallest to its largest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 20)]
    pub drive_mm: Option<Vec<f64>>,
    /// Number of drives at which every specimen could be scanned.
    #[serde(default = "num_drives")]
    #[schema(minimum = 1, maximum = 20, default = num_drives)]
    pub num_drives: usize,
    /// Number of Ogden terms; chosen by BIC where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 5)]
    pub num_terms: Option<usize>,
    /// Largest relative standard deviation of every μ and α with which it is enough.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1.0)]
    pub precision: Option<f64>,
    /// The same of single parameters by name (`mu_1`, `alpha_1`, …), in place of that of all.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub precision_by_parameter: BTreeMap<String, f64>,
    /// Minutes that the scan of one drive takes.
    #[serde(default = "scan_minutes")]
    #[schema(minimum = 0.01, maximum = 10000.0, default = scan_minutes)]
    pub scan_minutes: f64,
    /// Minutes that it takes to put another specimen into the scanner than the last recording's.
    #[serde(default = "change_minutes")]
    #[schema(minimum = 0.0, maximum = 10000.0, default = change_minutes)]
    pub change_minutes: f64,
    /// Element size as a factor on the standard one.
    #[serde(default = "mesh_factor")]
    #[schema(minimum = 0.2, maximum = 5.0, default = mesh_factor)]
    pub mesh_factor: f64,
    /// Whether the error of that mesh is extrapolated from a finer one and taken off the recordings.
    #[serde(default = "defaults::yes")]
    #[schema(default = defaults::yes)]
    pub has_mesh_correction: bool,
}

/// A study as requests spell it out.
fn study_of_request<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Study, D::Error> {
    let value = Value::deserialize(deserializer)?;
    Study::from_request(&value).map_err(|errors| {
        let all: Vec<String> = errors.iter().map(FieldError::to_string).collect();
        serde::de::Error::custom(all.join("; "))
    })
}

fn num_drives() -> usize {
    NextOptions::default().num_drives
}

fn scan_minutes() -> f64 {
    NextOptions::default().scan_minutes
}

fn change_minutes() -> f64 {
    NextOptions::default().change_minutes
}

fn mesh_factor() -> f64 {
    NextOptions::default().mesh_factor
}

impl NextRequest {
    fn options(&self) -> NextOptions {
        NextOptions {
            num_terms: self.num_terms,
            mesh_factor: self.mesh_factor,
            has_mesh_correction: self.has_mesh_correction,
            drives_mm: self.drive_mm.clone(),
            num_drives: self.num_drives,
            scan_minutes: self.scan_minutes,
            change_minutes: self.change_minutes,
            precision: Precision { of_all: self.precision, by_parameter: self.precision_by_parameter.clone() },
        }
    }

    /// The study's base and the further specimens.
    fn bodies(&self) -> Vec<Specimen> {
        std::iter::once(&self.study.base).chain(&self.specimens).cloned().collect()
    }
}

impl Request for NextRequest {
    const COMMAND: &'static str = "next";
    const COLLECTION: &'static str = "next-scans";
    const ABOUT: &'static str = "What to scan next, given what has been recorded so far, and what it is worth.";

    fn example() -> Value {
        let study = super::defaults::spelled_out(
            include_str!("../../geometries/studies/two-hole-shear.json"),
            &super::defaults::two_hole_shear(),
        );
        serde_json::json!({
            "recordings": [super::defaults::EXAMPLE_RECORDING], "study": study, "num_terms": 1, "precision": 0.02
        })
    }

    fn result() -> ResultSchema {
        ResultSchema::of::<NextResult>("next/1")
    }

    fn read(value: &Value) -> Result<Self, Vec<FieldError>> {
        if let Some(Err(errors)) = value.get("study").map(Study::from_request) {
            return Err(errors.into_iter().map(|e| e.below("/study")).collect());
        }
        read(value).map_err(|e| vec![e])
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        let mut errors = Vec::new();
        for (index, specimen) in self.specimens.iter().enumerate() {
            errors.extend(specimen.field_errors().into_iter().map(|e| e.below(&format!("/specimens/{index}"))));
        }
        for (index, drive) in self.drive_mm.iter().flatten().enumerate() {
            if !(*drive > 0.0 && drive.is_finite()) {
                errors.push(
                    FieldError::new(format!("/drive_mm/{index}"), *drive, "a finite number above 0")
                        .remedy("every specimen goes so far in the direction of its own drives"),
                );
            }
        }
        for (name, precision) in &self.precision_by_parameter {
            if !(1e-6..=1.0).contains(precision) {
                let pointer = format!("/precision_by_parameter/{}", crate::field::escaped(name));
                errors.push(FieldError::new(pointer, *precision, "from 0.000001 to 1"));
            }
        }
        if errors.is_empty() { Ok(Box::new(self)) } else { Err(errors) }
    }
}

impl Run for NextRequest {
    fn title(&self) -> String {
        format!("next scan of {}", self.study.name)
    }

    fn inputs(&self) -> Vec<InputUse> {
        InputUse::of_list("/recordings", &self.recordings, InputForm::Displacements)
    }

    fn check_size(&self, recordings: &[RecordingOutline], max_elements: usize) -> Result<(), FieldError> {
        let mesh = MeshSize::Factor(self.mesh_factor);
        let all =
            recordings.iter().map(|r| &r.specimen).chain(std::iter::once(&self.study.base)).chain(&self.specimens);
        all.into_iter().try_for_each(|s| check_mesh(s, mesh, "/mesh_factor", max_elements))
    }

    fn estimated_seconds(&self, recordings: &[RecordingOutline]) -> Option<f64> {
        let effort = cost::CalibrationEffort {
            num_terms: self.num_terms,
            num_starts: CalibrateOptions::default().num_starts,
            has_profiles: false,
            has_contours: false,
        };
        let fit = cost::of_calibration(recordings, self.mesh_factor, effort)?;
        let num_drives = self.drive_mm.as_ref().map_or(self.num_drives, Vec::len);
        let voxels = Some((self.study.scan.voxel_mm, None));
        let candidates = self
            .bodies()
            .into_iter()
            .filter_map(|body| cost::seconds(&body, &MeshOptions::scaled(&body, self.mesh_factor), voxels, num_drives));
        Some(fit + candidates.sum::<f64>())
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        let (mut observed, mut names, mut notes) = (Vec::new(), Vec::new(), Vec::new());
        for (index, read) in context.recordings.iter().enumerate() {
            let (recording, force_sd_n) = (&read.recording, self.study.scan.force_sd_n);
            let ready = Observed::new(recording, force_sd_n).map_err(|e| {
                let error = FieldError::new(format!("/recordings/{index}"), &recording.id, "fit for a calibration");
                JobError::from(error.remedy(e.to_string()))
            })?;
            let (ready, missing) = ready.with_readings_found(recording, &self.study.protocol, force_sd_n);
            notes.extend(missing.iter().map(|why| format!("{}: {why}", recording.id)));
            observed.push(ready);
            names.push(recording.id.clone());
        }
        let plan = Plan { study: &self.study, specimens: self.bodies() };
        let on_stage = |text: &str| context.progress(&Progress::stage(text));
        let hash = context.input_hash.clone();
        let mut found =
            advise((&observed, &names), &plan, &self.options(), hash, &on_stage, &|| context.is_cancelled())
                .map_err(|e| failure(&e, context))?;
        found.notes.extend(notes);
        let mut outcome = Outcome::new("next.json", &found, summary::next(&found))?;
        let (pictures, report) = next_report(&found, &self.study.name);
        outcome.add_pictures(pictures);
        outcome.add("report.html", report.to_html());
        outcome.add("material.json", found.material.to_json());
        Ok(outcome)
    }
}

/// A parameter that the law does not have is the request's fault, all else the computation's.
fn failure(error: &NextError, context: &Context) -> JobError {
    match error {
        NextError::UnknownParameter { name, known } => {
            JobError::at("/precision_by_parameter", name, format!("one of {known}, which the fitted law has"))
        }
        other => context.failed(other),
    }
}
