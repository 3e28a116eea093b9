//! What answers at once: checking and drawing a specimen, its cost, the shipped files, who is asking.

use crate::design::Study;
use crate::field::FieldError;
use crate::job::{RequestSchema, defaults, quick_response, seconds_per_drive};
use crate::material::Material;
use crate::mesh::{MeshSize, mesh_specimen};
use crate::service::access::{Caller, Role};
use crate::service::app::App;
use crate::service::body::receive_json;
use crate::service::problem::{FieldProblem, Problem};
use crate::specimen::{LimitMargin, ManufacturingLimits, Specimen, to_svg};
use crate::voxel::VoxelGrid;
use axum::Json;
use axum::extract::{Extension, Request, State};
use serde::{Deserialize, Serialize};
use std::sync::OnceLock;
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
    /// With a material the specimen is solved at its largest drive on the search's mesh, where a limit on a force or
    /// the local stretch asks for it.
    #[serde(default)]
    material: Option<Material>,
}

/// The schema of checks.
static CHECK_SCHEMA: OnceLock<RequestSchema> = OnceLock::new();

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
    /// Processor seconds of an evaluation at all of the specimen's drives, within the same factor.
    seconds: f64,
    /// Most processor seconds that a job of this service may be estimated to take.
    most_seconds: f64,
}

/// A limit that was not checked.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Unchecked {
    /// Name, with its unit.
    name: &'static str,
    /// The limit.
    limit: f64,
    /// Why it was not checked, and what to do.
    detail: String,
}

/// What was found.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Checked {
    /// Whether it can be evaluated and keeps every limit that was checked.
    is_valid: bool,
    /// What keeps it from being evaluated.
    errors: Vec<FieldProblem>,
    /// The limits that were checked, closest first. Forces and local stretch are those at the largest drive on the
    /// search's mesh.
    margins: Vec<Margin>,
    /// The limits that were not checked.
    unchecked: Vec<Unchecked>,
    /// Volume of one sample, of the first kind, mm³.
    volume_mm3: Option<f64>,
    /// Drawing of it, SVG.
    drawing_svg: Option<String>,
    /// Cost, where it can be meshed.
    #[schema(nullable = true)]
    cost: Option<Cost>,
}

/// Adds the limits on what the test does: the drive always, forces and local stretch where they can be solved at once.
fn check_response(request: &CheckRequest, limits: &ManufacturingLimits, checked: &mut Checked) {
    let drive_mm = request.specimen.largest_drive_mm().abs();
    let solved_for = [limits.max_force_n, limits.max_normal_force_n, limits.max_local_stretch];
    let solved = match &request.material {
        _ if solved_for.iter().all(Option::is_none) => Err(String::new()),
        None => Err("it is known once the specimen is solved; give a material, or start an evaluation".to_string()),
        Some(material) => quick_response(&request.specimen, material).map_err(|e| e.to_string()),
    };
    let values = match solved {
        Ok(response) => response.limited().map(|value| value.ok_or_else(|| "the test has grips and no plates".into())),
        Err(detail) => {
            let unknown = || Err(detail.clone());
            [Ok(drive_mm), unknown(), unknown(), unknown()]
        }
    };
    for ((name, limit), value) in limits.of_response().into_iter().zip(values) {
        match (limit, value) {
            (None, _) => {}
            (Some(limit), Ok(value)) => checked.margins.push(LimitMargin::at_most(name, value, limit).into()),
            (Some(limit), Err(detail)) => checked.unchecked.push(Unchecked { name, limit, detail }),
        }
    }
}

