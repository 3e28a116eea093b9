//! Departures against closed forms and Taylor's theorem.

use super::*;
use crate::material::Material;
use crate::mesh::{MeshOptions, mesh_specimen};
use crate::specimen::Specimen;

const TWO_HOLE: &str = include_str!("../../geometries/two-hole-shear.json");
const ECOFLEX: &str = include_str!("../../geometries/materials/ecoflex-0020.json");
const TIGHT: SolveOptions = SolveOptions { tolerance: 1e-9, max_iterations: 20, min_step: 1.0 / 64.0 };

fn coarse() -> (Specimen, MeshOptions, Material) {
    let specimen = Specimen::from_json(TWO_HOLE).unwrap();
    let options = MeshOptions { use_mirror: false, ..MeshOptions::scaled(&specimen, 3.0) };
    (specimen, options, Material::from_json(ECOFLEX).unwrap())
}

fn model() -> (ForwardModel, Material) {
    let (specimen, options, material) = coarse();
    (ForwardModel::new(mesh_specimen(&specimen, &options).unwrap(), &specimen).unwrap(), material)
}

fn solve(model: &mut ForwardModel, material: &Material, near: Option<&Equilibrium>) -> Equilibrium {
    model.solve(material, 4.0, near, &TIGHT, &|| false).unwrap()
}

fn largest_difference(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).fold(0.0f64, |s, (x, y)| s.max((x - y).abs()))
}

