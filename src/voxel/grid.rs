//! The regular grid of a scan.

use super::VoxelError;
use crate::specimen::Specimen;
use serde::Serialize;

/// A regular grid aligned with the specimen's axes. Voxels are numbered with x fastest: `i + nx (j + ny k)`.
///
/// The affine of a NIfTI image with this grid has `voxel_mm` on its diagonal and `origin_mm` in its last column.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct VoxelGrid {
    /// Centre of voxel (0, 0, 0), mm in the specimen's frame.
    pub origin_mm: [f64; 3],
    /// Edges of a voxel, mm.
    pub voxel_mm: [f64; 3],
    /// Voxels along x, y, z.
    pub shape: [usize; 3],
}

impl VoxelGrid {
    /// Largest number of voxels of a grid: memory, and indices in 32 bits.
    pub const MAX_VOXELS: usize = 50_000_000;

    /// A grid from its first voxel's centre, its voxel and its shape.
    ///
    /// # Errors
    /// [`VoxelError::InvalidVoxel`], [`VoxelError::TooManyVoxels`].
    pub fn new(origin_mm: [f64; 3], voxel_mm: [f64; 3], shape: [usize; 3]) -> Result<Self, VoxelError> {
        check_voxel(voxel_mm)?;
        check_size(shape.iter().map(|&n| n as f64).product())?;
        Ok(VoxelGrid { origin_mm, voxel_mm, shape })
    }

    /// The grid centred on the specimen's block, with extent / edge voxels along each axis, rounded to the nearest
    /// whole number (at least one).
    ///
    /// A scan's grid lies anywhere relative to the sample. On average over that offset, the voxels at least half filled
    /// number extent / edge along each axis; rounding keeps closest to that and keeps the grid mirror symmetric. Up to
    /// half a voxel of material at a face then belongs to no voxel. (25.4 × 6.4 × 19.1 mm at 1 × 0.1875 × 0.75 mm: 25 ×
    /// 34 × 25 = 21,250 voxels; volume / voxel volume is 22,079.)
    ///
    /// # Errors
    /// [`VoxelError::InvalidVoxel`], [`VoxelError::TooManyVoxels`].
    pub fn covering(specimen: &Specimen, voxel_mm: [f64; 3]) -> Result<Self, VoxelError> {
        check_voxel(voxel_mm)?;
        let extent = [specimen.block.length_mm, specimen.block.thickness_mm, specimen.block.width_mm];
        let count = [0, 1, 2].map(|a| (extent[a] / voxel_mm[a]).round().max(1.0));
        check_size(count.iter().product())?;
        let origin_mm = [0, 1, 2].map(|a| -0.5 * (count[a] - 1.0) * voxel_mm[a]);
        Ok(VoxelGrid { origin_mm, voxel_mm, shape: count.map(|n| n as usize) })
    }

    /// Number of voxels, in and out of the material.
    pub fn num_voxels(&self) -> usize {
        self.shape.iter().product()
    }

    /// Volume of a voxel, mm³.
    pub fn voxel_volume_mm3(&self) -> f64 {
        self.voxel_mm.iter().product()
    }

    /// Linear index of voxel (i, j, k).
    pub fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.shape[0] * (j + self.shape[1] * k)
    }

    /// How far the numbers of neighbours along an axis are apart.
    pub fn stride(&self, axis: usize) -> usize {
        self.shape[..axis].iter().product()
    }

    /// (i, j, k) of a linear index.
    pub fn indices(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.shape;
        [index % nx, index / nx % ny, index / (nx * ny)]
    }

    /// Centre of a voxel, mm.
    pub fn center_mm(&self, index: usize) -> [f64; 3] {
        let n = self.indices(index);
        [0, 1, 2].map(|a| self.origin_mm[a] + n[a] as f64 * self.voxel_mm[a])
    }
}

fn check_voxel(voxel_mm: [f64; 3]) -> Result<(), VoxelError> {
    for (axis, value) in ['x', 'y', 'z'].into_iter().zip(voxel_mm) {
        if !(value.is_finite() && value > 0.0) {
            return Err(VoxelError::InvalidVoxel { axis, value });
        }
    }
    Ok(())
}

fn check_size(num_voxels: f64) -> Result<(), VoxelError> {
    if num_voxels <= VoxelGrid::MAX_VOXELS as f64 {
        Ok(())
    } else {
        Err(VoxelError::TooManyVoxels { num_voxels, limit: VoxelGrid::MAX_VOXELS })
    }
}

#[cfg(test)]
mod tests {
    use super::super::mask::tests::{PUBLISHED_VOXEL, solid};
    use super::*;

    #[test]
    fn published_grid_is_centred() {
        let grid = VoxelGrid::covering(&solid(), PUBLISHED_VOXEL).unwrap();
        assert_eq!(grid.shape, [25, 34, 25]);
        let (first, last) = (grid.center_mm(0), grid.center_mm(grid.num_voxels() - 1));
        for a in 0..3 {
            // Rounding of coordinates of order ten.
            assert!((first[a] + last[a]).abs() < 1e-13);
        }
    }

    #[test]
    fn indices_invert() {
        let grid = VoxelGrid::new([1.0, 2.0, 3.0], [0.5, 0.25, 2.0], [4, 3, 5]).unwrap();
        for n in 0..grid.num_voxels() {
            assert_eq!(grid.index(grid.indices(n)), n);
        }
        assert_eq!(grid.center_mm(grid.index([3, 2, 1])), [2.5, 2.5, 5.0]);
    }

    #[test]
    fn bad_voxels_are_refused() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let error = VoxelGrid::covering(&solid(), [1.0, bad, 1.0]).unwrap_err();
            assert!(matches!(error, VoxelError::InvalidVoxel { axis: 'y', .. }));
        }
        assert!(matches!(VoxelGrid::covering(&solid(), [1e-9; 3]).unwrap_err(), VoxelError::TooManyVoxels { .. }));
    }
}
