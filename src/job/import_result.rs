//! The result of an import (`import/1`).

use crate::acquisition::StepReport;
use crate::voxel::Surface;
use serde::Serialize;
use utoipa::ToSchema;

/// The result of an import (`import/1`).
#[derive(Serialize, ToSchema)]
pub(super) struct ImportResult {
    pub schema: &'static str,
    pub version: &'static str,
    pub input_hash: String,
    pub id: String,
    pub is_raw: bool,
    pub num_voxels: usize,
    /// Null of a component that cameras do not measure.
    pub noise_sd_mm: Option<[Option<f64>; 3]>,
    /// The face that cameras saw; absent where the volume was scanned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surface: Option<Surface>,
    /// Columns of tables of points and variables of MATLAB files that were not used; absent where all were.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub left_aside: Vec<String>,
    pub steps: Vec<ImportStep>,
}

/// One drive of an import.
#[derive(Serialize, ToSchema)]
pub(super) struct ImportStep {
    pub drive_mm: f64,
    pub force_n: Option<f64>,
    pub num_complete: usize,
    pub reconstruction: Option<StepReport>,
}
