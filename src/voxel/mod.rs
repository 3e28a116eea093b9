//! The scan's grid: which voxels hold material, and what each of them measures.

mod filter;
mod grid;
mod histogram;
mod mask;
mod operator;
mod sampling;
mod section;

pub use filter::HammingFilter;
pub use grid::VoxelGrid;
pub use histogram::{Histogram2d, HistogramAxis};
pub use mask::VoxelMask;
pub use operator::VoxelOperator;
pub use sampling::{MaterialPoints, Sampling};

/// Why a grid, mask or operator was not made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VoxelError {
    /// A voxel edge is not a positive number.
    #[error("voxel edge along {axis} is {value} mm; it must be positive and finite")]
    InvalidVoxel {
        /// `x`, `y` or `z`.
        axis: char,
        /// Edge, mm.
        value: f64,
    },
    /// The grid would be too large to hold.
    #[error("the grid would have {num_voxels} voxels (limit: {limit}); use larger voxels")]
    TooManyVoxels {
        /// Voxels asked for.
        num_voxels: f64,
        /// [`VoxelGrid::MAX_VOXELS`].
        limit: usize,
    },
    /// No voxel is at least half material.
    #[error("no voxel of {voxel_mm:?} mm is at least half filled with material; use smaller voxels")]
    EmptyMask {
        /// Edges, mm.
        voxel_mm: [f64; 3],
    },
    /// Two things that must have the same length have not.
    #[error("{what} has {found} entries, {expected} are needed")]
    LengthMismatch {
        /// What was passed.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length it must have.
        expected: usize,
    },
    /// The sampling asks for no points or for too many.
    #[error("sampling asks for {value} points per axis; between 1 and {limit} are possible")]
    InvalidSampling {
        /// Points asked for.
        value: usize,
        /// Largest number.
        limit: usize,
    },
    /// None of a voxel's sample points lies in the mesh.
    #[error("voxel {voxel} at ({}, {}, {}) mm lies outside the mesh; the mesh does not belong to this mask", center_mm[0], center_mm[1], center_mm[2])]
    OutsideMesh {
        /// Linear index in the grid.
        voxel: usize,
        /// Centre, mm.
        center_mm: [f64; 3],
    },
    /// A histogram axis without extent or bins.
    #[error("histogram axis from {low} to {high} with {num_bins} bins; it needs low < high and at least one bin")]
    InvalidAxis {
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
        /// Bins.
        num_bins: usize,
    },
}
