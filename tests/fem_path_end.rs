//! Why a path of equilibria ends, where that is known: columns that buckle under a drive or before it, a bar that
//! necks, a material that is unstable.

mod common;

use common::{bar, never, ogden, one_term, specimen};
use lambdak::fem::{EndCause, ForwardModel, PathEnd, SolveError, SolveOptions, Way};
use lambdak::material::Material;
use lambdak::mesh::{MeshOptions, mesh_specimen};
use lambdak::specimen::{HoleAxis, Specimen, TestKind};
use std::f64::consts::PI;

/// Why the path to a drive that `s` does not reach ends.
fn end(s: &Specimen, options: &MeshOptions, material: &Material, asked_mm: f64) -> PathEnd {
    let mut model = ForwardModel::new(mesh_specimen(s, options).unwrap(), s).unwrap();
    let failed = model.solve(material, asked_mm, None, &SolveOptions::default(), &never);
    let Err(SolveError::Diverged { reached_mm, .. }) = failed else { panic!("it ends before {asked_mm} mm") };
    let end = model.path_end(material, reached_mm, asked_mm, &never).unwrap();
    println!("{end}");
    end
}

/// A column between clamped ends buckles at a compression of π² t²/(3 L²) of its length (Euler), as long as that is
/// small; the middle goes aside most.
#[test]
fn a_column_buckles_where_euler_says() {
    let [length, thickness, width] = [40.0, 2.0, 6.0];
    let column = specimen(TestKind::Uniaxial, [length, thickness, width], HoleAxis::Thickness, &[]);
    // A half of it that is mirrored could not go aside.
    let options = MeshOptions { use_mirror: false, ..MeshOptions::scaled(&column, 2.0) };
    let expected_mm = -length * (PI * thickness / length).powi(2) / 3.0;
    let found = end(&column, &options, &one_term(), 3.0 * expected_mm);
    let EndCause::Sample { least_stiffness, place_mm, is_limit_point, .. } = found.cause else {
        panic!("{:?}", found.cause)
    };
    println!("buckles at {:.4} mm, Euler {expected_mm:.4} mm", found.reached_mm);
    // The grips hold the ends' faces together, which stiffens them by about a thickness in twenty.
    assert!((found.reached_mm / expected_mm - 1.0).abs() < 0.08, "{} {expected_mm}", found.reached_mm);
    assert!(least_stiffness.abs() < 0.05 && !is_limit_point && place_mm[0].abs() < 0.1 * length, "{place_mm:?}");
}

/// A slender block between plates that are pressed together before any drive buckles where such a column does.
#[test]
fn a_block_buckles_while_its_plates_are_pressed_together() {
    let [length, thickness, width] = [2.0, 24.0, 6.0];
    let block = specimen(TestKind::DoubleLapShear, [length, thickness, width], HoleAxis::Thickness, &[]);
    let expected_mm = thickness * (PI * length / thickness).powi(2) / 3.0;
    let pressed = Specimen { precompression_mm: 3.0 * expected_mm, ..block };
    let options = MeshOptions { levels: 24, ..MeshOptions::scaled(&pressed, 2.0) };
    let mut model = ForwardModel::new(mesh_specimen(&pressed, &options).unwrap(), &pressed).unwrap();
    let failed = model.solve(&one_term(), 1.0, None, &SolveOptions::default(), &never);
    let Err(SolveError::NotPrecompressed { reached_mm, asked_mm, .. }) = failed else { panic!("{failed:?}") };
    let end = model.precompression_end(&one_term(), reached_mm, asked_mm, &never).unwrap();
    println!("{end}; solved to {reached_mm:.4} mm, Euler {expected_mm:.4} mm");
    let EndCause::Sample { least_stiffness, place_mm, is_limit_point, .. } = end.cause else {
        panic!("{:?}", end.cause)
    };
    assert!(end.way == Way::Precompression && end.to_string().contains("precompression_mm"));
    // The bonded ends stiffen it by about a thickness in twelve, the shear that Euler leaves out softens it by as much.
    assert!((end.reached_mm / expected_mm - 1.0).abs() < 0.08, "{} {expected_mm}", end.reached_mm);
    assert!(least_stiffness.abs() < 0.05 && !is_limit_point, "{least_stiffness}");
    assert!(place_mm[1].abs() < 0.1 * thickness, "{place_mm:?}");
}

