//! Solve: forces and fields of a specimen at its drives.

use super::array_files::{add_arrays, array_formats};
use super::path_end::no_equilibrium;
use super::subject::{check_meshes, driven, model_of, name_of_sample};
use super::{Context, JobError, Outcome, RecordingOutline, Request, ResultSchema, Run, cost, defaults, summary};
use crate::export::{FieldFormat, FieldSeries, solution_arrays, vtkhdf_file};
use crate::fem::{Equilibrium, ForwardModel, QuadraturePoint, SolveOptions, SolveResult};
use crate::field::FieldError;
use crate::kinematics::decompose;
use crate::material::Material;
use crate::mesh::{CoarserMeshes, Mesh, MeshOptions, MeshSize};
use crate::report::{deformed_picture, pvd, solution_fields, vtu_of};
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
    /// The material, Ogden's or another law; Ecoflex 00-20 where it is left out.
    #[serde(default = "defaults::ecoflex")]
    pub material: Material,
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
    /// Whether coarser meshes say what the mesh may put the forces wrong by. It takes about half as
    /// long again; of a mesh of more than 1.25 times the standard element size they say nothing.
    #[serde(default = "defaults::yes")]
    #[schema(default = defaults::yes)]
    pub has_discretisation: bool,
    /// Drives at which the fields are written: every one (at most 100), or the last.
    #[serde(default)]
    #[schema(default = FieldDrives::default)]
    pub fields: FieldDrives,
    /// Further files with the forces and the fields: arrays for MATLAB and Python, all drives in one file for ParaView.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 3)]
    pub arrays: Vec<FieldFormat>,
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

    fn result() -> ResultSchema {
        ResultSchema::of::<SolveResult>("solve/1")
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

    fn check_size(&self, _: &[RecordingOutline], max_elements: usize) -> Result<(), FieldError> {
        check_meshes(&self.specimen, self.request.mesh, "/mesh", max_elements)
    }

    fn estimated_seconds(&self, _: &[RecordingOutline]) -> Option<f64> {
        let mesh = self.mesh_options(&self.specimen);
        let num_drives = self.specimen.drive_mm.len();
        let coarser = match self.request.has_discretisation {
            true => cost::of_coarser_meshes(&self.specimen, &mesh, None, num_drives),
            false => 0.0,
        };
        Some(cost::seconds(&self.specimen, &mesh, None, num_drives)? + coarser)
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        let samples = self.specimen.samples();
        let solved = samples.iter().map(|s| self.solve(s, samples.len(), context)).collect::<Result<Vec<_>, _>>()?;
        let (results, solved): (Vec<SolveResult>, Vec<Solved>) = solved.into_iter().unzip();
        let mut result = SolveResult::of_samples(results, &context.input_hash);
        if self.request.has_discretisation {
            context.step("coarser meshes", self.specimen.drive_mm.len(), self.specimen.drive_mm.len());
            if let Some(meshes) = CoarserMeshes::of(&self.mesh_options(&samples[0]), &samples[0]) {
                result.bound_forces(&meshes, &self.forces_on_coarser_meshes(&samples, context));
            }
            context.stop_if_cancelled()?;
        }
        let mut outcome = Outcome::new("solve.json", &result, summary::solve(&self.specimen.name, &result))?;
        for (index, sample) in solved.iter().enumerate() {
            let name = |stem: &str| name_of_sample(stem, index);
            if let Some(deformed) = &sample.deformed {
                outcome.add(format!("{}.svg", name("deformed")), deformed.as_str());
            }
            let first = self.specimen.drive_mm.len() - sample.fields.len() + 1;
            let name_at = |index: usize| format!("{}.vtu", name(&format!("solution_{}", first + index)));
            let series = sample.fields.iter().enumerate().map(|(index, (drive, _))| (*drive, name_at(index)));
            outcome.add(format!("{}.pvd", name("solution")), pvd(&series.collect::<Vec<_>>()));
            for (index, (_, fields)) in sample.fields.iter().enumerate() {
                outcome.add(name_at(index), vtu_of(&sample.mesh, fields).map_err(|e| context.failed(&e))?);
            }
            if self.request.arrays.contains(&FieldFormat::Vtkhdf) {
                let file = vtkhdf_file(&sample.mesh, &sample.fields).map_err(|e| context.failed(&e))?;
                outcome.add(format!("{}.vtkhdf", name("solution")), file);
            }
        }
        let formats = array_formats(&self.request.arrays);
        if !formats.is_empty() {
            let parts: Vec<_> = solved.iter().map(|s| (&s.mesh, &s.fields)).collect();
            let tree = solution_arrays(&result, &parts).map_err(|e| context.failed(&e))?;
            add_arrays(&mut outcome, "solve", tree, &formats, context)?;
        }
        Ok(outcome)
    }
}

