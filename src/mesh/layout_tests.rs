//! Whole meshes: every layout conforms, is well shaped and fills the specimen.

use super::test_specimens::{Random, bar, dumbbell, free_dumbbell, off_axis, solid, specimen, two_holes, width_holes};
use super::{ElementKind, LigamentEnd, MeshError, MeshOptions, mesh_specimen};
use crate::specimen::{Dumbbell, HoleAxis, Outline, Specimen, TestKind};

/// Up to eight holes of random size, thrown until they keep `ligament` mm; sometimes symmetric about b = 0.
fn random_layout(random: &mut Random) -> Specimen {
    let test = [TestKind::DoubleLapShear, TestKind::Uniaxial][random.below(2)];
    let axis = [HoleAxis::Thickness, HoleAxis::Width][random.below(2)];
    let extents = [random.between(15.0, 45.0), random.between(3.0, 12.0), random.between(8.0, 25.0)];
    let half = [0.5 * extents[0], 0.5 * if axis == HoleAxis::Width { extents[1] } else { extents[2] }];
    let ligament = random.between(0.3, 1.0);
    let symmetric = random.below(2) == 0;
    let wanted = random.below(9);
    let mut holes: Vec<[f64; 3]> = Vec::new();
    for _ in 0..60 {
        if holes.len() >= wanted {
            break;
        }
        let r = random.between(0.4, 0.7 * half[1]).min(0.35 * half[0]);
        let mut center = [random.between(-half[0], half[0]), random.between(-half[1], half[1])];
        if symmetric && random.below(2) == 0 {
            center[1] = 0.0;
        }
        let mut new = vec![[center[0], center[1], 2.0 * r]];
        if symmetric && center[1].abs() > 0.0 {
            new.push([center[0], -center[1], 2.0 * r]);
        }
        let mut all = holes.clone();
        all.extend(&new);
        let fits = all.len() <= 8
            && all.iter().enumerate().all(|(i, h)| {
                let inside = (0..2).all(|c| h[c].abs() + 0.5 * h[2] + ligament <= half[c]);
                let apart = all[..i].iter().all(|g| (g[0] - h[0]).hypot(g[1] - h[1]) >= 0.5 * (g[2] + h[2]) + ligament);
                inside && apart
            });
        if fits {
            holes = all;
        }
    }
    specimen(test, extents, axis, &holes)
}

#[test]
fn random_layouts_conform() {
    let mut random = Random::new(2);
    let (mut quads, mut prisms, mut refused) = (0, 0, 0);
    for case in 0..120 {
        let specimen = random_layout(&mut random);
        for use_mirror in [true, false] {
            for options in [
                MeshOptions::scaled(&specimen, 1.8),
                MeshOptions::scaled(&specimen, 1.0),
                MeshOptions::graded(&specimen, 1.6),
            ] {
                let options = MeshOptions { use_mirror, ..options };
                match mesh_specimen(&specimen, &options) {
                    Ok(mesh) => {
                        let checked = mesh.check(&specimen);
                        assert!(checked.is_ok(), "case {case}, {}: {checked:?}", specimen.name);
                        let worst = mesh.quality().min_scaled_jacobian;
                        assert!(worst >= 0.2, "case {case}, {}: {worst}", specimen.name);
                        match mesh.element_kind {
                            ElementKind::Hex27 => quads += 1,
                            ElementKind::Prism21 => prisms += 1,
                        }
                    }
                    Err(e) => {
                        println!("case {case}, {}: {e}", specimen.name);
                        refused += 1;
                    }
                }
            }
        }
    }
    println!("{quads} hexahedral, {prisms} prismatic, {refused} refused");
    // All layouts are makeable: none may be refused, and quadrilaterals must be the rule.
    assert_eq!(refused, 0);
    assert!(quads > 3 * prisms);
}

