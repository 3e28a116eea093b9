//! What can be wrong with a study.

use crate::field::{FieldError, FieldPath};
use crate::material::MaterialError;
use crate::specimen::{LimitsError, SpecimenError};
use std::path::PathBuf;

/// Why a study cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// The text is not a study.
    #[error("not a study/1: {message}")]
    Json {
        /// Line, column and field.
        message: String,
    },
    /// A file that the study names cannot be used.
    #[error("{}: {message}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        message: String,
    },
    /// The name is too long.
    #[error("name has {length} characters; use at most {limit}")]
    NameTooLong {
        /// Number of characters.
        length: usize,
        /// Most characters.
        limit: usize,
    },
    /// The base specimen is not valid.
    #[error("base: {0}")]
    Base(SpecimenError),
    /// The limits are not valid.
    #[error("limits: {0}")]
    Limits(LimitsError),
    /// The scan is not usable.
    #[error("scan: {0}")]
    Scan(FieldError),
    /// The scan cannot vary as it is to.
    #[error("vary.scan: {0}")]
    VaryScan(FieldError),
    /// The protocol is not usable.
    #[error("protocol: {0}")]
    Protocol(FieldError),
    /// No material is given.
    #[error("materials is empty; give at least one")]
    NoMaterials,
    /// A material is not valid.
    #[error("material '{name}': {error}")]
    Material {
        /// Its place in the list.
        index: usize,
        /// Its name.
        name: String,
        /// What is wrong with it.
        error: MaterialError,
    },
    /// Two materials have one name, by which results tell them apart.
    #[error("two materials are called '{name}'; give each its own name")]
    SameName {
        /// The later one's place in the list.
        index: usize,
        /// The name.
        name: String,
    },
    /// A value is out of its range.
    #[error("{field} is {value}; it must be {allowed}")]
    OutOfRange {
        /// Field of the study.
        field: FieldPath,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: String,
    },
    /// The least number of holes is above the largest.
    #[error("vary.hole_count: min exceeds max")]
    EmptyCountRange {
        /// Least number of holes.
        min: usize,
        /// Largest number of holes.
        max: usize,
    },
    /// No outlines of holes are named, or one is named twice.
    #[error("vary.hole_shapes.kinds has {count} entries; give ellipse, slot or both, each once")]
    HoleKinds {
        /// How many entries.
        count: usize,
    },
    /// Sides for notches are named twice.
    #[error("vary.notches has {count} entries; give ends, sides or both, each once")]
    NotchedSides {
        /// How many entries.
        count: usize,
    },
    /// No structure of the study can have notches.
    #[error(
        "vary.notches asks for notches, and none is possible: they need a block with a free side of that kind and limits.symmetry \
         with a mirror that takes it to the other side; set the symmetry, or leave out vary.notches"
    )]
    NoPlaceForNotches,
    /// Holes are asked for, but no direction of theirs is allowed.
    #[error(
        "vary.axes is empty and vary.hole_count.max {max_holes}; give directions of the holes, or leave out vary.axes to keep the base's"
    )]
    NoAxes {
        /// Largest number of holes.
        max_holes: usize,
    },
    /// A gauge is to vary, and the base has none that is free.
    #[error(
        "vary.{field} varies, and the base's outline is {outline}; give the base an outline \"dumbbell\", or leave it out"
    )]
    NoGauge {
        /// Which dimension.
        field: &'static str,
        /// The base's outline.
        outline: &'static str,
    },
    /// A dumb-bell cannot be bonded between plates.
    #[error("vary.tests has double_lap_shear and the base is a dumb-bell; only a block may be sheared")]
    DumbbellInShear,
    /// Every drive to try is above the actuator's travel.
    #[error("vary.drive_mm.min is {min_mm} mm and limits.max_drive_mm {limit_mm} mm; no drive keeps both")]
    NoDrive {
        /// Smallest drive to try, mm.
        min_mm: f64,
        /// Largest travel, mm.
        limit_mm: f64,
    },
    /// The base is pushed together or sheared the other way, and designs are driven forwards.
    #[error("the base is driven to {drive_mm} mm, and designs to positive drives; give the base positive drives")]
    BaseDrivenBackwards {
        /// The base's largest drive, mm.
        drive_mm: f64,
    },
    /// There is nothing to tell apart.
    #[error("objective.kind: tell_apart needs at least two materials to tell apart")]
    NothingToTellApart {
        /// Materials given.
        count: usize,
    },
    /// More further samples are to vary than the base has.
    #[error("vary.other_samples has {count} entries and the base {limit} other samples; give at most so many")]
    NoSuchSamples {
        /// Entries.
        count: usize,
        /// Other samples of the base.
        limit: usize,
    },
    /// A sample is to be like the first and to vary by itself.
    #[error(
        "vary.other_samples[{index}]: with is_like_first length and width are the first sample's; leave out length_mm and \
         width_mm, or is_like_first"
    )]
    SampleLikeFirst {
        /// Which.
        index: usize,
    },
    /// Materials are to be told apart by several blocks, which is not supported.
    #[error(
        "objective.kind: tell_apart is supported for one scanned block without other samples; leave out base.other_samples \
         and protocol.blocks_scanned, or choose another objective"
    )]
    SeveralBlocksToTellApart,
    /// What would be found is to be told of several blocks, of which a diagnosis sees one.
    #[error(
        "objective.kind: detect is supported for one scanned block without other samples; leave out base.other_samples and \
         protocol.blocks_scanned, or choose another objective"
    )]
    SeveralBlocksToDiagnose,
    /// A wedge that does not go with the rest of the study.
    #[error("base.block.wedge_mm is {value_mm} mm; {reason}, or set it to 0")]
    UnsuitedWedge {
        /// The wedge, mm.
        value_mm: f64,
        /// What it does not go with, and what to change.
        reason: &'static str,
    },
    /// Gradients and variants of the priors know nothing of what a diagnosis would find.
    #[error(
        "objective.kind: detect has no gradients and is not judged at the priors' variants; set budget.refine and every \
         relative_sd to 0, or choose another objective"
    )]
    DetectNeedsVoxels,
    /// No recording is tested for a cause that is to count.
    #[error("objective.causes: '{name}' is not tested for every recording; there are {}", known.join(", "))]
    UnknownCause {
        /// The entry.
        name: String,
        /// What there is: cause and parameter.
        known: Vec<String>,
    },
    /// Causes are named that nothing counts.
    #[error("objective.causes: only `kind: detect` counts them; leave them out or choose that kind")]
    CausesUnused,
    /// Gradients, variants of the priors and distances of materials are of one scan alone.
    #[error(
        "vary.earlier_scan_mm: gradients, the priors' variants and tell_apart are of one scan alone; set budget.refine and \
         every relative_sd to 0 and choose another objective, or leave it out"
    )]
    EarlierScanNeedsVoxels,
    /// Grips are no plates that could be pressed together.
    #[error(
        "vary.precompression_mm: vary.tests has no double_lap_shear, whose plates could be pressed together; leave it out"
    )]
    PrecompressionWithoutPlates,
    /// Grips have no force across plates.
    #[error(
        "limits.max_normal_force_n: vary.tests has no double_lap_shear, whose plates are pulled together; leave it out"
    )]
    NormalForceWithoutPlates,
    /// Unlike samples cannot be pulled side by side.
    #[error("vary.tests has uniaxial and the base other_samples; only a double-lap shear test may hold unlike samples")]
    OtherSamplesInTension,
    /// Weights of parameters are given that nothing uses.
    #[error("objective.parameter_weights: only `combine: weighted` uses them")]
    WeightsUnused,
    /// The kind of objective has no gain per parameter to be weighted.
    #[error(
        "objective.combine: weighted needs a kind with a gain per parameter (integrated_sensitivity or \
         sensitivity_and_promised_sd)"
    )]
    NothingToWeigh,
    /// No material has a parameter of this name.
    #[error("objective.parameter_weights: no material has '{name}'; the names are mu_1, alpha_1, …")]
    UnknownParameter {
        /// The name.
        name: String,
    },
    /// All parameters of a material weigh nothing.
    #[error("objective.parameter_weights: all weights of a material are zero")]
    NoWeight,
    /// A symmetry that the search does not support.
    #[error("limits.symmetry: a design search supports none, mirror_x, mirror_z, mirror_x_and_z and point")]
    UnsupportedSymmetry {
        /// The symmetry, as JSON writes it.
        found: &'static str,
    },
}