/// One solved sample.
struct Solved {
    mesh: Mesh,
    /// Picture of the deformed sample at the last drive.
    deformed: Option<String>,
    /// The fields at the drives at which they are written: every one, or the last.
    fields: FieldSeries,
}

impl CheckedSolve {
    /// How one of the samples is meshed.
    fn mesh_options(&self, sample: &Specimen) -> MeshOptions {
        let options = self.request.mesh.options(sample);
        MeshOptions { use_mirror: options.use_mirror && !self.request.is_whole, ..options }
    }

    /// Forces of all samples together, along the drive and along +y, at every drive on the meshes of
    /// [`crate::mesh::COARSER`]; `None` where such a mesh has no solution.
    fn forces_on_coarser_meshes(&self, samples: &[Specimen], context: &Context) -> [Option<Vec<[f64; 2]>>; 2] {
        let on_mesh = |coarser: usize| {
            let mut forces = vec![[0.0; 2]; self.specimen.drive_mm.len()];
            for sample in samples {
                let mesh = CoarserMeshes::of(&self.mesh_options(sample), sample)?.options[coarser];
                let mut model = ForwardModel::of_specimen(sample, &mesh).ok()?;
                let mut last: Option<Equilibrium> = None;
                for (sum, &drive) in forces.iter_mut().zip(&sample.drive_mm) {
                    let (material, options) = (&self.request.material, SolveOptions::default());
                    let found =
                        model.solve(material, drive, last.as_ref(), &options, &|| context.is_cancelled()).ok()?;
                    sum[0] += found.force_n;
                    sum[1] += found.normal_force_n;
                    last = Some(found);
                }
            }
            Some(forces)
        };
        rayon::join(|| on_mesh(0), || on_mesh(1)).into()
    }

    /// One of `num_samples` kinds of samples at all drives.
    fn solve(
        &self,
        sample: &Specimen,
        num_samples: usize,
        context: &Context,
    ) -> Result<(SolveResult, Solved), JobError> {
        let material = &self.request.material;
        let mut model = model_of(sample, &self.mesh_options(sample), context)?;
        let mut result = SolveResult::new(&model, context.input_hash.clone());
        let mut last: Option<Equilibrium> = None;
        let (mut fields_of_drives, num_drives) = (Vec::new(), sample.drive_mm.len());
        for (index, &drive) in sample.drive_mm.iter().enumerate() {
            let of = if num_samples > 1 { format!("{}, ", sample.name) } else { String::new() };
            context.step(&format!("{of}solving drive {drive} mm"), index, num_drives);
            let found = model
                .solve(material, drive, last.as_ref(), &SolveOptions::default(), &|| context.is_cancelled())
                .map_err(|e| no_equilibrium(&e, &[(sample.clone(), self.mesh_options(sample))], material, context))?;
            let fields = model.quadrature_fields(material, &found);
            result.push(&found, extremes(&fields), model.contact(sample, &found), model.statistics());
            if self.request.fields == FieldDrives::Every || index + 1 == num_drives {
                fields_of_drives.push((drive, solution_fields(&model, material, &found)));
            }
            last = Some(found);
        }
        let deformed = last.map(|state| deformed_picture(&model, material, &state)).transpose();
        let deformed = deformed.map_err(|e| context.failed(&e))?;
        Ok((result, Solved { mesh: model.mesh().clone(), deformed, fields: fields_of_drives }))
    }
}

/// Largest principal stretch, smallest and largest det F.
fn extremes(fields: &[QuadraturePoint]) -> [f64; 3] {
    fields.iter().fold([f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY], |[s, low, high], q| {
        let d = decompose(&q.deformation_gradient);
        [s.max(d.principal_stretches[0]), low.min(d.jacobian), high.max(d.jacobian)]
    })
}
