//! Whether the voxels of a mask lie on the specimen: a frame whose origin is elsewhere shows there at once.

use super::RecordingError;
use crate::specimen::Specimen;
use crate::voxel::VoxelGrid;

/// A mask with a smaller part of its voxels on the block, which fill a smaller part of the block, lies elsewhere. Scans
/// of a part of the block have all of their voxels on it, and masks of the whole field of view fill it.
const LEAST: f64 = 0.5;

/// Compares where the marked voxels lie with the block, whose centre is the origin.
///
/// # Errors
/// [`RecordingError::Position`].
pub(super) fn check_position(specimen: &Specimen, grid: &VoxelGrid, mask: &[bool]) -> Result<(), RecordingError> {
    let extent_mm = specimen.block.extents_mm();
    let (mut num_voxels, mut num_inside) = (0, 0);
    let mut box_mm = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for voxel in (0..grid.num_voxels()).filter(|v| mask[*v]) {
        let center = grid.center_mm(voxel);
        num_voxels += 1;
        // Along the normal, the grid of a surface lies on the face.
        let mut axes = (0..3).filter(|&a| grid.normal_axis() != Some(a));
        num_inside += usize::from(axes.all(|a| center[a].abs() <= 0.5 * extent_mm[a]));
        for a in 0..3 {
            box_mm[0][a] = box_mm[0][a].min(center[a] - 0.5 * grid.voxel_mm[a]);
            box_mm[1][a] = box_mm[1][a].max(center[a] + 0.5 * grid.voxel_mm[a]);
        }
    }
    let filled = num_inside as f64 * grid.voxel_volume_mm3() / extent_mm.iter().product::<f64>();
    if num_inside as f64 >= LEAST * num_voxels as f64 || filled >= LEAST {
        return Ok(());
    }
    Err(RecordingError::Position { num_inside, num_voxels, box_mm, half_extent_mm: extent_mm.map(|e| 0.5 * e) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A solid block whose grid is moved, with `more` voxels around it on every side.
    fn check(moved_mm: [f64; 3], more: usize) -> Result<(), RecordingError> {
        let specimen = Specimen::from_json(include_str!("../../geometries/solid-shear.json")).expect("a specimen");
        let mut grid = VoxelGrid::covering(&specimen, [1.0, 0.5, 1.0]).expect("a grid");
        for a in 0..3 {
            grid.shape[a] += 2 * more;
            grid.origin_mm[a] += moved_mm[a] - more as f64 * grid.voxel_mm[a];
        }
        check_position(&specimen, &grid, &vec![true; grid.num_voxels()])
    }

    #[test]
    fn masks_elsewhere_are_refused() {
        check([0.0; 3], 0).expect("as it should be");
        check([4.0, 1.0, -3.0], 0).expect("a registration that is off, which a diagnosis finds");
        check([0.0; 3], 20).expect("a mask of the whole field of view");
        for moved in [[15.0, 0.0, 0.0], [0.0, 4.0, 0.0], [300.0, 0.0, 0.0], [12.7, 3.2, 9.55]] {
            let error = check(moved, 0).expect_err("the block is elsewhere");
            assert!(matches!(error, RecordingError::Position { .. }), "{error}");
            assert!(error.to_string().contains("affine"), "{error}");
        }
    }
}
