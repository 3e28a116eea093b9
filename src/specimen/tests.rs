//! Tests of validation, geometry and limits.

use super::sampling::{any_layout, dumbbell_with_hole, valid_specimen};
use super::*;
use proptest::prelude::*;

fn shipped(name: &str) -> Specimen {
    let path = format!("{}/geometries/{name}", env!("CARGO_MANIFEST_DIR"));
    Specimen::from_json(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn two_holes() -> Specimen {
    shipped("two-hole-shear.json")
}

fn refused(change: impl FnOnce(&mut Specimen)) -> SpecimenError {
    let mut specimen = two_holes();
    change(&mut specimen);
    specimen.validate().unwrap_err()
}

#[test]
fn shipped_specimens_are_valid_and_drawable() {
    let mut count = 0;
    for entry in std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/geometries")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "json") {
            let specimen = shipped(&path.file_name().unwrap().to_string_lossy());
            assert!(to_svg(&specimen).ends_with("</svg>\n"));
            assert!(to_dxf(&specimen).ends_with("EOF\n"));
            assert!(to_stl(&specimen).unwrap().len() > 84);
            count += 1;
        }
    }
    assert!(count >= 4);
}

#[test]
fn refuses_bad_holes() {
    use SpecimenError as E;
    let outside = refused(|s| s.holes[1].center_mm = [11.0, 0.0]);
    assert!(matches!(
        outside,
        E::HoleOutside { between: LigamentKind::HoleEdge(1, SectionEdge::PlusX), excess_mm, .. } if (excess_mm - 0.8).abs() < 1e-9
    ));
    assert!(outside.to_string().contains("holes[1]") && outside.to_string().contains("0.8000"));
    assert!(matches!(refused(|s| s.holes[0].center_mm = [400.0, 0.0]), E::HoleOutside { .. }));
    assert!(matches!(refused(|s| s.holes[0].center_mm = [1.0, 0.0]), E::HolesOverlap { .. }));
    assert!(matches!(refused(|s| s.holes[1] = s.holes[0]), E::HolesOverlap { overlap_mm, .. } if overlap_mm == 5.0));
    // Touching exactly: 5 mm apart, radii 2.5 each, all representable.
    let touching = refused(|s| {
        s.holes[0].center_mm = [-2.5, 0.0];
        s.holes[1].center_mm = [2.5, 0.0];
    });
    assert!(matches!(touching, E::HolesOverlap { .. }));
    let thin = refused(|s| s.holes[1].center_mm = [10.15, 0.0]);
    assert!(matches!(thin, E::LigamentTooThin { limit_mm, .. } if (limit_mm - 0.1).abs() < 1e-12));
    assert!(matches!(refused(|s| s.holes[1].axis = HoleAxis::Width), E::MixedHoleAxes { hole: 1, .. }));
    assert!(matches!(refused(|s| s.holes[0].diameter_mm = -5.0), E::SizeOutOfRange { .. }));
    assert!(matches!(refused(|s| s.holes[0].diameter_mm = f64::NAN), E::NotFinite { .. }));
    assert!(matches!(refused(|s| s.holes[0].center_mm[1] = f64::INFINITY), E::NotFinite { .. }));
    assert!(matches!(refused(|s| s.holes = vec![s.holes[0]; 65]), E::TooManyHoles { count: 65, limit: 64 }));
}

