//! Where something is in the sample.

use crate::mesh::half_extents_mm;
use crate::specimen::{Specimen, TestKind};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Where something is: a box in the undeformed sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Location {
    /// In words.
    pub region: String,
    /// Its centre in the undeformed sample, mm.
    pub center_mm: [f64; 3],
    /// Its size along x, y, z, mm.
    pub extent_mm: [f64; 3],
}

impl Location {
    /// The bonded face of the moved plate or grip.
    pub(super) fn of_moved_plate(specimen: &Specimen) -> Location {
        let b = specimen.block;
        match specimen.test {
            TestKind::DoubleLapShear => Location {
                region: "moved plate".into(),
                center_mm: [0.0, 0.5 * b.thickness_mm, 0.0],
                extent_mm: [b.length_mm, 0.0, b.width_mm],
            },
            TestKind::Uniaxial => Location {
                region: "moved grip".into(),
                center_mm: [0.5 * b.length_mm, 0.0, 0.0],
                extent_mm: [0.0, b.thickness_mm, b.width_mm],
            },
        }
    }

    /// The face of the block across `axis`, at its low (0) or high (1) side.
    pub(super) fn of_face(specimen: &Specimen, axis: usize, side: usize, what: &str) -> Location {
        let half_mm = half_extents_mm(specimen);
        let (mut center_mm, mut extent_mm) = ([0.0; 3], half_mm.map(|h| 2.0 * h));
        center_mm[axis] = [-1.0, 1.0][side] * half_mm[axis];
        extent_mm[axis] = 0.0;
        let (sign, name) = (["-", "+"][side], ["x", "y", "z"][axis]);
        Location { region: format!("{what} {sign}{name}"), center_mm, extent_mm }
    }
}