/// Next to every free face of a sheared block lies one layer of elements of the depth asked for, whatever the holes and
/// the element size; plates and mirror planes have none.
#[test]
fn layers_lie_along_free_faces() {
    for specimen in [solid(), two_holes(), off_axis(), width_holes()] {
        let half = [specimen.block.length_mm, specimen.block.thickness_mm, specimen.block.width_mm].map(|e| 0.5 * e);
        for (factor, use_mirror) in [(2.5, true), (1.6, false), (1.0, true)] {
            let options = MeshOptions { use_mirror, ..MeshOptions::graded(&specimen, factor) };
            let mesh = mesh_specimen(&specimen, &options).unwrap();
            mesh.check(&specimen).unwrap();
            assert_eq!(mesh.element_kind, ElementKind::Hex27);
            for axis in [0, 2] {
                for sign in [-1.0, 1.0] {
                    let is_mirrored_off = axis == 2 && mesh.mirror.z && sign < 0.0;
                    let depths = mesh.nodes.iter().map(|p| half[axis] - sign * p[axis]);
                    // Corners and middles of the layer; rounding only.
                    let in_layer = depths.filter(|d| *d < options.free_layer_mm - 1e-9);
                    let mut parts: Vec<f64> = in_layer.map(|d| d / options.free_layer_mm).collect();
                    parts.sort_by(f64::total_cmp);
                    parts.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
                    if is_mirrored_off {
                        assert!(parts.is_empty());
                        continue;
                    }
                    let name = &specimen.name;
                    assert_eq!(parts.len(), 2, "{name}, factor {factor}, axis {axis}: {parts:?}");
                    assert!(parts[0].abs() < 1e-9 && (parts[1] - 0.5).abs() < 1e-9, "{name}: {parts:?}");
                }
            }
        }
    }
}

/// A hole closer to a free face than two layers leaves a thinner one.
#[test]
fn layers_give_way_to_holes() {
    let near = specimen(TestKind::DoubleLapShear, [25.4, 6.4, 19.1], HoleAxis::Thickness, &[[0.0, 6.4, 5.0]]);
    let options = MeshOptions::graded(&near, 1.6);
    let mesh = mesh_specimen(&near, &options).unwrap();
    mesh.check(&near).unwrap();
    let depths = mesh.nodes.iter().map(|p| 9.55 - p[2]).filter(|d| *d > 1e-9);
    // Half of two fifths of 0.65 mm: the layer's middle nodes.
    assert!((depths.fold(f64::INFINITY, f64::min) - 0.13).abs() < 1e-9);
}

#[test]
fn forced_prisms_conform() {
    let mut random = Random::new(3);
    for case in 0..60 {
        let specimen = random_layout(&mut random);
        let options = MeshOptions { force_prisms: true, ..MeshOptions::search(&specimen) };
        let mesh = mesh_specimen(&specimen, &options);
        let mesh = mesh.unwrap_or_else(|e| panic!("case {case}, {}: {e}", specimen.name));
        assert_eq!(mesh.element_kind, ElementKind::Prism21);
        let checked = mesh.check(&specimen);
        assert!(checked.is_ok(), "case {case}, {}: {checked:?}", specimen.name);
    }
}

/// A mirrored mesh has half or a quarter of the closed-form volume, and finer meshes approach it with the fourth order
/// of quadratic arcs with exact middle nodes.
#[test]
fn volume_converges_to_the_closed_form() {
    for (specimen, parts) in [(two_holes(), 2.0), (bar(), 4.0), (width_holes(), 2.0)] {
        let mut exact = specimen.block.length_mm * specimen.block.thickness_mm * specimen.block.width_mm;
        let along_width = specimen.holes[0].axis == HoleAxis::Width;
        let depth = if along_width { specimen.block.width_mm } else { specimen.block.thickness_mm };
        for hole in &specimen.holes {
            exact -= 0.25 * std::f64::consts::PI * hole.diameter_mm.powi(2) * depth;
        }
        for force_prisms in [false, true] {
            let error = |segments: usize, size: f64| {
                let standard = MeshOptions::standard(&specimen);
                let options = MeshOptions { hole_segments: segments, section_size_mm: size, force_prisms, ..standard };
                let mirrored = mesh_specimen(&specimen, &options).unwrap().volume();
                let whole = mesh_specimen(&specimen, &MeshOptions { use_mirror: false, ..options }).unwrap().volume();
                // Both approximate arcs, with slightly different divisions.
                assert!((mirrored * parts - whole).abs() < 1e-3 * whole);
                (mirrored * parts - exact).abs() / exact
            };
            let (coarse, fine) = (error(10, 2.0), error(40, 0.5));
            // Fourth order would give 256 for four times as many equal arcs, second order 16; the coarse arcs of
            // triangles are finer than asked where walls are close.
            assert!(fine < 1e-6 && coarse / fine > 32.0, "{}: {coarse:e} {fine:e}", specimen.name);
        }
    }
    for use_mirror in [true, false] {
        let solid = solid();
        let options = MeshOptions { use_mirror, ..MeshOptions::search(&solid) };
        let volume = mesh_specimen(&solid, &options).unwrap().volume();
        // A block is meshed exactly.
        assert!((volume / (25.4 * 6.4 * 19.1) - if use_mirror { 0.5 } else { 1.0 }).abs() < 1e-12);
    }
}

