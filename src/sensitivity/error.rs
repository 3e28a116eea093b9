//! What can go wrong in an evaluation.

use super::information::InformationError;
use super::protocol::ProtocolMismatch;
use crate::fem::SolveError;
use crate::mesh::MeshError;
use crate::voxel::VoxelError;

/// Why a specimen was not evaluated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluationError {
    /// The specimen was not meshed.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// An equilibrium was not found.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// The scan's grid does not suit the specimen.
    #[error(transparent)]
    Voxel(#[from] VoxelError),
    /// The noise or a sensitivity is unusable.
    #[error(transparent)]
    Information(#[from] InformationError),
    /// The protocol does not suit the specimen.
    #[error(transparent)]
    Protocol(#[from] ProtocolMismatch),
    /// No drive was given.
    #[error("no drive to evaluate; give at least one, in mm")]
    NoDrive,
    /// Drives must lead away from rest in one direction.
    #[error(
        "drive {drive_mm} mm after {previous_mm} mm; drives must be finite and lead away from rest in one direction"
    )]
    InvalidDrive {
        /// The drive, mm.
        drive_mm: f64,
        /// The one before, mm (0 for the first).
        previous_mm: f64,
    },
    /// A drive goes the other way than those of the specimen, whose mesh is made for them.
    #[error(
        "drive {drive_mm} mm goes the other way than the specimen's own, {specimen_mm} mm; give the specimen drives in that direction"
    )]
    OtherWay {
        /// The drive, mm.
        drive_mm: f64,
        /// The specimen's largest, mm.
        specimen_mm: f64,
    },
    /// The median stretch asked for is not above 1 or not a number.
    #[error("median stretch {value} asked for; it must lie between 1 and {limit}")]
    InvalidMedianStretch {
        /// Value asked for.
        value: f64,
        /// Largest value.
        limit: f64,
    },
    /// The search for the drive did not end.
    #[error(
        "median stretch {target} not reached in {num_solves} solves: {found} at a drive of {drive_mm} mm; ask for a smaller one"
    )]
    MedianStretchNotReached {
        /// Asked for.
        target: f64,
        /// Found last.
        found: f64,
        /// At this drive, mm.
        drive_mm: f64,
        /// Equilibria solved.
        num_solves: usize,
    },
}
