//! What answers at once: checking and drawing a specimen, its cost, the shipped files, who is asking.

use crate::field::FieldError;
use crate::job::defaults;
use crate::mesh::{MeshSize, mesh_specimen};
use crate::service::access::{Caller, Role};
use crate::service::app::App;
use crate::service::body::receive_json;
use crate::service::problem::{FieldProblem, Problem};
use crate::specimen::{LimitMargin, ManufacturingLimits, Specimen, to_svg};
use axum::Json;
use axum::extract::{Extension, Request, State};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A specimen to check.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct CheckRequest {
    /// The specimen.
    specimen: Specimen,
    /// Limits of what can be made (as in a study).
    #[serde(default)]
    limits: Option<ManufacturingLimits>,
    /// The scan's voxel, mm.
    #[serde(default = "defaults::voxel_mm")]
    #[schema(min_items = 3, max_items = 3, default = defaults::voxel_mm)]
    voxel_mm: [f64; 3],
    /// Element size.
    #[serde(default)]
    #[schema(default = MeshSize::default)]
    mesh: MeshSize,
}

/// A limit and how far it is.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Margin {
    /// Name, with its unit.
    name: String,
    /// The value.
    value: f64,
    /// The limit.
    limit: f64,
    /// Distance relative to the limit; negative where violated.
    margin_relative: f64,
    /// Whether it is kept.
    is_satisfied: bool,
}

impl From<LimitMargin> for Margin {
    fn from(m: LimitMargin) -> Self {
        Margin {
            name: m.name,
            value: m.value,
            limit: m.limit,
            margin_relative: m.margin_relative,
            is_satisfied: m.is_satisfied,
        }
    }
}

/// What an evaluation would cost.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Cost {
    /// Elements of the mesh.
    #[schema(minimum = 0)]
    num_elements: usize,
    /// Nodes of the mesh.
    #[schema(minimum = 0)]
    num_nodes: usize,
    /// Voxels of the scan's grid.
    #[schema(minimum = 0)]
    num_voxels: usize,
    /// Processor seconds per drive, within a factor of about three.
    seconds_per_drive: f64,
}

/// What was found.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Checked {
    /// Whether it can be evaluated and keeps every limit.
    is_valid: bool,
    /// What keeps it from being evaluated.
    errors: Vec<FieldProblem>,
    /// The limits, closest first.
    margins: Vec<Margin>,
    /// Volume of material, mm³.
    volume_mm3: Option<f64>,
    /// Drawing, SVG.
    drawing_svg: Option<String>,
    /// Cost, where it can be meshed.
    #[schema(nullable = true)]
    cost: Option<Cost>,
}

/// Processor seconds of one drive of an evaluation with a material of one term. From the release build on one thread of
/// the development machine: eight evaluations of the shipped specimens (1,393 to 11,687 nodes, 2,000 to 21,000
/// voxels; 0.15 s to 2.5 s a drive) give 2.28 s at 10,000 nodes with the power 1.4, each within a factor of 2.3; voxels
/// eight times as many cost 2 µs each. Material terms and other machines change it: an estimate to decide by, not a
/// promise.
fn seconds(num_nodes: usize, num_voxels: usize) -> f64 {
    2.28 * (num_nodes as f64 / 1e4).powf(1.4) + 2e-6 * num_voxels as f64
}

fn check(request: &CheckRequest) -> Result<Checked, Problem> {
    let specimen = &request.specimen;
    let mut checked = Checked {
        is_valid: false,
        errors: Vec::new(),
        margins: Vec::new(),
        volume_mm3: None,
        drawing_svg: None,
        cost: None,
    };
    let below = |errors: Vec<FieldError>, prefix: &str| errors.into_iter().map(|e| e.below(prefix)).collect::<Vec<_>>();
    if let Some(limits) = &request.limits {
        let errors = below(limits.field_errors(), "/limits");
        if !errors.is_empty() {
            return Err(Problem::invalid(errors));
        }
    }
    checked.errors = below(specimen.field_errors(), "/specimen").into_iter().map(Into::into).collect();
    if !checked.errors.is_empty() {
        return Ok(checked);
    }
    let voxel = request.voxel_mm;
    let grid = crate::voxel::VoxelGrid::covering(specimen, voxel).map_err(|e| {
        let error = FieldError::new("/voxel_mm", format!("{voxel:?}"), "usable");
        Problem::invalid(vec![error.remedy(e.to_string())])
    })?;
    if let Some(limits) = &request.limits {
        let mut margins = limits.check_geometry(specimen, voxel);
        margins.sort_by(|a, b| a.margin_relative.total_cmp(&b.margin_relative));
        checked.margins = margins.into_iter().map(Margin::from).collect();
    }
    checked.drawing_svg = Some(to_svg(specimen));
    match mesh_specimen(specimen, &request.mesh.options(specimen)) {
        Ok(mesh) => {
            let (num_elements, num_nodes, num_voxels) = (mesh.num_elements(), mesh.nodes.len(), grid.num_voxels());
            let seconds_per_drive = seconds(num_nodes, num_voxels);
            checked.cost = Some(Cost { num_elements, num_nodes, num_voxels, seconds_per_drive });
            checked.is_valid = checked.margins.iter().all(|m| m.is_satisfied);
        }
        Err(error) => checked.errors.push(crate::job::unmeshable("/specimen", &error).into()),
    }
    checked.volume_mm3 = Some(specimen.volume_mm3());
    Ok(checked)
}

