//! Where something is in the sample.

use crate::specimen::{Specimen, TestKind};
use serde::{Deserialize, Serialize};

/// Where something is: a box in the undeformed sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
}
