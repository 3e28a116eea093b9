//! Locating many points that follow one another closely: start from where the last ones were.

use super::stand_in::{Location, Locator};
use crate::mesh::{ElementKind, Mesh};

/// Points up to this far outside an element's reference cell still count as inside: rounding at shared faces.
const CELL_TOLERANCE: f64 = 1e-8;
/// Newton stops when the step in reference coordinates falls below this.
const STEP_TOLERANCE: f64 = 1e-12;
/// Elements remembered; neighbouring voxels alternate between a few.
const NUM_REMEMBERED: usize = 6;

/// A locator with a memory.
pub(super) struct Tracker<'a> {
    mesh: &'a Mesh,
    locator: Locator,
    /// Last locations, most recent first, one per element.
    recent: Vec<Location>,
}

impl<'a> Tracker<'a> {
    pub fn new(mesh: &'a Mesh) -> Self {
        Tracker { mesh, locator: Locator::new(mesh), recent: Vec::with_capacity(NUM_REMEMBERED + 1) }
    }

    /// The element that holds a point of the meshed part and its reference coordinates there.
    pub fn locate(&mut self, point: [f64; 3]) -> Option<(usize, [f64; 3])> {
        for n in 0..self.recent.len() {
            let candidate = self.recent[n];
            let element = candidate.element as usize;
            if let Some(found) = inverse_map(self.mesh, element, point, candidate.reference_coordinates) {
                self.recent[..=n].rotate_right(1);
                self.recent[0].reference_coordinates = found;
                return Some((element, found));
            }
        }
        let location = self.locator.locate(self.mesh, point)?;
        self.recent.insert(0, location);
        self.recent.truncate(NUM_REMEMBERED);
        Some((location.element as usize, location.reference_coordinates))
    }
}

/// Centre of the reference cell.
pub(super) fn center(kind: ElementKind) -> [f64; 3] {
    match kind {
        ElementKind::Hex27 => [0.0; 3],
        ElementKind::Prism21 => [1.0 / 3.0, 1.0 / 3.0, 0.0],
    }
}

/// Reference coordinates of `point` in `element`, or none where it lies outside. Newton from `start`; gives up as soon as an
/// iterate is far outside the cell.
pub(super) fn inverse_map(mesh: &Mesh, element: usize, point: [f64; 3], start: [f64; 3]) -> Option<[f64; 3]> {
    let nodes = mesh.element(element);
    let mut r = start;
    for _ in 0..20 {
        let n = mesh.element_kind.shape_functions(r);
        let g = mesh.element_kind.shape_gradients(r);
        let mut residual = point;
        let mut map = [[0.0; 3]; 3];
        for (a, &node) in nodes.iter().enumerate() {
            let x = mesh.nodes[node as usize];
            for i in 0..3 {
                residual[i] -= n[a] * x[i];
                for j in 0..3 {
                    map[i][j] += x[i] * g[a][j];
                }
            }
        }
        let inverse = inverted(&map)?;
        let step = [0, 1, 2].map(|i| (0..3).map(|j| inverse[i][j] * residual[j]).sum::<f64>());
        for i in 0..3 {
            r[i] += step[i];
        }
        // Quadratic convergence: the iterate after a step of 1e-7 is exact to rounding.
        let length = step.iter().fold(0.0, |m: f64, s| m.max(s.abs()));
        if length < STEP_TOLERANCE.sqrt() * 0.1 {
            return is_inside(mesh.element_kind, r, CELL_TOLERANCE).then_some(r);
        }
        if !is_inside(mesh.element_kind, r, 1.0) {
            return None;
        }
    }
    None
}

fn is_inside(kind: ElementKind, [x, y, z]: [f64; 3], tolerance: f64) -> bool {
    let limit = 1.0 + tolerance;
    match kind {
        ElementKind::Hex27 => x.abs() <= limit && y.abs() <= limit && z.abs() <= limit,
        ElementKind::Prism21 => x >= -tolerance && y >= -tolerance && x + y <= limit && z.abs() <= limit,
    }
}

/// Inverse of a 3×3 matrix; none where it is singular.
pub(super) fn inverted(m: &[[f64; 3]; 3]) -> Option<[[f64; 3]; 3]> {
    let determinant = crate::kinematics::determinant(m);
    if !determinant.is_normal() {
        return None;
    }
    let mut inverse = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            let (a, b, c, d) = ((j + 1) % 3, (j + 2) % 3, (i + 1) % 3, (i + 2) % 3);
            inverse[i][j] = (m[a][c] * m[b][d] - m[a][d] * m[b][c]) / determinant;
        }
    }
    Some(inverse)
}
