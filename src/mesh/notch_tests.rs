//! Meshes of blocks with notches: they conform, fill the specimen, and follow their design.

use super::test_specimens::{Random, changed, specimen};
use super::{DesignVariable, Mesh, MeshOptions, mesh_specimen, mesh_specimen_along, morphed, shape_velocity};
use crate::specimen::{Hole, HoleAxis, Specimen, TestKind};

/// The published block with notches of every kind of place beside a hole.
fn notched() -> Specimen {
    let mut s = specimen(TestKind::DoubleLapShear, [25.4, 6.4, 19.1], HoleAxis::Thickness, &[[0.5, 0.5, 4.0]]);
    let notches = [([12.7, 1.0], 4.0), ([-13.2, -2.0], 5.0), ([5.0, 9.0], 3.0), ([-4.0, -9.55], 4.0)];
    s.holes.extend(notches.map(|(center, d)| Hole::notch(HoleAxis::Thickness, center, d)));
    s
}

fn mesh_of(s: &Specimen, factor: f64, use_mirror: bool) -> Mesh {
    let options = MeshOptions { use_mirror, ..MeshOptions::scaled(s, factor) };
    mesh_specimen(s, &options).unwrap_or_else(|e| panic!("{}: {e}", s.name))
}

#[test]
fn random_notches_conform() {
    let mut random = Random::new(11);
    let (mut mirrored, mut cases) = (0, 0);
    for case in 0..60 {
        let test = [TestKind::DoubleLapShear, TestKind::Uniaxial][random.below(2)];
        let axis = [HoleAxis::Thickness, HoleAxis::Width][random.below(2)];
        let mut s = specimen(test, [25.4, 6.4, 19.1], axis, &[]);
        let half = s.section_size().map(|extent| 0.5 * extent);
        let is_symmetric = random.below(2) == 0;
        for _ in 0..30 {
            let r = random.between(0.1, 0.4) * half[1];
            let (across, sign) = (random.below(2), [-1.0, 1.0][random.below(2)]);
            let mut center = [random.between(-0.8, 0.8) * half[0], random.between(-0.8, 0.8) * half[1]];
            center[across] = sign * (half[across] - random.between(-0.7, 0.45) * r);
            if across == 0 && random.below(2) == 0 {
                center[1] = 0.0;
            }
            let notch = Hole::notch(axis, center, 2.0 * r);
            let image = notch.mirrored([1.0, -1.0]);
            let before = s.holes.len();
            s.holes.push(notch);
            if is_symmetric && image.difference_mm(&notch) > 1e-9 {
                s.holes.push(image);
            }
            let is_clear = s.ligaments().iter().all(|l| l.length_mm > 0.08 * half[1]);
            if s.validate().is_err() || !is_clear || s.holes.len() > 5 {
                s.holes.truncate(before);
            }
        }
        s.name = format!("case {case}, {:?}", s.holes);
        for factor in [1.8, 1.0] {
            for use_mirror in [true, false] {
                let mesh = mesh_of(&s, factor, use_mirror);
                let checked = mesh.check(&s);
                assert!(checked.is_ok(), "{}: {checked:?}", s.name);
                assert!(mesh.quality().min_scaled_jacobian >= 0.2, "{}", s.name);
                let is_section_mirrored = if axis == HoleAxis::Width { mesh.mirror.y } else { mesh.mirror.z };
                mirrored += usize::from(is_section_mirrored);
                cases += s.holes.len();
            }
        }
    }
    println!("{cases} notches, {mirrored} mirrored sections");
    assert!(mirrored > 20 && cases > 300);
}

/// Lines that elements follow do not let the mesh into a notch.
#[test]
fn lines_leave_notches_open() {
    let s = notched();
    let line = [[-12.7, 6.0], [12.7, 6.0]];
    let mesh = mesh_specimen_along(&s, &MeshOptions::search(&s), &[line]).unwrap();
    assert_eq!(mesh.check(&s), Ok(()));
}

