//! Recordings: a folder with `recording.json`, images and a load curve (`mru-recording/1`).

mod component_fault;
mod error;
mod folder;
mod images;
mod import;
mod lab;
mod limits;
mod load_curve;
pub mod mat;
mod nifti;
mod placement;
mod plate_fault;
mod plates;
mod points;
mod position;
mod raw;
mod read;
mod scanner;
mod volume;
mod write;

pub use component_fault::ComponentFault;
pub use error::RecordingError;
pub use images::{NamedImage, VectorFrame, axes_of_affine, recording_from_images};
pub use import::{GridOrigin, ImportError, ImportOptions, IndexAxis};
pub use lab::{recording_from_mat, unused_variables};
pub use limits::ReadLimits;
pub use load_curve::LoadCurve;
pub use nifti::{Image, NiftiError, Samples};
pub use plate_fault::{MistakenUnit, PlateFault};
pub use points::{DisplacementPoint, PointTable, read_points, recording_from_points};
pub use raw::{RawRecording, RawStep};
pub use read::ReadRecording;
pub use scanner::{
    DicomFiles, ParavisionStudy, PhaseSource, ScannerError, SeriesLine, SeriesMap, SeriesStep, StackFault,
    VolumeReader, VolumeSource, raw_recording_from_series,
};
pub use write::{write_scalars, write_vectors};

use crate::specimen::Specimen;
use crate::voxel::VoxelGrid;

/// What a scan and a load cell recorded of one specimen.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Its name.
    pub id: String,
    /// The specimen as drawn; the made sample need not obey.
    pub specimen: Specimen,
    /// The images' grid.
    pub grid: VoxelGrid,
    /// Which voxels hold material, in the grid's order (x fastest).
    pub mask: Vec<bool>,
    /// One step per drive.
    pub steps: Vec<RecordedStep>,
    /// Noise of a displacement as given, per component, mm, infinite of a component that cameras do not measure; `None`
    /// where unknown.
    pub noise_sd_mm: Option<[f64; 3]>,
    /// The filter that the displacements went through.
    pub filter: Filter,
    /// The whole loading history.
    pub load: Option<LoadCurve>,
    /// Free remarks of whoever recorded.
    pub notes: Option<serde_json::Value>,
}

/// One drive of a recording.
#[derive(Clone, Debug)]
pub struct RecordedStep {
    /// What the actuator was told, mm.
    pub drive_mm: f64,
    /// Mean force over the window, all samples together, N.
    pub force_n: Option<f64>,
    /// Standard deviation of the load cell's slow drift, N.
    pub force_sd_n: Option<f64>,
    /// When the scan was made, s: start and end.
    pub window_s: Option<[f64; 2]>,
    /// u at each voxel, mm, in the grid's order; NaN where missing, and in components that are not measured.
    pub displacement: Vec<[f64; 3]>,
}

/// A filter that displacements went through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, utoipa::ToSchema)]
#[schema(as = DisplacementFilter)]
#[serde(rename_all = "snake_case")]
pub enum Filter {
    /// None.
    #[default]
    None,
    /// Means over 2×2×2 voxels.
    Hamming2,
}

/// Standard deviations as a file states them: nothing where there is no bound.
fn stated_noise(sd_mm: [f64; 3]) -> [Option<f64>; 3] {
    sd_mm.map(|sd| Some(sd).filter(|sd| sd.is_finite()))
}

impl Recording {
    /// Whether its displacements can be those of the specimen that its drives move: at the plates and in the volume.
    ///
    /// # Errors
    /// [`RecordingError::PlateMotion`] where a unit, a sign or the order of components is wrong;
    /// [`RecordingError::Components`] where y and z are exchanged or have the wrong sign.
    pub fn check_motion(&self) -> Result<(), RecordingError> {
        self.check_plate_motion()?;
        self.check_volume()
    }

    /// The noise as a file states it: nothing of a component that is not measured.
    pub fn stated_noise_sd_mm(&self) -> Option<[Option<f64>; 3]> {
        self.noise_sd_mm.map(stated_noise)
    }

    /// Whether every component that is measured has a value there.
    pub fn is_complete(&self, displacement: &[f64; 3]) -> bool {
        self.grid.is_complete(displacement)
    }

    /// Number of voxels in the mask.
    pub fn num_voxels(&self) -> usize {
        self.mask.iter().filter(|m| **m).count()
    }
}