#[test]
fn refuses_bad_numbers_and_names() {
    use SpecimenError as E;
    assert!(matches!(refused(|s| s.name = "a\nb".into()), E::BadName { .. }));
    assert!(matches!(refused(|s| s.name = "a".repeat(201)), E::BadName { length: 201, .. }));
    assert!(matches!(refused(|s| s.block.width_mm = 0.0), E::SizeOutOfRange { .. }));
    assert!(matches!(refused(|s| s.block.width_mm = f64::NAN), E::NotFinite { .. }));
    assert!(matches!(refused(|s| s.block.length_mm = 1e4), E::SizeOutOfRange { .. }));
    assert!(matches!(refused(|s| s.drive_mm.clear()), E::NoDrives { .. }));
    assert!(matches!(refused(|s| s.drive_mm = vec![1.0; 1001]), E::TooManyDrives { .. }));
    assert!(matches!(refused(|s| s.drive_mm = vec![0.0]), E::DriveZero { index: 0 }));
    assert!(matches!(refused(|s| s.drive_mm = vec![2.0, 2.0]), E::DrivesNotLeadingOn { index: 1, .. }));
    assert!(matches!(refused(|s| s.drive_mm = vec![f64::NAN]), E::NotFinite { .. }));
    assert!(matches!(refused(|s| s.drive_mm = vec![-1.0, 1.5]), E::DrivesNotLeadingOn { index: 1, .. }));
    assert!(matches!(refused(|s| s.drive_mm = vec![-2.0, -1.0]), E::DrivesNotLeadingOn { index: 1, .. }));
    let back = refused(|s| s.drive_mm = vec![-5.0, -9.7]);
    assert!(matches!(back, E::DriveTooLarge { index: 1, limit_mm, .. } if (limit_mm + 9.6).abs() < 1e-9));
    let far = refused(|s| s.drive_mm = vec![5.0, 9.7]);
    assert!(matches!(far, E::DriveTooLarge { index: 1, limit_mm, .. } if (limit_mm - 9.6).abs() < 1e-9));
    assert!(matches!(refused(|s| s.samples_in_parallel = 0), E::SamplesOutOfRange { value: 0, .. }));
    let mut bar = shipped("uniaxial-bar.json");
    bar.drive_mm = vec![80.0];
    assert_eq!(bar.validate(), Ok(()));
    bar.drive_mm = vec![81.0];
    assert!(matches!(bar.validate(), Err(E::DriveTooLarge { measure: "stretch", .. })));
    bar.drive_mm = vec![-10.0, -20.0];
    assert_eq!(bar.validate(), Ok(()));
    assert!(bar.is_compressed() && bar.supports_drive(-20.0) && !bar.supports_drive(-20.1));
    assert!(!bar.supports_drive(5.0) && !bar.supports_drive(0.0) && !bar.supports_drive(f64::NAN));
    bar.drive_mm = vec![-20.1];
    assert!(matches!(bar.validate(), Err(E::DriveTooLarge { measure: "stretch", .. })));
    let mut dumbbell = shipped("iso37-type4.json");
    dumbbell.drive_mm = vec![-1.0];
    assert!(matches!(dumbbell.validate(), Err(E::DumbbellCompressed { .. })));
}

#[test]
fn refuses_bad_dumbbells() {
    use SpecimenError as E;
    let dumbbell = shipped("iso37-type4.json");
    let refused = |change: &dyn Fn(&mut Specimen)| {
        let mut specimen = dumbbell.clone();
        change(&mut specimen);
        specimen.validate().unwrap_err()
    };
    let wide = refused(&|s| s.block.width_mm = 7.0);
    assert!(matches!(wide, E::NotTheStandardsBlock { .. }));
    assert_eq!(wide.field_error().pointer, "/block/width_mm");
    assert!(matches!(refused(&|s| s.test = TestKind::DoubleLapShear), E::DumbbellInShear { .. }));
    let hole = |axis, x, z, d| Hole::circle(axis, [x, z], d);
    assert!(matches!(
        refused(&|s| s.holes = vec![hole(HoleAxis::Width, 0.0, 0.0, 1.0)]),
        E::DumbbellHoleAlongWidth { hole: 0 }
    ));
    // Inside the bounding block, outside the narrow portion.
    assert!(matches!(refused(&|s| s.holes = vec![hole(HoleAxis::Thickness, 0.0, 2.0, 1.0)]), E::HoleOutside { .. }));
    let mut valid = dumbbell.clone();
    valid.holes = vec![hole(HoleAxis::Thickness, 14.0, 0.0, 3.0)];
    assert_eq!(valid.validate(), Ok(()));
}

