//! Meshes around holes that are not circles: they conform, fill the specimen, and follow their design.

use super::test_specimens::{Random, changed, specimen};
use super::{DesignVariable, ElementKind, Mesh, MeshOptions, mesh_specimen, morphed, shape_velocity};
use crate::specimen::{Hole, HoleAxis, HoleKind, HoleShape, Specimen, TestKind};
use std::f64::consts::PI;

const KINDS: [HoleKind; 2] = [HoleKind::Ellipse, HoleKind::Slot];

fn hole(kind: HoleKind, [x, b]: [f64; 2], [length_mm, diameter_mm]: [f64; 2], angle_deg: f64) -> Hole {
    let shape = Some(HoleShape { kind, length_mm, angle_deg });
    Hole { axis: HoleAxis::Thickness, center_mm: [x, b], diameter_mm, shape, is_notch: false }
}

/// The published block with two holes of a kind.
fn block(kind: HoleKind, size: [f64; 2], angles: [f64; 2]) -> Specimen {
    let mut block = specimen(TestKind::DoubleLapShear, [25.4, 6.4, 19.1], HoleAxis::Thickness, &[]);
    block.holes = vec![hole(kind, [-5.5, 0.5], size, angles[0]), hole(kind, [5.5, -1.0], size, angles[1])];
    block.name = format!("{kind:?} {size:?} at {angles:?}");
    block
}

fn whole(specimen: &Specimen, factor: f64, force_prisms: bool) -> Mesh {
    let options = MeshOptions { use_mirror: false, force_prisms, ..MeshOptions::scaled(specimen, factor) };
    mesh_specimen(specimen, &options).unwrap_or_else(|e| panic!("{}: {e}", specimen.name))
}

#[test]
fn random_outlines_conform() {
    let mut random = Random::new(5);
    let (mut quads, mut prisms) = (0, 0);
    for case in 0..50 {
        let kind = KINDS[random.below(2)];
        let count = 1 + random.below(3);
        let mut s = block(kind, [4.0, 4.0], [0.0; 2]);
        s.test = [TestKind::DoubleLapShear, TestKind::Uniaxial][random.below(2)];
        let axis = [HoleAxis::Thickness, HoleAxis::Width][random.below(2)];
        let scale = if axis == HoleAxis::Width { 0.3 } else { 1.0 };
        s.holes.clear();
        for _ in 0..40 {
            let width = scale * random.between(1.5, 4.0);
            let size = [width * random.between(1.0, 3.0), width];
            let place = [random.between(-9.0, 9.0), scale * random.between(-7.0, 7.0)];
            let angle = [random.between(-90.0, 90.0), 0.0, 90.0, -45.0][random.below(4)];
            s.holes.push(Hole { axis, ..hole(kind, place, size, angle) });
            let is_clear = s.ligaments().iter().all(|l| l.length_mm > 0.5 * scale);
            if !is_clear || s.holes.len() > count {
                s.holes.pop();
            }
        }
        s.name = format!("case {case}, {:?}", s.holes);
        for factor in [1.8, 1.0] {
            for use_mirror in [true, false] {
                let options = MeshOptions { use_mirror, ..MeshOptions::scaled(&s, factor) };
                let mesh = mesh_specimen(&s, &options).unwrap_or_else(|e| panic!("{}: {e}", s.name));
                let checked = mesh.check(&s);
                assert!(checked.is_ok(), "{}: {checked:?}", s.name);
                assert!(mesh.quality().min_scaled_jacobian >= 0.2, "{}", s.name);
                *(if mesh.element_kind == ElementKind::Hex27 { &mut quads } else { &mut prisms }) += 1;
            }
        }
    }
    println!("{quads} hexahedral, {prisms} prismatic");
    // Slots that lie oblique to each other have no cells of quadrilaterals; most layouts do.
    assert!(quads > prisms);
}

/// Upright holes on a mirror plane are halved, turned ones are not; a hole and its image may be turned.
#[test]
fn mirrors_ask_for_upright_holes() {
    for kind in KINDS {
        for (angle, is_halved) in [(0.0, true), (90.0, true), (180.0, true), (20.0, false)] {
            let mut s = block(kind, [5.0, 3.0], [angle; 2]);
            s.holes.iter_mut().for_each(|h| h.center_mm[1] = 0.0);
            for force_prisms in [false, true] {
                let options = MeshOptions { force_prisms, ..MeshOptions::search(&s) };
                let mesh = mesh_specimen(&s, &options).unwrap();
                assert_eq!(mesh.mirror.z, is_halved, "{kind:?} {angle}");
                mesh.check(&s).unwrap();
            }
        }
        let mut pair = block(kind, [5.0, 3.0], [25.0, -25.0]);
        (pair.holes[0].center_mm, pair.holes[1].center_mm) = ([2.0, 4.5], [2.0, -4.5]);
        let mesh = mesh_specimen(&pair, &MeshOptions::search(&pair)).unwrap();
        assert!(mesh.mirror.z);
        mesh.check(&pair).unwrap();
    }
}

