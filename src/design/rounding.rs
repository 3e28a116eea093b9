//! Designs in the steps that a mould maker works to.

use super::explore::is_makeable;
use crate::specimen::{Block, Hole, MIRROR_TOLERANCE_MM, ManufacturingLimits, Specimen};

/// The step where limits state none, mm.
const USUAL_STEP_MM: f64 = 0.1;

/// The step in which dimensions are made, mm.
pub(super) fn made_in_steps_of(limits: &ManufacturingLimits) -> f64 {
    limits.dimension_step_mm.unwrap_or(USUAL_STEP_MM)
}

/// The design nearest to `specimen` whose dimensions, places and drive are multiples of the limits' step, whose angles
/// are whole degrees, and that can be made: holes are smaller by up to two steps where the nearest ones come too close
/// to something. Punches keep their diameters. `None` where no such design can be made.
pub(super) fn in_steps(specimen: &Specimen, limits: &ManufacturingLimits, voxel_mm: [f64; 3]) -> Option<Specimen> {
    let step = made_in_steps_of(limits);
    let nearest = |value: f64| multiple(step, (value / step).round());
    let mut rounded = specimen.clone();
    rounded.drive_mm.iter_mut().for_each(|d| *d = nearest(*d));
    // Towards none: rounded up, the largest would be beyond what a specimen allows.
    rounded.precompression_mm = multiple(step, (rounded.precompression_mm / step).trunc());
    if let Some(gauge) = rounded.outline.free_gauge_mut() {
        for length in [&mut gauge.gauge_width_mm, &mut gauge.gauge_length_mm] {
            *length = nearest(*length);
        }
        // Rounded up, the sides stay no steeper than they may be.
        gauge.fillet_radius_mm = multiple(step, (gauge.fillet_radius_mm / step - 1e-9).ceil());
    }
    for (block, holes) in shapes_of(&mut rounded) {
        let drawn = *block;
        for length in [&mut block.length_mm, &mut block.thickness_mm, &mut block.width_mm] {
            *length = nearest(*length);
        }
        for hole in holes.iter_mut() {
            hole.center_mm =
                if hole.is_notch { notch_center(hole, &drawn, block, nearest) } else { hole.center_mm.map(nearest) };
            hole.shape.iter_mut().for_each(|shape| shape.angle_deg = shape.angle_deg.round());
        }
    }
    if limits.punches_mm.is_some() {
        for (_, holes) in shapes_of(&mut rounded) {
            for hole in holes.iter_mut() {
                let width = hole.diameter_mm;
                hole.shape.iter_mut().for_each(|shape| shape.length_mm = nearest(shape.length_mm).max(width));
            }
        }
        return Some(rounded).filter(|s| is_makeable(s, limits, voxel_mm));
    }
    let with_diameters = |of: &dyn Fn(f64) -> f64| {
        let mut made = rounded.clone();
        for (_, holes) in shapes_of(&mut made) {
            for hole in holes.iter_mut() {
                hole.diameter_mm = multiple(step, of(hole.diameter_mm / step));
                // Rounded as well, a hole as long as wide stays as long as wide.
                if let Some(shape) = &mut hole.shape {
                    shape.length_mm = multiple(step, of(shape.length_mm / step)).max(hole.diameter_mm);
                }
            }
        }
        made
    };
    let smaller_by = |steps: f64| with_diameters(&move |d: f64| (d + 1e-9).floor() - steps);
    [with_diameters(&f64::round), smaller_by(0.0), smaller_by(1.0), smaller_by(2.0)]
        .into_iter()
        .find(|s| is_makeable(s, limits, voxel_mm))
}

/// The centre of a notch in steps: on the side of the block as rounded, where it was on that of the block as drawn.
pub(super) fn notch_center(hole: &Hole, drawn: &Block, rounded: &Block, nearest: impl Fn(f64) -> f64) -> [f64; 2] {
    let [before, after] = [drawn, rounded].map(|block| hole.axis.section_of(block));
    [0, 1].map(|c| {
        let value = hole.center_mm[c];
        let is_on_side = (value.abs() - 0.5 * before[c]).abs() < MIRROR_TOLERANCE_MM;
        if is_on_side { 0.5 * after[c] * value.signum() } else { nearest(value) }
    })
}