/// A bar of a material that carries no more force beyond some stretch (Considère) necks, and snaps where what the neck
/// gains the rest of the bar, which is unloaded, can no longer give: at a limit point. Displacements then go with the
/// square root of the way that is left. From 0.04 to 0.01 of it they change twice as much as from 0.01 to 0.0025, four
/// times as much on a path that runs on; the middle between both decides.
#[test]
fn a_bar_that_necks_turns_back() {
    let s = specimen(TestKind::Uniaxial, [35.0, 3.0, 19.0], HoleAxis::Thickness, &[]);
    let material = ogden(320.0, &[(-41.0, -1.33)]);
    let options = MeshOptions::scaled(&s, 3.0);
    let found = end(&s, &options, &material, 70.0);
    let EndCause::Sample { is_limit_point, goes_on, .. } = found.cause else { panic!("{:?}", found.cause) };
    assert!(is_limit_point && !goes_on, "{:?}", found.cause);
    let mut model = ForwardModel::new(mesh_specimen(&s, &options).unwrap(), &s).unwrap();
    let drives = [0.04, 0.01, 0.0025].map(|left| found.reached_mm * (1.0 - left));
    let states = model.solve_path(&material, &drives, &SolveOptions::default(), &never).unwrap();
    // The plate's own motion, which goes with the drive, is taken off.
    let stretched = |n: usize| -> Vec<[f64; 3]> {
        let nodes = &model.mesh().nodes;
        let rigid = |x: &[f64; 3]| drives[n] * (x[0] / 35.0 + 0.5);
        states[n].displacement.iter().zip(nodes).map(|(u, x)| [u[0] - rigid(x), u[1], u[2]]).collect()
    };
    let change = |a: usize, b: usize| -> f64 {
        let pairs = stretched(a).into_iter().zip(stretched(b));
        pairs.map(|(a, b)| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>()).sum::<f64>().sqrt()
    };
    let ratio = change(0, 1) / change(1, 2);
    println!("forces {:?}, change {ratio:.2}", states.iter().map(|s| s.force_n).collect::<Vec<_>>());
    assert!(states[0].force_n > states[2].force_n, "beyond the largest force");
    assert!(ratio < 8f64.sqrt(), "{ratio}");
}

/// A material whose third product is negative is unstable beyond some stretch, at a point before the bar as a whole.
#[test]
fn an_unstable_material_is_told() {
    let material = ogden(2000.0, &[(20.0, 2.0), (5.0, 1.5), (-0.05, 9.0)]);
    let s = bar();
    let found = end(&s, &MeshOptions::scaled(&s, 1.8), &material, 40.0);
    let EndCause::Material { relative_stiffness, place_mm } = found.cause else { panic!("{:?}", found.cause) };
    // Next to the hole, where the bar is stretched most.
    assert!(relative_stiffness < 0.0 && place_mm[0].abs() < 4.0, "{relative_stiffness} {place_mm:?}");
}

/// A neo-Hookean bar is stable at every stretch. On six elements the meshed bar gives way at a stretch of five, before
/// any element folds; on finer ones it is followed further.
#[test]
fn a_coarse_mesh_gives_way_before_it_folds() {
    let s = specimen(TestKind::Uniaxial, [20.0, 8.0, 8.0], HoleAxis::Thickness, &[]);
    let material = ogden(2000.0, &[(10.0, 2.0)]);
    let asked_mm = 120.0;
    let found = end(&s, &MeshOptions::scaled(&s, 5.0), &material, asked_mm);
    let EndCause::Sample { least_stiffness, .. } = found.cause else { panic!("{:?}", found.cause) };
    assert!(least_stiffness < 0.05 && (70.0..100.0).contains(&found.reached_mm), "{found}");
    let mut finer = ForwardModel::new(mesh_specimen(&s, &MeshOptions::scaled(&s, 1.5)).unwrap(), &s).unwrap();
    finer.solve(&material, asked_mm, None, &SolveOptions::default(), &never).expect("a finer mesh goes on");
}
