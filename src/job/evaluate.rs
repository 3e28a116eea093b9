//! Evaluate: what a scan of a specimen would see and what it would tell about the material.

use super::array_files::{add_arrays, array_formats};
use super::detectable::{check_detectable, detectable_sizes, detection_seconds};
use super::path_end::no_equilibrium;
use super::subject::{add_drawings, check_meshes, driven, model_of, name_of_sample};
use super::{Context, JobError, Outcome, RecordingOutline, Request, ResultSchema, Run, cost, defaults, summary};
use crate::export::{FieldFormat, FieldSeries, evaluation_arrays, vtkhdf_file};
use crate::fem::Equilibrium;
use crate::field::FieldError;
use crate::material::Material;
use crate::mesh::{MeshOptions, MeshSize};
use crate::report::{
    bar_pictures, detectable_picture, histogram_picture, map_pictures, solution_fields, surface_json, vtu_of,
};
use crate::sensitivity::{
    DriveSelection, Evaluation, EvaluationError, EvaluationMaps, EvaluationOptions, Fixture, Protocol, ScanSettings,
    bound_discretisation, evaluate_fixture,
};
use crate::specimen::Specimen;
use crate::voxel::{VoxelError, VoxelGrid};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Most voxels of a scan: a voxel has several sample points, and more would not fit into a few gigabytes.
const MAX_VOXELS: usize = 2_000_000;

/// Drives that are solved, about, until one reaches a median stretch.
const MEDIAN_STRETCH_SOLVES: usize = 6;

/// Body of an evaluation.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct EvaluationRequest {
    /// The specimen (`specimen/1`).
    pub specimen: Specimen,
    /// The material, Ogden's or another law; Ecoflex 00-20 where it is left out.
    #[serde(default = "defaults::ecoflex")]
    pub material: Material,
    /// The scan; 1 × 0.1875 × 0.75 mm voxels, 0.05 mm and 0.02 N noise where it is left out.
    #[serde(default = "defaults::scan")]
    #[schema(default = defaults::scan)]
    pub scan: ScanSettings,
    /// Which samples are scanned and for how long, forces read beside those at the scans, and what is not known exactly
    /// of the load cell and the drive.
    #[serde(default)]
    #[schema(default = Protocol::default)]
    pub protocol: Protocol,
    /// Drives in mm instead of the specimen's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 1000)]
    pub drive_mm: Option<Vec<f64>>,
    /// Evaluate at the drive that reaches this median stretch instead of at given drives.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 1.0, maximum = 5.0)]
    pub median_stretch: Option<f64>,
    /// Element size.
    #[serde(default)]
    #[schema(default = MeshSize::default)]
    pub mesh: MeshSize,
    /// Mesh the whole specimen even where it has mirror planes.
    #[serde(default)]
    pub is_whole: bool,
    /// Whether the result says how small errors of the experiment may be and still be named by a diagnosis with 90 %
    /// probability (`detectable`). It takes one more equilibrium of the whole sample at every drive.
    #[serde(default)]
    pub has_detectable: bool,
    /// Whether coarser meshes say what the mesh may put the numbers wrong by. It takes about half as
    /// long again; of a mesh of more than 1.25 times the standard element size they say nothing.
    #[serde(default = "defaults::yes")]
    #[schema(default = defaults::yes)]
    pub has_discretisation: bool,
    /// Whether pictures, fields and drawings are made; without them there are numbers alone.
    #[serde(default = "defaults::yes")]
    #[schema(default = defaults::yes)]
    pub has_files: bool,
    /// Further files with the voxel fields and what they promise: arrays for MATLAB and Python, and the fields in the
    /// mesh, all drives in one file for ParaView.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 3)]
    pub arrays: Vec<FieldFormat>,
}

/// A checked evaluation.
pub(super) struct CheckedEvaluation {
    request: EvaluationRequest,
    drives: DriveSelection,
}