#[test]
fn a_dumbbell_has_a_gauge_of_its_own() {
    use SpecimenError as E;
    let text = r#"{ "schema": "specimen/1", "name": "necked", "test": "uniaxial",
        "block": { "length_mm": 40.0, "thickness_mm": 4.0, "width_mm": 12.0 },
        "outline": { "dumbbell": { "gauge_width_mm": 6.0, "gauge_length_mm": 8.0, "fillet_radius_mm": 5.0 } },
        "drive_mm": [4.0] }"#;
    let specimen = Specimen::from_json(text).unwrap();
    assert_eq!(Specimen::from_json(&specimen.to_json()), Ok(specimen.clone()));
    assert_eq!(specimen.half_width_mm(0.0), 3.0);
    assert!(specimen.contains([0.0, 0.0, 2.9]) && !specimen.contains([0.0, 0.0, 3.1]));
    assert!(specimen.is_mirror_y() && specimen.is_mirror_z() && specimen.is_geometry_mirror_x());
    let unknown = text.replace("gauge_width_mm", "neck_mm");
    let Err(E::Json(problem)) = Specimen::from_json(&unknown) else { panic!("an unknown field is read") };
    assert_eq!(problem.field, "outline.dumbbell.neck_mm");
    let pointers = |change: &dyn Fn(&mut Specimen)| {
        let mut changed = specimen.clone();
        change(&mut changed);
        changed.field_errors().into_iter().map(|e| e.pointer).collect::<Vec<_>>()
    };
    let gauge = |change: fn(&mut Dumbbell)| {
        pointers(&|s| {
            if let Some(gauge) = s.outline.free_gauge_mut() {
                change(gauge);
            }
        })
    };
    assert_eq!(gauge(|d| d.gauge_width_mm = 11.95), ["/outline/dumbbell/gauge_width_mm"]);
    assert_eq!(gauge(|d| d.gauge_length_mm = 0.1), ["/outline/dumbbell/gauge_length_mm"]);
    assert_eq!(gauge(|d| d.fillet_radius_mm = 2.0), ["/outline/dumbbell/fillet_radius_mm"]);
    assert_eq!(pointers(&|s| s.block.length_mm = 20.0), ["/block/length_mm"]);
    assert_eq!(pointers(&|s| s.test = TestKind::DoubleLapShear), ["/outline"]);
    assert_eq!(pointers(&|s| s.drive_mm = vec![-1.0]), ["/drive_mm"]);
}

/// The standard's dumb-bell is one of free gauge: the same sides, volume and drives, under another name.
#[test]
fn the_standards_dumbbell_is_a_case_of_the_free_one() {
    let standard = shipped("iso37-type4.json");
    let free = Specimen { outline: Outline::Dumbbell(super::dumbbell::ISO37_TYPE4), ..standard.clone() };
    assert_eq!(free.validate(), Ok(()));
    assert_eq!((free.profile(), free.volume_mm3()), (standard.profile(), standard.volume_mm3()));
    assert_eq!(free.drive_limit_mm(), standard.drive_limit_mm());
    assert_ne!(free.to_json(), standard.to_json());
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn dumbbells_that_can_be_drawn_are_valid(specimen in super::sampling::free_dumbbell()) {
        prop_assert_eq!(specimen.validate(), Ok(()));
        prop_assert_eq!(Specimen::from_json(&specimen.to_json()), Ok(specimen.clone()));
        // Narrower than its block, by what its volume says.
        let block = specimen.block.length_mm * specimen.block.thickness_mm * specimen.block.width_mm;
        prop_assert!(specimen.volume_mm3() < block && specimen.volume_mm3() > 0.0);
    }
}

#[test]
fn json_errors_tell_the_schema_from_the_field() {
    let text = two_holes().to_json();
    let unknown = text.replace("\"diameter_mm\"", "\"radius_mm\"");
    let SpecimenError::Json(problem) = Specimen::from_json(&unknown).unwrap_err() else { panic!("not a JSON error") };
    assert_eq!(problem.field, "holes[0].radius_mm");
    assert!(problem.line > 1 && problem.message.contains("unknown field"));
    let newer = unknown.replace("specimen/1", "specimen/2");
    assert!(matches!(Specimen::from_json(&newer), Err(SpecimenError::WrongSchema { .. })));
    assert!(matches!(Specimen::from_json("{ \"schema\": NaN }"), Err(SpecimenError::Json(_))));
}

#[test]
fn geometry_of_the_two_hole_specimen() {
    let specimen = two_holes();
    assert_eq!(specimen.hole_axis(), Some(HoleAxis::Thickness));
    assert_eq!(specimen.section_size(), [25.4, 19.1]);
    let exact = (25.4 * 19.1 - 2.0 * std::f64::consts::PI * 6.25) * 6.4;
    // Rounding of a few operations.
    assert!((specimen.volume_mm3() - exact).abs() < 1e-9);
    assert!(specimen.is_mirror_z() && specimen.is_geometry_mirror_x());
    // Shear is not symmetric in y, however symmetric the geometry.
    assert!(!specimen.is_mirror_y());
    assert!(!specimen.contains([4.2333, 0.0, 0.0]) && specimen.contains([0.0, 3.2, 9.55]));
    assert!(!specimen.contains([0.0, 3.3, 0.0]));
    let thinnest = specimen.ligaments().iter().map(|l| l.length_mm).fold(f64::INFINITY, f64::min);
    assert!((thinnest - 3.4666).abs() < 1e-9);
    let mut shifted = specimen.clone();
    shifted.holes[0].center_mm[1] = 1e-3;
    assert!(!shifted.is_mirror_z());
    shifted.holes[0].center_mm[1] = 1e-9;
    assert!(shifted.is_mirror_z());
    assert!(shipped("uniaxial-bar.json").is_mirror_y());
}

