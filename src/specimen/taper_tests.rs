//! Wedges: files, limits, closed forms and drawings.

use super::sampling::valid_wedge;
use super::*;
use proptest::prelude::*;

fn published(wedge_mm: f64) -> Specimen {
    let mut specimen = Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).expect("shipped");
    specimen.drive_mm = vec![3.0];
    specimen.block.wedge_mm = wedge_mm;
    specimen
}

fn pointers(specimen: &Specimen) -> Vec<String> {
    specimen.field_errors().into_iter().map(|e| e.pointer).collect()
}

#[test]
fn files_keep_wedges() {
    let specimen = published(-1.7);
    let text = specimen.to_json();
    assert!(text.contains("\"wedge_mm\": -1.7"));
    assert_eq!(Specimen::from_json(&text), Ok(specimen));
    assert!(!published(0.0).to_json().contains("wedge_mm"), "files of even blocks stay as they were");
    let unknown = text.replace("wedge_mm", "taper_mm");
    assert!(matches!(Specimen::from_json(&unknown), Err(SpecimenError::Json(_))));
    let shipped = Specimen::from_json(include_str!("../../geometries/wedged-shear.json")).expect("shipped");
    assert!(!shipped.block.taper().is_even());
}

/// Every refusal is told at its field and says what is allowed.
#[test]
fn what_cannot_be_a_wedge_is_refused() {
    for bad in [6.41, -6.41] {
        assert_eq!(pointers(&published(bad)), ["/block/wedge_mm"], "{bad}");
    }
    // Without a thickness, no drive is within its limit.
    for bad in [f64::NAN, f64::INFINITY] {
        assert_eq!(pointers(&published(bad))[0], "/block/wedge_mm", "{bad}");
    }
    let error = published(7.0).validate().expect_err("too large");
    assert!(
        matches!(error, SpecimenError::WedgeTooLarge { limit_mm, .. } if (limit_mm - 6.4).abs() < 1e-12),
        "{error}"
    );
    // What is left of a thin block must be meshed and made; a short one must not slant too much.
    let limit_of = |block: Block| Specimen { holes: vec![], drive_mm: vec![0.01], block, ..published(0.0) };
    for (block, limit_mm) in [(Block::new(20.0, 0.3, 10.0), 0.2), (Block::new(3.0, 6.4, 10.0), 3.0)] {
        for (factor, is_allowed) in [(1.0, true), (1.01, false), (-1.0, true), (-1.01, false)] {
            let block = Block { wedge_mm: factor * limit_mm, ..block };
            assert_eq!(limit_of(block).validate().is_ok(), is_allowed, "{block:?}");
        }
    }
    let mut pulled = Specimen { test: TestKind::Uniaxial, ..published(1.0) };
    pulled.drive_mm = vec![3.0];
    assert_eq!(pulled.validate(), Err(SpecimenError::WedgeOfPull { value_mm: 1.0 }));
    let mut across = published(1.0);
    across.holes = vec![Hole::circle(HoleAxis::Width, [2.0, 0.0], 2.0)];
    assert_eq!(across.validate(), Err(SpecimenError::WedgeHoleAlongWidth { hole: 0, value_mm: 1.0 }));
    assert_eq!(pointers(&across), ["/holes/0/axis"]);
    let mut unlike = published(0.0);
    unlike.other_samples = vec![Sample { block: Block { wedge_mm: 7.0, ..unlike.block }, holes: vec![] }];
    assert_eq!(pointers(&unlike), ["/other_samples/0/block/wedge_mm"]);
}

