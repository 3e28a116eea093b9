//! Invariances: mirrored and full models, exchanged axes, instruction sets, units of length and of stress.

mod common;

use common::{bar, ellipse_and_slot, model, off_axis, ogden, one_term, solve, specimen, two_holes, two_terms};
use lambdak::fem::ForwardModel;
use lambdak::mesh::{Mesh, MeshOptions, mesh_specimen};
use lambdak::specimen::{Hole, HoleAxis, HoleKind, HoleShape, Specimen, TestKind};

fn close(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * a.abs().max(b.abs())
}

/// The mesh joined with its mirror image in coordinate `axis`, and for each node the image's index.
fn reflected(mesh: &Mesh, axis: usize) -> (Mesh, Vec<u32>) {
    let on_plane = if axis == 1 { &mesh.mirror_y_nodes } else { &mesh.mirror_z_nodes };
    let mut full = mesh.clone();
    let mut image: Vec<u32> = (0..mesh.nodes.len() as u32).collect();
    for (v, &p) in mesh.nodes.iter().enumerate() {
        if !on_plane.contains(&(v as u32)) {
            image[v] = full.nodes.len() as u32;
            let mut q = p;
            q[axis] = -q[axis];
            full.nodes.push(q);
        }
    }
    let level = mesh.element_kind.num_nodes() / 3;
    for e in 0..mesh.num_elements() {
        // Levels in reverse order turn the reflected element right side out.
        for k in [2, 1, 0] {
            full.connectivity.extend(mesh.element(e)[k * level..(k + 1) * level].iter().map(|&v| image[v as usize]));
        }
    }
    let both = |set: &[u32]| {
        let mut all: Vec<u32> = set.iter().flat_map(|&v| [v, image[v as usize]]).collect();
        all.sort_unstable();
        all.dedup();
        all
    };
    full.fixed_nodes = both(&mesh.fixed_nodes);
    full.moved_nodes = both(&mesh.moved_nodes);
    full.mirror_y_nodes = both(&mesh.mirror_y_nodes);
    full.mirror_z_nodes = both(&mesh.mirror_z_nodes);
    if axis == 1 {
        full.mirror.y = false;
        full.mirror_y_nodes.clear();
    } else {
        full.mirror.z = false;
        full.mirror_z_nodes.clear();
    }
    (full, image)
}

/// A model of the half and one of the half joined with its image give the same forces and displacements, up to the
/// solver's tolerance (residual 1e-11 of the reactions).
#[test]
fn mirrored_models_equal_full_ones() {
    for (specimen, drive) in [(two_holes(), 5.0), (bar(), 15.0)] {
        let material = two_terms();
        let mut half = model(&specimen, 2.0);
        let part = solve(&mut half, &material, drive).unwrap();
        for axis in [1, 2] {
            let is_mirror = if axis == 1 { half.mesh().mirror.y } else { half.mesh().mirror.z };
            if !is_mirror {
                continue;
            }
            let (mesh, image) = reflected(half.mesh(), axis);
            let mut full = ForwardModel::new(mesh, &specimen).unwrap();
            let whole = solve(&mut full, &material, drive).unwrap();
            println!("axis {axis}: half {} N, full {} N", part.force_n, whole.force_n);
            assert!(close(part.force_n, whole.force_n, 1e-9), "{} {}", part.force_n, whole.force_n);
            assert!(close(part.normal_force_n, whole.normal_force_n, 1e-7) || axis == 1 || full.mesh().mirror.y);
            for (v, u) in part.displacement.iter().enumerate() {
                let (same, other) = (whole.displacement[v], whole.displacement[image[v] as usize]);
                for i in 0..3 {
                    let sign = if i == axis { -1.0 } else { 1.0 };
                    assert!((u[i] - same[i]).abs() < 1e-8 && (u[i] - sign * other[i]).abs() < 1e-8);
                }
            }
        }
    }
}

/// The mesher's own full mesh has other node positions than the half (its section is divided as a whole): equal forces
/// within the discretisation error, here far below 0.1 %.
#[test]
fn meshes_with_and_without_mirrors_agree() {
    for (specimen, drive) in [(two_holes(), 5.0), (bar(), 15.0)] {
        let options = MeshOptions::scaled(&specimen, 2.0);
        let forces = [true, false].map(|use_mirror| {
            let mesh = mesh_specimen(&specimen, &MeshOptions { use_mirror, ..options }).unwrap();
            solve(&mut ForwardModel::new(mesh, &specimen).unwrap(), &two_terms(), drive).unwrap().force_n
        });
        println!("mirrored {} N, full {} N: {:+.1e}", forces[0], forces[1], forces[0] / forces[1] - 1.0);
        assert!(close(forces[0], forces[1], 1e-3), "{forces:?}");
    }
}

/// In a uniaxial test thickness and width are alike: exchanging them together with the holes' axis turns the specimen.
#[test]
fn exchanging_thickness_and_width_changes_nothing() {
    let holes = [[-6.0, 1.0, 4.0], [7.0, -2.0, 3.0]];
    let a = specimen(TestKind::Uniaxial, [40.0, 5.0, 14.0], HoleAxis::Thickness, &holes);
    let b = specimen(TestKind::Uniaxial, [40.0, 14.0, 5.0], HoleAxis::Width, &holes);
    let base = MeshOptions::scaled(&a, 2.0);
    let forces = [a, b].map(|s| {
        // The defaults differ with the holes' axis; the comparison needs equal meshes.
        let mesh = mesh_specimen(&s, &MeshOptions { levels: 4, use_mirror: false, ..base }).unwrap();
        let mut model = ForwardModel::new(mesh, &s).unwrap();
        solve(&mut model, &two_terms(), 15.0).unwrap().force_n
    });
    println!("holes along thickness {} N, along width {} N", forces[0], forces[1]);
    // Equal meshes up to a rotation: solver tolerance.
    assert!(close(forces[0], forces[1], 1e-9));
}

