//! `POST /v1/scans`: a synthetic scan of a specimen with noise, wraps and a loading history. Its displacements become a
//! recording of the service, which calibrations and diagnoses take by its identifier.

use super::fields::{Artefacts, media_type, written};
use super::{
    EvaluationRequest, JobKind, MaterialSchema, Plan, RunContext, RunError, SizeLimits, SpecimenSchema, TaskProgress,
    json_bytes, mesh_of, plan_evaluation,
};
use crate::acquisition::{
    AcquisitionError, KSpace, LoadProgram, ReconstructOptions, Reconstruction, Scan, ScanOptions, ScanResult, Window,
    reconstruct, scan,
};
use crate::fem::{SolveError, SolveOptions};
use crate::material::Ogden;
use crate::provenance::{VERSION, input_hash};
use crate::recording::{Filter, write_vectors};
use crate::report::{displacement_picture, raw_picture};
use crate::sensitivity::ScanSettings;
use crate::service::problem::{Problem, parse};
use crate::service::store::{NewTask, TaskResult};
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Voxels around the specimen from which noise is estimated.
const MARGIN_VOXELS: usize = 3;

/// What is lost of k-space.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct KSpaceRequest {
    /// Part kept along x, y, z.
    #[schema(min_items = 3, max_items = 3)]
    pub keep: [f64; 3],
    /// Whether the kept part is weighted with a Hamming window.
    #[serde(default)]
    pub is_apodised: bool,
}

/// Body of a scan.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ScanRequest {
    /// The specimen (`specimen/1`).
    #[schema(value_type = SpecimenSchema)]
    pub specimen: Specimen,
    /// The material (`ogden/1`).
    #[schema(value_type = MaterialSchema)]
    pub material: Ogden,
    /// Drives in mm instead of the specimen's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 1000)]
    pub drive_mm: Option<Vec<f64>>,
    /// `search`, `standard` (default), `fine`, or a factor from 0.2 to 5 on the standard element size.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 16)]
    pub mesh: Option<String>,
    /// Edges of a voxel, mm; by default 1 × 0.1875 × 0.75.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 3, max_items = 3)]
    pub voxel_mm: Option<[f64; 3]>,
    /// Offset of the grid from the specimen's centre in voxels, each from −1 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 3, max_items = 3)]
    pub offset_voxels: Option<[f64; 3]>,
    /// Noise of a full voxel's displacement, mm; by default 0.01.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 3, max_items = 3)]
    pub noise_sd_mm: Option<[f64; 3]>,
    /// Displacement per phase, mm/rad; by default 1/(2π): one turn per millimetre.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 3, max_items = 3)]
    pub mm_per_radian: Option<[f64; 3]>,
    /// Filter on the displacements: `none` (default) or `hamming2`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = String, pattern = "^(none|hamming2)$", nullable = false)]
    pub filter: Option<Filter>,
    /// What is lost of k-space; nothing by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub kspace: Option<KSpaceRequest>,
    /// Noise of the load cell's mean (slow drift), N; by default 0.02.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0)]
    pub force_sd_n: Option<f64>,
    /// Leave wrapped phases and magnitudes instead of displacements. They are files of the job and no recording.
    #[serde(default)]
    pub is_raw: bool,
    /// Seed of all noise; 1 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0)]
    pub seed: Option<u64>,
}

/// The specimen at the drives asked for, and the scanner's settings.
fn settings(request: &ScanRequest) -> Result<(Specimen, ScanOptions), Problem> {
    let mut specimen = request.specimen.clone();
    if let Some(drives) = &request.drive_mm {
        specimen.drive_mm.clone_from(drives);
    }
    let mm_per_radian = request.mm_per_radian.unwrap_or([0.5 * std::f64::consts::FRAC_1_PI; 3]);
    let noise = request.noise_sd_mm.unwrap_or([0.01; 3]);
    for (name, values) in [("mm_per_radian", mm_per_radian), ("noise_sd_mm", noise)] {
        for (axis, value) in values.into_iter().enumerate() {
            if !(value.is_finite() && value > 1e-100) {
                let detail = format!("{name} is {value}; it must be positive and finite");
                return Err(Problem::at(format!("/{name}/{axis}"), detail));
            }
        }
    }
    let kspace = request
        .kspace
        .map(|k| KSpace { keep: k.keep, window: if k.is_apodised { Window::Hamming } else { Window::None } });
    if let Some(kspace) = &kspace {
        kspace.check().map_err(|e| Problem::at("/kspace/keep", e.to_string()))?;
    }
    let offset = request.offset_voxels.unwrap_or_default();
    if let Some(axis) = offset.iter().position(|o| !(o.abs() <= 1.0)) {
        let detail = format!("{} voxels; it must be from -1 to 1", offset[axis]);
        return Err(Problem::at(format!("/offset_voxels/{axis}"), detail));
    }
    let drift = request.force_sd_n.unwrap_or(0.02);
    if !(drift.is_finite() && drift >= 0.0) {
        return Err(Problem::at("/force_sd_n", format!("{drift} N; it must be finite and not negative")));
    }
    let grid = ScanOptions::grid_around(&specimen, voxel_of(request), MARGIN_VOXELS, offset)
        .map_err(|e| Problem::at("/voxel_mm", e.to_string()))?;
    let options = ScanOptions {
        grid,
        mm_per_radian,
        snr: [0, 1, 2].map(|axis| mm_per_radian[axis] / noise[axis]),
        kspace,
        load: LoadProgram { drift_sd_n: drift, ..LoadProgram::default() },
        seed: request.seed.unwrap_or(1),
    };
    Ok((specimen, options))
}

