//! Why a path of equilibria ends, where that is known: a column that buckles, a material that is unstable.

mod common;

use common::{bar, never, ogden, one_term, specimen};
use lambdak::fem::{EndCause, ForwardModel, PathEnd, SolveError, SolveOptions};
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
    println!("buckles at {:.4} mm, Euler {expected_mm:.4} mm", found.drive_mm);
    // The grips hold the ends' faces together, which stiffens them by about a thickness in twenty.
    assert!((found.drive_mm / expected_mm - 1.0).abs() < 0.08, "{} {expected_mm}", found.drive_mm);
    assert!(least_stiffness.abs() < 0.05 && !is_limit_point && place_mm[0].abs() < 0.1 * length, "{place_mm:?}");
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
