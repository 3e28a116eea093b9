//! One task: a design with a material, evaluated; its figures or the reason why there are none.

use super::points::points;
use super::study::SweepStudy;
use crate::fem::SolveError;
use crate::material::Material;
use crate::mesh::MeshSize;
use crate::sensitivity::{
    DriveSelection, EvaluationError, EvaluationOptions, EvaluationStep, PromisedSd, ScanSettings, evaluate,
};
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};

/// One task of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// Index, from 0: design × number of materials + material.
    pub index: usize,
    /// Index of the design.
    pub point: usize,
    /// Index of the material.
    pub material: usize,
    /// Values of the variables.
    pub values: Vec<f64>,
}

/// What a task evaluates.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskInputs {
    /// The design; one that cannot be made is a result.
    pub specimen: Specimen,
    /// The material.
    pub material: Material,
    /// The scan.
    pub scan: ScanSettings,
    /// The mesh.
    pub mesh: MeshSize,
}

/// What became of a task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "status")]
pub enum Outcome {
    /// Evaluated.
    Done(Box<Figures>),
    /// Not evaluated; a result as well.
    Failed {
        /// `specimen`, `material`, `mesh`, `equilibrium`, `voxels`, `information`, `drive`, `not_finite` or `internal`.
        kind: String,
        /// Why, in words.
        reason: String,
    },
}

/// Figures of an evaluation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// Volume of the specimen, mm³.
    pub volume_mm3: f64,
    /// Drives, increasing.
    pub steps: Vec<EvaluationStep>,
    /// Standard deviations that all drives together promise.
    pub promised_sd: Vec<PromisedSd>,
    /// Largest over smallest eigenvalue of the relative covariance; null where undetermined.
    pub condition_number: Option<f64>,
    /// Free displacement unknowns.
    pub num_unknowns: usize,
    /// Hash of the evaluation's inputs.
    pub input_hash: String,
}

/// All tasks of a study, by index.
pub fn tasks(study: &SweepStudy) -> Vec<Task> {
    let num_materials = study.materials.len();
    let each = |(point, values): (usize, Vec<f64>)| {
        (0..num_materials).map(move |material| Task {
            index: point * num_materials + material,
            point,
            material,
            values: values.clone(),
        })
    };
    points(study).into_iter().enumerate().flat_map(each).collect()
}

impl Task {
    /// What this task evaluates.
    pub fn inputs(&self, study: &SweepStudy) -> TaskInputs {
        let mut specimen = study.base.clone();
        let mut material = study.materials[self.material].material.clone();
        let mut scan = study.scan;
        for (targets, &value) in study.targets().iter().zip(&self.values) {
            for target in targets {
                // A valid study has no target that does not exist.
                target.set(value, &mut specimen, &mut material, &mut scan);
            }
        }
        TaskInputs { specimen, material, scan, mesh: study.mesh }
    }

    /// Evaluates; `None` where it was stopped from outside.
    pub fn evaluate(&self, study: &SweepStudy, is_cancelled: &(dyn Fn() -> bool + Sync)) -> Option<Outcome> {
        self.inputs(study).evaluate(is_cancelled)
    }
}

impl TaskInputs {
    /// Evaluates; `None` where it was stopped from outside.
    pub fn evaluate(&self, is_cancelled: &(dyn Fn() -> bool + Sync)) -> Option<Outcome> {
        let TaskInputs { specimen, material, scan, mesh } = self;
        if let Err(e) = specimen.validate() {
            return Some(failed("specimen", &e));
        }
        if let Err(e) = material.validate() {
            return Some(failed("material", &e));
        }
        let options = EvaluationOptions { mesh: mesh.options(specimen), ..EvaluationOptions::standard(specimen) };
        let drives = DriveSelection::DriveMm(specimen.drive_mm.clone());
        let evaluation = match evaluate(specimen, material, scan, &drives, &options, is_cancelled) {
            Ok((evaluation, _)) => evaluation,
            Err(EvaluationError::Solve(SolveError::Cancelled { .. })) => return None,
            Err(error) => return Some(failed(kind_of(&error), &error)),
        };
        let outcome = Outcome::Done(Box::new(Figures {
            volume_mm3: specimen.volume_mm3(),
            steps: evaluation.steps,
            promised_sd: evaluation.promised_sd,
            condition_number: evaluation.condition_number,
            num_unknowns: evaluation.statistics.num_unknowns,
            input_hash: evaluation.input_hash,
        }));
        // JSON has no NaN: what would not come back as it was is no result.
        let returns = serde_json::to_string(&outcome)
            .is_ok_and(|t| serde_json::from_str(&t).is_ok_and(|o: Outcome| o == outcome));
        Some(if returns { outcome } else { failed("not_finite", &"a figure of the evaluation is not finite") })
    }
}

fn failed(kind: &str, reason: &dyn std::fmt::Display) -> Outcome {
    Outcome::Failed { kind: kind.into(), reason: reason.to_string() }
}

fn kind_of(error: &EvaluationError) -> &'static str {
    match error {
        EvaluationError::Mesh(_) => "mesh",
        EvaluationError::Solve(_) => "equilibrium",
        EvaluationError::Voxel(_) => "voxels",
        EvaluationError::Information(_) => "information",
        _ => "drive",
    }
}
