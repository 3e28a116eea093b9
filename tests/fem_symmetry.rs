//! Invariances: mirrored and full models, exchanged axes, instruction sets, units of length and of stress.

mod common;

use common::{bar, model, off_axis, ogden, one_term, solve, specimen, two_holes, two_terms};
use lambdak::fem::{Equilibrium, ForwardModel};
use lambdak::mesh::{Locator, MeshOptions, mesh_specimen};
use lambdak::specimen::{HoleAxis, Specimen, TestKind};

fn displacement_at(model: &ForwardModel, found: &Equilibrium, point: [f64; 3]) -> [f64; 3] {
    let mesh = model.mesh();
    let location = Locator::new(mesh).locate(mesh, point).expect("inside");
    let shape = mesh.element_kind.shape_functions(location.reference_coordinates);
    let mut u = [0.0; 3];
    for (&v, n) in mesh.element(location.element as usize).iter().zip(shape) {
        for i in 0..3 {
            u[i] += n * found.displacement[v as usize][i];
        }
    }
    u
}

fn close(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * a.abs().max(b.abs())
}

/// The full mesh whose half is the mirrored mesh: the node at each mirrored place exists, so results agree to the
/// solver's tolerance.
#[test]
fn mirrored_models_equal_full_ones() {
    for (specimen, drive) in [(two_holes(), 5.0), (bar(), 15.0)] {
        let material = two_terms();
        let options = MeshOptions::scaled(&specimen, 2.0);
        // An even number of levels is cut in two by the mirror plane.
        let options = MeshOptions { levels: options.levels.next_multiple_of(2), ..options };
        let [mut half, mut full] = [true, false].map(|use_mirror| {
            let mesh = mesh_specimen(&specimen, &MeshOptions { use_mirror, ..options }).unwrap();
            ForwardModel::new(mesh, &specimen).unwrap()
        });
        let planes = u32::from(half.mesh().mirror.y) + u32::from(half.mesh().mirror.z);
        assert!(planes > 0 && !full.mesh().mirror.y && !full.mesh().mirror.z);
        let is_nested = full.mesh().num_elements() == half.mesh().num_elements() << planes;
        let [a, b] = [&mut half, &mut full].map(|m| solve(m, &material, drive).unwrap());
        println!(
            "{}: half {} N, full {} N, relative {:.1e}, nested: {is_nested}",
            specimen.name,
            a.force_n,
            b.force_n,
            a.force_n / b.force_n - 1.0
        );
        // Residual 1e-11 of the reactions.
        assert!(close(a.force_n, b.force_n, 1e-9));
        for (node, u) in half.mesh().nodes.iter().zip(&a.displacement).step_by(7) {
            let signs = [1.0, if half.mesh().mirror.y { -1.0 } else { 1.0 }, -1.0];
            let v = displacement_at(&full, &b, *node);
            let w = displacement_at(&full, &b, [0, 1, 2].map(|i| signs[i] * node[i]));
            for i in 0..3 {
                assert!((u[i] - v[i]).abs() < 1e-8 && (u[i] - signs[i] * w[i]).abs() < 1e-8, "{node:?} {u:?} {v:?}");
            }
        }
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
            fast.material_sensitivities(&material, &a).unwrap(),
            portable.material_sensitivities(&material, &b).unwrap(),
        );
        for (a, b) in a.iter().zip(&b) {
            // The linear solves stop at 1e-10.
            assert!(close(a.force_n, b.force_n, 1e-8), "{:?} {} {}", a.parameter, a.force_n, b.force_n);
        }
    }
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