impl StudyError {
    /// The same as an error of a field, with a pointer into the study.
    pub fn field_error(&self) -> FieldError {
        use StudyError as E;
        let weights = "/objective/parameter_weights";
        match self {
            E::Json { message } => FieldError::new("", "", "JSON of a study").remedy(message.clone()),
            E::File { path, message } => {
                FieldError::new("", path.display(), "a file that can be used").remedy(message.clone())
            }
            E::NameTooLong { length, limit } => {
                FieldError::new("/name", format!("a text of {length} characters"), format!("at most {limit} characters"))
            }
            E::Base(error) => error.field_error().below("/base"),
            E::Limits(error) => error.field_error().below("/limits"),
            E::Scan(error) => error.clone().below("/scan"),
            E::VaryScan(error) => error.clone().below("/vary/scan"),
            E::Protocol(error) => error.clone().below("/protocol"),
            E::NoMaterials => FieldError::new("/materials", "[]", "a list of at least one material"),
            E::Material { index, error, .. } => error.field_error().below(&format!("/materials/{index}/material")),
            E::SameName { index, name } => {
                let pointer = FieldPath::of("materials").index(*index).name("name").pointer();
                FieldError::new(pointer, format!("{name:?}"), "a name of its own")
                    .remedy("results tell materials apart by their names")
            }
            E::OutOfRange { field, value, allowed } => FieldError::new(field.pointer(), value, allowed.clone()),
            E::EmptyCountRange { min, max } => {
                FieldError::new("/vary/hole_count/min", min, format!("at most the max, {max}"))
            }
            E::HoleKinds { count } => {
                FieldError::new("/vary/hole_shapes/kinds", format!("a list of {count}"), "ellipse, slot or both, each once")
                    .remedy("leave out hole_shapes to try circles alone")
            }
            E::NotchedSides { count } => {
                FieldError::new("/vary/notches", format!("a list of {count}"), "ends, sides or both, each once")
            }
            E::NoPlaceForNotches => FieldError::new(
                "/vary/notches",
                "notches",
                "free sides of a block that a mirror of limits.symmetry takes to each other",
            )
            .remedy("set limits.symmetry, or leave out vary.notches"),
            E::NoAxes { max_holes } => {
                FieldError::new("/vary/axes", "[]", format!("a list of directions, as up to {max_holes} holes are asked for"))
                    .remedy("or leave it out to keep the base's direction")
            }
            E::NoGauge { field, outline } => {
                let pointer = FieldPath::of("vary").name(field).pointer();
                FieldError::new(pointer, "given", format!("left out where the base's outline is {outline}"))
                    .remedy("only an outline \"dumbbell\" has a gauge that may vary")
            }
            E::DumbbellInShear => {
                FieldError::new("/vary/tests", "a list with double_lap_shear", "uniaxial where the base is a dumb-bell")
            }
            E::NoDrive { min_mm, limit_mm } => {
                FieldError::new("/vary/drive_mm/min", min_mm, format!("at most limits.max_drive_mm, {limit_mm} mm"))
            }
            E::BaseDrivenBackwards { drive_mm } => {
                FieldError::new("/base/drive_mm", drive_mm, "positive drives in a search for a design")
                    .remedy("vary.drive_mm drives every design forwards")
            }
            E::NothingToTellApart { count } => {
                FieldError::new("/materials", format!("a list of {count}"), "a list of at least two")
                    .remedy("the objective tell_apart compares materials with each other")
            }
            E::NoSuchSamples { count, limit } => {
                let allowed = format!("at most {limit}, as the base has other samples");
                FieldError::new("/vary/other_samples", format!("a list of {count}"), allowed)
            }
            E::SampleLikeFirst { index } => {
                let pointer = FieldPath::of("vary").name("other_samples").index(*index).name("is_like_first").pointer();
                FieldError::new(pointer, true, "false where length_mm or width_mm vary")
                    .remedy("a sample like the first has its length and width")
            }
            E::SeveralBlocksToTellApart => {
                FieldError::new("/objective/kind", "\"tell_apart\"", "another kind for several blocks")
                    .remedy("or leave out base.other_samples and protocol.blocks_scanned")
            }
            E::SeveralBlocksToDiagnose => {
                FieldError::new("/objective/kind", "\"detect\"", "another kind for several blocks")
                    .remedy("or leave out base.other_samples and protocol.blocks_scanned")
            }
            E::UnsuitedWedge { value_mm, reason } => {
                FieldError::new("/base/block/wedge_mm", value_mm, "0 in such a study").remedy(format!("{reason}, or set it to 0"))
            }
            E::DetectNeedsVoxels => {
                let allowed = "another kind where budget.refine or a relative_sd is above 0";
                FieldError::new("/objective/kind", "\"detect\"", allowed).remedy("or set both to 0")
            }
            E::UnknownCause { name, known } => {
                FieldError::new("/objective/causes", format!("{name:?}"), "causes for which every recording is tested")
                    .remedy(format!("there are {}", known.join(", ")))
            }
            E::CausesUnused => FieldError::new("/objective/causes", "given", "left out")
                .remedy("only `kind: detect` counts causes"),
            E::EarlierScanNeedsVoxels => {
                let allowed = "left out where budget.refine or a relative_sd is above 0, and with tell_apart";
                FieldError::new("/vary/earlier_scan_mm", "given", allowed).remedy("these are of one scan alone")
            }
            E::PrecompressionWithoutPlates => {
                FieldError::new("/vary/precompression_mm", "given", "left out without a double-lap shear test")
                    .remedy("a bar has grips and no plates that could be pressed together")
            }
            E::NormalForceWithoutPlates => {
                FieldError::new("/limits/max_normal_force_n", "given", "left out without a double-lap shear test")
                    .remedy("a bar has grips and no plates across which there is a force")
            }
            E::OtherSamplesInTension => {
                FieldError::new("/vary/tests", "a list with uniaxial", "double_lap_shear where the base has other samples")
            }
            E::WeightsUnused => FieldError::new(weights, "given", "left out")
                .remedy("only `combine: weighted` uses weights of parameters"),
            E::NothingToWeigh => {
                FieldError::new("/objective/combine", "\"weighted\"", "maximin or geometric_mean for this kind").remedy(
                    "weighted needs a kind with a gain per parameter, integrated_sensitivity or sensitivity_and_promised_sd",
                )
            }
            E::UnknownParameter { name } => {
                let pointer = FieldPath::of("objective").name("parameter_weights").name(name).pointer();
                FieldError::new(pointer, "given", "left out").remedy("no material has such a parameter; the names are mu_1, alpha_1, …")
            }
            E::NoWeight => {
                FieldError::new(weights, "a list of zeros", "above zero for at least one parameter of every material")
            }
            E::UnsupportedSymmetry { found } => FieldError::new(
                "/limits/symmetry",
                format!("{found:?}"),
                "one of none, mirror_x, mirror_z, mirror_x_and_z and point in a design search",
            ),
        }
    }
}
