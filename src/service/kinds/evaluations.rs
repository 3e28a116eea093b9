//! `POST /v1/evaluations`: what a scan of a specimen would see and what it would tell about the material.

use super::{JobKind, Plan, RunContext, RunError, SizeLimits, TaskProgress, json_bytes};
use super::{MaterialSchema, ScanSchema, SpecimenSchema};
use crate::fem::{ForwardModel, SolveError};
use crate::material::Ogden;
use crate::mesh::{MeshOptions, mesh_specimen};
use crate::provenance::{VERSION, input_hash};
use crate::report::{bar_pictures, histogram_picture, map_pictures, vtu_of};
use crate::sensitivity::{
    DriveSelection, EvaluationError, EvaluationOptions, PartialVoxels, ScanSettings, evaluate_model,
};
use crate::service::problem::{Problem, parse, pointer_in_message};
use crate::service::store::{NewTask, TaskResult};
use crate::service::surface::surface_json;
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Body of an evaluation.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct EvaluationRequest {
    /// The specimen (`specimen/1`).
    #[schema(value_type = SpecimenSchema)]
    pub specimen: Specimen,
    /// The material (`ogden/1`).
    #[schema(value_type = MaterialSchema)]
    pub material: Ogden,
    /// The scan; by default 1 × 0.1875 × 0.75 mm voxels, 0.05 mm and 0.02 N noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = ScanSchema, nullable = false)]
    pub scan: Option<ScanSettings>,
    /// Drives in mm instead of the specimen's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 1000)]
    pub drive_mm: Option<Vec<f64>>,
    /// The drive that reaches this median stretch, instead of given drives.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 1.0, maximum = 5.0)]
    pub median_stretch: Option<f64>,
    /// `search`, `standard` (default), `fine`, or a factor from 0.2 to 5 on the standard element size.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 16)]
    pub mesh: Option<String>,
}

/// The scan asked for, or the default one (the paper's voxel).
pub fn scan_of(scan: Option<ScanSettings>) -> ScanSettings {
    scan.unwrap_or(ScanSettings {
        voxel_mm: [1.0, 0.1875, 0.75],
        noise_sd_mm: [0.05; 3],
        force_sd_n: 0.02,
        partial_voxels: PartialVoxels::default(),
    })
}

/// The mesh asked for.
///
/// # Errors
/// A [`Problem`] at `/mesh`.
pub fn mesh_of(mesh: Option<&str>, specimen: &Specimen) -> Result<MeshOptions, Problem> {
    match mesh.unwrap_or("standard") {
        "search" => Ok(MeshOptions::search(specimen)),
        "standard" => Ok(MeshOptions::standard(specimen)),
        "fine" => Ok(MeshOptions::fine(specimen)),
        other => match other.parse::<f64>() {
            Ok(factor) if (0.2..=5.0).contains(&factor) => Ok(MeshOptions::scaled(specimen, factor)),
            _ => Err(Problem::at(
                "/mesh",
                format!("{other:?} is not search, standard, fine or a size factor from 0.2 to 5"),
            )),
        },
    }
}

/// The drives asked for.
pub(super) fn drives_of(request: &EvaluationRequest) -> DriveSelection {
    match (request.median_stretch, &request.drive_mm) {
        (Some(target), _) => DriveSelection::MedianStretch(target),
        (None, Some(drives)) => DriveSelection::DriveMm(drives.clone()),
        (None, None) => DriveSelection::DriveMm(request.specimen.drive_mm.clone()),
    }
}

/// Settings of the library call.
///
/// # Errors
/// A [`Problem`] at `/mesh`.
pub(super) fn options_of(request: &EvaluationRequest) -> Result<EvaluationOptions, Problem> {
    let mesh = mesh_of(request.mesh.as_deref(), &request.specimen)?;
    Ok(EvaluationOptions { mesh, ..EvaluationOptions::standard(&request.specimen) })
}

