//! Solve: forces and fields of a specimen at its drives.

use super::subject::{check_mesh, driven, model_of};
use super::{Context, JobError, Outcome, Request, Run, cost, defaults, summary};
use crate::fem::{Equilibrium, QuadraturePoint, SolveOptions, SolveResult};
use crate::field::FieldError;
use crate::kinematics::decompose;
use crate::material::Ogden;
use crate::mesh::MeshSize;
use crate::report::{deformed_picture, pvd, vtu_of};
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Most drives whose fields are written: with the standard mesh of a block some megabytes each.
const MAX_FIELD_DRIVES: usize = 100;

/// At which drives the fields are written for ParaView.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FieldDrives {
    /// At every drive, as a series.
    #[default]
    Every,
    /// At the last drive.
    Last,
}

/// Body of a forward solution.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SolveRequest {
    /// The specimen (`specimen/1`).
    pub specimen: Specimen,
    /// The material (`ogden/1`); Ecoflex 00-20 where it is left out.
    #[serde(default = "defaults::ecoflex")]
    pub material: Ogden,
    /// Drives in mm instead of the specimen's.
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
    /// Drives at which the fields are written: every one (at most 100), or the last.
    #[serde(default)]
    #[schema(default = FieldDrives::default)]
    pub fields: FieldDrives,
}

struct CheckedSolve {
    request: SolveRequest,
    /// At the drives that are asked for.
    specimen: Specimen,
}

impl Request for SolveRequest {
    const COMMAND: &'static str = "solve";
    const COLLECTION: &'static str = "solves";
    const ABOUT: &'static str = "Forces and fields of a specimen at its drives, by finite elements.";

    fn example() -> serde_json::Value {
        serde_json::json!({ "specimen": defaults::two_hole_shear(), "drive_mm": [2.0], "mesh": "search" })
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        let mut errors = Vec::new();
        let specimen = driven(&self.specimen, self.drive_mm.as_ref(), &mut errors);
        errors.extend(self.material.field_errors().into_iter().map(|e| e.below("/material")));
        let count = specimen.drive_mm.len();
        if self.fields == FieldDrives::Every && count > MAX_FIELD_DRIVES {
            let allowed = format!("last for more than {MAX_FIELD_DRIVES} drives");
            let error = FieldError::new("/fields", format!("every, and there are {count} drives"), allowed);
            errors.push(error.remedy("ask for the fields of the last drive, or for fewer drives"));
        }
        if errors.is_empty() { Ok(Box::new(CheckedSolve { request: self, specimen })) } else { Err(errors) }
    }
}

impl Run for CheckedSolve {
    fn title(&self) -> String {
        self.specimen.name.clone()
    }

    fn check_size(&self, _: &[Specimen], max_elements: usize) -> Result<(), FieldError> {
        check_mesh(&self.specimen, self.request.mesh, "/mesh", max_elements)
    }

    fn estimated_seconds(&self) -> Option<f64> {
        let mut mesh = self.request.mesh.options(&self.specimen);
        mesh.use_mirror &= !self.request.is_whole;
        cost::seconds(&self.specimen, &mesh, None, self.specimen.drive_mm.len())
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        let (specimen, material) = (&self.specimen, &self.request.material);
        let mut options = self.request.mesh.options(specimen);
        options.use_mirror &= !self.request.is_whole;
        let mut model = model_of(specimen, &options, context)?;
        let mut result = SolveResult::new(&model, context.input_hash.clone());
        let mut last: Option<Equilibrium> = None;
        let (mut fields_of_drives, num_drives) = (Vec::new(), specimen.drive_mm.len());
        for (index, &drive) in specimen.drive_mm.iter().enumerate() {
            context.step(&format!("solving drive {drive} mm"), index, num_drives);
            let found = model
                .solve(material, drive, last.as_ref(), &SolveOptions::default(), &|| context.is_cancelled())
                .map_err(|e| context.failed(&e))?;
            let fields = model.quadrature_fields(material, &found);
            result.push(&found, extremes(&fields), model.statistics());
            if self.request.fields == FieldDrives::Every || index + 1 == num_drives {
                let vtu = vtu_of(&model, material, &found).map_err(|e| context.failed(&e))?;
                fields_of_drives.push((drive, format!("solution_{}.vtu", index + 1), vtu));
            }
            last = Some(found);
        }
        let mut outcome = Outcome::new("solve.json", &result, summary::solve(&specimen.name, &result))?;
        if let Some(state) = &last {
            outcome.add("deformed.svg", deformed_picture(&model, material, state).map_err(|e| context.failed(&e))?);
        }
        let series: Vec<(f64, String)> = fields_of_drives.iter().map(|(d, name, _)| (*d, name.clone())).collect();
        outcome.add("solution.pvd", pvd(&series));
        for (_, name, vtu) in fields_of_drives {
            outcome.add(name, vtu);
        }
        Ok(outcome)
    }
}

/// Largest principal stretch, smallest and largest det F.
fn extremes(fields: &[QuadraturePoint]) -> [f64; 3] {
    fields.iter().fold([f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY], |[s, low, high], q| {
        let d = decompose(&q.deformation_gradient);
        [s.max(d.principal_stretches[0]), low.min(d.jacobian), high.max(d.jacobian)]
    })
}
