//! Displacements from other files: what the readers of MATLAB files and point clouds share.

use super::mat::MatError;
use super::position::check_position;
use super::scanner::ScannerError;
use super::{Filter, RecordedStep, Recording, RecordingError};
use crate::file::MemoryError;
use crate::specimen::Specimen;
use crate::voxel::{VoxelError, VoxelGrid, unbounded_where_unmeasured};
use std::path::PathBuf;

/// The measured box may be this much smaller or larger than the drawn block, as a factor, before its unit or its axes
/// are doubted.
const LARGEST_MISFIT: f64 = 1.6;

/// Why a file was not imported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// A MATLAB file was not read.
    #[error("{}: {source}", path.display())]
    Mat {
        /// The file.
        path: PathBuf,
        /// Why.
        source: MatError,
    },
    /// A file of ours was not read or written.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The files of a scanner were not read.
    #[error(transparent)]
    Scanner(#[from] ScannerError),
    /// The grid cannot be used.
    #[error(transparent)]
    Voxel(#[from] VoxelError),
    /// It would take more memory than reading may.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// A variable is missing.
    #[error("there is no variable {what}; the file holds: {found}")]
    Missing {
        /// What was looked for.
        what: &'static str,
        /// What there is.
        found: String,
    },
    /// A variable has another layout than expected.
    #[error("{name}: {message}")]
    Layout {
        /// The variable.
        name: String,
        /// What is wrong.
        message: String,
    },
    /// Drives and steps do not match.
    #[error("{found} drives were given for {num_steps} steps; give one drive per step (--drive)")]
    Drives {
        /// Drives given.
        found: usize,
        /// Steps in the file.
        num_steps: usize,
    },
    /// The mask has several regions, or not the one asked for.
    #[error(
        "the mask has {num_regions} separate regions; choose one, counted along the thickness (--region 1 to {num_regions})"
    )]
    Regions {
        /// Large regions.
        num_regions: usize,
        /// What was asked for.
        asked: Option<usize>,
    },
    /// The mask marks nothing.
    #[error("the mask marks no voxel")]
    EmptyMask,
    /// The measured box does not fit the drawn block.
    #[error(
        "the measured box of {found_mm:.2?} mm does not fit the block of {expected_mm:.2?} mm: check the unit (--unit), the axes (--axes) and the specimen"
    )]
    Extent {
        /// Box of the mask, mm.
        found_mm: [f64; 3],
        /// The drawn block, mm.
        expected_mm: [f64; 3],
    },
    /// A table cannot be read.
    #[error("{}: line {line}: {message}", path.display())]
    Table {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong.
        message: String,
    },
    /// A point that should lie on a face does not.
    #[error(
        "{axis} = {found_mm} mm is {:.3} mm off the face {face}, which lies at {expected_mm} mm, and at most {allowed_mm:.3} mm \
         are allowed: check face, unit (--unit) and origin, which is the centre of the block",
        (found_mm - expected_mm).abs()
    )]
    OffFace {
        /// The axis of the face's normal.
        axis: &'static str,
        /// Where the point lies along it, mm.
        found_mm: f64,
        /// The face.
        face: &'static str,
        /// Where the face lies, mm.
        expected_mm: f64,
        /// How far off a point may be: half the smaller edge of a subset.
        allowed_mm: f64,
    },
    /// Points do not lie on a regular grid.
    #[error(
        "the points do not lie on one regular grid along the axes ({message}); give a voxel to average them in (--voxel x,y,z)"
    )]
    NoGrid {
        /// What does not fit.
        message: String,
    },
}

/// Along which axis of the specimen's frame an array's index runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IndexAxis {
    /// 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// The index rises against the axis.
    pub is_reversed: bool,
}

impl IndexAxis {
    /// Axes as they are given, such as `-y,z,x`.
    pub(super) fn words(axes: [IndexAxis; 3]) -> String {
        axes.map(|a| format!("{}{}", if a.is_reversed { "-" } else { "" }, ["x", "y", "z"][a.axis])).join(",")
    }
}

/// Where the voxels of MATLAB files and of scanners lie in the specimen's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum GridOrigin {
    /// The mask's box is centred on the specimen: the scanner's frame is not the specimen's.
    #[default]
    MaskCenter,
    /// Where `X`, or the scanner, says: its frame is the specimen's.
    Positions,
}

