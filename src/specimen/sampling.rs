//! Random specimens for tests.

use super::{Block, Hole, HoleAxis, HoleKind, HoleShape, Outline, Specimen, TestKind, dumbbell};
use proptest::prelude::*;

/// Any arrangement of up to seven holes in a block, valid or not.
pub(crate) fn any_layout() -> impl Strategy<Value = Specimen> {
    let kind = prop_oneof![2 => Just(None), 1 => Just(Some(HoleKind::Ellipse)), 1 => Just(Some(HoleKind::Slot))];
    let hole = (-0.6..0.6, -0.6..0.6, 0.02..0.4, kind, 1.0..4.0, -180.0..180.0);
    let sizes = (5.0..60.0, 2.0..12.0, 4.0..30.0);
    (sizes, prop::collection::vec(hole, 0..8), any::<bool>(), any::<bool>()).prop_map(
        |((length_mm, thickness_mm, width_mm), holes, is_along_width, is_shear)| {
            let axis = if is_along_width { HoleAxis::Width } else { HoleAxis::Thickness };
            let lateral = if is_along_width { thickness_mm } else { width_mm };
            let place = |(x, b, d, kind, aspect, angle_deg): (f64, f64, f64, Option<HoleKind>, f64, f64)| {
                let diameter_mm = 0.1 + d * lateral / kind.map_or(1.0, |_| aspect);
                let shape = kind.map(|kind| HoleShape { kind, length_mm: aspect * diameter_mm, angle_deg });
                Hole { axis, center_mm: [x * length_mm, b * lateral], diameter_mm, shape }
            };
            Specimen {
                name: "random layout".into(),
                test: if is_shear { TestKind::DoubleLapShear } else { TestKind::Uniaxial },
                block: Block { length_mm, thickness_mm, width_mm },
                outline: Outline::Block,
                holes: holes.into_iter().map(place).collect(),
                drive_mm: vec![0.3 * thickness_mm, thickness_mm],
                drive_angle_deg: 0.0,
                samples_in_parallel: 2,
                other_samples: Vec::new(),
            }
        },
    )
}

/// A valid block: holes that would make it invalid are left out, in order.
pub(crate) fn valid_specimen() -> impl Strategy<Value = Specimen> {
    any_layout().prop_map(|layout| {
        let mut specimen = Specimen { holes: Vec::new(), ..layout.clone() };
        // A uniaxial block shorter than half its drive would exceed the stretch limit.
        specimen.drive_mm = vec![0.3 * specimen.drive_limit_mm()];
        for hole in layout.holes {
            specimen.holes.push(hole);
            if specimen.validate().is_err() {
                specimen.holes.pop();
            }
        }
        specimen
    })
}

/// A dumb-bell with one hole that may lie anywhere.
pub(crate) fn dumbbell_with_hole() -> impl Strategy<Value = Specimen> {
    (-17.0..17.0, -2.5..2.5, 0.1..1.5).prop_map(|(x, z, diameter_mm): (f64, f64, f64)| Specimen {
        name: "dumb-bell".into(),
        test: TestKind::Uniaxial,
        block: Block {
            length_mm: dumbbell::LENGTH_MM,
            thickness_mm: dumbbell::THICKNESS_MM,
            width_mm: dumbbell::END_WIDTH_MM,
        },
        outline: Outline::Iso37Type4,
        holes: vec![Hole::circle(HoleAxis::Thickness, [x, z], diameter_mm)],
        drive_mm: vec![5.0],
        drive_angle_deg: 0.0,
        samples_in_parallel: 1,
        other_samples: Vec::new(),
    })
}