/// A path of departures and its name.
type Path = (&'static str, fn(f64) -> Departures);

fn paths() -> Vec<Path> {
    vec![
        ("gradient", |t| Departures {
            stiffness_factor: Some(Field::new(move |x| 1.0 + t * x[1] / 3.2)),
            ..Departures::default()
        }),
        ("swelling", |t| Departures { log_growth: Some(Field::new(move |_| 0.1 * t)), ..Departures::default() }),
        ("fibre", |t| Departures {
            fibre: Some(Fibre { direction: [0.6, 0.8, 0.0], modulus_kpa: 5.0 * t }),
            ..Departures::default()
        }),
        ("law", |t| Departures {
            law: Some(LawCorrection { reach: 0.5, coefficients_kpa: [8.0 * t, -5.0 * t, 4.0 * t, 3.0 * t] }),
            stiffness_factor: Some(Field::new(|x| 1.0 + 0.2 * x[1] / 3.2)),
            ..Departures::default()
        }),
        ("tilt", |t| Departures {
            moved_plate: PlateMotion { rotation_rad_per_mm: [0.0, 0.0, 0.02 * t], ..PlateMotion::default() },
            ..Departures::default()
        }),
        ("gap", |t| Departures {
            fixed_plate: PlateMotion { translation_mm: [0.0, -0.5 * t, 0.2 * t], ..PlateMotion::default() },
            ..Departures::default()
        }),
    ]
}

/// The derivative of an equilibrium along a path of departures.
pub(super) fn along(tangent: &mut Tangent, path: &dyn Fn(f64) -> Departures) -> ChangeSensitivity {
    let change = tangent.change_of_departures(path, 1e-3);
    tangent.sensitivities(&[change]).unwrap().swap_remove(0)
}

/// |u(t) − u(0) − t u′(0)| falls by four when t is halved, for every kind of departure, and so does the force's error.
#[test]
fn derivatives_pass_the_taylor_test() {
    for (name, path) in paths() {
        let (mut model, material) = model();
        let at_rest = solve(&mut model, &material, None);
        let mut departed = model.departed(&path(0.0));
        let base = solve(&mut departed, &material, Some(&at_rest));
        let slope = along(&mut departed.tangent(&material, &base).unwrap(), &path);
        let mut errors = Vec::new();
        for t in [0.2, 0.1] {
            let moved = solve(&mut model.departed(&path(t)), &material, Some(&base));
            let linear: Vec<[f64; 3]> = base
                .displacement
                .iter()
                .zip(&slope.displacement)
                .map(|(u, d)| [0, 1, 2].map(|i| u[i] + t * d[i]))
                .collect();
            let force = moved.force_n - base.force_n - t * slope.force_n;
            errors.push((largest_difference(&moved.displacement, &linear), force.abs()));
        }
        let (ratio, force_ratio) = (errors[0].0 / errors[1].0, errors[0].1 / errors[1].1);
        // Second order is 4; the third-order term at t = 0.2 moves it by some ten percent.
        assert!((3.2..4.9).contains(&ratio), "{name}: {ratio} {errors:?}");
        // The force may happen to be nearly linear.
        let is_linear = errors[0].1 < 1e-4 * base.force_n;
        assert!(is_linear || (3.0..5.5).contains(&force_ratio), "{name}: {force_ratio} {errors:?}");
    }
}

/// A factor everywhere is the material with all its moduli times the factor.
#[test]
fn uniform_factor_is_a_stiffer_material() {
    let (mut model, material) = model();
    let factor = 1.3;
    let mut stiffer = material.clone();
    stiffer.terms[0].mu_kpa *= factor;
    let expected = solve(&mut model, &stiffer, None);
    let everywhere = Departures { stiffness_factor: Some(Field::new(move |_| factor)), ..Departures::default() };
    let found = solve(&mut model.departed(&everywhere), &material, None);
    // The solver's tolerance.
    assert!((found.force_n / expected.force_n - 1.0).abs() < 1e-8, "{} {}", found.force_n, expected.force_n);
    assert!(largest_difference(&found.displacement, &expected.displacement) < 1e-7);
}

/// A rigid motion of both plates moves the sample as a whole: the force along x turns with it.
#[test]
fn rigid_motions_of_both_plates_cost_nothing() {
    let (mut model, material) = model();
    let nominal = solve(&mut model, &material, None);
    let shift = PlateMotion { translation_mm: [0.3, -0.2, 0.5], ..PlateMotion::default() };
    let shifted = Departures { fixed_plate: shift, moved_plate: shift, ..Departures::default() };
    let moved = solve(&mut model.departed(&shifted), &material, Some(&nominal));
    assert!((moved.force_n / nominal.force_n - 1.0).abs() < 1e-8);
    let expected: Vec<[f64; 3]> =
        nominal.displacement.iter().map(|u| [0, 1, 2].map(|i| u[i] + shift.translation_mm[i])).collect();
    assert!(largest_difference(&moved.displacement, &expected) < 1e-7);
}

/// Released nodes with firm bonds are as good as held ones; without bonds on a face there is nothing to pull on.
#[test]
fn firm_bonds_hold_and_broken_bonds_let_go() {
    let (specimen, options, material) = coarse();
    let (mut held, _) = model();
    let nominal = solve(&mut held, &material, None);
    let mesh = mesh_specimen(&specimen, &options).unwrap();
    let mut released = ForwardModel::with_released(mesh, &specimen, &|_, is_moved| is_moved).unwrap();
    assert!(released.num_unknowns() > held.num_unknowns());
    let firm = solve(&mut released, &material, None);
    // Slip of traction / bond stiffness: some 50 kPa at the coarse mesh's edges over 10⁶ kPa/mm, against 4 mm of drive.
    assert!((firm.force_n / nominal.force_n - 1.0).abs() < 1e-4, "{} {}", firm.force_n, nominal.force_n);
    assert!(firm.reaction_imbalance < 1e-6);
    let mut unbonded = released.departed(&Departures {
        bond_kpa_per_mm: Some(Field::new(|x| if x[0] > 8.7 { 0.0 } else { FIRM_BOND_KPA_PER_MM })),
        ..Departures::default()
    });
    let part = solve(&mut unbonded, &material, None);
    // About an eighth of the face carries no shear any more; the block's end still passes some on.
    assert!(part.force_n < 0.97 * nominal.force_n && part.force_n > 0.8 * nominal.force_n, "{}", part.force_n);
    let slip = released.mesh().moved_nodes.iter().map(|&v| 4.0 - part.displacement[v as usize][0]);
    assert!(slip.fold(0.0, f64::max) > 0.3);
}

/// The derivative with respect to a bond's compliance, as that of every other departure.
#[test]
fn bonds_pass_the_taylor_test() {
    let (specimen, options, material) = coarse();
    let mesh = mesh_specimen(&specimen, &options).unwrap();
    let model = ForwardModel::with_released(mesh, &specimen, &|_, is_moved| is_moved).unwrap();
    let path = |t: f64| Departures {
        bond_kpa_per_mm: Some(Field::new(move |x| if x[0] > 5.0 { 30.0 * (1.0 + t) } else { FIRM_BOND_KPA_PER_MM })),
        ..Departures::default()
    };
    let mut departed = model.departed(&path(0.0));
    let base = solve(&mut departed, &material, None);
    let slope = along(&mut departed.tangent(&material, &base).unwrap(), &path);
    let errors = [0.2, 0.1].map(|t| {
        let moved = solve(&mut model.departed(&path(t)), &material, Some(&base));
        (moved.force_n - base.force_n - t * slope.force_n).abs()
    });
    // Second order is 4; stiffness enters as t/(1 + t), whose third-order term is a fifth of the second at t = 0.2.
    assert!((3.0..4.9).contains(&(errors[0] / errors[1])), "{errors:?}");
}

/// A plate out of place by a degree is reached by parts as at once; one out of place by four degrees by parts.
#[test]
fn plates_are_brought_out_of_place_by_parts() {
    let turned = |degrees: f64| Departures {
        moved_plate: PlateMotion { rotation_rad: [0.0, 0.0, degrees.to_radians()], ..PlateMotion::default() },
        ..Departures::default()
    };
    let (model, material) = model();
    let mut near = model.departed(&turned(1.0));
    let at_once = solve(&mut near, &material, None);
    let by_parts = near.solve_by_parts(&material, 4.0, &TIGHT, &|| false).unwrap();
    // The tolerance of the solver, 1e-9 of the force, moves points of this soft block by less than this, mm.
    assert!(largest_difference(&at_once.displacement, &by_parts.displacement) < 1e-6);
    let mut turned_far = model.departed(&turned(4.0));
    let far = turned_far.solve_by_parts(&material, 4.0, &TIGHT, &|| false).unwrap();
    // It is an equilibrium of the whole departure: solved anew from there, it stays.
    let solved_anew = solve(&mut turned_far, &material, Some(&far));
    assert!(largest_difference(&far.displacement, &solved_anew.displacement) < 1e-6);
}
