//! What a voxel measures of a nodal field: its average, and that of its gradient, over the voxel's material part.

use super::point_shapes::{ElementSums, Shapes};
use super::section::Section;
use super::{Sampling, VoxelError, VoxelMask};
use crate::kinematics::{IDENTITY, Tensor};
use crate::mesh::{Locator, Mesh};
use crate::specimen::Specimen;
use rayon::prelude::*;

/// Voxels that one thread works on at a time.
const CHUNK: usize = 512;

/// A sample point, mm, with its weight.
type SamplePoint = ([f64; 3], f64);

/// Sparse operator from nodal fields to voxel averages.
///
/// With sample points X_q and weights w_q (Σ w_q = 1) in the material part of a voxel,
/// ū_i = Σ_q w_q u_i(X_q) and (∇u)_iJ = Σ_q w_q ∂u_i/∂X_J(X_q). Points in a mirrored half are reflected to the meshed
/// one; there the field has u_y (mirror in y) or u_z (mirror in z) reversed, as displacements and their derivatives
/// have. Per voxel the points are condensed to one weight and one gradient weight per node and reflection.
#[derive(Clone, Debug)]
pub struct VoxelOperator {
    num_nodes: usize,
    /// Entries of voxel v: `offsets[v]..offsets[v + 1]`.
    offsets: Vec<u32>,
    /// 4 × node + reflection, the reflection being 1 for y plus 2 for z.
    keys: Vec<u32>,
    values: Vec<f64>,
    /// ∂/∂X_J in the unreflected frame, mm⁻¹.
    gradients: Vec<[f64; 3]>,
    num_points: usize,
    num_dropped_points: usize,
}

/// A sample point of a mirrored half carried to the meshed one, the reflection, and ∂X/∂x of the field that is seen
/// there.
fn reflected(mesh: &Mesh, (mut point, mut back): ([f64; 3], Tensor)) -> ([f64; 3], u32, Tensor) {
    let mut reflection = 0;
    for (axis, is_mirrored) in [(1, mesh.mirror.y), (2, mesh.mirror.z)] {
        if is_mirrored && point[axis] < 0.0 {
            point[axis] = -point[axis];
            reflection |= axis as u32;
        }
    }
    let signs = SIGNS[reflection as usize];
    for (row, sign) in back.iter_mut().zip(signs) {
        for b in row {
            *b *= sign;
        }
    }
    (point, reflection, back)
}

/// The same in the flattened coordinates of a wedge, in which the locator's columns and levels are.
fn flattened(locator: &Locator, (point, reflection, mut back): ([f64; 3], u32, Tensor)) -> ([f64; 3], u32, Tensor) {
    let taper = locator.taper();
    if taper.is_even() {
        return (point, reflection, back);
    }
    let [along_x, along_y] = taper.flattening_slopes(point);
    let [of_x, of_y, _] = back;
    back[1] = [0, 1, 2].map(|j| along_x * of_x[j] + along_y * of_y[j]);
    (taper.flattened(point), reflection, back)
}

/// Signs of x, y, z under each reflection.
const SIGNS: [[f64; 3]; 4] = [[1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0], [1.0, -1.0, -1.0]];

impl VoxelOperator {
    /// Builds the operator for the voxels of `mask`. `mesh` is a mesh of `specimen`.
    ///
    /// Points between the curved wall and the mesh's approximation of it lie in no element; they are dropped
    /// ([`Self::num_dropped_points`]) and the voxel's other points carry their weight.
    ///
    /// # Errors
    /// [`VoxelError::InvalidSampling`]; [`VoxelError::OutsideMesh`] where no point of a voxel is in the mesh.
    pub fn new(specimen: &Specimen, mesh: &Mesh, mask: &VoxelMask, sampling: Sampling) -> Result<Self, VoxelError> {
        Self::placed(specimen, mesh, mask, sampling, &|x| (x, IDENTITY))
    }

