//! `POST /v1/calibrations`: material parameters from recordings, with their uncertainty and the number of terms.

use super::fields::displacement_images;
use super::{JobKind, Plan, RunContext, RunError, SizeLimits, TaskProgress, json_bytes, mesh_is_small_enough};
use crate::calibration::{
    CalibrateOptions, Calibration, CalibrationResult, ContourOptions, Objective, Observed, PAPER_BETA, Rule, TermCount,
    calibrate,
};
use crate::mesh::MeshOptions;
use crate::provenance::{VERSION, input_hash};
use crate::report::calibration_report;
use crate::service::problem::{Problem, parse};
use crate::service::store::{NewTask, TaskResult};
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicU64, Ordering};
use utoipa::ToSchema;

/// Standard deviation of a force whose recording does not state one, N.
const FORCE_SD_N: f64 = 0.02;
/// Most recordings of one calibration.
const MAX_RECORDINGS: usize = 20;

/// Body of a calibration.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CalibrationRequest {
    /// Identifiers of recordings; all are fitted together.
    #[schema(min_items = 1, max_items = 20)]
    pub recordings: Vec<String>,
    /// Number of Ogden terms; chosen by the rule where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 5)]
    pub num_terms: Option<usize>,
    /// Rule that decides the number of terms: `bic` (default), `f_test` or `decrement`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = String, pattern = "^(bic|f_test|decrement)$", nullable = false)]
    pub rule: Option<Rule>,
    /// What is minimised: `weighted` (χ² by the noise, default) or `paper` (the paper's loss).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(pattern = "^(weighted|paper)$", nullable = false)]
    pub objective: Option<String>,
    /// Weight of the force in the paper's loss.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0)]
    pub beta: Option<f64>,
    /// Element size as a factor on the standard one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.2, maximum = 5.0)]
    pub mesh_factor: Option<f64>,
    /// Whether a second mesh widens the intervals by the error of the first; true by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub has_mesh_allowance: Option<bool>,
    /// Starts tried for every number of terms; 3 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 20)]
    pub num_starts: Option<usize>,
    /// Voxels nearer than this to the ends of a sheared block are left out, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0)]
    pub end_margin_mm: Option<f64>,
    /// Profile likelihoods of all parameters.
    #[serde(default)]
    pub has_profiles: bool,
    /// Contours of the losses around the estimate.
    #[serde(default)]
    pub has_contours: bool,
}

fn options_of(request: &CalibrationRequest) -> Result<CalibrateOptions, Problem> {
    let within = |pointer: &str, value: f64, [low, high]: [f64; 2]| {
        let is_fine = value >= low && value <= high;
        let message = || Problem::at(pointer, format!("{value}; it must be from {low} to {high}"));
        if is_fine { Ok(()) } else { Err(message()) }
    };
    let default = CalibrateOptions::default();
    let beta = request.beta.unwrap_or(PAPER_BETA);
    within("/beta", beta, [0.0, 1e12])?;
    let objective = match request.objective.as_deref() {
        None | Some("weighted") => Objective::Weighted,
        Some("paper") => Objective::Paper { beta },
        Some(other) => return Err(Problem::at("/objective", format!("{other:?} is not weighted or paper"))),
    };
    let mesh_factor = request.mesh_factor.unwrap_or(default.mesh_factor);
    within("/mesh_factor", mesh_factor, [0.2, 5.0])?;
    let num_starts = request.num_starts.unwrap_or(default.num_starts);
    within("/num_starts", num_starts as f64, [1.0, 20.0])?;
    within("/end_margin_mm", request.end_margin_mm.unwrap_or(0.0), [0.0, 1000.0])?;
    let terms = match request.num_terms {
        None => default.terms,
        Some(n) => {
            within("/num_terms", n as f64, [1.0, 5.0])?;
            TermCount::Fixed(n)
        }
    };
    Ok(CalibrateOptions {
        terms,
        objective,
        rule: request.rule.unwrap_or(default.rule),
        mesh_factor,
        has_mesh_allowance: request.has_mesh_allowance.unwrap_or(default.has_mesh_allowance),
        num_starts,
        has_profiles: request.has_profiles,
        contours: request.has_contours.then(|| ContourOptions { beta, ..ContourOptions::default() }),
        ..default
    })
}

/// The kind.
pub struct Calibrations;

