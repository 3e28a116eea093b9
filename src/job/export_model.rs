//! Export of a model: a specimen's mesh, material, boundary conditions and drives for other programs.

use super::export_result::{ExportModelResult, ModelFile};
use super::subject::{check_mesh, driven, model_of};
use super::{Context, JobError, Outcome, RecordingOutline, Request, ResultSchema, Run, defaults, summary};
use crate::export::{ExportError, Model, ModelFormat, Origin, model_file};
use crate::field::FieldError;
use crate::material::Material;
use crate::mesh::MeshSize;
use crate::provenance::VERSION;
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Body of the export of a model.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ExportModelRequest {
    /// The specimen (`specimen/1`).
    pub specimen: Specimen,
    /// The material, Ogden's or another law; Ecoflex 00-20 where it is left out.
    #[serde(default = "defaults::ecoflex")]
    pub material: Material,
    /// Drives in mm instead of the specimen's; one load step each.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 1000)]
    pub drive_mm: Option<Vec<f64>>,
    /// Element size.
    #[serde(default)]
    #[schema(default = MeshSize::default)]
    pub mesh: MeshSize,
    /// Mesh the whole specimen even where it has mirror planes.
    #[serde(default)]
    pub is_whole: bool,
    /// Programs that it is written for; all that have the material's law and read so many terms where the list is left
    /// out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 3)]
    pub formats: Option<Vec<ModelFormat>>,
}

struct CheckedExport {
    request: ExportModelRequest,
    /// At the drives that are asked for.
    specimen: Specimen,
    formats: Vec<ModelFormat>,
}

impl ExportModelRequest {
    /// The programs that are asked for.
    fn formats(&self) -> Result<Vec<ModelFormat>, FieldError> {
        let check = |f: ModelFormat| f.check(&self.material);
        let Some(formats) = &self.formats else {
            return Ok(ModelFormat::ALL.into_iter().filter(|&f| check(f).is_ok()).collect());
        };
        let unfit = |index: usize, e: ExportError| {
            FieldError::new(format!("/formats/{index}"), formats[index].program(), "left out").remedy(e.to_string())
        };
        let checked = formats.iter().enumerate().map(|(index, &f)| check(f).map(|()| f).map_err(|e| unfit(index, e)));
        checked.collect()
    }
}

impl Request for ExportModelRequest {
    const COMMAND: &'static str = "export-model";
    const COLLECTION: &'static str = "model-exports";
    const ABOUT: &'static str = "A specimen's mesh, material, boundary conditions and drives for Abaqus, CalculiX and \
                                 FEBio.";

    fn example() -> serde_json::Value {
        serde_json::json!({
            "specimen": super::defaults::two_hole_shear(),
            "material": super::defaults::ecoflex(),
            "drive_mm": [2.0]
        })
    }

    fn result() -> ResultSchema {
        ResultSchema::of::<ExportModelResult>("export-model/1")
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        let mut errors = Vec::new();
        let specimen = driven(&self.specimen, self.drive_mm.as_ref(), &mut errors);
        errors.extend(self.material.field_errors().into_iter().map(|e| e.below("/material")));
        match self.formats() {
            Ok(formats) if errors.is_empty() => {
                return Ok(Box::new(CheckedExport { request: self, specimen, formats }));
            }
            Ok(_) => {}
            Err(error) => errors.push(error),
        }
        Err(errors)
    }
}

impl Run for CheckedExport {
    fn title(&self) -> String {
        format!("model of {}", self.specimen.name)
    }

    fn check_size(&self, _: &[RecordingOutline], max_elements: usize) -> Result<(), FieldError> {
        check_mesh(&self.specimen, self.request.mesh, "/mesh", max_elements)
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        let specimen = &self.specimen;
        let mut options = self.request.mesh.options(specimen);
        options.use_mirror &= !self.request.is_whole;
        // The mesh of `solve`, which a forward model chooses.
        let forward = model_of(specimen, &options, context)?;
        let (mesh, multiplicity) = (forward.mesh(), forward.multiplicity());
        let result = ExportModelResult {
            schema: "export-model/1",
            version: VERSION,
            input_hash: &context.input_hash,
            name: &specimen.name,
            num_elements: mesh.num_elements(),
            mirror: [mesh.mirror.y, mesh.mirror.z],
            reaction_multiplier: multiplicity,
            drive_mm: &specimen.drive_mm,
            files: self.formats.iter().map(|&format| ModelFile { format, file: format.file_name() }).collect(),
        };
        let mut outcome = Outcome::new("export-model.json", &result, summary::export_model(&result))?;
        let model = Model {
            mesh,
            material: &self.request.material,
            drives_mm: &specimen.drive_mm,
            direction: specimen.drive_direction(),
            beside_drive_mm: specimen.displacement_before_drive_mm(),
            multiplicity,
        };
        let origin = Origin { name: &specimen.name, version: VERSION, input_hash: &context.input_hash };
        for &format in &self.formats {
            let text = model_file(&model, format, &origin).map_err(|e| context.failed(&e))?;
            outcome.add(format.file_name(), text);
        }
        Ok(outcome)
    }
}
