//! Complex images of a displaced specimen, without noise.

use super::AcquisitionError;
use crate::mesh::{Locator, Mesh};
use crate::specimen::Specimen;
use crate::voxel::{MaterialPoints, Sampling, VoxelGrid, VoxelMask};
use rayon::prelude::*;

/// A complex number.
pub type Complex = nalgebra::Complex<f64>;

/// Four Gauss points per axis: exp(iφ) is integrated to 10⁻³ of the signal for one whole turn of φ across the voxel, to
/// 10⁻⁶ for a third of a turn.
const SAMPLING: Sampling = Sampling { gauss_points: [4; 3], cut_slices: 12 };

/// Voxels per parallel task; also how often `is_cancelled` is asked.
const CHUNK: usize = 2048;

/// Signs of x, y, z under each reflection (1: y, 2: z).
const SIGNS: [[f64; 3]; 4] = [[1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0], [1.0, -1.0, -1.0]];

/// The images of each state (nodal displacements, mm) and direction: per voxel of `grid`, (material volume / voxel
/// volume) × mean over the material of exp(i uₐ / mm_per_radianₐ). A full voxel in a uniform field has magnitude one.
/// `[state][axis]`, each in the grid's order.
///
/// `mesh` is a mesh of `specimen`. Sample points between a curved wall and the mesh's approximation of it lie in no
/// element; the voxel's other points carry their weight.
///
/// # Errors
/// [`AcquisitionError::Value`], [`AcquisitionError::Length`], [`AcquisitionError::Voxel`],
/// [`AcquisitionError::Cancelled`].
pub fn signal_images(
    specimen: &Specimen,
    mesh: &Mesh,
    states: &[&[[f64; 3]]],
    grid: &VoxelGrid,
    mm_per_radian: [f64; 3],
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<[Vec<Complex>; 3]>, AcquisitionError> {
    for value in mm_per_radian {
        if !(value.is_finite() && value > 0.0) {
            return Err(AcquisitionError::Value { name: "mm_per_radian", value, requirement: "positive and finite" });
        }
    }
    for state in states {
        if state.len() != mesh.nodes.len() {
            let (found, expected) = (state.len(), mesh.nodes.len());
            return Err(AcquisitionError::Length { what: "nodal displacement", found, expected });
        }
    }
    // Every voxel with any material.
    let mask = VoxelMask::from_flags(specimen, grid.clone(), &vec![true; grid.num_voxels()], 0.0)?;
    let points = MaterialPoints::new(specimen, SAMPLING)?;
    let locator = Locator::new(mesh);
    let per_voxel = 3 * states.len();
    let chunks: Vec<Vec<Complex>> = mask
        .voxels
        .par_chunks(CHUNK)
        .map(|voxels| {
            if is_cancelled() {
                return Err(AcquisitionError::Cancelled);
            }
            let mut sums = vec![Complex::new(0.0, 0.0); per_voxel * voxels.len()];
            let mut sample = Vec::new();
            for (&voxel, sums) in voxels.iter().zip(sums.chunks_exact_mut(per_voxel.max(1))) {
                points.of_voxel(grid, voxel as usize, &mut sample);
                let mut total = 0.0;
                for &(point, weight) in &sample {
                    if add_point(mesh, &locator, states, mm_per_radian, point, weight, sums) {
                        total += weight;
                    }
                }
                if total > 0.0 {
                    sums.iter_mut().for_each(|s| *s /= total);
                }
            }
            Ok(sums)
        })
        .collect::<Result<_, _>>()?;
    let zeros = || vec![Complex::new(0.0, 0.0); grid.num_voxels()];
    let mut images: Vec<[Vec<Complex>; 3]> = states.iter().map(|_| [zeros(), zeros(), zeros()]).collect();
    let sums = chunks.iter().flat_map(|chunk| chunk.chunks_exact(per_voxel.max(1)));
    for ((&voxel, &fraction), sums) in mask.voxels.iter().zip(&mask.material_fraction).zip(sums) {
        for (state, image) in images.iter_mut().enumerate() {
            for axis in 0..3 {
                image[axis][voxel as usize] = sums[3 * state + axis] * fraction;
            }
        }
    }
    Ok(images)
}

/// Adds weight × exp(iφ) of one point to the sums, three per state; false where the point lies in no element.
fn add_point(
    mesh: &Mesh,
    locator: &Locator,
    states: &[&[[f64; 3]]],
    mm_per_radian: [f64; 3],
    mut point: [f64; 3],
    weight: f64,
    sums: &mut [Complex],
) -> bool {
    let mut reflection = 0;
    for (axis, is_mirrored) in [(1, mesh.mirror.y), (2, mesh.mirror.z)] {
        if is_mirrored && point[axis] < 0.0 {
            point[axis] = -point[axis];
            reflection |= axis;
        }
    }
    let Some(location) = locator.locate(mesh, point) else { return false };
    let shape = mesh.element_kind.shape_functions(location.reference_coordinates);
    let nodes = mesh.element(location.element as usize);
    for (state, displacement) in states.iter().enumerate() {
        let mut u = [0.0; 3];
        for (a, &node) in nodes.iter().enumerate() {
            for i in 0..3 {
                u[i] += shape[a] * displacement[node as usize][i];
            }
        }
        for axis in 0..3 {
            let phase = SIGNS[reflection][axis] * u[axis] / mm_per_radian[axis];
            sums[3 * state + axis] += Complex::from_polar(weight, phase);
        }
    }
    true
}