/// Check a specimen against limits, draw it and estimate its cost.
#[utoipa::path(post, path = "/v1/specimens/check", request_body = CheckRequest, responses(
    (status = 200, description = "What was found", body = Checked),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "quick")]
pub(super) async fn check_specimen(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    request: Request,
) -> Result<Json<Checked>, Problem> {
    let body = receive_json(&app, request).await?;
    let work = app.compute(move || {
        let request: CheckRequest = crate::field::read(&body.value).map_err(|e| Problem::invalid(vec![e]))?;
        check(&request)
    });
    Ok(Json(app.answer(&caller, app.limits.request_time, work).await?))
}

/// The specimens, materials and studies that the program ships.
#[derive(Serialize, ToSchema)]
pub(super) struct Library {
    /// Specimens by file name.
    #[schema(value_type = Vec<Specimen>)]
    specimens: Vec<serde_json::Value>,
    /// Materials: name and content.
    #[schema(value_type = Vec<Object>)]
    materials: Vec<serde_json::Value>,
    /// Studies, spelled out.
    #[schema(value_type = Vec<Object>)]
    studies: Vec<serde_json::Value>,
}

macro_rules! shipped {
    ($file:literal) => {
        include_str!(concat!("../../../geometries/", $file))
    };
}

/// What the program ships.
#[utoipa::path(get, path = "/v1/library", responses(
    (status = 200, description = "Specimens, materials, studies", body = Library),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "quick")]
pub(super) async fn library() -> Json<Library> {
    let read = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap_or_default();
    let two_hole = read(shipped!("two-hole-shear.json"));
    let bar = read(shipped!("uniaxial-bar.json"));
    let one = read(shipped!("materials/ecoflex-0020.json"));
    let two = read(shipped!("materials/ecoflex-0020-two-term.json"));
    let study = |text: &str, base: &serde_json::Value| {
        let mut study = read(text);
        study["base"] = base.clone();
        for entry in study["materials"].as_array_mut().into_iter().flatten() {
            let is_two = entry["material"].as_str().is_some_and(|name| name.contains("two-term"));
            entry["material"] = if is_two { two.clone() } else { one.clone() };
        }
        study
    };
    Json(Library {
        studies: vec![
            study(shipped!("studies/two-hole-shear.json"), &two_hole),
            study(shipped!("studies/uniaxial-bar.json"), &bar),
        ],
        materials: vec![
            serde_json::json!({ "name": "Ecoflex 00-20", "material": one.clone() }),
            serde_json::json!({ "name": "Ecoflex 00-20, two terms", "material": two.clone() }),
        ],
        specimens: vec![
            two_hole.clone(),
            read(shipped!("solid-shear.json")),
            bar.clone(),
            read(shipped!("iso37-type4.json")),
        ],
    })
}

/// Who is asking.
#[derive(Serialize, ToSchema)]
pub(super) struct Me {
    /// Name of the token; `local` without tokens.
    name: String,
    /// Role.
    role: Role,
    /// Whether the service asks for tokens.
    needs_token: bool,
    /// Most tasks queued at a time.
    #[schema(minimum = 0)]
    max_queued_tasks: Option<usize>,
    /// Version of the program.
    version: String,
}

/// Who is asking, and what it may do.
#[utoipa::path(get, path = "/v1/me", responses(
    (status = 200, description = "The caller", body = Me),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "quick")]
pub(super) async fn me(State(app): State<App>, Extension(caller): Extension<Caller>) -> Json<Me> {
    Json(Me {
        needs_token: app.access.is_closed(),
        name: caller.name,
        role: caller.role,
        max_queued_tasks: caller.max_queued_tasks,
        version: crate::provenance::VERSION.into(),
    })
}