impl JobKind for Calibrations {
    fn name(&self) -> &'static str {
        "calibrations"
    }

    fn recordings(&self, body: &serde_json::Value) -> Vec<(String, String)> {
        let list = body.get("recordings").and_then(|r| r.as_array()).into_iter().flatten();
        list.enumerate().filter_map(|(i, id)| Some((format!("/recordings/{i}"), id.as_str()?.to_string()))).collect()
    }

    fn check_recording(
        &self,
        body: &serde_json::Value,
        specimen: &Specimen,
        limits: &SizeLimits,
    ) -> Result<(), Problem> {
        let request: CalibrationRequest = parse(body)?;
        mesh_is_small_enough(specimen, request.mesh_factor.unwrap_or(1.0), limits)
    }

    fn plan(&self, body: &serde_json::Value, _limits: &SizeLimits) -> Result<Plan, Problem> {
        let request: CalibrationRequest = parse(body)?;
        if request.recordings.is_empty() || request.recordings.len() > MAX_RECORDINGS {
            let count = request.recordings.len();
            return Err(Problem::at("/recordings", format!("{count} recordings; give 1 to {MAX_RECORDINGS}")));
        }
        options_of(&request)?;
        let input = serde_json::to_string(&request).map_err(|e| Problem::new("internal", e.to_string()))?;
        // A recording's identifier is a hash of its content.
        let cache_key =
            input_hash(&serde_json::json!({ "kind": "calibration", "version": VERSION, "request": request }));
        let first = &request.recordings[0];
        let title = match request.recordings.len() {
            1 => format!("calibration on {}", first.get(..8).unwrap_or(first)),
            n => format!("calibration on {n} recordings"),
        };
        Ok(Plan { title, tasks: vec![NewTask { input, cache_key }], has_gather: false })
    }

    fn run(&self, input: &serde_json::Value, context: &RunContext) -> Result<TaskResult, RunError> {
        let request: CalibrationRequest = parse(input)?;
        let options = options_of(&request)?;
        let (mut observed, mut names) = (Vec::new(), Vec::new());
        for (i, id) in request.recordings.iter().enumerate() {
            let recording = (context.recording)(id)?;
            let unfit = |detail: String| Problem::at(format!("/recordings/{i}"), detail);
            let mut ready = Observed::new(&recording, FORCE_SD_N).map_err(|e| unfit(e.to_string()))?;
            let margin = request.end_margin_mm.unwrap_or(0.0);
            if margin > 0.0 && ready.leave_out_ends(margin) == 0 {
                return Err(Problem::at("/end_margin_mm", format!("{margin} mm leaves no voxel")).into());
            }
            observed.push(ready);
            names.push(recording.id);
        }
        let step = AtomicU64::new(0);
        let on_stage = |text: &str| {
            let done = step.fetch_add(1, Ordering::Relaxed) + 1;
            let stage = text.trim().chars().take(120).collect();
            // The number of stages is not known before.
            (context.progress)(TaskProgress { stage, done, total: 0, best: None });
        };
        let cancelled = || (context.is_cancelled)();
        let mesh = |s: &Specimen, factor: f64| MeshOptions::scaled(s, factor);
        let found = calibrate(&observed, &mesh, &options, &on_stage, &cancelled).map_err(|e| {
            if cancelled() { RunError::Stopped } else { Problem::new("no-solution", e.to_string()).into() }
        })?;
        let hash = input_hash(&serde_json::json!({ "version": VERSION, "request": request }));
        let result = CalibrationResult::new(&found, &observed, &names, options.objective, hash);
        let artefacts = files(&found, &result, &observed)?;
        Ok(TaskResult { result: json_bytes(&result)?, artefacts })
    }
}

/// Report, pictures, the material, and per recording and drive what was measured, what the material predicts, and the rest.
fn files(
    found: &Calibration,
    result: &CalibrationResult,
    observed: &[Observed],
) -> Result<Vec<(String, String, Vec<u8>)>, RunError> {
    let mut artefacts = Vec::new();
    for (r, recording) in observed.iter().enumerate() {
        for (s, step) in recording.steps.iter().enumerate() {
            let model = found.fit.predicted(r, s);
            let rest: Vec<[f64; 3]> =
                step.displacement.iter().zip(model).map(|(u, m)| [0, 1, 2].map(|c| u[c] - m[c])).collect();
            let name = |what: &str| format!("{what}_{}_{}", r + 1, s + 1);
            let fields =
                [(name("measured"), &step.displacement[..]), (name("model"), model), (name("misfit"), &rest[..])];
            displacement_images(recording, &fields, &mut artefacts)?;
        }
    }
    let (pictures, report) = calibration_report(found, result, observed);
    for (name, svg) in pictures {
        artefacts.push((format!("{name}.svg"), "image/svg+xml".into(), svg.into_bytes()));
    }
    artefacts.push(("report.html".into(), "text/html".into(), report.to_html().into_bytes()));
    artefacts.push(("material.json".into(), "application/json".into(), result.material.to_json().into_bytes()));
    Ok(artefacts)
}
