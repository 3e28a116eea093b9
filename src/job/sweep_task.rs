//! One task of a sweep: a design with a material, evaluated; its figures or the reason why there are none.

use super::{Context, JobError, Outcome, Request, ResultSchema, Run};
use crate::field::FieldError;
use crate::material::Material;
use crate::mesh::MeshSize;
use crate::sensitivity::ScanSettings;
use crate::specimen::Specimen;
use crate::sweep::TaskInputs;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// One task of a sweep.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SweepTaskRequest {
    /// The design. One that cannot be made is a result.
    specimen: Specimen,
    /// The material.
    material: Material,
    /// The scan.
    scan: ScanSettings,
    /// Element size.
    mesh: MeshSize,
}

impl Request for SweepTaskRequest {
    const COMMAND: &'static str = "sweep-task";
    const COLLECTION: &'static str = "sweep-tasks";
    const ABOUT: &'static str = "One task of a sweep.";

    fn example() -> serde_json::Value {
        serde_json::json!({ "specimen": super::defaults::two_hole_shear(), "material": super::defaults::ecoflex(), "scan": super::defaults::scan(), "mesh": "search" })
    }

    fn result() -> ResultSchema {
        ResultSchema::default()
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        Ok(Box::new(self))
    }
}

impl Run for SweepTaskRequest {
    fn title(&self) -> String {
        self.specimen.name.clone()
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        let inputs = TaskInputs {
            specimen: self.specimen.clone(),
            material: self.material.clone(),
            scan: self.scan,
            mesh: self.mesh,
        };
        let outcome = inputs.evaluate(&|| context.is_cancelled()).ok_or_else(JobError::stopped)?;
        Ok(Outcome::new("task.json", &outcome, "")?)
    }
}
