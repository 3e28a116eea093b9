//! `POST /v1/designs`: the best specimen under the limits of a study, with the evidence.

use super::evaluations::add_drawings;
use super::{JobKind, Plan, RunContext, RunError, SizeLimits, TaskProgress, json_bytes};
use crate::calibration::{ParameterSpread, VerifyOptions, verify};
use crate::design::{Checkpoint, DesignResult, MaterialVerification, Progress, SearchError, Study, search, study_hash};
use crate::fem::ForwardModel;
use crate::material::Ogden;
use crate::mesh::{MeshOptions, mesh_specimen};
use crate::report::{DesignPictures, deformed_picture, design_report, histogram_picture};
use crate::sensitivity::{DriveSelection, EvaluationOptions, evaluate_model};
use crate::service::problem::{Problem, pointer_in_message};
use crate::service::store::{NewTask, TaskResult};
use crate::service::surface::surface_json;
use crate::specimen::Specimen;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// Most evaluations that a study may ask for.
const MAX_EVALUATIONS: usize = 20_000;

/// Reads a study from a request. Files that a study on disk may name are refused: a request spells everything out.
fn read_study(body: &serde_json::Value) -> Result<Study, Problem> {
    let named = |value: Option<&serde_json::Value>, pointer: String| match value {
        Some(serde_json::Value::String(_)) => {
            Err(Problem::at(pointer, "names a file; a request must hold the specimen or material itself"))
        }
        _ => Ok(()),
    };
    named(body.get("base"), "/base".into())?;
    for (index, entry) in body.get("materials").and_then(|m| m.as_array()).into_iter().flatten().enumerate() {
        named(entry.get("material"), format!("/materials/{index}/material"))?;
    }
    Study::from_json(&body.to_string(), Path::new("")).map_err(|e| {
        let message = e.to_string();
        Problem::at(pointer_in_message("", &message), message)
    })
}

/// The kind.
pub struct Designs;

impl JobKind for Designs {
    fn name(&self) -> &'static str {
        "designs"
    }

    fn plan(&self, body: &serde_json::Value, limits: &SizeLimits) -> Result<Plan, Problem> {
        let study = read_study(body)?;
        let budget = study.budget;
        let evaluations = budget
            .refine
            .saturating_mul(budget.iterations)
            .saturating_add(budget.explore)
            .saturating_add(budget.confirm)
            .saturating_mul(study.materials.len());
        if evaluations > MAX_EVALUATIONS {
            return Err(Problem::at(
                "/budget",
                format!("asks for about {evaluations} evaluations; at most {MAX_EVALUATIONS}"),
            ));
        }
        let fine = mesh_specimen(&study.base, &MeshOptions::fine(&study.base))
            .map_err(|e| Problem::at("/base", e.to_string()))?;
        if fine.num_elements() > limits.max_elements {
            let (count, most) = (fine.num_elements(), limits.max_elements);
            return Err(Problem::too_big("/base", format!("the base specimen needs {count} elements; at most {most}")));
        }
        // Equal studies of one version have equal results: the search is deterministic by its seed.
        let cache_key = format!("design:{}", study_hash(&study));
        let input = body.to_string();
        Ok(Plan { title: study.name.clone(), tasks: vec![NewTask { input, cache_key }], has_gather: false })
    }

    fn run(&self, input: &serde_json::Value, context: &RunContext) -> Result<TaskResult, RunError> {
        let study = read_study(input)?;
        let hash = study_hash(&study);
        let checkpoint = match Checkpoint::open(context.checkpoint, &hash) {
            Ok(checkpoint) => checkpoint,
            Err(_) => {
                // Of another version, or damaged: the search starts afresh.
                let _ = std::fs::remove_file(context.checkpoint);
                Checkpoint::open(context.checkpoint, &hash).unwrap_or_else(|_| Checkpoint::in_memory())
            }
        };
        let show = |p: &Progress| {
            (context.progress)(TaskProgress {
                stage: p.stage.into(),
                done: p.done as u64,
                total: p.total as u64,
                best: p.best,
            });
        };
        let found = search(&study, &checkpoint, &show, context.is_cancelled).map_err(|e| match e {
            SearchError::Stopped { .. } => RunError::Stopped,
            other => failed(&other),
        })?;
        let Some(mut result) = DesignResult::new(&study, &found) else {
            return Err(Problem::new("no-solution", "nothing was confirmed; widen the limits").into());
        };
        if study.verification.is_on {
            let verified = verify_both(&study, &result, context)?;
            result.add_verification(verified);
        }
        let mut artefacts = Vec::new();
        let pictures = pictures(&study, &result, &mut artefacts)?;
        artefacts.push(("report.html".into(), "text/html".into(), design_report(&result, &pictures).into_bytes()));
        let mut best = result.best.specimen.clone();
        best.name = format!("{} (designed for: {})", best.name, result.name).chars().take(200).collect();
        add_drawings(&best, "best-specimen", &mut artefacts)?;
        Ok(TaskResult { result: json_bytes(&result)?, artefacts })
    }
}