fn voxel_of(request: &ScanRequest) -> [f64; 3] {
    request.voxel_mm.unwrap_or([1.0, 0.1875, 0.75])
}

/// The kind.
pub struct Scans;

impl JobKind for Scans {
    fn name(&self) -> &'static str {
        "scans"
    }

    fn plan(&self, body: &serde_json::Value, limits: &SizeLimits) -> Result<Plan, Problem> {
        let request: ScanRequest = parse(body)?;
        // Specimen, material, mesh, drives and the number of voxels obey the same limits as an evaluation's.
        let same = EvaluationRequest {
            specimen: request.specimen.clone(),
            material: request.material.clone(),
            scan: Some(ScanSettings { voxel_mm: voxel_of(&request), ..super::scan_of(None) }),
            drive_mm: request.drive_mm.clone(),
            median_stretch: None,
            mesh: request.mesh.clone(),
        };
        plan_evaluation(&same, "", limits).map_err(|mut problem| {
            for error in &mut problem.errors {
                if let Some(rest) = error.pointer.strip_prefix("/scan/voxel_mm") {
                    error.pointer = format!("/voxel_mm{rest}");
                }
            }
            problem
        })?;
        if request.is_raw && request.filter.is_some_and(|f| f != Filter::None) {
            return Err(Problem::at("/filter", "the filter belongs to displacements; leave out is_raw or the filter"));
        }
        settings(&request)?;
        let input = serde_json::to_string(&request).map_err(|e| Problem::new("internal", e.to_string()))?;
        let cache_key = input_hash(&serde_json::json!({ "kind": "scan", "version": VERSION, "request": request }));
        let title = format!("scan of {}", request.specimen.name);
        Ok(Plan { title, tasks: vec![NewTask { input, cache_key }], has_gather: false })
    }

    fn run(&self, input: &serde_json::Value, context: &RunContext) -> Result<TaskResult, RunError> {
        let request: ScanRequest = parse(input)?;
        let (specimen, options) = settings(&request)?;
        let progress = |stage: &str, done| {
            (context.progress)(TaskProgress { stage: stage.into(), done, total: 3, best: None });
        };
        let cancelled = || (context.is_cancelled)();
        let stopped = |e: AcquisitionError| match e {
            AcquisitionError::Cancelled | AcquisitionError::Solve(SolveError::Cancelled { .. }) => RunError::Stopped,
            _ if cancelled() => RunError::Stopped,
            other => Problem::new("no-solution", other.to_string()).into(),
        };
        progress("solve and scan", 0);
        let mesh = mesh_of(request.mesh.as_deref(), &specimen)?;
        let hash = input_hash(&serde_json::json!({ "version": VERSION, "request": request }));
        let id = format!("{}-seed-{}", plain(&specimen.name), options.seed);
        let mut made = scan(&id, &specimen, &request.material, &mesh, &SolveOptions::default(), &options, &cancelled)
            .map_err(stopped)?;
        made.raw.notes = Some(serde_json::json!({
            "synthetic": { "program": format!("lambdak {VERSION}"), "input_hash": hash, "seed": options.seed },
        }));
        progress("reconstruct", 1);
        let found = if request.is_raw {
            None
        } else {
            let how =
                ReconstructOptions { filter: request.filter.unwrap_or_default(), ..ReconstructOptions::default() };
            Some(reconstruct(&made.raw, &how).map_err(stopped)?)
        };
        progress("files", 2);
        let result = ScanResult::new(&made, &options, found.as_ref(), hash).map_err(stopped)?;
        let mut result = serde_json::to_value(&result).map_err(|e| Problem::new("internal", e.to_string()))?;
        let (artefacts, recording) = files(&made, found.as_ref(), &request.material, context)?;
        result["recording"] = recording.into();
        Ok(TaskResult { result: json_bytes(&result)?, artefacts })
    }
}

/// The recording's files, the estimated noise, pictures; and the identifier under which the recording is kept.
fn files(
    made: &Scan,
    found: Option<&Reconstruction>,
    material: &Ogden,
    context: &RunContext,
) -> Result<(Artefacts, Option<String>), RunError> {
    let folder = written(|folder| match found {
        None => made.raw.write(folder),
        Some(found) => found.recording.write(folder),
    })?;
    let recording = match found {
        None => None,
        Some(_) => Some((context.keep)(folder.clone())?),
    };
    let mut artefacts: Artefacts =
        folder.into_iter().map(|(name, bytes)| (name.clone(), media_type(&name).to_string(), bytes)).collect();
    if let Some(found) = found {
        let noise = written(|folder| {
            for (n, sd) in found.sd_mm.iter().enumerate() {
                write_vectors(folder, &format!("sd_{}.nii.gz", n + 1), &found.recording.grid, sd)?;
            }
            Ok(())
        })?;
        artefacts.extend(noise.into_iter().map(|(name, bytes)| (name, super::fields::NIFTI.to_string(), bytes)));
    }
    for n in 0..made.raw.steps.len() {
        let mut picture = |name: &str, svg: String| {
            artefacts.push((format!("{name}_{}.svg", n + 1), "image/svg+xml".into(), svg.into_bytes()));
        };
        picture("raw", raw_picture(&made.raw, n));
        if let Some(found) = found {
            picture("displacement", displacement_picture(&found.recording, n));
        }
    }
    artefacts.push(("material.json".into(), "application/json".into(), material.to_json().into_bytes()));
    Ok((artefacts, recording))
}

/// A recording's name from a specimen's.
fn plain(name: &str) -> String {
    let text: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect();
    let parts: Vec<&str> = text.split('-').filter(|p| !p.is_empty()).collect();
    if parts.is_empty() { "scan".into() } else { parts.join("-").chars().take(60).collect() }
}