impl EvaluationRequest {
    /// Everything that is wrong with it beyond the limits of single fields, and the drives that it asks for.
    pub(super) fn checked(mut self) -> Result<CheckedEvaluation, Vec<FieldError>> {
        let mut errors: Vec<FieldError> = Vec::new();
        let driven = driven(&self.specimen, self.drive_mm.as_ref(), &mut errors);
        if self.specimen.is_other_way(driven.largest_drive_mm()) {
            // The mesh of a bar that is pushed is another one than that of a bar that is pulled.
            self.specimen = driven;
        }
        errors.extend(self.material.field_errors().into_iter().map(|e| e.below("/material")));
        errors.extend(self.scan.field_errors().into_iter().map(|e| e.below("/scan")));
        errors.extend(self.protocol.field_errors().into_iter().map(|e| e.below("/protocol")));
        if let (Some(stretch), Some(_)) = (self.median_stretch, &self.drive_mm) {
            let error = FieldError::new("/median_stretch", stretch, "left out where drive_mm is given");
            errors.push(error.remedy("give one of the two"));
        }
        if !self.arrays.is_empty() && !self.has_files {
            let error = FieldError::new("/arrays", "given", "left out where has_files is false");
            errors.push(error.remedy("leave out one of the two"));
        }
        if errors.is_empty()
            && let Err(error) = check_grid(&self.specimen, &self.scan)
        {
            errors.push(error);
        }
        if !errors.is_empty() {
            return Err(errors);
        }
        let drives = match (self.median_stretch, &self.drive_mm) {
            (Some(target), _) => DriveSelection::MedianStretch(target),
            (None, Some(drives)) => DriveSelection::DriveMm(drives.clone()),
            (None, None) => DriveSelection::DriveMm(self.specimen.drive_mm.clone()),
        };
        self.protocol.suits(&self.specimen, drives.count()).map_err(|e| vec![e.field_error().below("/protocol")])?;
        if self.has_detectable {
            check_detectable(&self.specimen, &self.scan, &self.protocol, drives.count()).map_err(|e| vec![e])?;
        }
        Ok(CheckedEvaluation { request: self, drives })
    }
}

/// Whether the scan's grid can be held in memory.
fn check_grid(specimen: &Specimen, scan: &ScanSettings) -> Result<(), FieldError> {
    let mut num_voxels = 0;
    for sample in specimen.samples() {
        let grid = VoxelGrid::planned(&sample, scan.voxel_mm, scan.surface).map_err(|e| {
            let error = match (&e, scan.surface) {
                (VoxelError::HiddenFace { .. }, Some(surface)) => {
                    FieldError::new("/scan/surface/face", surface.face.name(), "a plane face that cameras can see")
                }
                _ => FieldError::new("/scan/voxel_mm", format!("{:?}", scan.voxel_mm), "usable"),
            };
            error.remedy(e.to_string())
        })?;
        num_voxels += grid.num_voxels();
    }
    if num_voxels <= MAX_VOXELS {
        return Ok(());
    }
    let found = format!("{:?}, which makes {num_voxels} voxels", scan.voxel_mm);
    let allowed = format!("large enough for at most {MAX_VOXELS} voxels");
    Err(FieldError::new("/scan/voxel_mm", found, allowed))
}

impl Request for EvaluationRequest {
    const COMMAND: &'static str = "evaluate";
    const COLLECTION: &'static str = "evaluations";
    const ABOUT: &'static str = "What a scan of a specimen would see, and what it would tell about the material.";

    fn example() -> serde_json::Value {
        serde_json::json!({ "specimen": defaults::two_hole_shear(), "material": defaults::ecoflex(), "drive_mm": [5.0], "mesh": "search" })
    }

    fn result() -> ResultSchema {
        ResultSchema::of::<Evaluation>("evaluation/1")
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        Ok(Box::new(self.checked()?))
    }
}

impl CheckedEvaluation {
    /// All that its numbers depend on.
    pub(super) fn content(&self) -> serde_json::Value {
        let r = &self.request;
        serde_json::json!({
            "specimen": r.specimen, "material": r.material, "scan": r.scan, "drives": self.drives,
            "mesh": self.options().mesh, "protocol": r.protocol, "has_detectable": r.has_detectable,
            "has_discretisation": r.has_discretisation,
        })
    }

    fn options(&self) -> EvaluationOptions {
        let specimen = &self.request.specimen;
        let mut mesh = self.request.mesh.options(specimen);
        mesh.use_mirror &= !self.request.is_whole;
        EvaluationOptions { mesh, protocol: self.request.protocol.clone(), ..EvaluationOptions::standard(specimen) }
    }
}

impl Run for CheckedEvaluation {
    fn title(&self) -> String {
        self.request.specimen.name.clone()
    }

    fn check_size(&self, _: &[RecordingOutline], max_elements: usize) -> Result<(), FieldError> {
        check_meshes(&self.request.specimen, self.request.mesh, "/mesh", max_elements)
    }

    fn estimated_seconds(&self, _: &[RecordingOutline]) -> Option<f64> {
        let num_drives = match &self.drives {
            DriveSelection::DriveMm(drives) => drives.len(),
            // The drive is looked for first.
            DriveSelection::MedianStretch(_) => MEDIAN_STRETCH_SOLVES,
        };
        let EvaluationRequest { specimen, scan, has_detectable, .. } = &self.request;
        let seen = Some((scan.voxel_mm, scan.surface));
        let mesh = self.options().mesh;
        let mut evaluation = cost::seconds(specimen, &mesh, seen, num_drives)?;
        if self.request.has_discretisation {
            evaluation += cost::of_coarser_meshes(specimen, &mesh, seen, self.drives.count());
        }
        let detection = if *has_detectable { detection_seconds(specimen, scan, self.drives.count())? } else { 0.0 };
        Some(evaluation + detection)
    }

