//! What several kinds of jobs do alike: checks of a specimen with its drives, the size of its mesh, its drawings.

use super::{Context, JobError, Outcome};
use crate::fem::{ForwardModel, PrepareError};
use crate::field::FieldError;
use crate::mesh::{MeshOptions, MeshSize, mesh_specimen};
use crate::specimen::{Specimen, Tolerances, mould_to_step, to_dxf_with, to_step, to_stl, to_svg_with};

/// The specimen driven to `drive_mm`, where given, with everything that is wrong with it added to `errors`.
pub fn driven(specimen: &Specimen, drive_mm: Option<&Vec<f64>>, errors: &mut Vec<FieldError>) -> Specimen {
    let own = specimen.field_errors();
    let is_sound = own.is_empty();
    errors.extend(own.into_iter().map(|e| e.below("/specimen")));
    let mut driven = specimen.clone();
    if let Some(drives) = drive_mm {
        driven.drive_mm.clone_from(drives);
        if is_sound {
            // Only the drives are new: their pointers are those of the request.
            errors.extend(driven.field_errors());
        }
    }
    driven
}

/// Whether `specimen` meshes into at most `max_elements` elements; `pointer` is the field of the mesh's size.
///
/// # Errors
/// The field that decides.
pub fn check_mesh(specimen: &Specimen, mesh: MeshSize, pointer: &str, max_elements: usize) -> Result<(), FieldError> {
    let built = mesh_specimen(specimen, &mesh.options(specimen)).map_err(|e| unmeshable("/specimen", &e))?;
    check_count(built.num_elements(), pointer, max_elements)
}

/// As [`check_mesh`], all samples of `specimen` together.
///
/// # Errors
/// As [`check_mesh`].
pub fn check_meshes(specimen: &Specimen, mesh: MeshSize, pointer: &str, max_elements: usize) -> Result<(), FieldError> {
    let count = num_elements(specimen, "/specimen", &|sample| mesh.options(sample))?;
    check_count(count, pointer, max_elements)
}

/// Elements of the meshes of all samples of `specimen`, which stands at `pointer`.
///
/// # Errors
/// A sample cannot be meshed.
pub fn num_elements(
    specimen: &Specimen,
    pointer: &str,
    mesh: &dyn Fn(&Specimen) -> MeshOptions,
) -> Result<usize, FieldError> {
    let of_sample = |sample: &Specimen| mesh_specimen(sample, &mesh(sample)).map(|m| m.num_elements());
    specimen.samples().iter().map(of_sample).sum::<Result<usize, _>>().map_err(|e| unmeshable(pointer, &e))
}

/// The name of a file of one of several samples, the first of which has the plain one: `solution`, `solution-sample-2`.
pub fn name_of_sample(stem: &str, index: usize) -> String {
    if index == 0 { stem.to_string() } else { format!("{stem}-sample-{}", index + 1) }
}

/// A model for finite elements of at most as many elements as the door allows.
///
/// # Errors
/// [`JobError`]: the specimen cannot be meshed, or the mesh is too large.
pub fn model_of(specimen: &Specimen, options: &MeshOptions, context: &Context) -> Result<ForwardModel, JobError> {
    let model = ForwardModel::of_specimen(specimen, options).map_err(|e| match e {
        PrepareError::Mesh(e) => unmeshable("/specimen", &e).into(),
        PrepareError::Solve(e) => context.failed(&e),
    })?;
    check_count(model.mesh().num_elements(), "/mesh", context.surroundings.max_elements()).map_err(JobError::TooBig)?;
    Ok(model)
}

/// A specimen that no mesh fits.
pub fn unmeshable(pointer: &str, error: &dyn std::fmt::Display) -> FieldError {
    FieldError::new(pointer, "a specimen that cannot be meshed", "one that can").remedy(error.to_string())
}

/// Whether a mesh of `count` elements keeps the limit.
///
/// # Errors
/// The field that decides.
pub fn check_count(count: usize, pointer: &str, max_elements: usize) -> Result<(), FieldError> {
    if count <= max_elements {
        return Ok(());
    }
    let found = format!("a mesh of {count} elements");
    Err(FieldError::new(pointer, found, format!("at most {max_elements}")).remedy("use a coarser mesh"))
}

/// Adds the specimen's file and the drawings for the mould maker, of every sample its own, with its `tolerances` where
/// there are any.
///
/// # Errors
/// [`JobError::NoSolution`] where the solid cannot be drawn.
pub fn add_drawings(
    outcome: &mut Outcome,
    specimen: &Specimen,
    stem: &str,
    tolerances: &[Tolerances],
) -> Result<(), JobError> {
    outcome.add(format!("{stem}.json"), specimen.to_json());
    let no_drawing = |e: &dyn std::fmt::Display| JobError::NoSolution(e.to_string());
    for (index, sample) in specimen.samples().iter().enumerate() {
        let mould = name_of_sample(&format!("{stem}-mould"), index);
        let stem = name_of_sample(stem, index);
        let none = Tolerances::default();
        let tolerances = tolerances.get(index).unwrap_or(&none);
        outcome.add(format!("{stem}.svg"), to_svg_with(sample, tolerances));
        outcome.add(format!("{stem}.dxf"), to_dxf_with(sample, tolerances));
        outcome.add(format!("{stem}.stl"), to_stl(sample).map_err(|e| no_drawing(&e))?);
        outcome.add(format!("{stem}.step"), to_step(sample).map_err(|e| no_drawing(&e))?);
        outcome.add(format!("{mould}.step"), mould_to_step(sample).map_err(|e| no_drawing(&e))?);
    }
    Ok(())
}
