//! The bonded faces: which nodes move with a plate or grip, which are released, and how a drive moves them.

use super::departures::Departures;
use super::lifting::AffineMap;
use crate::mesh::Mesh;
use crate::specimen::{PRECOMPRESSION_DIRECTION, Specimen, TestKind};

/// The first part of the way that the plates are pressed together, in first steps of a drive: a bonded block is stiffer
/// across its plates than along them.
const FIRST_STEP_OF_PRESSING: f64 = 0.1;

/// The plates or grips of a test, on a mesh. The moved one is displaced by the drive in its direction; the fixed one
/// not at all.
#[derive(Clone)]
pub(super) struct Plates {
    /// Whether each node is on the moved face.
    pub(super) is_moved: Vec<bool>,
    /// Whether each node moves with a plate.
    pub(super) is_held: Vec<bool>,
    /// Whether each node is on a face but moves under a spring instead of with the plate.
    pub(super) is_released: Vec<bool>,
    /// Those nodes with the area of the face that they stand for, mm².
    pub(super) released: Vec<(u32, f64)>,
    /// Elements with a node on the moved face.
    pub(super) driven_elements: Vec<u32>,
    /// Unit vector in which the moved plate goes for a positive drive.
    pub(super) direction: [f64; 3],
    /// Displacement of the moved plate before it is driven, mm; it stays on.
    pub(super) before_drive_mm: [f64; 3],
    /// Where each node lies between the fixed face (0) and the moved one (1).
    lift: Vec<f64>,
    /// Largest first load step, mm.
    pub(super) first_step_mm: f64,
    /// Centres of the fixed and of the moved face, mm.
    face_centers: [[f64; 3]; 2],
    /// The axis across the faces.
    axis: usize,
}

impl Plates {
    /// The plates of `specimen` on its `mesh`; `is_released`(position, whether on the moved face) says which nodes of
    /// the faces are held by springs.
    pub(super) fn new(mesh: &Mesh, specimen: &Specimen, is_released: &dyn Fn([f64; 3], bool) -> bool) -> Plates {
        let areas = mesh.face_areas();
        let mut released = Vec::new();
        let mut flags = vec![false; mesh.nodes.len()];
        for (nodes, is_moved) in [(&mesh.fixed_nodes, false), (&mesh.moved_nodes, true)] {
            for &v in nodes.iter() {
                if is_released(mesh.nodes[v as usize], is_moved) {
                    flags[v as usize] = true;
                    released.push((v, areas[v as usize]));
                }
            }
        }
        let mut is_moved = vec![false; mesh.nodes.len()];
        for &v in &mesh.moved_nodes {
            is_moved[v as usize] = true;
        }
        let mut is_held = is_moved.clone();
        for &v in &mesh.fixed_nodes {
            is_held[v as usize] = true;
        }
        for &(v, _) in &released {
            is_held[v as usize] = false;
        }
        let driven_elements = (0..mesh.num_elements() as u32)
            .filter(|&e| mesh.element(e as usize).iter().any(|&v| is_moved[v as usize]))
            .collect();
        let (axis, extent) = match specimen.test {
            TestKind::DoubleLapShear => (1, specimen.block.thickness_mm),
            TestKind::Uniaxial => (0, specimen.block.length_mm),
        };
        Plates {
            is_moved,
            is_held,
            is_released: flags,
            released,
            driven_elements,
            direction: specimen.drive_direction(),
            before_drive_mm: specimen.displacement_before_drive_mm(),
            lift: mesh.nodes.iter().map(|x| mesh.taper.flattened(*x)[axis] / extent + 0.5).collect(),
            // One step to a shear strain of 0.8 takes five or six iterations; stretching is more nonlinear.
            first_step_mm: if axis == 1 { 0.85 } else { 0.3 } * extent,
            face_centers: [-0.5, 0.5].map(|side| {
                let mut center = [0.0; 3];
                center[axis] = side * extent;
                center
            }),
            axis,
        }
    }

    /// The same plates where they are brought to where they are before any drive: what drives them (mm) is the
    /// precompression.
    pub(super) fn pressing(&self) -> Plates {
        Plates {
            direction: PRECOMPRESSION_DIRECTION,
            before_drive_mm: [0.0; 3],
            first_step_mm: FIRST_STEP_OF_PRESSING * self.first_step_mm,
            ..self.clone()
        }
    }

    /// The precompression that stays on while the plates are driven, mm.
    pub(super) fn precompression_mm(&self) -> f64 {
        (0..3).map(|i| PRECOMPRESSION_DIRECTION[i] * self.before_drive_mm[i]).sum()
    }

    /// The part of a force or a displacement in the direction of the drive.
    pub(super) fn along(&self, vector: [f64; 3]) -> f64 {
        (0..3).map(|i| vector[i] * self.direction[i]).sum()
    }

    /// The vector of a length in the direction of the drive.
    pub(super) fn vector(&self, length: f64) -> [f64; 3] {
        self.direction.map(|component| length * component)
    }

    /// Nodes that move with a plate.
    pub(super) fn held_nodes(&self) -> impl Iterator<Item = usize> {
        (0..self.is_held.len()).filter(|&v| self.is_held[v])
    }

    /// Displacement (mm) that the plates impose on node `v` at a drive, were it at the position `x` (mm); the node must
    /// be on a plate.
    pub(super) fn imposed(&self, x: [f64; 3], departures: &Departures, v: usize, drive_mm: f64) -> [f64; 3] {
        let (motion, center, along, before) = if self.is_moved[v] {
            (&departures.moved_plate, self.face_centers[1], drive_mm, self.before_drive_mm)
        } else {
            (&departures.fixed_plate, self.face_centers[0], 0.0, [0.0; 3])
        };
        let mut u = motion.displacement([0, 1, 2].map(|i| x[i] - center[i]), drive_mm);
        for (u, (component, before)) in u.iter_mut().zip(self.direction.iter().zip(before)) {
            *u += along * component + before;
        }
        if let Some(face) = &departures.faces_per_mm[usize::from(self.is_moved[v])] {
            for (u, rate) in u.iter_mut().zip(face.at(x)) {
                *u += drive_mm * rate;
            }
        }
        u
    }

    /// Brings the held nodes to where `imposed`(node) wants them (mm), and the nodes between the faces along
    /// ([`super::lifting`]): a first guess of the displacement (mm) of the nodes at `positions` (mm).
    pub(super) fn carry(
        &self,
        positions: &[[f64; 3]],
        imposed: &dyn Fn(usize) -> [f64; 3],
        displacement: &mut [[f64; 3]],
    ) {
        let in_plane = |x: [f64; 3]| [x[(self.axis + 1) % 3], x[(self.axis + 2) % 3]];
        let maps = [false, true].map(|is_moved| {
            let (mut points, mut lacking) = (Vec::new(), Vec::new());
            for v in self.held_nodes().filter(|&v| self.is_moved[v] == is_moved) {
                let (to, from) = (imposed(v), displacement[v]);
                points.push(in_plane(positions[v]));
                lacking.push([0, 1, 2].map(|i| to[i] - from[i]));
            }
            AffineMap::fitted(&points, &lacking)
        });
        for (side, map) in maps.iter().enumerate() {
            let Some(map) = map else { continue };
            for ((u, &x), lift) in displacement.iter_mut().zip(positions).zip(&self.lift) {
                let part = if side == 1 { *lift } else { 1.0 - lift };
                for (u, carried) in u.iter_mut().zip(map.at(in_plane(x))) {
                    *u += part * carried;
                }
            }
        }
        for v in self.held_nodes() {
            displacement[v] = imposed(v);
        }
    }
}