    /// As [`Self::new`] for a sample that is not where or what its drawing says: `place` gives for each sample point x
    /// (mm) of the drawing's voxels the point X of `mesh` whose displacement is seen there, and ∂X/∂x (row: X).
    /// Gradients are with respect to x.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn placed(
        specimen: &Specimen,
        mesh: &Mesh,
        mask: &VoxelMask,
        sampling: Sampling,
        place_of: &(dyn Fn([f64; 3]) -> ([f64; 3], Tensor) + Sync),
    ) -> Result<Self, VoxelError> {
        sampling.check()?;
        let section = Section::new(specimen);
        let locator = Locator::new(mesh);
        let of_chunk = |shapes: &mut Shapes, voxels: &[u32]| {
            let mut part = VoxelOperator::empty(mesh, voxels.len());
            part.add_voxels(voxels, shapes, place_of, &|voxel, points| {
                sampling.points(&section, &mask.grid, voxel, points);
            })
            .map_err(|voxel| VoxelError::OutsideMesh { voxel, center_mm: mask.grid.center_mm(voxel) })?;
            Ok(part)
        };
        // Every voxel stands for itself: the operator is the same for any number of threads.
        let parts = mask.voxels.par_chunks(CHUNK).map_init(|| Shapes::new(&locator, mesh), of_chunk);
        let parts = parts.collect::<Result<Vec<_>, VoxelError>>()?;
        let mut operator = VoxelOperator::empty(mesh, mask.num_voxels());
        parts.into_iter().for_each(|part| operator.append(part));
        Ok(operator)
    }

    /// Without voxels; memory for some.
    fn empty(mesh: &Mesh, num_voxels: usize) -> VoxelOperator {
        let mut operator = VoxelOperator {
            num_nodes: mesh.nodes.len(),
            offsets: Vec::with_capacity(num_voxels + 1),
            keys: Vec::with_capacity(40 * num_voxels),
            values: Vec::with_capacity(40 * num_voxels),
            gradients: Vec::with_capacity(40 * num_voxels),
            num_points: 0,
            num_dropped_points: 0,
        };
        operator.offsets.push(0);
        operator
    }

    /// Adds the voxels of another operator of the same mesh behind its own.
    fn append(&mut self, other: VoxelOperator) {
        let first = self.keys.len() as u32;
        self.offsets.extend(other.offsets[1..].iter().map(|offset| first + offset));
        self.keys.extend(other.keys);
        self.values.extend(other.values);
        self.gradients.extend(other.gradients);
        self.num_points += other.num_points;
        self.num_dropped_points += other.num_dropped_points;
    }

    /// Adds voxels, whose sample points with weights `points_of` gives; the error is a voxel without a point in the
    /// mesh.
    fn add_voxels(
        &mut self,
        voxels: &[u32],
        shapes: &mut Shapes,
        place_of: &dyn Fn([f64; 3]) -> ([f64; 3], Tensor),
        points_of: &dyn Fn(usize, &mut Vec<SamplePoint>),
    ) -> Result<(), usize> {
        // Place of a key among the current voxel's entries; valid where it is at or after the voxel's first entry.
        let mesh = shapes.mesh;
        let mut place = vec![u32::MAX; 4 * mesh.nodes.len()];
        let mut points = Vec::new();
        let mut sums = ElementSums::new(mesh, shapes.locator.extrusion_axis());
        for &voxel in voxels {
            let first = self.keys.len();
            points_of(voxel as usize, &mut points);
            let mut total = 0.0;
            for &(point, weight) in &points {
                let (point, reflection, back) = flattened(shapes.locator, reflected(mesh, place_of(point)));
                let Some((element, column, level)) = shapes.at(point) else {
                    self.num_dropped_points += 1;
                    continue;
                };
                if !sums.is_of(element, reflection) {
                    self.take(&mut sums, &mut place, first);
                    sums.start(element, reflection);
                }
                sums.add(column, level, &back, weight);
                self.num_points += 1;
                total += weight;
            }
            self.take(&mut sums, &mut place, first);
            if self.keys.len() == first {
                return Err(voxel as usize);
            }
            self.values[first..].iter_mut().for_each(|value| *value /= total);
            self.gradients[first..].iter_mut().flatten().for_each(|gradient| *gradient /= total);
            self.offsets.push(self.keys.len() as u32);
        }
        Ok(())
    }

    /// Adds what was summed in an element to the entries of the current voxel, which begin at `first`.
    fn take(&mut self, sums: &mut ElementSums, place: &mut [u32], first: usize) {
        if !sums.is_started {
            return;
        }
        sums.is_started = false;
        let nodes = sums.mesh.element(sums.element as usize);
        for (k, nodes) in nodes.chunks(nodes.len() / 3).enumerate() {
            for (s, &node) in nodes.iter().enumerate() {
                let key = 4 * node + sums.reflection;
                let mut at = place[key as usize] as usize;
                if at < first || at >= self.keys.len() || self.keys[at] != key {
                    at = self.keys.len();
                    place[key as usize] = at as u32;
                    self.keys.push(key);
                    self.values.push(0.0);
                    self.gradients.push([0.0; 3]);
                }
                self.values[at] += sums.values[k][s];
                for j in 0..3 {
                    self.gradients[at][j] += sums.gradients[j][k][s];
                }
            }
        }
    }

    /// Number of voxels.
    pub fn num_voxels(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Number of mesh nodes, the length of the fields that it takes.
    pub fn num_nodes(&self) -> usize {
        self.num_nodes
    }

    /// Number of stored node weights.
    pub fn num_entries(&self) -> usize {
        self.keys.len()
    }

    /// Sample points in use.
    pub fn num_points(&self) -> usize {
        self.num_points
    }

    /// Sample points that lay in no element.
    pub fn num_dropped_points(&self) -> usize {
        self.num_dropped_points
    }

    /// Voxel averages ū of a nodal field (displacement, mm, or its derivative with respect to a parameter).
    ///
    /// # Errors
    /// [`VoxelError::LengthMismatch`].
    pub fn average(&self, field: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, VoxelError> {
        self.check(field.len(), self.num_nodes, "nodal field")?;
        let of_voxel = |range: &[u32]| {
            let range = range[0] as usize..range[1] as usize;
            let mut mean = [0.0; 3];
            for (key, value) in self.keys[range.clone()].iter().zip(&self.values[range]) {
                let (u, signs) = (field[(key / 4) as usize], SIGNS[(key % 4) as usize]);
                for i in 0..3 {
                    mean[i] += signs[i] * value * u[i];
                }
            }
            mean
        };
        Ok(self.offsets.par_windows(2).with_min_len(CHUNK).map(of_voxel).collect())
    }

    /// Voxel averages of ∂u_i/∂X_J, `[i][J]`, of a nodal field.
    ///
    /// # Errors
    /// [`VoxelError::LengthMismatch`].
    pub fn average_gradient(&self, field: &[[f64; 3]]) -> Result<Vec<Tensor>, VoxelError> {
        self.gradients_from([[0.0; 3]; 3], field)
    }

    /// F = I + ∇u averaged over each voxel, from nodal displacements in mm.
    ///
    /// # Errors
    /// [`VoxelError::LengthMismatch`].
    pub fn deformation_gradients(&self, displacement: &[[f64; 3]]) -> Result<Vec<Tensor>, VoxelError> {
        self.gradients_from(IDENTITY, displacement)
    }

    fn gradients_from(&self, start: Tensor, field: &[[f64; 3]]) -> Result<Vec<Tensor>, VoxelError> {
        self.check(field.len(), self.num_nodes, "nodal field")?;
        let of_voxel = |range: &[u32]| {
            let range = range[0] as usize..range[1] as usize;
            let mut mean = start;
            for (key, g) in self.keys[range.clone()].iter().zip(&self.gradients[range]) {
                let (u, signs) = (field[(key / 4) as usize], SIGNS[(key % 4) as usize]);
                for i in 0..3 {
                    for j in 0..3 {
                        mean[i][j] += signs[i] * u[i] * g[j];
                    }
                }
            }
            mean
        };
        Ok(self.offsets.par_windows(2).with_min_len(CHUNK).map(of_voxel).collect())
    }

    /// The transpose of [`Self::average`]: Σ_v ∂ū_v/∂u_node · w_v for each node. For adjoint loads.
    ///
    /// # Errors
    /// [`VoxelError::LengthMismatch`].
    pub fn average_transposed(&self, weights: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, VoxelError> {
        self.check(weights.len(), self.num_voxels(), "voxel weights")?;
        let mut nodal = vec![[0.0; 3]; self.num_nodes];
        for (range, weight) in self.offsets.windows(2).zip(weights) {
            for n in range[0] as usize..range[1] as usize {
                let (node, signs) = ((self.keys[n] / 4) as usize, SIGNS[(self.keys[n] % 4) as usize]);
                for i in 0..3 {
                    nodal[node][i] += signs[i] * self.values[n] * weight[i];
                }
            }
        }
        Ok(nodal)
    }

    fn check(&self, found: usize, expected: usize, what: &'static str) -> Result<(), VoxelError> {
        if found == expected { Ok(()) } else { Err(VoxelError::LengthMismatch { what, found, expected }) }
    }
}

#[cfg(test)]
pub(crate) mod tests;