/// The morphed mesh passes the whole check of the changed specimen; the check allows 2.5e-6 mm, and a wall that changes
/// its depth or its radius leaves itself by about step²/r.
#[test]
fn the_morphed_mesh_is_a_mesh_of_the_changed_specimen() {
    use DesignVariable::*;
    let s = notched();
    let mesh = mesh_of(&s, 1.8, false);
    let mut variables = vec![BlockLength, BlockWidth, BlockThickness];
    for notch in 1..5 {
        variables.extend([HoleX(notch), HoleOther(notch), HoleDiameter(notch)]);
    }
    for variable in variables {
        let step = 1e-3;
        let moved = morphed(&mesh, &shape_velocity(&mesh, &s, variable), step);
        let result = moved.check(&changed(&s, variable, step));
        assert!(result.is_ok(), "{variable:?}: {result:?}");
    }
}

/// Along its side a notch moves rigidly, at any step; on the mirror plane its depth and its radius move it.
#[test]
fn notches_on_the_mirror_plane_move_with_it() {
    let mut s = specimen(TestKind::DoubleLapShear, [25.4, 6.4, 19.1], HoleAxis::Thickness, &[]);
    s.holes = [-12.7, 12.7].map(|x| Hole::notch(HoleAxis::Thickness, [x, 0.0], 5.0)).to_vec();
    let mesh = mesh_of(&s, 1.4, true);
    assert!(mesh.mirror.z);
    assert_eq!(mesh.check(&s), Ok(()));
    for variable in [DesignVariable::HoleX(0), DesignVariable::HoleDiameter(1), DesignVariable::BlockLength] {
        let moved = morphed(&mesh, &shape_velocity(&mesh, &s, variable), 1e-3);
        let result = moved.check(&changed(&s, variable, 1e-3));
        assert!(result.is_ok(), "{variable:?}: {result:?}");
    }
    let whole = notched();
    let mesh = mesh_of(&whole, 1.8, false);
    let velocity = shape_velocity(&mesh, &whole, DesignVariable::HoleX(3));
    let moved = morphed(&mesh, &velocity, 0.3);
    assert_eq!(moved.check(&changed(&whole, DesignVariable::HoleX(3), 0.3)), Ok(()));
}

#[test]
fn volume_derivatives_are_the_closed_forms() {
    use DesignVariable::*;
    let s = notched();
    let mesh = mesh_of(&s, 1.0, false);
    let [length, thickness, width] = [25.4, 6.4, 19.1];
    let notch = |i: usize| s.notch_of(&s.holes[i]).unwrap();
    let mouth = |i: usize| 2.0 * notch(i).half_mouth_mm();
    let arc = |i: usize| 2.0 * notch(i).radius_mm * notch(i).half_angle();
    for (variable, area_rate) in [
        // Outwards, material grows by the mouth.
        (HoleX(1), mouth(1)),
        (HoleX(2), -mouth(2)),
        (HoleOther(3), mouth(3)),
        (HoleOther(1), 0.0),
        (HoleDiameter(1), -0.5 * arc(1)),
        (HoleDiameter(2), -0.5 * arc(2)),
        (HoleDiameter(3), -0.5 * arc(3)),
        (BlockLength, width - 0.5 * (mouth(1) + mouth(2))),
        (BlockWidth, length - 0.5 * (mouth(3) + mouth(4))),
    ] {
        let velocity = shape_velocity(&mesh, &s, variable);
        let step = 1e-4;
        let [ahead, behind] = [step, -step].map(|t| morphed(&mesh, &velocity, t).volume());
        let (rate, expected) = ((ahead - behind) / (2.0 * step), thickness * area_rate);
        // Quadratic parts of 30° miss 1e-4 of a circle's area.
        assert!((rate - expected).abs() < 1e-3 * expected.abs() + 1e-6, "{variable:?}: {rate} {expected}");
    }
}
