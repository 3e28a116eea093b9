//! What can be wrong with a sweep study.

use crate::design::StudyError;
use crate::field::{FieldError, FieldPath};
use crate::material::MaterialError;
use crate::specimen::SpecimenError;

/// What a variable may set, for messages.
const KNOWN_TARGETS: &str = "drive_mm, precompression_mm, block.length_mm, block.thickness_mm, block.width_mm, block.wedge_mm, outline.dumbbell.gauge_width_mm, \
    outline.dumbbell.gauge_length_mm, outline.dumbbell.fillet_radius_mm, holes[i].x_mm, \
     holes[i].other_mm, holes[i].diameter_mm, holes[i].length_mm, holes[i].angle_deg, material.bulk_kpa, material.mu_1_kpa, material.alpha_1, scan.voxel_mm[c], \
     scan.noise_sd_mm[c], scan.force_sd_n, each with or without a leading '-'";

/// Why a sweep study cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SweepStudyError {
    /// The text is not a sweep study.
    #[error("not a sweep-study/1: {message}")]
    Json {
        /// Line and column of what is no JSON, or the pointer of what does not fit.
        message: String,
    },
    /// A file that the study names cannot be used.
    #[error(transparent)]
    File(#[from] StudyError),
    /// The base specimen is not valid.
    #[error("base: {0}")]
    Base(SpecimenError),
    /// The scan is not usable.
    #[error("scan: {0}")]
    Scan(FieldError),
    /// No material is given.
    #[error("materials is empty; give at least one")]
    NoMaterials,
    /// A material is not valid.
    #[error("material '{name}': {error}")]
    Material {
        /// Its name.
        name: String,
        /// What is wrong with it.
        error: MaterialError,
    },
    /// Two materials have one name, by which the table tells them apart.
    #[error("two materials are called '{name}'")]
    SameName {
        /// The name.
        name: String,
    },
    /// A number is out of its range.
    #[error("{field} is {value}; it must be {allowed}")]
    OutOfRange {
        /// Field of the study.
        field: FieldPath,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: String,
    },
    /// The study has no tasks, or too many.
    #[error("number of tasks is {count}; it must be from 1 to {limit} (designs × materials)")]
    NumTasks {
        /// Designs × materials.
        count: usize,
        /// Most.
        limit: usize,
    },
    /// A variable sets something that does not exist.
    #[error("variable '{variable}' sets '{target}', which does not exist; known: {KNOWN_TARGETS}")]
    UnknownTarget {
        /// Name of the variable.
        variable: String,
        /// What it sets.
        target: String,
    },
    /// A variable sets a hole or a term that the study's specimen or material does not have.
    #[error(
        "variable '{variable}' sets '{target}', but the base specimen has {num_holes} holes and material '{material}' \
         {num_terms} terms"
    )]
    NoSuchPlace {
        /// Name of the variable.
        variable: String,
        /// What it sets.
        target: String,
        /// Holes of the base specimen.
        num_holes: usize,
        /// Name of the material.
        material: String,
        /// Terms of the material.
        num_terms: usize,
    },
    /// Two variables set the same number, so that one has no effect.
    #[error("variable '{variable}' sets '{target}', which '{other}' sets already; leave one of the two out")]
    SameTarget {
        /// Name of the later variable.
        variable: String,
        /// What it sets.
        target: String,
        /// Name of the variable that sets it before.
        other: String,
    },
    /// A variable's name does not say its unit.
    #[error("variable '{variable}' sets '{target}'; its name must end in '{suffix}', so that its column says the unit")]
    MissingUnit {
        /// Name of the variable.
        variable: String,
        /// What it sets.
        target: String,
        /// The unit.
        suffix: &'static str,
    },
    /// A variable's name cannot be a column of its own, or it sets nothing.
    #[error("variable '{variable}': {problem}")]
    BadName {
        /// Name of the variable.
        variable: String,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// A variable has not what its sampling needs.
    #[error("variable '{variable}': {sampling} sampling needs {needed}")]
    MissingValues {
        /// Name of the variable.
        variable: String,
        /// The sampling.
        sampling: &'static str,
        /// What is missing.
        needed: &'static str,
    },
    /// The range of a variable is empty.
    #[error("range of '{variable}': min {min} exceeds max {max}")]
    EmptyRange {
        /// Name of the variable.
        variable: String,
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
    },
    /// A row of a list does not fit.
    #[error("sampling.rows[{row}] has {found} numbers; there are {expected} variables")]
    RowLength {
        /// Index of the row.
        row: usize,
        /// Its length.
        found: usize,
        /// The number of variables.
        expected: usize,
    },
}

impl SweepStudyError {
    /// The same as an error of the field at `path`.
    pub(super) fn field_error(&self, path: &FieldPath) -> FieldError {
        use SweepStudyError as E;
        let pointer = path.pointer();
        let quoted = |text: &str| format!("{text:?}");
        match self {
            E::Json { message } => FieldError::new(pointer, "", "JSON of a sweep study").remedy(message.clone()),
            E::File(error) => error.field_error().below(&pointer),
            E::Base(error) => error.field_error().below(&pointer),
            E::Scan(error) => error.clone().below(&pointer),
            E::NoMaterials => FieldError::new(pointer, "[]", "a list of at least one material"),
            E::Material { error, .. } => error.field_error().below(&pointer),
            E::SameName { name } => FieldError::new(pointer, quoted(name), "a name of its own")
                .remedy("the table tells materials apart by their names"),
            E::OutOfRange { value, allowed, .. } => FieldError::new(pointer, value, allowed.clone()),
            E::NumTasks { count, limit } => FieldError::new(
                pointer,
                format!("a sampling with {count} tasks"),
                format!("one with 1 to {limit} tasks"),
            )
            .remedy("tasks are designs × materials"),
            E::UnknownTarget { target, .. } => FieldError::new(pointer, quoted(target), "the name of a number to set")
                .remedy(format!("known: {KNOWN_TARGETS}")),
            E::NoSuchPlace { target, num_holes, material, num_terms, .. } => {
                FieldError::new(pointer, quoted(target), "something that base and materials have").remedy(format!(
                    "the base specimen has {num_holes} holes and material '{material}' {num_terms} terms"
                ))
            }
            E::SameTarget { target, other, .. } => {
                FieldError::new(pointer, quoted(target), format!("something else than what '{other}' sets"))
                    .remedy("leave one of the two out")
            }
            E::MissingUnit { variable, suffix, .. } => {
                FieldError::new(pointer, quoted(variable), format!("a name that ends in '{suffix}'"))
                    .remedy("the name of a column says its unit")
            }
            E::BadName { variable, problem } => {
                FieldError::new(pointer, quoted(variable), "different").remedy((*problem).to_string())
            }
            E::MissingValues { variable, sampling, needed } => {
                let value = format!("the variable {variable:?}");
                FieldError::new(pointer, value, format!("one with {needed}"))
                    .remedy(format!("the sampling is {sampling}"))
            }
            E::EmptyRange { min, max, .. } => FieldError::new(pointer, min, format!("at most the max, {max}")),
            E::RowLength { found, expected, .. } => {
                let value = format!("a row of {found} numbers");
                FieldError::new(pointer, value, format!("a row of {expected}, one for each variable"))
            }
        }
    }
}