fn failed(error: &dyn std::fmt::Display) -> RunError {
    Problem::new("no-solution", error.to_string()).into()
}

fn verify_both(
    study: &Study,
    result: &DesignResult,
    context: &RunContext,
) -> Result<Vec<MaterialVerification>, RunError> {
    let draws = study.verification.draws;
    let total = (2 * study.materials.len() * draws) as u64;
    let done = AtomicU64::new(0);
    // A specimen that cannot be verified is a finding, not a failed job.
    let of = |specimen: &Specimen, material: &Ogden| -> Result<(Vec<ParameterSpread>, Option<String>), RunError> {
        let options = VerifyOptions::new(specimen, draws, study.seed);
        let on_draw = || {
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            let best = Some(result.best.objective);
            (context.progress)(TaskProgress { stage: "verify".into(), done, total, best });
        };
        match verify(specimen, material, &study.scan, &options, &on_draw, context.is_cancelled) {
            Ok(spread) => Ok((spread, None)),
            Err(_) if (context.is_cancelled)() => Err(RunError::Stopped),
            Err(error) => Ok((Vec::new(), Some(error.to_string()))),
        }
    };
    let mut verified = Vec::new();
    for prior in &study.materials {
        let (best, best_failure) = of(&result.best.specimen, &prior.material)?;
        let (base, base_failure) = of(&result.base.specimen, &prior.material)?;
        verified.push(MaterialVerification { material: prior.name.clone(), best, base, best_failure, base_failure });
    }
    Ok(verified)
}

/// Base and best once more, for what needs fields: histograms, deformed shapes, surfaces for the page.
fn pictures(
    study: &Study,
    result: &DesignResult,
    artefacts: &mut Vec<(String, String, Vec<u8>)>,
) -> Result<DesignPictures, RunError> {
    let Some(prior) = study.materials.first() else { return Err(Problem::new("internal", "no material").into()) };
    let material = &prior.material;
    let mut evaluated = Vec::new();
    let mut deformed = Vec::new();
    for (label, specimen) in [("base", &result.base.specimen), ("best", &result.best.specimen)] {
        let options =
            EvaluationOptions { mesh: MeshOptions::search(specimen), ..EvaluationOptions::standard(specimen) };
        let mut model = ForwardModel::of_specimen(specimen, &options.mesh).map_err(|e| failed(&e))?;
        let drives = DriveSelection::DriveMm(specimen.drive_mm.clone());
        let (_, maps) = evaluate_model(&mut model, specimen, material, &study.scan, &drives, &options, &|| false)
            .map_err(|e| failed(&e))?;
        if let Some(state) = maps.equilibria.last() {
            let svg = deformed_picture(&model, material, state).map_err(|e| failed(&e))?;
            deformed.push((svg, format!("{label}: {}", specimen.name)));
            let surface = surface_json(&model, material, state).map_err(|e| failed(&e))?;
            artefacts.push((format!("surface-{label}.json"), "application/json".into(), surface));
        }
        evaluated.push((label, maps));
    }
    let panels: Vec<_> = evaluated.iter().map(|(label, maps)| ((*label).to_string(), maps, 0)).collect();
    let histogram = histogram_picture(&panels);
    artefacts.push(("histogram.svg".into(), "image/svg+xml".into(), histogram.clone().into_bytes()));
    Ok(DesignPictures { histogram, deformed })
}