/// How to read foreign files.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportOptions {
    /// Name of the recording.
    pub id: String,
    /// The files' unit of length, mm.
    pub unit_mm: f64,
    /// Axis of each array index (MATLAB files). MR-u laboratories: thickness, width, length = y, z, x.
    pub axes: [IndexAxis; 3],
    /// Axis of each of the three displacement arrays (MATLAB files); without it, array i is along the axis of index i.
    pub components: Option<[IndexAxis; 3]>,
    /// Where a MATLAB file's voxels lie.
    pub origin: GridOrigin,
    /// Voxel's edges along the array's indices, mm, instead of the file's.
    pub voxel_mm_by_index: Option<[f64; 3]>,
    /// Which region of the mask, from 1, counted along the thickness.
    pub region: Option<usize>,
    /// Drives, mm; empty takes the file's or the specimen's.
    pub drive_mm: Vec<f64>,
    /// The filter that the displacements went through.
    pub filter: Filter,
    /// Noise of a displacement, mm, where known.
    pub noise_sd_mm: Option<[f64; 3]>,
}

impl Default for ImportOptions {
    fn default() -> Self {
        let axis = |axis| IndexAxis { axis, is_reversed: false };
        ImportOptions {
            id: "imported".into(),
            unit_mm: 1.0,
            axes: [axis(1), axis(2), axis(0)],
            components: None,
            origin: GridOrigin::default(),
            voxel_mm_by_index: None,
            region: None,
            drive_mm: vec![],
            filter: Filter::None,
            noise_sd_mm: None,
        }
    }
}

impl ImportOptions {
    /// Reads axes such as `y,z,x` or `-y,z,-x`: one of each.
    pub fn parse_axes(text: &str) -> Option<[IndexAxis; 3]> {
        let one = |s: &str| {
            let s = s.trim();
            let (is_reversed, name) = s.strip_prefix('-').map_or((false, s), |rest| (true, rest));
            let axis = ["x", "y", "z"].iter().position(|a| *a == name)?;
            Some(IndexAxis { axis, is_reversed })
        };
        let list: Vec<IndexAxis> = text.split(',').map(one).collect::<Option<_>>()?;
        let [a, b, c] = list[..] else { return None };
        (a.axis != b.axis && b.axis != c.axis && a.axis != c.axis).then_some([a, b, c])
    }
}

/// Whether the measured box is that of the drawn block, but for what a unit or an axis could not explain.
///
/// # Errors
/// [`ImportError::Extent`].
pub(super) fn check_extent(specimen: &Specimen, grid: &VoxelGrid) -> Result<(), ImportError> {
    let expected_mm = specimen.block.extents_mm();
    let found_mm = [0, 1, 2].map(|a| grid.shape[a] as f64 * grid.voxel_mm[a]);
    let fits = |a: usize| {
        let ratio = found_mm[a] / expected_mm[a];
        (1.0 / LARGEST_MISFIT..=LARGEST_MISFIT).contains(&ratio)
    };
    if (0..3).all(|a| grid.normal_axis() == Some(a) || fits(a)) {
        Ok(())
    } else {
        Err(ImportError::Extent { found_mm, expected_mm })
    }
}

/// Last checks and the recording.
pub(super) fn finish(
    specimen: &Specimen,
    grid: VoxelGrid,
    mask: Vec<bool>,
    steps: Vec<RecordedStep>,
    options: &ImportOptions,
    notes: serde_json::Value,
) -> Result<Recording, ImportError> {
    check_extent(specimen, &grid)?;
    let num_voxels = mask.iter().filter(|m| **m).count();
    if num_voxels == 0 {
        return Err(ImportError::EmptyMask);
    }
    check_position(specimen, &grid, &mask)?;
    for (n, step) in steps.iter().enumerate() {
        if !step.displacement.iter().any(|u| grid.is_complete(u)) {
            return Err(RecordingError::NoDisplacement { step: n + 1, num_voxels }.into());
        }
    }
    let noise_sd_mm = options.noise_sd_mm.map(|sd| unbounded_where_unmeasured(grid.measured(), sd));
    let recording = Recording {
        id: options.id.clone(),
        specimen: specimen.clone(),
        grid,
        mask,
        steps,
        noise_sd_mm,
        filter: options.filter,
        load: None,
        notes: Some(notes),
    };
    recording.check_motion()?;
    Ok(recording)
}