/// The volume comes to the block less the exact holes with the order of quadratic curves through exact middles.
#[test]
fn volumes_converge_to_the_closed_form() {
    for kind in KINDS {
        let s = block(kind, [6.0, 3.0], [30.0, 90.0]);
        let hole_area = match kind {
            HoleKind::Ellipse => PI * 3.0 * 1.5,
            HoleKind::Slot => PI * 1.5 * 1.5 + 3.0 * 3.0,
        };
        let exact = (25.4 * 19.1 - 2.0 * hole_area) * 6.4;
        // One more rounding per term.
        assert!((s.volume_mm3() - exact).abs() < 1e-9);
        for force_prisms in [false, true] {
            let error = |segments: usize, size: f64| {
                let options = MeshOptions {
                    hole_segments: segments,
                    section_size_mm: size,
                    force_prisms,
                    ..MeshOptions::standard(&s)
                };
                (mesh_specimen(&s, &options).unwrap().volume() - exact).abs() / exact
            };
            let (coarse, fine) = (error(10, 2.0), error(40, 0.5));
            println!("{kind:?}, prisms {force_prisms}: {coarse:e} {fine:e}");
            // Fourth order would give 256 and second order 16 for four times as many equal parts; where no corner
            // stands at the end of a slot's straight line, third.
            assert!(fine < 2e-6 && coarse / fine > 24.0, "{}: {coarse:e} {fine:e}", s.name);
        }
    }
}

/// The morphed mesh passes the whole check of the changed specimen, at steps of any size but for the angle: a turn
/// moves the wall off itself by the square of the step (1e-7 mm at a hundredth of a degree), which the check allows.
#[test]
fn the_morphed_mesh_is_a_mesh_of_the_changed_specimen() {
    use DesignVariable::*;
    for kind in KINDS {
        let s = block(kind, [6.0, 3.0], [25.0, -70.0]);
        for force_prisms in [false, true] {
            let mesh = whole(&s, 1.8, force_prisms);
            for (variable, step) in [
                (HoleX(0), 0.05),
                (HoleOther(1), 0.05),
                (HoleDiameter(0), 0.05),
                (HoleLength(1), 0.05),
                (HoleAngle(0), 0.01),
                (BlockLength, 0.05),
                (BlockWidth, 0.05),
            ] {
                let moved = morphed(&mesh, &shape_velocity(&mesh, &s, variable), step);
                let result = moved.check(&changed(&s, variable, step));
                assert!(result.is_ok(), "{variable:?} of {}: {result:?}", s.name);
            }
        }
    }
}

/// In a mirrored mesh a hole and its image move together, turned against each other; a hole on the plane does not turn.
#[test]
fn mirrored_pairs_turn_against_each_other() {
    use DesignVariable::{HoleAngle, HoleLength};
    for kind in KINDS {
        let mut s = block(kind, [5.0, 3.0], [25.0, -25.0]);
        (s.holes[0].center_mm, s.holes[1].center_mm) = ([2.0, 4.5], [2.0, -4.5]);
        s.holes.push(hole(kind, [-6.0, 0.0], [4.0, 3.0], 90.0));
        let mesh = mesh_specimen(&s, &MeshOptions::search(&s)).unwrap();
        assert!(mesh.mirror.z);
        for (first, second, sign, step) in
            [(HoleLength(0), HoleLength(1), 1.0, 0.1), (HoleAngle(0), HoleAngle(1), -1.0, 0.01)]
        {
            let [v, w] = [first, second].map(|variable| shape_velocity(&mesh, &s, variable));
            let moved = morphed(&morphed(&mesh, &v, step), &w, sign * step);
            moved.check(&changed(&changed(&s, first, step), second, sign * step)).unwrap();
        }
        assert!(shape_velocity(&mesh, &s, HoleAngle(2)).iter().flatten().all(|v| *v == 0.0));
    }
}

#[test]
fn volume_derivatives_are_the_closed_forms() {
    use DesignVariable::{HoleAngle, HoleDiameter, HoleLength};
    let [length, width] = [6.0, 3.0];
    for kind in KINDS {
        let s = block(kind, [length, width], [25.0, -70.0]);
        let mesh = whole(&s, 1.0, false);
        let [along, across] = match kind {
            HoleKind::Ellipse => [0.25 * PI * width, 0.25 * PI * length],
            HoleKind::Slot => [width, length + (0.5 * PI - 2.0) * width],
        };
        for (variable, area_rate) in [(HoleLength(0), along), (HoleDiameter(1), across), (HoleAngle(0), 0.0)] {
            let velocity = shape_velocity(&mesh, &s, variable);
            let step = 1e-4;
            let [ahead, behind] = [step, -step].map(|t| morphed(&mesh, &velocity, t).volume());
            let (rate, expected) = ((ahead - behind) / (2.0 * step), -6.4 * area_rate);
            // Quadratic parts of 30° miss 1e-4 of a circle's area, those at the ends of straight lines about ten times
            // as much of their own.
            assert!((rate - expected).abs() < 2e-3 * expected.abs() + 1e-6, "{kind:?} {variable:?}: {rate} {expected}");
        }
    }
}
