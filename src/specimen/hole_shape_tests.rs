//! Specimens with holes that are not circles: reading, validation, limits.

use super::*;
use crate::specimen::{ManufacturingLimits, Specimen, SpecimenError};

fn two_holes() -> Specimen {
    Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).unwrap()
}

fn refused(change: impl FnOnce(&mut Specimen)) -> SpecimenError {
    let mut specimen = two_holes();
    change(&mut specimen);
    specimen.validate().unwrap_err()
}

#[test]
fn refuses_bad_outlines_of_holes() {
    use SpecimenError as E;
    let with = |length_mm: f64, angle_deg: f64| {
        refused(|s| s.holes[1].shape = Some(HoleShape { kind: HoleKind::Slot, length_mm, angle_deg }))
    };
    let short = with(4.9, 0.0);
    assert!(matches!(short, E::SizeOutOfRange { min_mm: 5.0, max_mm: 25.0, .. }), "{short}");
    assert_eq!(short.field_error().pointer, "/holes/1/shape/length_mm");
    assert!(matches!(with(25.1, 0.0), E::SizeOutOfRange { .. }));
    assert!(matches!(with(f64::NAN, 0.0), E::NotFinite { .. }));
    assert!(matches!(with(6.0, f64::INFINITY), E::NotFinite { .. }));
    assert!(matches!(with(6.0, 181.0), E::AngleOutOfRange { limit_deg: 180.0, .. }));
    // Along x it reaches beyond the end at 12.7 mm, and into the other hole; across it fits.
    let along = with(17.0, 0.0);
    assert!(matches!(along, E::HolesOverlap { .. } | E::HoleOutside { .. }), "{along}");
    let mut across = two_holes();
    across.holes[1].shape = Some(HoleShape { kind: HoleKind::Slot, length_mm: 17.0, angle_deg: 90.0 });
    assert_eq!(across.validate(), Ok(()));
}

/// Limits see the outline: ligaments along and across a slot, its width as the diameter, and a turned hole on a mirror.
#[test]
fn limits_see_outlines() {
    let limits = ManufacturingLimits::from_json(
        r#"{ "min_ligament_hole_hole_mm": 1.0, "min_ligament_hole_edge_mm": 1.0, "diameter_mm": { "min": 2.0, "max": 4.0 },
             "symmetry": "mirror_z" }"#,
    )
    .unwrap();
    let mut specimen = two_holes();
    for hole in &mut specimen.holes {
        hole.diameter_mm = 3.0;
        hole.shape = Some(HoleShape { kind: HoleKind::Slot, length_mm: 6.0, angle_deg: 0.0 });
    }
    let value = |specimen: &Specimen, name: &str| {
        limits.check_geometry(specimen, [1.0; 3]).into_iter().find(|m| m.name == name).unwrap()
    };
    // 8.4666 between centres less 2 × 3; 12.7 − 4.2333 − 3 to the ends.
    assert!((value(&specimen, "min_ligament_hole_hole_mm").value - 2.4666).abs() < 1e-12);
    assert!((value(&specimen, "min_ligament_hole_edge_mm").value - 5.4667).abs() < 1e-12);
    assert!((value(&specimen, "diameter_mm.max").value - 3.0).abs() < 1e-12);
    assert!(value(&specimen, "symmetry").is_satisfied && specimen.is_mirror_z());
    specimen.holes[0].shape.as_mut().unwrap().angle_deg = 20.0;
    assert!(!value(&specimen, "symmetry").is_satisfied && !specimen.is_mirror_z());
}

/// A file without outlines is written as it was before there were any, so that it keeps its hash; one with an outline
/// comes back from its text.
#[test]
fn circles_are_written_as_ever() {
    let text = two_holes().to_json();
    let hole = "{\n      \"axis\": \"thickness\",\n      \"center_mm\": [\n        -4.2333,\n        0.0\n      ],\n      \
                \"diameter_mm\": 5.0\n    }";
    assert!(text.contains(hole), "{text}");
    let with = text.replacen(
        "\"diameter_mm\": 5.0",
        "\"diameter_mm\": 5.0, \"shape\": { \"kind\": \"slot\", \"length_mm\": 6 }",
        1,
    );
    let specimen = Specimen::from_json(&with).unwrap();
    let shape = HoleShape { kind: HoleKind::Slot, length_mm: 6.0, angle_deg: 0.0 };
    assert_eq!(specimen.holes[0].shape, Some(shape));
    assert_eq!(Specimen::from_json(&specimen.to_json()), Ok(specimen));
    assert!(Specimen::from_json(&with.replace("slot", "circle")).is_err());
}
