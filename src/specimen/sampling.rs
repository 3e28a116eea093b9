//! Random specimens for tests.

use super::dumbbell::{ISO37_LENGTH_MM, ISO37_THICKNESS_MM, ISO37_WIDTH_MM};
use super::{Block, Dumbbell, Hole, HoleAxis, HoleKind, HoleShape, Outline, Specimen, TestKind};
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
                Hole { axis, center_mm: [x * length_mm, b * lateral], diameter_mm, shape, is_notch: false }
            };
            Specimen {
                name: "random layout".into(),
                test: if is_shear { TestKind::DoubleLapShear } else { TestKind::Uniaxial },
                block: Block::new(length_mm, thickness_mm, width_mm),
                outline: Outline::Block,
                holes: holes.into_iter().map(place).collect(),
                drive_mm: vec![0.3 * thickness_mm, thickness_mm],
                drive_angle_deg: 0.0,
                precompression_mm: 0.0,
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

/// A valid wedge with holes along its thickness.
pub(crate) fn valid_wedge() -> impl Strategy<Value = Specimen> {
    (valid_specimen(), 0.05..1.0, any::<bool>()).prop_map(|(mut specimen, part, is_thin_at_plus)| {
        specimen.test = TestKind::DoubleLapShear;
        if specimen.hole_axis() == Some(HoleAxis::Width) {
            specimen.holes.clear();
        }
        let sign = if is_thin_at_plus { -1.0 } else { 1.0 };
        specimen.block.wedge_mm = sign * part * specimen.block.wedge_limit_mm(super::MIN_SIZE_MM);
        specimen.drive_mm = vec![0.3 * specimen.drive_limit_mm()];
        specimen
    })
}

/// A dumb-bell, the standard's or one with a gauge of its own, with one hole that may lie anywhere.
pub(crate) fn dumbbell_with_hole() -> impl Strategy<Value = Specimen> {
    (free_dumbbell(), any::<bool>(), -0.5..0.5, -0.4..0.4, 0.02..0.25).prop_map(
        |(free, is_standard, x, z, diameter): (Specimen, bool, f64, f64, f64)| {
            let standard = Block::new(ISO37_LENGTH_MM, ISO37_THICKNESS_MM, ISO37_WIDTH_MM);
            let (block, outline) =
                if is_standard { (standard, Outline::Iso37Type4) } else { (free.block, free.outline) };
            let center_mm = [x * block.length_mm, z * block.width_mm];
            let diameter_mm = (diameter * block.width_mm).max(0.1);
            let holes = vec![Hole::circle(HoleAxis::Thickness, center_mm, diameter_mm)];
            Specimen { block, outline, holes, ..free }
        },
    )
}

/// Any dumb-bell that can be drawn, without holes.
pub(crate) fn free_dumbbell() -> impl Strategy<Value = Specimen> {
    let sizes = (4.0..30.0, 1.0..8.0, 0.0..1.0, 0.0..1.0);
    (sizes, 0.0..1.0, 0.0..1.0).prop_map(|((width_mm, thickness_mm, width, radius), gauge, tabs)| {
        let gauge_width_mm = (0.13_f64 + 0.84 * width) * width_mm;
        let steepest_mm: f64 = 0.5 * (width_mm - gauge_width_mm);
        let fillet_radius_mm = f64::max(steepest_mm * (1.0 + 6.0 * radius * radius), 0.1);
        let gauge_length_mm = 0.2 + 0.1 * gauge_width_mm + 2.0_f64 * gauge * width_mm;
        let dumbbell = Dumbbell { gauge_width_mm, gauge_length_mm, fillet_radius_mm };
        let mut specimen = Specimen {
            name: "dumb-bell".into(),
            test: TestKind::Uniaxial,
            block: Block::new(1.0, thickness_mm, width_mm),
            outline: Outline::Dumbbell(dumbbell),
            holes: Vec::new(),
            drive_mm: vec![1.0],
            drive_angle_deg: 0.0,
            precompression_mm: 0.0,
            samples_in_parallel: 1,
            other_samples: Vec::new(),
        };
        // The shortest block that it fits in, or one with longer ends.
        let shortest_mm = dumbbell.misfits([1.0, width_mm]).iter().map(|m| m.min_mm).fold(0.0, f64::max);
        specimen.block.length_mm = shortest_mm.max(1.0) + 2.0 * tabs * width_mm;
        specimen
    })
}