/// Validates a request and makes its task; `prefix` is the pointer of the request in the body.
///
/// # Errors
/// A [`Problem`] with pointers.
pub fn plan_evaluation(request: &EvaluationRequest, prefix: &str, limits: &SizeLimits) -> Result<NewTask, Problem> {
    request
        .specimen
        .validate()
        .map_err(|e| Problem::at(pointer_in_message(&format!("{prefix}/specimen"), &e.to_string()), e.to_string()))?;
    request
        .material
        .validate()
        .map_err(|e| Problem::at(pointer_in_message(&format!("{prefix}/material"), &e.to_string()), e.to_string()))?;
    let mesh = mesh_of(request.mesh.as_deref(), &request.specimen)?;
    let drives = drives_of(request);
    match &drives {
        DriveSelection::DriveMm(list) => {
            let mut with_drives = request.specimen.clone();
            with_drives.drive_mm.clone_from(list);
            with_drives
                .validate()
                .map_err(|e| Problem::at(pointer_in_message(prefix, &e.to_string()), e.to_string()))?;
        }
        DriveSelection::MedianStretch(value) => {
            if request.drive_mm.is_some() {
                return Err(Problem::at(
                    format!("{prefix}/median_stretch"),
                    "median_stretch and drive_mm exclude each other; give one",
                ));
            }
            if !(*value > 1.0 && *value <= 5.0) {
                return Err(Problem::at(
                    format!("{prefix}/median_stretch"),
                    format!("median_stretch is {value}; it must be above 1 and at most 5"),
                ));
            }
        }
    }
    let scan = scan_of(request.scan);
    let noise_is_fine = scan.noise_sd_mm.iter().chain([&scan.force_sd_n]).all(|sd| sd.is_finite() && *sd > 1e-100);
    if !noise_is_fine {
        let name = if scan.force_sd_n.is_finite() && scan.force_sd_n > 1e-100 { "noise_sd_mm" } else { "force_sd_n" };
        let detail = "every standard deviation must be positive and finite";
        return Err(Problem::at(format!("{prefix}/scan/{name}"), detail));
    }
    let grid = crate::voxel::VoxelGrid::covering(&request.specimen, scan.voxel_mm)
        .map_err(|e| Problem::at(format!("{prefix}/scan/voxel_mm"), e.to_string()))?;
    // A voxel has several sample points: more would not fit into a few gigabytes.
    if grid.num_voxels() > 2_000_000 {
        return Err(Problem::at(
            format!("{prefix}/scan/voxel_mm"),
            format!("{} voxels; at most 2000000: use larger voxels", grid.num_voxels()),
        ));
    }
    let built = mesh_specimen(&request.specimen, &mesh)
        .map_err(|e| Problem::at(format!("{prefix}/specimen"), e.to_string()))?;
    if built.num_elements() > limits.max_elements {
        let (count, most) = (built.num_elements(), limits.max_elements);
        let detail = format!("{count} elements; at most {most}: use a coarser mesh");
        return Err(Problem::too_big(format!("{prefix}/mesh"), detail));
    }
    let options = EvaluationOptions { mesh, ..EvaluationOptions::standard(&request.specimen) };
    let content = serde_json::json!({
        "kind": "evaluation", "version": VERSION, "specimen": request.specimen, "material": request.material,
        "scan": scan, "drives": drives, "mesh": options.mesh,
    });
    let input = serde_json::to_string(request).map_err(|e| Problem::new("internal", e.to_string()))?;
    Ok(NewTask { input, cache_key: input_hash(&content) })
}

/// The kind.
pub struct Evaluations;

impl JobKind for Evaluations {
    fn name(&self) -> &'static str {
        "evaluations"
    }

    fn plan(&self, body: &serde_json::Value, limits: &SizeLimits) -> Result<Plan, Problem> {
        let request: EvaluationRequest = parse(body)?;
        let task = plan_evaluation(&request, "", limits)?;
        Ok(Plan { title: request.specimen.name.clone(), tasks: vec![task], has_gather: false })
    }

    fn run(&self, input: &serde_json::Value, context: &RunContext) -> Result<TaskResult, RunError> {
        let request: EvaluationRequest = parse(input)?;
        let specimen = &request.specimen;
        let progress = |stage: &str, done| {
            (context.progress)(TaskProgress { stage: stage.into(), done, total: 2, best: None });
        };
        progress("solve", 0);
        let options = options_of(&request)?;
        let mut model = ForwardModel::of_specimen(specimen, &options.mesh).map_err(|e| no_solution(&e))?;
        let drives = drives_of(&request);
        let cancelled = || (context.is_cancelled)();
        let (evaluation, maps) = evaluate_model(
            &mut model,
            specimen,
            &request.material,
            &scan_of(request.scan),
            &drives,
            &options,
            &cancelled,
        )
        .map_err(|e| match e {
            EvaluationError::Solve(SolveError::Cancelled { .. }) => RunError::Stopped,
            _ if cancelled() => RunError::Stopped,
            other => no_solution(&other),
        })?;
        progress("pictures", 1);
        let mut artefacts = Vec::new();
        let mut add =
            |name: String, media_type: &str, bytes: Vec<u8>| artefacts.push((name, media_type.to_string(), bytes));
        let panels: Vec<_> = maps
            .drives
            .iter()
            .enumerate()
            .map(|(index, d)| (format!("drive {:.2} mm", d.drive_mm), &maps, index))
            .collect();
        add("histogram.svg".into(), "image/svg+xml", histogram_picture(&panels).into_bytes());
        for (name, svg) in map_pictures(&maps).into_iter().chain(bar_pictures(&evaluation)) {
            add(format!("{name}.svg"), "image/svg+xml", svg.into_bytes());
        }
        if let Some(state) = maps.equilibria.last() {
            let vtu = vtu_of(&model, &request.material, state).map_err(|e| no_solution(&e))?;
            add("solution.vtu".into(), "application/xml", vtu.into_bytes());
            let surface = surface_json(&model, &request.material, state).map_err(|e| no_solution(&e))?;
            add("surface.json".into(), "application/json", surface);
        }
        add_drawings(specimen, "specimen", &mut artefacts)?;
        Ok(TaskResult { result: json_bytes(&evaluation)?, artefacts })
    }
}

/// Drawings for the mould maker and the specimen's file.
///
/// # Errors
/// [`RunError`] where the solid cannot be drawn.
pub(super) fn add_drawings(
    specimen: &Specimen,
    stem: &str,
    artefacts: &mut Vec<(String, String, Vec<u8>)>,
) -> Result<(), RunError> {
    use crate::specimen::{to_dxf, to_stl, to_svg};
    artefacts.push((format!("{stem}.json"), "application/json".into(), specimen.to_json().into_bytes()));
    artefacts.push((format!("{stem}.svg"), "image/svg+xml".into(), to_svg(specimen).into_bytes()));
    artefacts.push((format!("{stem}.dxf"), "image/vnd.dxf".into(), to_dxf(specimen).into_bytes()));
    let stl = to_stl(specimen).map_err(|e| no_solution(&e))?;
    artefacts.push((format!("{stem}.stl"), "model/stl".into(), stl));
    Ok(())
}

fn no_solution(error: &dyn std::fmt::Display) -> RunError {
    Problem::new("no-solution", error.to_string()).into()
}