    fn equal_work(&self) -> Option<(serde_json::Value, bool)> {
        let mut content = self.content();
        if !self.request.arrays.is_empty() {
            content["arrays"] = serde_json::json!(self.request.arrays);
        }
        Some((content, !self.request.has_files))
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        let EvaluationRequest { specimen, material, scan, protocol, .. } = &self.request;
        context.step("solve", 0, 2);
        let options = self.options();
        let samples: Vec<(Specimen, MeshOptions)> =
            specimen.samples().into_iter().map(|s| (s.clone(), options.mesh.carried(specimen, &s))).collect();
        let models =
            samples.iter().map(|(sample, mesh)| model_of(sample, mesh, context)).collect::<Result<Vec<_>, _>>()?;
        let cancelled = || context.is_cancelled();
        let evaluated = Fixture::of_models(specimen, models, scan, &options).and_then(|mut fixture| {
            let found = evaluate_fixture(&mut fixture, material, &self.drives, &[], &options, &cancelled)?;
            Ok((fixture, found))
        });
        let (fixture, (mut evaluation, maps)) = evaluated.map_err(|e| match e {
            EvaluationError::Solve(e) => no_equilibrium(&e, &samples, material, context),
            EvaluationError::MedianStretchNotReached { .. } => context.failed(&e),
            other => FieldError::new("", "an evaluation that cannot be made", "one that can")
                .remedy(other.to_string())
                .into(),
        })?;
        if self.request.has_discretisation {
            context.step("coarser meshes", 1, 2);
            bound_discretisation(&mut evaluation, specimen, material, &options, &cancelled);
            context.stop_if_cancelled()?;
        }
        if self.request.has_detectable {
            context.step("what would be found", 1, 2);
            evaluation.detectable = detectable_sizes(specimen, material, protocol, &evaluation, context)?;
        }
        let text = summary::evaluation(&specimen.name, &evaluation);
        let mut outcome = Outcome::new("evaluation.json", &evaluation, text)?;
        if !self.request.has_files {
            return Ok(outcome);
        }
        context.step("pictures", 1, 2);
        outcome.add_pictures(bar_pictures(&evaluation));
        if self.request.has_detectable {
            outcome.add("detectable.svg", detectable_picture(&evaluation.detectable));
        }
        self.add_samples(&mut outcome, &fixture, &maps, context)?;
        add_drawings(&mut outcome, specimen, "specimen", &[])?;
        let formats = array_formats(&self.request.arrays);
        if !formats.is_empty() {
            add_arrays(&mut outcome, "evaluation", evaluation_arrays(&evaluation, &maps), &formats, context)?;
        }
        Ok(outcome)
    }
}

impl CheckedEvaluation {
    /// Adds pictures and fields of every sample.
    fn add_samples(
        &self,
        outcome: &mut Outcome,
        fixture: &Fixture,
        maps: &EvaluationMaps,
        context: &Context,
    ) -> Result<(), JobError> {
        let material = &self.request.material;
        let has_others = maps.samples.len() > 1;
        let mut panels = Vec::new();
        for (number, sample) in maps.samples.iter().enumerate() {
            let of = if has_others { format!(", sample {}", number + 1) } else { String::new() };
            panels.extend(sample.drives.iter().map(|d| (format!("drive {:.2} mm{of}", d.drive_mm), &d.states[..])));
        }
        outcome.add("histogram.svg", histogram_picture(&panels));
        for (index, (part, sample)) in fixture.parts().iter().zip(&maps.samples).enumerate() {
            let name = |stem: &str| name_of_sample(stem, index);
            outcome.add_pictures(map_pictures(sample).into_iter().map(|(stem, svg)| (name(&stem), svg)));
            if let Some(state) = sample.equilibria.last() {
                let fields = solution_fields(&part.model, material, state);
                let vtu = vtu_of(part.model.mesh(), &fields).map_err(|e| context.failed(&e))?;
                outcome.add(format!("{}.vtu", name("solution")), vtu);
                let surface = surface_json(&part.model, material, state).map_err(|e| context.failed(&e))?;
                outcome.add(format!("{}.json", name("surface")), surface);
            }
            if self.request.arrays.contains(&FieldFormat::Vtkhdf) {
                let fields = |state: &Equilibrium| (state.drive_mm, solution_fields(&part.model, material, state));
                let series: FieldSeries = sample.equilibria.iter().map(fields).collect();
                let file = vtkhdf_file(part.model.mesh(), &series).map_err(|e| context.failed(&e))?;
                outcome.add(format!("{}.vtkhdf", name("solution")), file);
            }
        }
        Ok(())
    }
}
