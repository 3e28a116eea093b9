//! What a voxel measures of a nodal field: its average, and that of its gradient, over the voxel's material part.

use super::section::Section;
use super::{Sampling, VoxelError, VoxelMask};
use crate::kinematics::{IDENTITY, Tensor, inverse};
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
        let of_chunk = |voxels: &[u32]| {
            let mut part = VoxelOperator::empty(mesh, voxels.len());
            part.add_voxels(voxels, mesh, &locator, place_of, &|voxel, points| {
                sampling.points(&section, &mask.grid, voxel, points);
            })
            .map_err(|voxel| VoxelError::OutsideMesh { voxel, center_mm: mask.grid.center_mm(voxel) })?;
            Ok(part)
        };
        // Every voxel stands for itself: the operator is the same for any number of threads.
        let parts = mask.voxels.par_chunks(CHUNK).map(of_chunk).collect::<Result<Vec<_>, VoxelError>>()?;
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
        mesh: &Mesh,
        locator: &Locator,
        place_of: &dyn Fn([f64; 3]) -> ([f64; 3], Tensor),
        points_of: &dyn Fn(usize, &mut Vec<SamplePoint>),
    ) -> Result<(), usize> {
        // Place of a key among the current voxel's entries; valid where it is at or after the voxel's first entry.
        let mut place = vec![u32::MAX; 4 * mesh.nodes.len()];
        let mut points = Vec::new();
        for &voxel in voxels {
            let first = self.keys.len();
            points_of(voxel as usize, &mut points);
            let mut total = 0.0;
            for &(point, weight) in &points {
                if self.add_point(mesh, locator, &mut place, first, place_of(point), weight) {
                    total += weight;
                }
            }
            if self.keys.len() == first {
                return Err(voxel as usize);
            }
            for n in first..self.keys.len() {
                self.values[n] /= total;
                self.gradients[n] = self.gradients[n].map(|g| g / total);
            }
            self.offsets.push(self.keys.len() as u32);
        }
        Ok(())
    }

    /// Adds one sample point to the current voxel; false where it lies in no element.
    fn add_point(
        &mut self,
        mesh: &Mesh,
        locator: &Locator,
        place: &mut [u32],
        first: usize,
        (mut point, back): ([f64; 3], Tensor),
        weight: f64,
    ) -> bool {
        let mut reflection = 0;
        for (axis, is_mirrored) in [(1, mesh.mirror.y), (2, mesh.mirror.z)] {
            if is_mirrored && point[axis] < 0.0 {
                point[axis] = -point[axis];
                reflection |= axis as u32;
            }
        }
        let Some(location) = locator.locate(mesh, point) else {
            self.num_dropped_points += 1;
            return false;
        };
        let (nodes, r) = (mesh.element(location.element as usize), location.reference_coordinates);
        let (n, g) = (mesh.element_kind.shape_functions(r), mesh.element_kind.shape_gradients(r));
        let mut map = [[0.0; 3]; 3];
        for (a, &node) in nodes.iter().enumerate() {
            let x = mesh.nodes[node as usize];
            for i in 0..3 {
                for j in 0..3 {
                    map[i][j] += x[i] * g[a][j];
                }
            }
        }
        let Some(inverse) = inverse(&map) else {
            self.num_dropped_points += 1;
            return false;
        };
        for (a, &node) in nodes.iter().enumerate() {
            let key = 4 * node + reflection;
            let mut at = place[key as usize] as usize;
            if at < first || at >= self.keys.len() || self.keys[at] != key {
                at = self.keys.len();
                place[key as usize] = at as u32;
                self.keys.push(key);
                self.values.push(0.0);
                self.gradients.push([0.0; 3]);
            }
            self.values[at] += weight * n[a];
            let slope = [0, 1, 2].map(|j| (0..3).map(|m| g[a][m] * inverse[m][j]).sum::<f64>());
            for j in 0..3 {
                let seen: f64 = (0..3).map(|m| SIGNS[reflection as usize][m] * slope[m] * back[m][j]).sum();
                self.gradients[at][j] += weight * seen;
            }
        }
        self.num_points += 1;
        true
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
        Ok(self
            .offsets
            .windows(2)
            .map(|range| {
                let mut mean = [0.0; 3];
                for n in range[0] as usize..range[1] as usize {
                    let (node, signs) = self.entry(n);
                    for i in 0..3 {
                        mean[i] += signs[i] * self.values[n] * field[node][i];
                    }
                }
                mean
            })
            .collect())
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
        Ok(self
            .offsets
            .windows(2)
            .map(|range| {
                let mut mean = start;
                for n in range[0] as usize..range[1] as usize {
                    let (node, signs) = self.entry(n);
                    let g = self.gradients[n];
                    for i in 0..3 {
                        let u = signs[i] * field[node][i];
                        for j in 0..3 {
                            mean[i][j] += u * g[j];
                        }
                    }
                }
                mean
            })
            .collect())
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
                let (node, signs) = self.entry(n);
                for i in 0..3 {
                    nodal[node][i] += signs[i] * self.values[n] * weight[i];
                }
            }
        }
        Ok(nodal)
    }

    fn entry(&self, n: usize) -> (usize, [f64; 3]) {
        let key = self.keys[n];
        ((key / 4) as usize, SIGNS[(key % 4) as usize])
    }

    fn check(&self, found: usize, expected: usize, what: &'static str) -> Result<(), VoxelError> {
        if found == expected { Ok(()) } else { Err(VoxelError::LengthMismatch { what, found, expected }) }
    }
}

#[cfg(test)]
pub(crate) mod tests;
