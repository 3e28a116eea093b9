//! The result of an import (`import/1`).

use crate::acquisition::StepReport;
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
    pub noise_sd_mm: Option<[f64; 3]>,
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