#[test]
fn dumbbells_follow_their_outline() {
    let mut holed = dumbbell();
    holed.holes = specimen(TestKind::Uniaxial, [35.0, 2.0, 6.0], HoleAxis::Thickness, &[[-13.0, 0.0, 2.0]]).holes;
    let mut free_holed = free_dumbbell();
    free_holed.holes = bar().holes;
    free_holed.holes[0].diameter_mm = 3.0;
    for specimen in [dumbbell(), holed, free_dumbbell(), free_holed] {
        for use_mirror in [true, false] {
            for force_prisms in [true, false] {
                for factor in [1.8, 1.0] {
                    let options = MeshOptions { use_mirror, force_prisms, ..MeshOptions::scaled(&specimen, factor) };
                    let mesh = mesh_specimen(&specimen, &options).unwrap();
                    mesh.check(&specimen).unwrap();
                }
            }
        }
    }
}

/// Every dumb-bell that can be drawn is meshed, with the volume of the closed form (in the mesh's check), and its worst
/// element is no worse than the limit that a block's holes are held to.
#[test]
fn any_free_dumbbell_is_meshed() {
    use crate::specimen::sampling::free_dumbbell;
    use proptest::prelude::*;
    let settings = ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() };
    let checked = proptest::test_runner::TestRunner::new(settings).run(&free_dumbbell(), |specimen| {
        prop_assert_eq!(specimen.validate(), Ok(()));
        for factor in [1.8, 1.0] {
            let options = MeshOptions::scaled(&specimen, factor);
            let mesh = mesh_specimen(&specimen, &options).map_err(|e| TestCaseError::fail(e.to_string()))?;
            prop_assert_eq!(mesh.check(&specimen), Ok(()));
            let quality = mesh.quality();
            prop_assert!(quality.min_scaled_jacobian >= options.min_scaled_jacobian, "{:?}", quality);
            prop_assert!(quality.max_aspect_ratio < 25.0, "{:?}", quality);
        }
        Ok(())
    });
    assert!(checked.is_ok(), "{checked:?}");
}

#[test]
fn mirrors_are_used_where_they_exist() {
    let mirrors = |s: &Specimen| {
        let m = mesh_specimen(s, &MeshOptions::search(s)).unwrap().mirror;
        (m.y, m.z)
    };
    assert_eq!(mirrors(&solid()), (false, true));
    assert_eq!(mirrors(&two_holes()), (false, true));
    assert_eq!(mirrors(&off_axis()), (false, false));
    assert_eq!(mirrors(&width_holes()), (false, true));
    assert_eq!(mirrors(&bar()), (true, true));
    let mut moved = bar();
    moved.holes[0].center_mm[1] = 1.0;
    assert_eq!(mirrors(&moved), (true, false));
}

