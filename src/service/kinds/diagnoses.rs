//! `POST /v1/diagnoses`: where a recording and its model differ, and what physics was left out.

use super::fields::displacement_images;
use super::{
    JobKind, MaterialSchema, Plan, RunContext, RunError, SizeLimits, TaskProgress, json_bytes, mesh_is_small_enough,
};
use crate::diagnosis::{DiagnosisOptions, DiagnosisResult, diagnose};
use crate::material::Ogden;
use crate::provenance::{VERSION, input_hash};
use crate::report::{diagnosis_pictures, diagnosis_report};
use crate::service::problem::{Problem, parse, pointer_in_message};
use crate::service::store::{NewTask, TaskResult};
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Body of a diagnosis.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DiagnosisRequest {
    /// Identifier of an uploaded recording.
    #[schema(max_length = 64)]
    pub recording: String,
    /// The material as believed; its number of terms is the nominal one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = MaterialSchema, nullable = false)]
    pub material: Option<Ogden>,
    /// Element size as a factor on the standard one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.3, maximum = 5.0)]
    pub mesh_factor: Option<f64>,
    /// Displacement error that meshes may leave, mm rms at the largest drive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0)]
    pub allowance_mm: Option<f64>,
    /// Most causes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 20)]
    pub max_causes: Option<usize>,
}

fn options_of(request: &DiagnosisRequest) -> DiagnosisOptions {
    let default = DiagnosisOptions::default();
    DiagnosisOptions {
        mesh_factor: request.mesh_factor.unwrap_or(default.mesh_factor),
        allowance_mm: request.allowance_mm,
        prior: request.material.clone(),
        max_causes: request.max_causes.unwrap_or(default.max_causes),
        ..default
    }
}

/// The kind.
pub struct Diagnoses;

impl JobKind for Diagnoses {
    fn name(&self) -> &'static str {
        "diagnoses"
    }

    fn recordings(&self, body: &serde_json::Value) -> Vec<(String, String)> {
        let id = body.get("recording").and_then(|r| r.as_str());
        id.map(|id| ("/recording".to_string(), id.to_string())).into_iter().collect()
    }

    fn check_recording(
        &self,
        body: &serde_json::Value,
        specimen: &Specimen,
        limits: &SizeLimits,
    ) -> Result<(), Problem> {
        let request: DiagnosisRequest = parse(body)?;
        mesh_is_small_enough(specimen, options_of(&request).mesh_factor, limits)
    }

    fn plan(&self, body: &serde_json::Value, _limits: &SizeLimits) -> Result<Plan, Problem> {
        let request: DiagnosisRequest = parse(body)?;
        if let Some(material) = &request.material {
            material
                .validate()
                .map_err(|e| Problem::at(pointer_in_message("/material", &e.to_string()), e.to_string()))?;
        }
        if let Some(factor) = request.mesh_factor
            && !(0.3..=5.0).contains(&factor)
        {
            return Err(Problem::at("/mesh_factor", format!("mesh_factor is {factor}; it must be from 0.3 to 5")));
        }
        if let Some(allowance) = request.allowance_mm
            && !(allowance > 0.0)
        {
            return Err(Problem::at("/allowance_mm", format!("allowance_mm is {allowance}; it must be positive")));
        }
        if let Some(count) = request.max_causes
            && !(1..=20).contains(&count)
        {
            return Err(Problem::at("/max_causes", format!("max_causes is {count}; it must be from 1 to 20")));
        }
        let input = serde_json::to_string(&request).map_err(|e| Problem::new("internal", e.to_string()))?;
        // The recording's identifier is a hash of its content.
        let cache_key = input_hash(&serde_json::json!({ "kind": "diagnosis", "version": VERSION, "request": request }));
        let title = format!("diagnosis of {}", request.recording.get(..8).unwrap_or(&request.recording));
        Ok(Plan { title, tasks: vec![NewTask { input, cache_key }], has_gather: false })
    }

    fn run(&self, input: &serde_json::Value, context: &RunContext) -> Result<TaskResult, RunError> {
        let request: DiagnosisRequest = parse(input)?;
        let recording = (context.recording)(&request.recording)?;
        let options = options_of(&request);
        let step = std::sync::atomic::AtomicU64::new(0);
        let progress = |text: &str| {
            let done = step.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
            // The number of steps is not known before: the bar stays open-ended.
            (context.progress)(TaskProgress {
                stage: text.trim().chars().take(120).collect(),
                done,
                total: 0,
                best: None,
            });
        };
        let cancelled = || (context.is_cancelled)();
        let found = diagnose(&recording, &options, &progress, &cancelled).map_err(|e| {
            if cancelled() { RunError::Stopped } else { Problem::new("no-solution", e.to_string()).into() }
        })?;
        let hash = input_hash(&serde_json::json!({ "version": VERSION, "request": request }));
        let result = DiagnosisResult::new(&found, &recording.id, hash);
        // Measured less predicted, by the nominal model and with the causes.
        let mut artefacts = Vec::new();
        let residuals = [("before", &found.nominal.residual), ("after", &found.corrected.residual)];
        let fields: Vec<(String, &[[f64; 3]])> = residuals
            .iter()
            .flat_map(|(when, trace)| {
                let steps = trace.displacement.iter().enumerate();
                steps.map(move |(s, u)| (format!("residual-{when}_{}", s + 1), &u[..]))
            })
            .collect();
        displacement_images(&found.observed, &fields, &mut artefacts)?;
        for (name, svg) in diagnosis_pictures(&found) {
            artefacts.push((format!("{name}.svg"), "image/svg+xml".into(), svg.into_bytes()));
        }
        let report = diagnosis_report(&found, &result).to_html();
        artefacts.push(("report.html".into(), "text/html".into(), report.into_bytes()));
        Ok(TaskResult { result: json_bytes(&result)?, artefacts })
    }
}
