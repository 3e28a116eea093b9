//! What a job will take, before it runs: an estimate to decide by.

use crate::mesh::{MeshOptions, mesh_specimen};
use crate::specimen::Specimen;
use crate::voxel::VoxelGrid;

/// Processor seconds of one drive of an evaluation with a material of one term. From the release build on one thread of
/// the development machine: eight evaluations of the shipped specimens (1,393 to 11,687 nodes, 2,000 to 21,000
/// voxels; 0.15 s to 2.5 s a drive) give 2.28 s at 10,000 nodes with the power 1.4, each within a factor of 2.3; voxels
/// eight times as many cost 2 µs each. Material terms and other machines change it: an estimate to decide by, not a
/// promise.
pub fn seconds_per_drive(num_nodes: usize, num_voxels: usize) -> f64 {
    2.28 * (num_nodes as f64 / 1e4).powf(1.4) + 2e-6 * num_voxels as f64
}

/// Processor seconds of `num_drives` drives of a specimen on a mesh, each seen by a scan of `voxel_mm` where there is
/// one; none where the specimen cannot be meshed or the scan has no grid. Meshes once.
pub(super) fn seconds(
    specimen: &Specimen,
    mesh: &MeshOptions,
    voxel_mm: Option<[f64; 3]>,
    num_drives: usize,
) -> Option<f64> {
    let num_nodes = mesh_specimen(specimen, mesh).ok()?.nodes.len();
    let num_voxels = match voxel_mm {
        Some(voxel) => VoxelGrid::covering(specimen, voxel).ok()?.num_voxels(),
        None => 0,
    };
    Some(seconds_per_drive(num_nodes, num_voxels) * num_drives as f64)
}
