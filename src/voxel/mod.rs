//! The scan's grid: which voxels hold material, and what each of them measures.
//!
//! What cameras measure of a face ([`Surface`]) is the same with voxels of no thickness: a grid of one layer whose
//! sample points lie on the face, and whose voxels are the subsets of a digital image correlation.

mod filter;
mod grid;
mod histogram;
mod mask;
mod operator;
mod point_shapes;
mod sampling;
mod section;
mod surface;

pub use filter::HammingFilter;
pub use grid::VoxelGrid;
pub use histogram::{Histogram2d, HistogramAxis};
pub use mask::VoxelMask;
pub use operator::VoxelOperator;
pub use sampling::{MaterialPoints, Sampling};
pub use surface::{Face, MeasuredComponents, Surface, unbounded_where_unmeasured};

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
    /// A face that cameras cannot see, or that is no plane.
    #[error("the face {face} is bonded or curved; the plane faces that cameras see are {}", free.join(", "))]
    HiddenFace {
        /// The face.
        face: &'static str,
        /// Those that can be seen.
        free: Vec<&'static str>,
    },
    /// A grid that should lie on a face does not.
    #[error(
        "a grid of {layers} layers, the first at {found_mm} mm along the normal of the face {face}, is none of the face, \
         which lies at {expected_mm} mm; it must be one layer there"
    )]
    OffFace {
        /// The face.
        face: &'static str,
        /// Layers along its normal.
        layers: usize,
        /// Where the first of them lies, mm.
        found_mm: f64,
        /// Where the face lies, mm.
        expected_mm: f64,
    },
    /// A filter over voxels of the volume was asked for where a surface was measured.
    #[error("hamming2 averages 2×2×2 voxels of a volume; displacements of a surface are given without a filter")]
    FilteredSurface,
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
