//! What all arrays on a scan's voxels have in common: the grid, the mask, and fields over them.

use super::arrays::{Axis, Tree, components_last};
use crate::voxel::VoxelGrid;

/// The axes of a field of numbers, one per voxel and drive.
pub(super) fn scalar_axes(grid: &VoxelGrid, num_drives: usize) -> [Axis; 4] {
    let [nx, ny, nz] = grid.shape;
    [("x", nx), ("y", ny), ("z", nz), ("drive", num_drives)]
}

/// The axes of a field of vectors, one per voxel and drive.
pub(super) fn vector_axes(grid: &VoxelGrid, num_drives: usize) -> [Axis; 5] {
    let [nx, ny, nz] = grid.shape;
    [("x", nx), ("y", ny), ("z", nz), ("component", 3), ("drive", num_drives)]
}

/// Adds grid and mask.
pub(super) fn add_grid(tree: &mut Tree, grid: &VoxelGrid, mask: Vec<bool>) {
    let mut affine = vec![0.0; 16];
    for axis in 0..3 {
        affine[axis + 4 * axis] = grid.voxel_mm[axis];
        affine[axis + 4 * 3] = grid.origin_mm[axis];
    }
    affine[15] = 1.0;
    let about = "position of a voxel's centre = affine (i, j, k, 1), voxels counted from 0, in the specimen's frame";
    tree.array("affine", "mm", about, &[("row", 4), ("column", 4)], affine);
    tree.array("voxel_mm", "mm", "edges of a voxel", &[("axis", 3)], grid.voxel_mm.to_vec());
    let [nx, ny, nz] = grid.shape;
    tree.array("mask", "1", "where there is material", &[("x", nx), ("y", ny), ("z", nz)], mask);
}

/// The vectors of all drives, each drive's in the grid's order, as numbers with x fastest and the drive slowest.
pub(super) fn vectors<'a>(of_drives: impl Iterator<Item = &'a [[f64; 3]]>) -> Vec<f64> {
    of_drives.flat_map(components_last).collect()
}
