//! Dumb-bells of free gauge: forces against finer meshes, whole models and blocks, and the traditional route.

mod common;

use common::{model, never, one_term, short_dumbbell, solve, specimen, tight, two_terms};
use lambdak::fem::{ForwardModel, SolveOptions};
use lambdak::homogeneous::{CurveFitOptions, DumbbellOptions, fit_dumbbell};
use lambdak::mesh::{MeshOptions, mesh_specimen};
use lambdak::specimen::dumbbell::ISO37_TYPE4;
use lambdak::specimen::{Dumbbell, HoleAxis, Outline, Specimen, TestKind};

fn force(model: &mut ForwardModel, drive_mm: f64) -> f64 {
    solve(model, &one_term(), drive_mm).unwrap().force_n
}

/// The standard mesh's force is that of a mesh with five times as many elements, to the 0.1 % to which meshes of bars
/// agree, and the coarse mesh's to 1 %; triangles give the same.
#[test]
fn forces_settle_with_the_mesh() {
    let short = short_dumbbell();
    let fine = force(&mut model(&short, 0.6), 8.0);
    let standard = force(&mut model(&short, 1.0), 8.0);
    let coarse = force(&mut model(&short, 1.8), 8.0);
    println!("{coarse} {standard} {fine}");
    assert!((standard / fine - 1.0).abs() < 1e-3 && (coarse / fine - 1.0).abs() < 1e-2);
    let options = MeshOptions { force_prisms: true, ..MeshOptions::standard(&short) };
    let prisms = force(&mut ForwardModel::new(mesh_specimen(&short, &options).unwrap(), &short).unwrap(), 8.0);
    println!("{prisms}");
    assert!((prisms / fine - 1.0).abs() < 2e-3);
}

/// A quarter stands for the whole, to the solver's tolerance: the whole mesh is the quarter's with its images.
#[test]
fn a_quarter_stands_for_the_whole() {
    let short = short_dumbbell();
    let quarter = model(&short, 1.8).solve(&one_term(), 8.0, None, &tight(), &never).unwrap().force_n;
    let options = MeshOptions { use_mirror: false, ..MeshOptions::scaled(&short, 1.8) };
    let whole = force(&mut ForwardModel::new(mesh_specimen(&short, &options).unwrap(), &short).unwrap(), 8.0);
    println!("{quarter} {whole}");
    // The whole has other divisions across the width: the coarse meshes' own difference.
    assert!((quarter / whole - 1.0).abs() < 5e-3);
}

/// A gauge that is hardly narrower than the block pulls like the block: the force falls short in proportion to what is
/// cut away.
#[test]
fn a_gauge_that_hardly_narrows_is_a_block() {
    let block = specimen(TestKind::Uniaxial, [40.0, 4.0, 12.0], HoleAxis::Thickness, &[]);
    let whole = force(&mut model(&block, 1.3), 8.0);
    let short_by = |narrower_mm: f64| {
        let gauge_width_mm = 12.0 - narrower_mm;
        let gauge = Dumbbell { gauge_width_mm, gauge_length_mm: 20.0, fillet_radius_mm: 5.0 };
        let necked = Specimen { outline: Outline::Dumbbell(gauge), ..block.clone() };
        assert_eq!(necked.validate(), Ok(()));
        1.0 - force(&mut model(&necked, 1.3), 8.0) / whole
    };
    let [wide, narrow] = [short_by(0.1), short_by(0.2)];
    println!("{wide} {narrow}");
    // Half of the length is narrower by 1/120: about 1/240 of the force.
    assert!((0.003..0.006).contains(&wide), "{wide}");
    assert!((narrow / wide - 2.0).abs() < 0.1, "{narrow} {wide}");
}

/// The standard's dumb-bell, written as one of free gauge, is the same to the last bit.
#[test]
fn the_standards_gauge_gives_the_standards_force() {
    let standard = Specimen::from_json(include_str!("../geometries/iso37-type4.json")).unwrap();
    let free = Specimen { outline: Outline::Dumbbell(ISO37_TYPE4), ..standard.clone() };
    let [a, b] = [&standard, &free].map(|s| force(&mut model(s, 1.8), 10.0));
    assert_eq!(a.to_bits(), b.to_bits());
}

/// The material behind a force over grip displacement is recovered from a short gauge as well: the two meshes' forces
/// differ by some 0.3 %.
#[test]
fn the_traditional_route_takes_any_gauge() {
    let short = short_dumbbell();
    let truth = two_terms();
    let drives: Vec<f64> = (1..=12).map(|i| 2.5 * f64::from(i)).collect();
    let path = model(&short, 1.3).solve_path(&truth, &drives, &SolveOptions::default(), &never).unwrap();
    let forces: Vec<f64> = path.iter().map(|e| e.force_n).collect();
    let options = DumbbellOptions {
        mesh: MeshOptions::scaled(&short, 1.8),
        fit: CurveFitOptions { max_terms: 2, bulk_kpa: Some(2200.0), ..CurveFitOptions::default() },
        max_rounds: 16,
        tolerance: 1.5e-3,
    };
    let found = fit_dumbbell(&short, &drives, &forces, &options, &never).unwrap();
    let modulus = found.sequence.chosen().initial_shear_modulus_kpa.value;
    println!("{modulus} {}, mismatch {}", truth.initial_shear_modulus_kpa(), found.force_mismatch);
    assert!(found.force_mismatch < 0.01);
    assert!((modulus / truth.initial_shear_modulus_kpa() - 1.0).abs() < 0.03);
}