#[test]
fn equal_input_gives_equal_bits() {
    for specimen in [two_holes(), off_axis(), width_holes(), dumbbell()] {
        for force_prisms in [false, true] {
            let options = MeshOptions { force_prisms, ..MeshOptions::search(&specimen) };
            let [a, b] = [0; 2].map(|_| mesh_specimen(&specimen, &options).unwrap());
            assert_eq!(a.connectivity, b.connectivity);
            let bits = |m: &super::Mesh| m.nodes.iter().flatten().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&a), bits(&b));
            assert_eq!((a.fixed_nodes, a.moved_nodes), (b.fixed_nodes, b.moved_nodes));
        }
    }
}

#[test]
fn unknowns_are_in_the_promised_ranges() {
    let s = two_holes();
    for (options, low, high) in [
        (MeshOptions::search(&s), 2_000, 4_000),
        (MeshOptions::standard(&s), 10_000, 15_000),
        (MeshOptions::fine(&s), 40_000, 70_000),
    ] {
        let quality = mesh_specimen(&s, &options).unwrap().quality();
        let free = quality.num_free_displacements;
        assert!((low..=high).contains(&free), "{free} not in {low}..={high}");
        assert!(quality.min_scaled_jacobian > 0.4);
    }
}

#[test]
fn bad_input_gives_typed_errors() {
    let mesh = |s: &Specimen| mesh_specimen(s, &MeshOptions::standard(s)).map(|m| m.quality());
    for bad in [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e300] {
        for field in 0..6 {
            let mut s = two_holes();
            match field {
                0 => s.block.length_mm = bad,
                1 => s.block.thickness_mm = bad,
                2 => s.block.width_mm = bad,
                3 => s.holes[0].diameter_mm = bad,
                4 => s.holes[0].center_mm[0] = if bad == 0.0 || bad == -1.0 { 4.0 } else { bad },
                _ => s.holes[1].center_mm[1] = if bad == 0.0 || bad == -1.0 { 9.0 } else { bad },
            }
            assert!(mesh(&s).is_err(), "field {field} = {bad}");
            // Options made for a good specimen must not make a bad one pass either.
            assert!(mesh_specimen(&s, &MeshOptions::standard(&two_holes())).is_err());
        }
    }
    let mut overlapping = two_holes();
    overlapping.holes[0].center_mm[0] = 0.0;
    match mesh(&overlapping) {
        Err(MeshError::LigamentTooThin {
            from: LigamentEnd::Hole(0),
            to: LigamentEnd::Hole(1),
            length_mm,
            limit_mm,
        }) => {
            // 4.2333 − 5 and 2 % of 5 mm, to rounding.
            assert!((length_mm + 0.7667).abs() < 1e-9 && (limit_mm - 0.1).abs() < 1e-12);
        }
        other => panic!("{other:?}"),
    }
    let mut mixed = two_holes();
    mixed.holes[1].axis = HoleAxis::Width;
    assert_eq!(mesh(&mixed).unwrap_err(), MeshError::MixedHoleAxes { hole: 1 });
    let mut wrong = two_holes();
    wrong.outline = Outline::Iso37Type4;
    assert!(matches!(mesh(&wrong), Err(MeshError::OutlineMismatch { name: "width_mm", .. })));
    let s = two_holes();
    let tiny = MeshOptions { section_size_mm: 1e-5, ..MeshOptions::standard(&s) };
    assert!(matches!(mesh_specimen(&s, &tiny), Err(MeshError::TooManyElements { .. })));
    let tiny = MeshOptions { force_prisms: true, ..tiny };
    assert!(matches!(mesh_specimen(&s, &tiny), Err(MeshError::TooManyElements { .. })));
    let nan = MeshOptions { grading: f64::NAN, ..MeshOptions::standard(&s) };
    assert!(matches!(mesh_specimen(&s, &nan), Err(MeshError::OutOfRange { name: "grading", .. })));
}

