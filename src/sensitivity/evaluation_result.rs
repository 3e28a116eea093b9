//! The result of an evaluation (`evaluation/1`).

use super::covariance::PromisedSd;
use super::detectable_size::DetectableSize;
use super::observation::EvaluationStep;
use super::scan_settings::ScanSettings;
use super::shares::BestShares;
use serde::{Deserialize, Serialize};

/// Result of an evaluation (`evaluation/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Evaluation {
    /// Always `evaluation/1`.
    pub schema: String,
    /// Drives that are scanned, increasing.
    pub steps: Vec<EvaluationStep>,
    /// Drives at which the force alone is read.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub force_steps: Vec<ForceStep>,
    /// How many blocks are scanned.
    #[serde(default = "one_block", skip_serializing_if = "is_one_block")]
    pub blocks_scanned: u32,
    /// Shares of the time of one scan that the drives get; empty where every drive gets that of a whole scan.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub scan_share: Vec<f64>,
    /// Where the drives share the time of one scan: the best shares, and what they promise. Absent where the drives do
    /// not determine all μᵢ and αᵢ.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub best_scan_share: Option<BestShares>,
    /// Standard deviations that all drives together promise.
    pub promised_sd: Vec<PromisedSd>,
    /// Correlation of the estimates, rows and columns as `promised_sd`; null where undetermined.
    pub correlation: Vec<Vec<Option<f64>>>,
    /// Largest over smallest eigenvalue of the relative covariance of all μᵢ, αᵢ; null where undetermined.
    pub condition_number: Option<f64>,
    /// How small errors of the experiment may be and still be named by a diagnosis with 90 % probability, cause by
    /// cause; empty unless it was asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub detectable: Vec<DetectableSize>,
    /// Largest principal stretch at any drive.
    pub largest_principal_stretch: f64,
    /// Material volume of the masks of all scanned blocks, mm³; zero where a surface is seen.
    pub voxel_material_volume_mm3: f64,
    /// Where a surface is seen: material area of the subsets of all blocks that are looked at, mm².
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub subset_material_area_mm2: Option<f64>,
    /// The scan.
    pub scan: ScanSettings,
    /// What the numbers mean.
    pub notes: EvaluationNotes,
    /// Sizes of the computation.
    pub statistics: EvaluationStatistics,
    /// Version of the program.
    pub version: String,
    /// SHA-256 of specimen, material, scan, drives and settings, hexadecimal.
    pub input_hash: String,
}

fn one_block() -> u32 {
    1
}

fn is_one_block(blocks: &u32) -> bool {
    *blocks == 1
}

/// A drive at which the force alone is read.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct ForceStep {
    /// Drive, mm.
    pub drive_mm: f64,
    /// Force of all samples together, N.
    pub force_n: f64,
}

/// Meaning of the numbers, for readers of the JSON alone.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct EvaluationNotes {
    /// `integrated_sensitivity`.
    pub integrated_sensitivity: String,
    /// `promised_sd`.
    pub promised_sd: String,
}

impl Default for EvaluationNotes {
    fn default() -> Self {
        EvaluationNotes {
            integrated_sensitivity: "sum: over voxels of d2Psi/dxi dlambda at the voxel's (lambda, k), 1 for mu and kPa for alpha; \
                                     mean_per_voxel: sum / num_voxels; volume_integral: sum weighted by the voxel's material \
                                     volume (mm3), comparable across voxel sizes; kappa's is zero"
                .into(),
            promised_sd: "Cramer-Rao bound of a joint fit of all parameters to the voxel displacements and forces; at the top level from \
                          all drives together, in a step from that drive alone; value in the parameter's unit, null where the \
                          data do not determine it"
                .into(),
        }
    }
}

impl EvaluationNotes {
    /// Of the numbers of a scan: of a surface, what its voxels are.
    pub(super) fn of(scan: &ScanSettings) -> EvaluationNotes {
        let mut notes = EvaluationNotes::default();
        if let Some(surface) = scan.surface {
            notes.integrated_sensitivity += &format!(
                "; voxels are subsets of the face {}, of the model's states there; they have no volume, and \
                 surface_integral is weighted by their area (mm2)",
                surface.face.name()
            );
        }
        notes
    }
}

/// Sizes of the computation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct EvaluationStatistics {
    /// Elements of the mesh.
    pub num_elements: usize,
    /// Nodes of the mesh.
    pub num_nodes: usize,
    /// Free displacement unknowns.
    pub num_unknowns: usize,
    /// Equilibria solved for (more than steps when a drive was searched).
    pub num_equilibria: usize,
    /// Sample points of the voxels.
    pub num_sample_points: usize,
    /// Sample points dropped between wall and mesh.
    pub num_dropped_points: usize,
}