/// Pulling to −x is the mirror image of pulling to +x in shear of a specimen symmetric in x.
#[test]
fn shear_is_odd_in_the_drive() {
    let mut model = model(&two_holes(), 2.0);
    let [plus, minus] = [4.0, -4.0].map(|d| solve(&mut model, &one_term(), d).unwrap());
    assert!(close(plus.force_n, -minus.force_n, 1e-9), "{} {}", plus.force_n, minus.force_n);
    assert!(close(plus.normal_force_n, minus.normal_force_n, 1e-7));
    assert!(plus.reaction_imbalance < 1e-9);
}

/// Portable kernels and those with special instructions differ by rounding only: 1e-15 × κ/μ in the residual.
#[test]
fn instruction_sets_agree() {
    for s in [off_axis(), bar()] {
        let drive = 0.6 * if s.test == TestKind::Uniaxial { s.block.length_mm } else { s.block.thickness_mm };
        let mut fast = model(&s, 2.5);
        let mut portable = model(&s, 2.5);
        portable.use_portable_kernels();
        assert_eq!(portable.instruction_set(), "portable");
        let material = two_terms();
        let (a, b) = (solve(&mut fast, &material, drive).unwrap(), solve(&mut portable, &material, drive).unwrap());
        println!("{}: {:e}", fast.instruction_set(), a.force_n / b.force_n - 1.0);
        assert!(close(a.force_n, b.force_n, 1e-12), "{} {}", a.force_n, b.force_n);
        let (a, b) = (
            fast.tangent(&material, &a).unwrap().material_sensitivities().unwrap(),
            portable.tangent(&material, &b).unwrap().material_sensitivities().unwrap(),
        );
        for (a, b) in a.iter().zip(&b) {
            // The linear solves stop at 1e-10.
            assert!(close(a.force_n, b.force_n, 1e-8), "{:?} {} {}", a.parameter, a.force_n, b.force_n);
        }
    }
}

/// Holes that are not circles: an ellipse as long as wide is the circle; half a turn changes nothing; a specimen
/// mirrored in z has the same force; mirrored in x, where the other plate then moves the other way, too.
#[test]
fn turned_and_mirrored_outlines_have_the_same_force() {
    let material = two_terms();
    let force = |s: &Specimen| solve(&mut model(s, 2.0), &material, 5.0).unwrap().force_n;
    let with = |change: &dyn Fn(&mut Hole)| {
        let mut s = ellipse_and_slot();
        s.holes.iter_mut().for_each(change);
        s
    };
    let drawn = force(&ellipse_and_slot());
    let turned = force(&with(&|h| h.shape.iter_mut().for_each(|shape| shape.angle_deg += 180.0)));
    // The same mesh to rounding, and the solver's tolerance.
    assert!(close(drawn, turned, 1e-8), "{drawn} {turned}");
    for signs in [[1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]] {
        let mirrored = force(&with(&|h| *h = h.mirrored(signs)));
        // Divisions of edges may differ by one part between a cell and its image: a discretisation's difference.
        assert!(close(drawn, mirrored, 2e-3), "{signs:?}: {drawn} {mirrored}");
    }
    let circles = force(&off_axis());
    let mut round = off_axis();
    for hole in &mut round.holes {
        hole.shape = Some(HoleShape { kind: HoleKind::Ellipse, length_mm: hole.diameter_mm, angle_deg: 25.0 });
    }
    // The same wall, divided along other lines.
    assert!(close(circles, force(&round), 2e-3), "{circles} {}", force(&round));
}

/// All lengths × s: the same strains, forces × s². All moduli × c: the same displacements, forces × c.
#[test]
fn results_scale_with_units() {
    let base = off_axis();
    let options = MeshOptions::scaled(&base, 2.5);
    let run = |s: &Specimen, length: f64, modulus: f64| {
        let size = MeshOptions { section_size_mm: length * options.section_size_mm, ..options };
        let mut model = ForwardModel::new(mesh_specimen(s, &size).unwrap(), s).unwrap();
        let material = ogden(2200.0 * modulus, &[(16.0 * modulus, 1.9), (0.35 * modulus, 8.0)]);
        solve(&mut model, &material, 5.0 * length).unwrap()
    };
    let first = run(&base, 1.0, 1.0);
    for (length, modulus) in [(2.0, 1.0), (0.37, 1.0), (1.0, 53.0), (10.0, 1e3)] {
        let mut s = base.clone();
        s.block.length_mm *= length;
        s.block.thickness_mm *= length;
        s.block.width_mm *= length;
        for hole in &mut s.holes {
            hole.center_mm = hole.center_mm.map(|x| x * length);
            hole.diameter_mm *= length;
        }
        let other = run(&s, length, modulus);
        let expected = first.force_n * length * length * modulus;
        // Solver tolerance.
        assert!(close(other.force_n, expected, 1e-9), "{length} {modulus}: {} {expected}", other.force_n);
        for (u, v) in first.displacement.iter().zip(&other.displacement) {
            for i in 0..3 {
                assert!((u[i] * length - v[i]).abs() < 1e-8 * length);
            }
        }
    }
}