/// Every grading gives a valid mesh with the same number of elements, finer at the faces the stronger it is.
#[test]
fn gradings_keep_the_number_of_elements() {
    for specimen in [solid(), two_holes(), bar(), width_holes(), dumbbell()] {
        let mut last: Option<super::MeshQuality> = None;
        for grading in [1.0, 0.5, 0.25, 0.1] {
            let options = MeshOptions { grading, ..MeshOptions::standard(&specimen) };
            let mesh = mesh_specimen(&specimen, &options).unwrap();
            mesh.check(&specimen).unwrap();
            let quality = mesh.quality();
            if let Some(last) = &last {
                assert!(quality.min_size_mm <= last.min_size_mm, "{}", specimen.name);
                // The ranking of layouts may change with the grading, but not by much.
                let ratio = quality.num_elements as f64 / last.num_elements as f64;
                assert!((0.7..1.4).contains(&ratio), "{}: {ratio}", specimen.name);
            }
            last = Some(quality);
        }
    }
}

/// Ligaments down to the limit are meshed.
#[test]
fn thin_ligaments_are_meshed() {
    for gap in [0.11, 0.2, 0.5, 1.0] {
        for (axis, holes) in [
            (HoleAxis::Thickness, vec![[-2.5 - 0.5 * gap, 0.0, 5.0], [2.5 + 0.5 * gap, 0.0, 5.0]]),
            (HoleAxis::Thickness, vec![[0.0, 9.55 - 2.5 - gap, 5.0]]),
            (HoleAxis::Thickness, vec![[12.7 - 2.5 - gap, 9.55 - 2.5 - gap, 5.0], [-3.0, -1.0, 7.0]]),
            (HoleAxis::Width, vec![[0.0, 3.2 - 2.5 - gap, 5.0]]),
        ] {
            let s = specimen(TestKind::DoubleLapShear, [25.4, 6.4, 19.1], axis, &holes);
            let mesh = mesh_specimen(&s, &MeshOptions::standard(&s));
            let mesh = mesh.unwrap_or_else(|e| panic!("{}: {e}", s.name));
            mesh.check(&s).unwrap();
        }
    }
}

/// Nonsense of every kind ends in a mesh or a typed error, and soon.
#[test]
fn nonsense_never_panics() {
    let mut random = Random::new(11);
    let values =
        [f64::NAN, f64::INFINITY, -1.0, 0.0, -0.0, 1e-320, 1e-9, 1e-3, 0.5, 2.0, 6.0, 12.0, 35.0, 1e3, 1e5, 1e300];
    let (mut meshed, mut refused) = (0, 0);
    for _ in 0..3000 {
        let mut pick = |usual: f64| {
            if random.below(4) == 0 {
                values[random.below(values.len() as u64)]
            } else {
                usual * random.between(0.3, 1.7)
            }
        };
        let extents = [pick(25.0), pick(6.0), pick(18.0)];
        let holes: Vec<[f64; 3]> = (0..4).map(|_| [pick(10.0) - 10.0, pick(4.0) - 4.0, pick(2.0)]).collect();
        let [gauge_width_mm, gauge_length_mm, fillet_radius_mm] = [pick(6.0), pick(6.0), pick(6.0)];
        let count = random.below(5);
        let axis = [HoleAxis::Thickness, HoleAxis::Width][random.below(2)];
        let test = [TestKind::DoubleLapShear, TestKind::Uniaxial][random.below(2)];
        let mut s = specimen(test, extents, axis, &holes[..count]);
        if random.below(4) == 0 {
            s.outline = Outline::Iso37Type4;
            (s.block.length_mm, s.block.width_mm) = (35.0, 6.0);
        } else if random.below(4) == 0 {
            s.outline = Outline::Dumbbell(Dumbbell { gauge_width_mm, gauge_length_mm, fillet_radius_mm });
        }
        let mut options = MeshOptions::search(&s);
        options.max_elements = 3000;
        options.force_prisms = random.below(3) == 0;
        if random.below(10) == 0 {
            options.section_size_mm = values[random.below(values.len() as u64)];
            options.grading = values[random.below(values.len() as u64)];
        }
        match mesh_specimen(&s, &options) {
            Ok(mesh) => {
                let checked = mesh.check(&s);
                assert!(checked.is_ok(), "{}: {checked:?}", s.name);
                meshed += 1;
            }
            Err(error) => {
                assert!(!error.to_string().is_empty());
                refused += 1;
            }
        }
    }
    println!("{meshed} meshed, {refused} refused");
    assert!(meshed > 100 && refused > 100);
}
