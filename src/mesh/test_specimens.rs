//! Specimens and random numbers for the mesh tests.

use super::DesignVariable;
use crate::specimen::{Block, Dumbbell, Hole, HoleAxis, Outline, Specimen, TestKind};

/// A block with holes (first, second coordinate, diameter).
pub(super) fn specimen(test: TestKind, extents: [f64; 3], axis: HoleAxis, holes: &[[f64; 3]]) -> Specimen {
    let [length_mm, thickness_mm, width_mm] = extents;
    Specimen {
        name: format!("{test:?} {extents:?} {axis:?} {holes:?}"),
        test,
        block: Block::new(length_mm, thickness_mm, width_mm),
        outline: Outline::Block,
        holes: holes.iter().map(|h| Hole::circle(axis, [h[0], h[1]], h[2])).collect(),
        drive_mm: vec![1.0],
        drive_angle_deg: 0.0,
        precompression_mm: 0.0,
        samples_in_parallel: 1,
        other_samples: Vec::new(),
    }
}

const SHEAR_BLOCK: [f64; 3] = [25.4, 6.4, 19.1];

pub(super) fn solid() -> Specimen {
    specimen(TestKind::DoubleLapShear, SHEAR_BLOCK, HoleAxis::Thickness, &[])
}

pub(super) fn two_holes() -> Specimen {
    let holes = [[-4.2333, 0.0, 5.0], [4.2333, 0.0, 5.0]];
    specimen(TestKind::DoubleLapShear, SHEAR_BLOCK, HoleAxis::Thickness, &holes)
}

pub(super) fn off_axis() -> Specimen {
    let holes = [[-5.0, 3.0, 4.0], [4.0, -2.0, 5.0], [6.0, 5.5, 3.0]];
    specimen(TestKind::DoubleLapShear, SHEAR_BLOCK, HoleAxis::Thickness, &holes)
}

pub(super) fn width_holes() -> Specimen {
    let holes = [[-6.0, 0.4, 3.0], [0.0, -0.5, 4.0], [6.5, 0.0, 2.0]];
    specimen(TestKind::DoubleLapShear, SHEAR_BLOCK, HoleAxis::Width, &holes)
}

pub(super) fn bar() -> Specimen {
    specimen(TestKind::Uniaxial, [40.0, 4.0, 12.0], HoleAxis::Thickness, &[[0.0, 0.0, 4.0]])
}

pub(super) fn dumbbell() -> Specimen {
    let mut dumbbell = specimen(TestKind::Uniaxial, [35.0, 2.0, 6.0], HoleAxis::Thickness, &[]);
    dumbbell.outline = Outline::Iso37Type4;
    dumbbell
}

/// A dumb-bell with a short gauge.
pub(super) fn free_dumbbell() -> Specimen {
    let mut free = specimen(TestKind::Uniaxial, [40.0, 4.0, 12.0], HoleAxis::Thickness, &[]);
    let gauge = Dumbbell { gauge_width_mm: 6.0, gauge_length_mm: 8.0, fillet_radius_mm: 5.0 };
    free.outline = Outline::Dumbbell(gauge);
    free
}

/// SplitMix64: a fixed sequence per seed.
pub(super) struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Random(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn below(&mut self, n: u64) -> usize {
        (self.next() % n) as usize
    }
}

/// A specimen with one of its sizes larger by `step`, mm or degrees.
pub(super) fn changed(specimen: &Specimen, variable: DesignVariable, step: f64) -> Specimen {
    let mut s = specimen.clone();
    match variable {
        DesignVariable::HoleX(i) => s.holes[i].center_mm[0] += step,
        DesignVariable::HoleOther(i) => s.holes[i].center_mm[1] += step,
        DesignVariable::HoleDiameter(i) => s.holes[i].diameter_mm += step,
        DesignVariable::HoleLength(i) => s.holes[i].shape.iter_mut().for_each(|shape| shape.length_mm += step),
        DesignVariable::HoleAngle(i) => s.holes[i].shape.iter_mut().for_each(|shape| shape.angle_deg += step),
        DesignVariable::BlockLength => s.block.length_mm += step,
        DesignVariable::BlockThickness => s.block.thickness_mm += step,
        DesignVariable::BlockWidth => s.block.width_mm += step,
        DesignVariable::GaugeWidth | DesignVariable::GaugeLength | DesignVariable::FilletRadius => {
            if let Some(gauge) = s.outline.free_gauge_mut() {
                match variable {
                    DesignVariable::GaugeWidth => gauge.gauge_width_mm += step,
                    DesignVariable::GaugeLength => gauge.gauge_length_mm += step,
                    _ => gauge.fillet_radius_mm += step,
                }
            }
        }
    }
    s
}
