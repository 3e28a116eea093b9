//! What an image makes of a sample's displacement.

use crate::fem::turned_by;
use crate::voxel::VoxelMask;

/// Where the image lies against the specimen's frame: it shows at x what the sample has at R x + s, in components along
/// its own axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Shift s of the image, mm.
    pub shift_mm: [f64; 3],
    /// Vector of the image's rotation R about the origin, rad.
    pub rotation_rad: [f64; 3],
}

impl Pose {
    /// R x + s.
    fn place(&self, x: [f64; 3]) -> [f64; 3] {
        let turned = turned_by(self.rotation_rad, x);
        [0, 1, 2].map(|i| turned[i] + self.shift_mm[i])
    }
}

/// How recorded displacements differ from the sample's.
#[derive(Clone, Debug, Default)]
pub struct ImageChange {
    /// Relative error of the encoding along x, y, z.
    pub gain: [f64; 3],
    /// Where the image lies.
    pub pose: Pose,
    /// Background per component: coefficients (mm) of 1, x, y, z, x², y², z², xy, yz, zx in units of the half extents.
    pub background_mm: [[f64; 10]; 3],
    /// Jumps: step, component, voxels (places in the compared mask) and size, mm.
    pub jumps: Vec<Jump>,
}

/// Voxels whose phase is off by a multiple of 2π.
#[derive(Clone, Debug)]
pub struct Jump {
    /// Which step.
    pub step: usize,
    /// Which component.
    pub component: usize,
    /// Places in the compared mask.
    pub voxels: std::sync::Arc<Vec<u32>>,
    /// Size, mm.
    pub size_mm: f64,
}

impl ImageChange {
    /// Whether the image lies elsewhere than at `pose`.
    pub(super) fn lies_off(&self, pose: &Pose) -> bool {
        self.pose != *pose
    }

    /// Whether both make the same of a displacement.
    pub(super) fn is_as(&self, other: &ImageChange) -> bool {
        let sizes = |image: &ImageChange| image.jumps.iter().map(|j| j.size_mm.to_bits()).collect::<Vec<_>>();
        self.pose == other.pose
            && self.gain == other.gain
            && self.background_mm == other.background_mm
            && sizes(self) == sizes(other)
    }

    /// Turns vectors into the image's axes and scales them by its gain: what it makes of changes of a displacement.
    pub(super) fn turn_and_scale(&self, field: &mut [[f64; 3]]) {
        let back = self.pose.rotation_rad.map(|w| -w);
        let turns = back.iter().any(|w| w.abs() > 0.0);
        for u in field {
            if turns {
                *u = turned_by(back, *u);
            }
            for c in 0..3 {
                u[c] *= 1.0 + self.gain[c];
            }
        }
    }

    /// What the image shows at a step, in the order of `mask`: of the averages `seen` over the voxels where they lie at
    /// `viewed`, and of their gradients (to be given where the image lies elsewhere: then to first order).
    pub(super) fn shown(
        &self,
        step: usize,
        seen: &[[f64; 3]],
        gradients: Option<&[[[f64; 3]; 3]]>,
        viewed: &Pose,
        mask: &VoxelMask,
        half_extents_mm: [f64; 3],
    ) -> Vec<[f64; 3]> {
        let mut field = seen.to_vec();
        for ((u, g), &voxel) in field.iter_mut().zip(gradients.unwrap_or(&[])).zip(&mask.voxels) {
            let x = mask.grid.center_mm(voxel as usize);
            let (there, here) = (self.pose.place(x), viewed.place(x));
            for i in 0..3 {
                u[i] += (0..3).map(|j| g[i][j] * (there[j] - here[j])).sum::<f64>();
            }
        }
        self.turn_and_scale(&mut field);
        if self.background_mm.iter().flatten().any(|x| x.abs() > 0.0) {
            for (u, &voxel) in field.iter_mut().zip(&mask.voxels) {
                let x = mask.grid.center_mm(voxel as usize);
                let terms = background_terms([0, 1, 2].map(|a| x[a] / half_extents_mm[a]));
                for c in 0..3 {
                    u[c] += self.background_mm[c].iter().zip(terms).map(|(a, b)| a * b).sum::<f64>();
                }
            }
        }
        for jump in self.jumps.iter().filter(|j| j.step == step) {
            for &v in jump.voxels.iter() {
                field[v as usize][jump.component] += jump.size_mm;
            }
        }
        field
    }
}

/// 1, x, y, z, x², y², z², xy, yz, zx.
pub(super) fn background_terms([x, y, z]: [f64; 3]) -> [f64; 10] {
    [1.0, x, y, z, x * x, y * y, z * z, x * y, y * z, z * x]
}
