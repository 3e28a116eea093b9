//! Why a recording was not read or written.

use super::component_fault::ComponentFault;
use super::nifti::NiftiError;
use super::plate_fault::PlateFault;
use crate::file::MemoryError;
use crate::specimen::SpecimenError;
use crate::voxel::VoxelError;
use std::path::PathBuf;

impl RecordingError {
    /// The refusal of memory, where that is what ended the reading.
    pub fn memory(&self) -> Option<&MemoryError> {
        match self {
            RecordingError::Memory(error) | RecordingError::Image { source: NiftiError::Memory(error), .. } => {
                Some(error)
            }
            _ => None,
        }
    }
}

/// Why a recording was not read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// A file cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file is larger than allowed.
    #[error("{}: more than {limit} bytes", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Most bytes.
        limit: u64,
    },
    /// It would take more memory than reading may.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// A path does not lead to a file but to a folder, a pipe or a device.
    #[error("{}: {}", path.display(), crate::file::ReadError::NotRegular)]
    NotRegular {
        /// The path.
        path: PathBuf,
    },
    /// `recording.json` does not fit the schema.
    #[error("recording.json: {0}")]
    Json(String),
    /// The specimen in `recording.json` is not valid.
    #[error("recording.json: specimen: {0}")]
    Specimen(#[from] SpecimenError),
    /// A file name is more than a name in the recording's folder.
    #[error("'{name}' is not the plain name of a file in the recording's folder")]
    FileName {
        /// The name.
        name: String,
    },
    /// An image cannot be used.
    #[error("{}: {source}", path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: NiftiError,
    },
    /// The images of a recording do not lie on one grid.
    #[error("{}: its grid {found} is not the mask's {expected}", path.display())]
    Grid {
        /// The file.
        path: PathBuf,
        /// Its grid.
        found: String,
        /// The mask's.
        expected: String,
    },
    /// The grid cannot be used.
    #[error("mask: {0}")]
    Voxel(#[from] VoxelError),
    /// The mask marks nothing.
    #[error("the mask marks no voxel; there is nothing to compare")]
    EmptyMask,
    /// No voxel of the mask has a displacement.
    #[error("step {step}: none of the mask's {num_voxels} voxels has a finite displacement")]
    NoDisplacement {
        /// Which step, from 1.
        step: usize,
        /// Voxels of the mask.
        num_voxels: usize,
    },
    /// A number is out of range.
    #[error("{name} is {value}; it must be {requirement}")]
    Value {
        /// Which number.
        name: String,
        /// Its value.
        value: f64,
        /// What it must be.
        requirement: &'static str,
    },
    /// The plates do not move as the drive says.
    #[error(
        "step {step}: the driven plate moves by {found_mm:.4?} mm (x, y, z) against the other one, the drive is {drive_mm} mm; {fault}"
    )]
    PlateMotion {
        /// Which step, from 1.
        step: usize,
        /// Its drive, mm.
        drive_mm: f64,
        /// Motion found, mm.
        found_mm: [f64; 3],
        /// What it looks like.
        fault: PlateFault,
    },
    /// Components across the drive are mistaken for others.
    #[error(
        "step {step}: {fault}: as stored, the material's volume changes by {found_percent:.1} per cent (root mean square), otherwise by {mended_percent:.1}; y points across the gap, z along the width, and a component is positive along its axis (on import: --axes, --components)"
    )]
    Components {
        /// Which step, from 1.
        step: usize,
        /// What seems to be wrong.
        fault: ComponentFault,
        /// Root mean square of J − 1 as stored, per cent.
        found_percent: f64,
        /// The same without the fault, per cent.
        mended_percent: f64,
    },
    /// The voxel in `recording.json` is not that of the images.
    #[error(
        "recording.json: acquisition.voxel_mm is {stated_mm:?}, the images' affine has voxels of {found_mm:.4?} mm; correct the one that is wrong"
    )]
    VoxelMismatch {
        /// In `recording.json`, mm.
        stated_mm: [f64; 3],
        /// In the mask's affine, mm.
        found_mm: [f64; 3],
    },
    /// The mask lies elsewhere than the specimen.
    #[error(
        "only {num_inside} of the mask's {num_voxels} voxels lie on the specimen: they reach from {:.1?} to {:.1?} mm, the block to {half_extent_mm:.1?} mm (x, y, z) on either side of the origin; correct the images' affine, whose origin is the block's centre",
        box_mm[0],
        box_mm[1]
    )]
    Position {
        /// Voxels of the mask on the block.
        num_inside: usize,
        /// Voxels of the mask.
        num_voxels: usize,
        /// Least and greatest corner of the mask's box, mm.
        box_mm: [[f64; 3]; 2],
        /// Half of the block along x, y, z, mm.
        half_extent_mm: [f64; 3],
    },
    /// A drive is no drive of the specimen.
    #[error(
        "steps[{step}].drive_mm is {drive_mm}; it must lie between 0 (excluded) and {limit_mm:.4} mm, the farthest that is supported in the direction of the specimen's own drives"
    )]
    Drive {
        /// Which step, from 0 as in `recording.json`.
        step: usize,
        /// Its drive, mm.
        drive_mm: f64,
        /// The farthest, mm.
        limit_mm: f64,
    },
    /// A step holds displacements and raw phases.
    #[error("steps[{step}] has displacement and raw; give the one that was recorded, or make two recordings")]
    TwoKinds {
        /// Which step, from 0 as in `recording.json`.
        step: usize,
    },
    /// A load curve cannot be read.
    #[error("{}: line {line}: {message}", path.display())]
    LoadCurve {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong.
        message: String,
    },
    /// The recording holds wrapped phases instead of displacements.
    #[error("step {step} holds raw phases; unwrap them first")]
    Raw {
        /// Which step, from 1.
        step: usize,
    },
    /// The recording holds displacements where raw phases were asked for.
    #[error("step {step} holds displacements, not raw phases")]
    NotRaw {
        /// Which step, from 1.
        step: usize,
    },
}