#[test]
fn limits_are_measured_against_closed_forms() {
    let limits = ManufacturingLimits::from_json(
        r#"{ "min_ligament_hole_hole_mm": 3.0, "min_ligament_hole_edge_mm": 6.0, "diameter_mm": { "min": 2.0, "max": 4.0 },
             "min_voxels_across_ligament": 3, "max_force_n": 10, "max_holes": 2, "symmetry": "mirror_x_and_z" }"#,
    )
    .unwrap();
    let margins = limits.check_geometry(&two_holes(), [1.0, 0.1875, 0.75]);
    let margin = |name: &str| margins.iter().find(|m| m.name == name).unwrap().clone();
    assert!((margin("min_ligament_hole_hole_mm").margin_relative - 0.4666 / 3.0).abs() < 1e-9);
    let edge = margin("min_ligament_hole_edge_mm");
    assert!((edge.value - 5.9667).abs() < 1e-9 && !edge.is_satisfied);
    assert!(margin("diameter_mm.min").is_satisfied && !margin("diameter_mm.max").is_satisfied);
    // Along x between the holes: 3.4666 mm of 1 mm voxels.
    assert!((margin("min_voxels_across_ligament").value - 3.4666).abs() < 1e-9);
    assert!(margin("max_holes").is_satisfied && margin("symmetry").is_satisfied);
    let mut response = TestResponse { drive_mm: 7.0, force_n: -12.0, normal_force_n: Some(-28.0), local_stretch: 2.0 };
    let margins = limits.check_response(&response);
    assert_eq!(margins.len(), 1);
    assert!(!margins[0].is_satisfied);
    // Across the plates either way counts; grips have none.
    let across = ManufacturingLimits { max_force_n: None, max_normal_force_n: Some(20.0), ..limits.clone() };
    let margins = across.check_response(&response);
    assert_eq!((margins.len(), margins[0].is_satisfied), (1, false));
    assert!((margins[0].margin_relative + 0.4).abs() < 1e-12, "(20 − 28) / 20, to rounding");
    assert_eq!(margins[0].in_words(), "force across the plates: 28.000 N (limit 20.000 N, margin -40.0 %)");
    response.normal_force_n = Some(15.0);
    assert!(across.check_response(&response)[0].is_satisfied);
    response.normal_force_n = None;
    assert_eq!(across.check_response(&response), []);

    let punched = ManufacturingLimits { diameter_mm: None, punches_mm: Some(vec![3.0, 5.0]), ..limits.clone() };
    assert_eq!(punched.validate(), Ok(()));
    let margins = punched.check_geometry(&two_holes(), [1.0; 3]);
    assert!(margins.iter().any(|m| m.name == "punches_mm" && m.is_satisfied));
    let mut odd = two_holes();
    odd.holes[1].diameter_mm = 4.5;
    let margins = punched.check_geometry(&odd, [1.0; 3]);
    assert!(margins.iter().any(|m| m.name == "punches_mm" && !m.is_satisfied && m.value == 4.5));
    assert!(margins.iter().any(|m| m.name == "symmetry" && !m.is_satisfied));
    let solid = limits.check_geometry(&shipped("solid-shear.json"), [1.0; 3]);
    assert!(solid.iter().all(|m| m.is_satisfied));
}