/// The thin end is sheared most: it limits drives and what the plates may be pressed together.
#[test]
fn the_thin_end_limits_the_test() {
    let specimen = published(2.4);
    assert!((specimen.block.thinnest_mm() - 5.2).abs() < 1e-12);
    assert!((specimen.drive_limit_mm() - MAX_SHEAR_STRAIN * 5.2).abs() < 1e-12);
    assert!((specimen.nominal_deformation(2.6) - 0.5).abs() < 1e-12);
    let pressed = Specimen { precompression_mm: 1.001 * MAX_PRECOMPRESSION * 5.2, ..specimen.clone() };
    assert_eq!(pointers(&pressed), ["/precompression_mm"]);
    assert_eq!(specimen.block.end_thicknesses_mm().map(|t| (1e6 * t).round()), [5_200_000.0, 7_600_000.0]);
    assert!(specimen.is_mirror_z() && !specimen.is_geometry_mirror_x());
    // ∫ dx/thickness in closed form against the midpoint rule, whose error is of second order in 1/1000.
    let x = |i: usize| 25.4 * ((i as f64 + 0.5) / 1000.0 - 0.5);
    let mean = (0..1000).map(|i| 1e-3 / (2.0 * specimen.half_gap_mm(x(i)))).sum::<f64>();
    assert!((specimen.block.harmonic_thickness_mm() * mean - 1.0).abs() < 1e-6);
}

#[test]
fn material_ends_at_the_slanted_faces() {
    let specimen = published(2.0);
    for (x, half) in [(-12.7, 2.7), (0.0, 3.2), (12.7, 3.7), (8.0, 3.2 + 0.5 * 2.0 * 8.0 / 25.4)] {
        for sign in [-1.0, 1.0] {
            assert!(specimen.contains([x, sign * (half - 1e-9), 9.0]));
            assert!(!specimen.contains([x, sign * (half + 1e-9), 9.0]));
        }
    }
}

/// Volume by slices along x: thickness there times what walls leave of the width, notches and all.
fn sliced_mm3(specimen: &Specimen) -> f64 {
    let (length, half_width) = (specimen.block.length_mm, 0.5 * specimen.block.width_mm);
    let count = 40_000;
    let slice = |i: usize| {
        let x = length * ((i as f64 + 0.5) / count as f64 - 0.5);
        let cut = |hole: &Hole| {
            let chord = hole.wall().chord_mm(x);
            chord.map_or(0.0, |[low, high]| (high.min(half_width) - low.max(-half_width)).max(0.0))
        };
        let across = 2.0 * half_width - specimen.holes.iter().map(cut).sum::<f64>();
        2.0 * specimen.half_gap_mm(x) * across * length / count as f64
    };
    (0..count).map(slice).sum()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn volumes_are_those_of_slices(specimen in valid_wedge()) {
        prop_assert_eq!(specimen.validate(), Ok(()));
        // Slices miss of a chord's square-root ends (length/40000)^1.5 times the root of a radius.
        let (closed, sliced) = (specimen.volume_mm3(), sliced_mm3(&specimen));
        prop_assert!((closed / sliced - 1.0).abs() < 1e-5, "{} {}", closed, sliced);
    }
}

#[test]
fn notches_in_a_wedge_have_their_moment() {
    let mut specimen = published(-5.0);
    let notch = |center_mm, diameter_mm| Hole::notch(HoleAxis::Thickness, center_mm, diameter_mm);
    specimen.holes = vec![notch([12.3, 1.0], 5.0), notch([-13.0, -3.0], 4.0), notch([4.0, 9.5], 4.5)];
    assert_eq!(specimen.validate(), Ok(()));
    // As above.
    assert!((specimen.volume_mm3() / sliced_mm3(&specimen) - 1.0).abs() < 1e-6);
}

/// The side view has both ends' thicknesses, and the outline's corners where the faces end.
#[test]
fn drawings_show_the_slant() {
    let specimen = published(2.4);
    let svg = to_svg(&specimen);
    for text in [">5.2<", ">7.6<", "Wedge 25.4 × 5.2 to 7.6 × 19.1 (x, y, z)", "slanted faces bonded"] {
        assert!(svg.contains(text), "{text}");
    }
    let dxf = to_dxf(&specimen);
    let lines: Vec<&str> = dxf.lines().collect();
    let ends = lines.windows(2).filter(|pair| pair[0] == "20" || pair[0] == "21");
    let heights: Vec<f64> = ends.filter_map(|pair| pair[1].parse().ok()).collect();
    let has_pair = |apart: f64| heights.iter().any(|a| heights.iter().any(|b| (a - b - apart).abs() < 1e-8));
    assert!(has_pair(5.2) && has_pair(7.6));
}
