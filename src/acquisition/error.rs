//! Why a scan was not made or not reconstructed.

use crate::fem::{PrepareError, SolveError};
use crate::homogeneous::TableError;
use crate::voxel::VoxelError;

/// Why a scan was not made or not reconstructed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AcquisitionError {
    /// The specimen cannot be meshed or solved.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    /// The forward solution failed.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// The grid does not fit.
    #[error(transparent)]
    Voxel(#[from] VoxelError),
    /// A setting is out of range.
    #[error("{name} is {value}; it must be {requirement}")]
    Value {
        /// Which setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        requirement: &'static str,
    },
    /// Two lists that belong together differ in length.
    #[error("{what} has {found} entries, {expected} are needed")]
    Length {
        /// What was passed.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length needed.
        expected: usize,
    },
    /// The force over the drive is not known.
    #[error("the force over the drive: {0}")]
    Force(#[from] TableError),
    /// Nothing of a direction could be unwrapped with certainty.
    #[error(
        "step {step}, direction {axis}: no voxel could be unwrapped with certainty; the signal is too low or the phase changes by more than π from voxel to voxel"
    )]
    NothingUnwrapped {
        /// Which step, from 1.
        step: usize,
        /// x, y or z.
        axis: char,
    },
    /// The caller stopped it.
    #[error("stopped")]
    Cancelled,
}
