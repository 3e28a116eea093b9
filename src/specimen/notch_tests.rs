use super::*;
use crate::specimen::{Block, DrawingError, Outline, SpecimenError, to_dxf, to_step, to_stl, to_svg};

/// A block with notches (section coordinates of the centre, diameter).
pub(crate) fn notched(notches: &[([f64; 2], f64)]) -> Specimen {
    Specimen {
        name: "notched".into(),
        test: TestKind::DoubleLapShear,
        block: Block::new(25.4, 6.4, 19.1),
        outline: Outline::Block,
        holes: notches.iter().map(|&(center, d)| Hole::notch(HoleAxis::Thickness, center, d)).collect(),
        drive_mm: vec![4.0],
        drive_angle_deg: 0.0,
        precompression_mm: 0.0,
        samples_in_parallel: 2,
        other_samples: Vec::new(),
    }
}

/// Notches on, outside and inside of all four sides.
fn everywhere() -> Specimen {
    notched(&[([12.7, 0.0], 4.0), ([-13.2, 1.0], 5.0), ([3.0, 9.55], 3.0), ([-4.0, -9.0], 4.0)])
}

/// The cut area against counting points of the section, and the mouth on both the side and the wall.
#[test]
fn areas_and_mouths_are_those_of_the_cut_circles() {
    let specimen = everywhere();
    specimen.validate().unwrap();
    for hole in &specimen.holes {
        let notch = specimen.notch_of(hole).unwrap();
        let (axis, sign) = notch.side.axis_and_sign();
        let side = 0.5 * sign * specimen.section_size()[axis];
        for (end, angle) in notch.mouth_mm().into_iter().zip(notch.wall_angles()) {
            let on_wall = hole.wall().point_at(angle);
            assert!((end[axis] - side).abs() < 1e-12, "{notch:?}");
            assert!((0..2).all(|c| (end[c] - on_wall[c]).abs() < 1e-9), "{notch:?} {end:?} {on_wall:?}");
        }
        // Chords of the circle along x by the midpoint rule; its error is (h/r)^1.5 of the area where a chord ends.
        let (n, r, half) = (200_000, notch.radius_mm, specimen.section_size().map(|e| 0.5 * e));
        let step = 2.0 * r / f64::from(n);
        let area: f64 = (0..n)
            .map(|i| hole.center_mm[0] - r + (f64::from(i) + 0.5) * step)
            .filter(|x| x.abs() <= half[0])
            .filter_map(|x| hole.wall().chord_mm(x))
            .map(|[low, high]| (high.min(half[1]) - low.max(-half[1])).max(0.0) * step)
            .sum();
        assert!((area - notch.area_mm2()).abs() < 1e-4, "{notch:?}: {area} {}", notch.area_mm2());
    }
    let whole = 25.4 * 19.1;
    let cut: f64 = specimen.holes.iter().map(|hole| specimen.hole_area_mm2(hole)).sum();
    assert!((specimen.volume_mm3() - 6.4 * (whole - cut)).abs() < 1e-9);
    // Half a disc where the centre lies on the side.
    assert!((specimen.hole_area_mm2(&specimen.holes[0]) - 0.5 * PI * 4.0).abs() < 1e-12);
}

/// Every way in which a notch is none is told, with what to change.
#[test]
fn what_is_no_notch_is_refused() {
    let problem_of = |specimen: &Specimen| match specimen.validate() {
        Err(SpecimenError::BadNotch { hole: 0, problem }) => Some(problem),
        other => panic!("{other:?}"),
    };
    let mut specimen = notched(&[([8.0, 0.0], 4.0)]);
    let Some(NotchProblem::Depth([inset, low, high])) = problem_of(&specimen) else { panic!() };
    assert!((inset - 4.7).abs() < 1e-12 && (low + 1.6).abs() < 1e-12 && (high - 1.0).abs() < 1e-12);
    specimen.holes[0].center_mm = [14.5, 0.0];
    assert!(matches!(problem_of(&specimen), Some(NotchProblem::Depth(_))));
    specimen = notched(&[([12.7, 0.0], 4.0)]);
    specimen.validate().unwrap();
    specimen.test = TestKind::Uniaxial;
    assert_eq!(problem_of(&specimen), Some(NotchProblem::BondedSide(SectionEdge::PlusX)));
    specimen = notched(&[([0.0, 3.2], 3.0)]);
    specimen.holes[0].axis = HoleAxis::Width;
    assert_eq!(problem_of(&specimen), Some(NotchProblem::BondedSide(SectionEdge::PlusLateral)));
    specimen = notched(&[([12.7, 0.0], 4.0)]);
    let kind = crate::specimen::HoleKind::Slot;
    specimen.holes[0].shape = Some(crate::specimen::HoleShape { kind, length_mm: 5.0, angle_deg: 0.0 });
    assert_eq!(problem_of(&specimen), Some(NotchProblem::NotRound));
    // A notch too near to a corner, and two that overlap, are ligaments as those of holes are.
    assert!(matches!(notched(&[([12.7, 8.5], 4.0)]).validate(), Err(SpecimenError::HoleOutside { .. })));
    let overlapping = notched(&[([12.7, 1.0], 4.0), ([12.7, -1.0], 4.0)]);
    assert!(matches!(overlapping.validate(), Err(SpecimenError::HolesOverlap { .. })));
    // Without the mark the hole reaches outside.
    let mut unmarked = notched(&[([12.7, 0.0], 4.0)]);
    unmarked.holes[0].is_notch = false;
    assert!(matches!(unmarked.validate(), Err(SpecimenError::HoleOutside { .. })));
}

/// A file says what is a notch and nothing where there is none, and comes back the same.
#[test]
fn files_keep_notches() {
    let specimen = everywhere();
    let text = specimen.to_json();
    assert!(text.contains("\"is_notch\": true"));
    assert_eq!(Specimen::from_json(&text).unwrap(), specimen);
    let mut plain = specimen;
    plain.holes.clear();
    assert!(!plain.to_json().contains("is_notch"));
}

/// The solid is closed and has the closed form's volume; drawings hold no number that is none.
#[test]
fn drawings_cut_the_outline() -> Result<(), DrawingError> {
    let specimen = everywhere();
    let stl = to_stl(&specimen)?;
    let number = |at: usize| f64::from(f32::from_le_bytes([stl[at], stl[at + 1], stl[at + 2], stl[at + 3]]));
    let count = u32::from_le_bytes([stl[80], stl[81], stl[82], stl[83]]) as usize;
    let mut volume = 0.0;
    for facet in 0..count {
        let corner = |k: usize| [0, 1, 2].map(|c| number(84 + 50 * facet + 12 * (k + 1) + 4 * c));
        let [a, b, c] = [corner(0), corner(1), corner(2)];
        volume += triple(a, b, c) / 6.0;
    }
    // Chords stay within 0.008 mm of about 25 mm of wall.
    assert!((volume - specimen.volume_mm3()).abs() < 6.4 * 0.008 * 25.0, "{volume} {}", specimen.volume_mm3());
    for text in [to_svg(&specimen), to_dxf(&specimen), to_step(&specimen).unwrap()] {
        assert!(!text.contains("NaN") && !text.contains("inf"));
    }
    // Each wall is one or two arcs, and no circle is left.
    let svg = to_svg(&specimen);
    assert!(!svg.contains("<circle") && svg.matches("<path").count() >= 4);
    Ok(())
}

/// a · (b × c).
fn triple(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
}
