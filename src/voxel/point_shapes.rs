//! Shape functions at the sample points of voxels, and their sums over the points that lie in one element.

use crate::kinematics::Tensor;
use crate::mesh::{ColumnShape, LevelShape, Locator, Mesh};
use std::collections::HashMap;

/// Shape functions at the sample points of voxels. Voxels above one another have the same section points, and those of
/// a row the same positions along the extrusion, to the last bit; what was found of either is kept.
pub(super) struct Shapes<'a> {
    pub(super) locator: &'a Locator,
    pub(super) mesh: &'a Mesh,
    columns: HashMap<[u64; 2], Option<ColumnShape>>,
    levels: HashMap<u64, Option<LevelShape>>,
}

/// Most columns, and most levels, that are kept: a few megabytes. Sample points that lie on no grid share none.
const MAX_KEPT: usize = 10_000;

impl<'a> Shapes<'a> {
    pub(super) fn new(locator: &'a Locator, mesh: &'a Mesh) -> Self {
        Shapes { locator, mesh, columns: HashMap::new(), levels: HashMap::new() }
    }

    /// At a point (mm) of the meshed half: the element and its shape functions; `None` outside the mesh, and where an
    /// element is flat.
    pub(super) fn at(&mut self, point: [f64; 3]) -> Option<(u32, &ColumnShape, &LevelShape)> {
        let (locator, mesh) = (self.locator, self.mesh);
        if self.columns.len().max(self.levels.len()) >= MAX_KEPT {
            self.columns.clear();
            self.levels.clear();
        }
        let along = point[locator.extrusion_axis()];
        let level = self.levels.entry(along.to_bits()).or_insert_with(|| locator.level_shape(along)).as_ref()?;
        let in_section = [point[0], point[3 - locator.extrusion_axis()]];
        let column = self.columns.entry([in_section[0].to_bits(), in_section[1].to_bits()]).or_insert_with(|| {
            locator.locate_column(mesh, in_section).and_then(|column| locator.column_shape(mesh, column))
        });
        let column = column.as_ref()?;
        Some((locator.element(column.cell, level.layer), column, level))
    }
}

/// Weights of an element's nodes, summed over the sample points of a voxel that lie in it one after the other.
pub(super) struct ElementSums<'a> {
    pub(super) mesh: &'a Mesh,
    extrusion_axis: usize,
    pub(super) is_started: bool,
    pub(super) element: u32,
    pub(super) reflection: u32,
    /// By level, then by node of the section.
    pub(super) values: [[f64; 9]; 3],
    /// The same by direction.
    pub(super) gradients: [[[f64; 9]; 3]; 3],
}

impl<'a> ElementSums<'a> {
    pub(super) fn new(mesh: &'a Mesh, extrusion_axis: usize) -> Self {
        let (values, gradients) = ([[0.0; 9]; 3], [[[0.0; 9]; 3]; 3]);
        ElementSums { mesh, extrusion_axis, is_started: false, element: 0, reflection: 0, values, gradients }
    }

    pub(super) fn is_of(&self, element: u32, reflection: u32) -> bool {
        self.is_started && self.element == element && self.reflection == reflection
    }

    pub(super) fn start(&mut self, element: u32, reflection: u32) {
        (self.is_started, self.element, self.reflection) = (true, element, reflection);
        (self.values, self.gradients) = ([[0.0; 9]; 3], [[[0.0; 9]; 3]; 3]);
    }

    /// Adds a point. `back` is ∂X/∂x with the signs of the reflection.
    pub(super) fn add(&mut self, column: &ColumnShape, level: &LevelShape, back: &Tensor, weight: f64) {
        let (along, across) = (self.extrusion_axis, 3 - self.extrusion_axis);
        for k in 0..3 {
            let (value, slope) = (weight * level.values[k], weight * level.slopes[k]);
            for s in 0..9 {
                self.values[k][s] += value * column.values[s];
            }
            for j in 0..3 {
                let (of_x, of_across, of_along) = (value * back[0][j], value * back[across][j], slope * back[along][j]);
                let sums = &mut self.gradients[j][k];
                for s in 0..9 {
                    sums[s] += of_x * column.along_x[s] + of_across * column.across[s] + of_along * column.values[s];
                }
            }
        }
    }
}