fn check(request: &CheckRequest, most_seconds: f64) -> Result<Checked, Problem> {
    let specimen = &request.specimen;
    let mut checked = Checked {
        is_valid: false,
        errors: Vec::new(),
        margins: Vec::new(),
        unchecked: Vec::new(),
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
    if let Some(material) = &request.material {
        let errors = below(material.field_errors(), "/material");
        if !errors.is_empty() {
            return Err(Problem::invalid(errors));
        }
    }
    checked.errors = below(specimen.field_errors(), "/specimen").into_iter().map(Into::into).collect();
    if !checked.errors.is_empty() {
        return Ok(checked);
    }
    let voxel = request.voxel_mm;
    let samples = specimen.samples();
    let unusable = |e: crate::voxel::VoxelError| {
        let error = FieldError::new("/voxel_mm", format!("{voxel:?}"), "usable");
        Problem::invalid(vec![error.remedy(e.to_string())])
    };
    let grids =
        samples.iter().map(|s| VoxelGrid::covering(s, voxel)).collect::<Result<Vec<_>, _>>().map_err(unusable)?;
    if let Some(limits) = &request.limits {
        checked.margins = limits.check_geometry(specimen, voxel).into_iter().map(Margin::from).collect();
        check_response(request, limits, &mut checked);
        checked.margins.sort_by(|a, b| a.margin_relative.total_cmp(&b.margin_relative));
    }
    // The first sample's: the page shows one.
    checked.drawing_svg = samples.first().map(to_svg);
    let meshes = samples.iter().map(|s| mesh_specimen(s, &request.mesh.options(s))).collect::<Result<Vec<_>, _>>();
    match meshes {
        Ok(meshes) => {
            let num_elements = meshes.iter().map(|m| m.num_elements()).sum();
            let num_nodes = meshes.iter().map(|m| m.nodes.len()).sum();
            let num_voxels = grids.iter().map(VoxelGrid::num_voxels).sum();
            let each = meshes.iter().zip(&grids);
            let seconds_per_drive = each.map(|(m, g)| seconds_per_drive(m.nodes.len(), g.num_voxels())).sum::<f64>();
            let seconds = seconds_per_drive * specimen.drive_mm.len() as f64;
            checked.cost = Some(Cost { num_elements, num_nodes, num_voxels, seconds_per_drive, seconds, most_seconds });
            checked.is_valid = checked.margins.iter().all(|m| m.is_satisfied);
        }
        Err(error) => checked.errors.push(crate::job::unmeshable("/specimen", &error).into()),
    }
    checked.volume_mm3 = Some(specimen.volume_mm3());
    Ok(checked)
}

/// Check a specimen against limits, draw it and estimate its cost.
#[utoipa::path(post, path = "/v1/specimens/check", operation_id = "check_specimen", request_body(content = CheckRequest, example = json!({ "specimen": crate::job::defaults::two_hole_shear() })), responses(
    (status = 200, description = "What was found", body = Checked),
    (status = "default", description = "A problem", body = Problem, content_type = "application/problem+json"),
), tag = "quick")]
pub(super) async fn check_specimen(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    request: Request,
) -> Result<Json<Checked>, Problem> {
    let body = receive_json(&app, request).await?;
    let most_seconds = app.limits.max_job_time.as_secs_f64();
    let work = app.compute(&caller.share, move || {
        let schema = CHECK_SCHEMA.get_or_init(RequestSchema::of::<CheckRequest>);
        let errors = schema.errors(&body.value);
        if !errors.is_empty() {
            return Err(Problem::misfit(errors));
        }
        let request: CheckRequest =
            crate::field::read(&schema.settled(&body.value)).map_err(|e| Problem::invalid(vec![e]))?;
        check(&request, most_seconds)
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
    #[schema(value_type = Vec<NamedMaterial>)]
    materials: Vec<serde_json::Value>,
    /// Studies, spelled out.
    #[schema(value_type = Vec<Study>)]
    studies: Vec<serde_json::Value>,
}

/// A material with its name.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = ShippedMaterial)]
pub(super) struct NamedMaterial {
    /// Name.
    name: String,
    /// The material.
    material: Material,
}

macro_rules! shipped {
    ($file:literal) => {
        include_str!(concat!("../../../geometries/", $file))
    };
}

/// What the program ships.
#[utoipa::path(get, path = "/v1/library", operation_id = "get_library", responses(
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
#[utoipa::path(get, path = "/v1/me", operation_id = "get_caller", responses(
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