#[test]
fn refuses_bad_limits() {
    use LimitsError as E;
    let read = |rest: &str| {
        ManufacturingLimits::from_json(&format!(
            r#"{{ "min_ligament_hole_hole_mm": 1.0, "min_ligament_hole_edge_mm": 1.0 {rest} }}"#
        ))
    };
    assert!(matches!(read(""), Err(E::DiametersAmbiguous { has_range: false, has_punches: false })));
    let both = r#", "punches_mm": [1.0], "diameter_mm": { "min": 1.0, "max": 2.0 }"#;
    assert!(matches!(read(both), Err(E::DiametersAmbiguous { has_range: true, has_punches: true })));
    assert!(matches!(read(r#", "punches_mm": []"#), Err(E::NoPunches)));
    assert!(matches!(read(r#", "punches_mm": [0.0]"#), Err(E::OutOfRange { .. })));
    assert!(matches!(read(r#", "diameter_mm": { "min": 3.0, "max": 2.0 }"#), Err(E::EmptyRange { .. })));
    assert!(matches!(read(r#", "punches_mm": [1.0], "max_holes": 65"#), Err(E::TooManyHoles { .. })));
    assert!(matches!(read(r#", "punches_mm": [1.0], "max_local_stretch": 0.9"#), Err(E::OutOfRange { .. })));
    assert!(matches!(read(r#", "punches_mm": [1.0], "max_forces_n": 1"#), Err(E::Json(_))));
    let across = read(r#", "punches_mm": [1.0], "max_normal_force_n": 0.0"#);
    assert!(matches!(across, Err(E::OutOfRange { field, .. }) if field.to_string() == "max_normal_force_n"));
}

/// Least distance between points on a hole's wall and points on another wall or side.
fn brute_force(specimen: &Specimen, kind: LigamentKind) -> f64 {
    const POINTS: usize = 600;
    let wall = |hole: &Hole| -> Vec<[f64; 2]> {
        (0..POINTS).map(|i| hole.wall().point_at(std::f64::consts::TAU * i as f64 / POINTS as f64)).collect()
    };
    let [length, lateral] = specimen.section_size();
    let along = |i: usize| i as f64 / (4 * POINTS) as f64 - 0.5;
    let half = |x: f64| if specimen.outline == Outline::Block { 0.5 * lateral } else { specimen.half_width_mm(x) };
    let side = |sign: f64| (0..=4 * POINTS).map(|i| [along(i) * length, sign * half(along(i) * length)]).collect();
    let end = |sign: f64| (0..=4 * POINTS).map(|i| [sign * 0.5 * length, along(i) * lateral]).collect();
    let (first, others): (usize, Vec<[f64; 2]>) = match kind {
        LigamentKind::HoleHole(i, j) => (i, wall(&specimen.holes[j])),
        LigamentKind::HoleEdge(i, SectionEdge::MinusX) => (i, end(-1.0)),
        LigamentKind::HoleEdge(i, SectionEdge::PlusX) => (i, end(1.0)),
        LigamentKind::HoleEdge(i, SectionEdge::MinusLateral) => (i, side(-1.0)),
        LigamentKind::HoleEdge(i, SectionEdge::PlusLateral) => (i, side(1.0)),
    };
    let hole = wall(&specimen.holes[first]);
    hole.iter().flat_map(|p| others.iter().map(|q| (p[0] - q[0]).hypot(p[1] - q[1]))).fold(f64::INFINITY, f64::min)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_text_is_read_or_refused(text in ".*") {
        let _ = Specimen::from_json(&text);
    }

    #[test]
    fn a_damaged_file_is_read_or_refused(cut in 0usize..700, insert in "[\\{\\}\\[\\],:\"0-9eE.a-z\\\\-]{0,4}", skip in 0usize..6) {
        let text = two_holes().to_json();
        let at = cut.min(text.len());
        let damaged = format!("{}{insert}{}", &text[..at], &text[(at + skip).min(text.len())..]);
        if let Err(error) = Specimen::from_json(&damaged) {
            prop_assert!(!error.to_string().is_empty());
        }
    }

    #[test]
    fn any_layout_is_accepted_or_refused_typed(specimen in any_layout()) {
        if specimen.validate().is_ok() {
            for ligament in specimen.ligaments() {
                prop_assert!(ligament.length_mm >= 0.05);
            }
            for hole in &specimen.holes {
                let [x, b] = hole.center_mm;
                let middle = if hole.axis == HoleAxis::Width { [x, b, 0.0] } else { [x, 0.0, b] };
                prop_assert!(!specimen.contains(middle));
            }
        }
    }

    #[test]
    fn reading_back_gives_the_same_specimen(specimen in valid_specimen()) {
        let back = Specimen::from_json(&specimen.to_json()).unwrap();
        prop_assert_eq!(back, specimen);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn ligaments_equal_a_dense_search(specimen in valid_specimen(), dumbbell in dumbbell_with_hole()) {
        let mut specimens = vec![specimen];
        specimens.extend(Some(dumbbell).filter(|s| s.validate().is_ok()));
        for specimen in specimens {
            for ligament in specimen.ligaments() {
                let found = brute_force(&specimen, ligament.kind);
                // Samples are at most 1/2400 of a side or 1/600 of a circle apart (of other walls at most twice as
                // much): the search is above the distance, by no more than half the sum of both spacings.
                let size = specimen.block.length_mm.max(specimen.block.width_mm);
                let circle = std::f64::consts::PI * specimen.holes.iter().map(|h| h.length_mm()).fold(0.0, f64::max);
                let spacing = size / 2400.0 + 2.0 * circle / 600.0;
                prop_assert!(found >= ligament.length_mm - 1e-9, "{}", ligament.kind);
                prop_assert!(found <= ligament.length_mm + spacing, "{}: {} {}", ligament.kind, found, ligament.length_mm);
            }
        }
    }

    #[test]
    fn volume_equals_the_share_of_points_inside(specimen in valid_specimen()) {
        let [length, lateral] = specimen.section_size();
        const N: usize = 400;
        let mut inside = 0usize;
        for i in 0..N {
            for j in 0..N {
                let [x, b] = [(i as f64 + 0.5) / N as f64 - 0.5, (j as f64 + 0.5) / N as f64 - 0.5];
                let (x, b) = (x * length, b * lateral);
                let p = if specimen.extrusion_axis() == HoleAxis::Width { [x, b, 0.0] } else { [x, 0.0, b] };
                inside += usize::from(specimen.contains(p));
            }
        }
        let volume = inside as f64 / (N * N) as f64 * length * lateral * specimen.extrusion_mm();
        let perimeter: f64 = specimen.holes.iter().map(|h| h.wall().perimeter_mm()).sum();
        // Cells that a wall cuts may count wrongly by half their area, on average far less.
        let tolerance = perimeter * (length + lateral) / N as f64 * specimen.extrusion_mm();
        prop_assert!((volume - specimen.volume_mm3()).abs() <= tolerance + 1e-9 * volume);
    }
}

/// Every violated rule is told at once, each with its pointer; ligaments only where the holes themselves are fine.
#[test]
fn all_errors_come_at_once_with_pointers() {
    let mut specimen = two_holes();
    specimen.name = "a\nb".into();
    specimen.block.width_mm = f64::NAN;
    specimen.holes[1].diameter_mm = -3.0;
    specimen.holes[1].axis = HoleAxis::Width;
    specimen.drive_mm = vec![2.0, 1.0, -1.0];
    specimen.samples_in_parallel = 0;
    let pointers: Vec<String> = specimen.field_errors().into_iter().map(|e| e.pointer).collect();
    assert_eq!(
        pointers,
        [
            "/name",
            "/block/width_mm",
            "/holes/1/diameter_mm",
            "/holes/1/axis",
            "/drive_mm/1",
            "/drive_mm/2",
            "/samples_in_parallel"
        ]
    );
    assert_eq!(specimen.validate().expect_err("refused").field_error().pointer, pointers[0]);
    let mut close = two_holes();
    close.holes[1] = close.holes[0];
    let errors = close.field_errors();
    assert_eq!(errors.len(), 1, "{errors:?}");
    assert_eq!(errors[0].pointer, "/holes/0");
    assert_eq!(two_holes().field_errors(), []);
}

#[test]
fn limits_that_are_none_have_pointers() {
    let limits = ManufacturingLimits::from_json(
        r#"{ "min_ligament_hole_hole_mm": 2.0, "min_ligament_hole_edge_mm": 2.0, "punches_mm": [3.0, 4.0] }"#,
    )
    .expect("they are valid");
    assert_eq!(limits.field_errors(), []);
    let bad = ManufacturingLimits {
        min_ligament_hole_hole_mm: f64::NAN,
        punches_mm: Some(vec![3.0, 0.0]),
        max_local_stretch: Some(1.0),
        max_holes: Some(65),
        ..limits
    };
    let pointers: Vec<String> = bad.field_errors().into_iter().map(|e| e.pointer).collect();
    assert_eq!(pointers, ["/min_ligament_hole_hole_mm", "/punches_mm/1", "/max_local_stretch", "/max_holes"]);
}

/// A limit may be smaller than any difference: the margin stays a number that JSON can hold.
#[test]
fn margins_are_finite() {
    for limit in [5e-324, f64::MIN_POSITIVE, 1e-300] {
        let broken = LimitMargin::at_most("max_drive_mm", 7.0, limit);
        assert!(broken.margin_relative.is_finite() && broken.margin_relative < 0.0 && !broken.is_satisfied, "{limit}");
    }
}