/// Block and holes of every sample.
pub(super) fn shapes_of(specimen: &mut Specimen) -> impl Iterator<Item = (&mut Block, &mut Vec<Hole>)> {
    let Specimen { block, holes, other_samples, .. } = specimen;
    std::iter::once((block, holes)).chain(other_samples.iter_mut().map(|s| (&mut s.block, &mut s.holes)))
}

/// `count` steps, without the last digit that a product of a decimal fraction leaves.
pub(super) fn multiple(step: f64, count: f64) -> f64 {
    let per_mm = (1.0 / step).round();
    if (per_mm * step - 1.0).abs() < 1e-12 { count / per_mm } else { count * step }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::specimen::HoleAxis;

    fn published() -> (Specimen, ManufacturingLimits) {
        let specimen = Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).expect("a specimen");
        let limits = r#"{ "min_ligament_hole_hole_mm": 1.5, "min_ligament_hole_edge_mm": 1.2, "diameter_mm": { "min": 2, "max": 8 } }"#;
        (specimen, ManufacturingLimits::from_json(limits).expect("limits"))
    }

    #[test]
    fn every_dimension_is_a_multiple() {
        let (mut specimen, limits) = published();
        specimen.block.length_mm = 28.6613;
        specimen.drive_mm = vec![6.9999];
        let made = in_steps(&specimen, &limits, [1.0; 3]).expect("it can be made");
        assert_eq!(made.block.length_mm, 28.7);
        assert_eq!(made.drive_mm, [7.0]);
        assert_eq!(made.holes[0].center_mm, [-4.2, 0.0]);
        assert_eq!(made.holes[1].center_mm, [4.2, 0.0]);
        assert_eq!(made.holes[0].diameter_mm, 5.0);
    }

    /// A notch stays on its side although half of a multiple is none.
    #[test]
    fn notches_stay_on_their_sides() {
        let (mut specimen, limits) = published();
        specimen.block.length_mm = 28.5413;
        specimen.holes = [-1.0, 1.0].map(|s| Hole::notch(HoleAxis::Thickness, [s * 0.5 * 28.5413, 0.0], 4.02)).to_vec();
        let made = in_steps(&specimen, &limits, [1.0; 3]).expect("it can be made");
        assert_eq!(made.block.length_mm, 28.5);
        assert_eq!([made.holes[0].center_mm, made.holes[1].center_mm], [[-14.25, 0.0], [14.25, 0.0]]);
        assert_eq!(made.holes[0].diameter_mm, 4.0);
    }

    /// Lengths are multiples too, angles whole degrees, and no hole becomes wider than long.
    #[test]
    fn outlines_are_rounded() {
        use crate::specimen::{HoleKind, HoleShape};
        let (mut specimen, limits) = published();
        let shape = HoleShape { kind: HoleKind::Slot, length_mm: 6.4449, angle_deg: 29.6 };
        specimen.holes[0].shape = Some(shape);
        specimen.holes[1].shape = Some(HoleShape { length_mm: 5.0 + 1e-6, angle_deg: -0.2, ..shape });
        let made = in_steps(&specimen, &limits, [1.0; 3]).expect("it can be made");
        let of = |i: usize| made.holes[i].shape.map(|s| (s.length_mm, s.angle_deg));
        assert_eq!((of(0), of(1)), (Some((6.4, 30.0)), Some((5.0, -0.0))));
    }

    /// A ligament at its limit is not rounded away: the holes give way.
    #[test]
    fn ligaments_are_kept() {
        let (mut specimen, limits) = published();
        // 1.5 mm between the holes as drawn; places rounded inwards would leave 1.42.
        let [a, b] = [-3.2449, 3.2449].map(|x| Hole::circle(HoleAxis::Thickness, [x, 0.0], 4.9898));
        specimen.holes = vec![a, b];
        let made = in_steps(&specimen, &limits, [1.0; 3]).expect("it can be made");
        assert!(made.holes.iter().all(|h| h.diameter_mm < 4.95), "{:?}", made.holes);
        assert!(is_makeable(&made, &limits, [1.0; 3]));
    }
}
