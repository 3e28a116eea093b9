//! A tangent is a value: what its model or a model beside it solves meanwhile does not change it.

use super::*;
use crate::material::{MAX_TERMS, Material, OgdenTerm};
use crate::mesh::{MeshOptions, mesh_specimen};
use crate::specimen::Specimen;

const TWO_HOLE: &str = include_str!("../../geometries/two-hole-shear.json");
const ECOFLEX: &str = include_str!("../../geometries/materials/ecoflex-0020.json");

fn model() -> (ForwardModel, Material) {
    let specimen = Specimen::from_json(TWO_HOLE).unwrap();
    let mesh = mesh_specimen(&specimen, &MeshOptions::scaled(&specimen, 3.0)).unwrap();
    (ForwardModel::new(mesh, &specimen).unwrap(), Material::from_json(ECOFLEX).unwrap())
}

fn solve(model: &mut ForwardModel, material: &Material, drive_mm: f64) -> Equilibrium {
    model.solve(material, drive_mm, None, &SolveOptions::default(), &|| false).unwrap()
}

/// Every number of an equilibrium.
fn bits_of(state: &Equilibrium) -> Vec<u64> {
    let forces = [state.force_n, state.normal_force_n, state.reaction_imbalance];
    let all = state.displacement.iter().flatten().chain(state.pressure.iter().flatten()).chain(&forces);
    all.map(|x| x.to_bits()).collect()
}

/// Every number of every derivative that a tangent gives.
fn derivatives(tangent: &mut Tangent, drive_rate: f64) -> Vec<u64> {
    let material = tangent.material_sensitivities().unwrap();
    let path = tangent.path_sensitivity(&material, None, drive_rate).unwrap();
    let swelling = |t: f64| Departures { log_growth: Some(Field::new(move |_| 0.1 * t)), ..Departures::default() };
    let swollen = departures_tests::along(tangent, &swelling);
    let by_displacement = path.displacement.clone();
    let adjoint = tangent.adjoint_gradient(&by_displacement, 1.0).unwrap();
    let parameters = material.iter().chain(&path.parameters);
    let mut numbers: Vec<f64> =
        parameters.flat_map(|s| s.displacement.iter().flatten().copied().chain([s.force_n])).collect();
    numbers.extend(path.displacement.iter().flatten().chain(swollen.displacement.iter().flatten()));
    numbers.extend([path.force_n, swollen.force_n].iter().chain(&adjoint));
    numbers.iter().map(|x| x.to_bits()).collect()
}

/// The model assembles and factorises other tangents, of another drive and of another material, while one is held.
#[test]
fn a_held_tangent_outlives_what_its_model_solves_next() {
    let (mut model, material) = model();
    let state = solve(&mut model, &material, 4.0);
    let factorisations = model.num_factorisations();
    let expected = derivatives(&mut model.tangent(&material, &state).unwrap(), 1.0);
    let with_first = model.num_factorisations();
    assert!(with_first <= factorisations + 1, "{with_first} {factorisations}");
    let mut held = model.tangent(&material, &state).unwrap();
    assert_eq!(model.num_factorisations(), with_first, "the tangent was factorised anew");
    let mut softer = material.clone();
    softer.terms[0].mu_kpa *= 0.7;
    let other = solve(&mut model, &softer, 6.0);
    let of_other = derivatives(&mut model.tangent(&softer, &other).unwrap(), 1.0);
    assert_eq!(derivatives(&mut held, 1.0), expected);
    assert_ne!(of_other, expected);
    // Nor does the tangent that is held change what the model finds.
    drop(held);
    let unobserved = solve(&mut model, &softer, 6.0);
    assert_eq!(bits_of(&unobserved), bits_of(&other));
}

/// The tangent of a state that the model has left is assembled and factorised once, and then held by the model.
#[test]
fn a_tangent_asked_for_late_takes_one_factorisation() {
    let (mut model, material) = model();
    let first = solve(&mut model, &material, 3.0);
    let second = solve(&mut model, &material, 5.0);
    let before = model.num_factorisations();
    model.tangent(&material, &second).unwrap();
    let with_second = model.num_factorisations();
    assert!(with_second <= before + 1, "{with_second} {before}");
    for _ in 0..2 {
        model.tangent(&material, &first).unwrap();
        assert_eq!(model.num_factorisations(), with_second + 1);
    }
}

/// Two models of one mesh, one departed, in turn: each gives what it gives alone, to the bit.
#[test]
fn departed_and_nominal_models_do_not_disturb_each_other() {
    let departures = Departures {
        stiffness_factor: Some(Field::new(|x| 1.0 + 0.05 * x[1])),
        moved_plate: PlateMotion { translation_mm: [0.0, 0.1, 0.0], ..PlateMotion::default() },
        ..Departures::default()
    };
    let alone = |departures: &Departures| -> Vec<Vec<u64>> {
        let (nominal, material) = model();
        let mut model = nominal.departed(departures);
        let at = |drive: f64| {
            let state = solve(&mut model, &material, drive);
            let derivatives = derivatives(&mut model.tangent(&material, &state).unwrap(), 1.0);
            [bits_of(&state), derivatives].concat()
        };
        [3.0, 5.0].map(at).to_vec()
    };
    let (mut nominal, material) = model();
    let mut departed = nominal.departed(&departures);
    let mut found = [Vec::new(), Vec::new()];
    for drive in [3.0, 5.0] {
        let states = [solve(&mut nominal, &material, drive), solve(&mut departed, &material, drive)];
        let mut tangents =
            [nominal.tangent(&material, &states[0]).unwrap(), departed.tangent(&material, &states[1]).unwrap()];
        for k in 0..2 {
            found[k].push([bits_of(&states[k]), derivatives(&mut tangents[k], 1.0)].concat());
        }
    }
    assert!(nominal.departures().is_none() && !departed.departures().is_none());
    assert_eq!(found[0], alone(&Departures::default()));
    assert_eq!(found[1], alone(&departures));
    assert_ne!(found[0], found[1]);
}

/// What a further term would change is told without it: the same as the derivative by its modulus where it is there,
/// but hardly. More exponents than a material has room for are told in turns.
#[test]
fn further_terms_are_told_before_they_are_there() {
    let (mut model, material) = model();
    let state = solve(&mut model, &material, 4.0);
    let exponents = [-9.0, -4.0, 1.0, 3.0, 6.0, 12.0];
    let told = model.tangent(&material, &state).unwrap().further_term_sensitivities(&exponents).unwrap();
    assert_eq!(told.len(), exponents.len());
    for (told, alpha) in told.iter().zip(exponents) {
        let mut with_term = material.clone();
        with_term.terms.push(OgdenTerm { mu_kpa: 1e-9, alpha });
        let found = model.tangent(&with_term, &state).unwrap().material_sensitivities().unwrap();
        let found = &found[found.len() - 2];
        let largest = told.displacement.iter().flatten().fold(0.0f64, |s, x| s.max(x.abs()));
        let apart = told.displacement.iter().flatten().zip(found.displacement.iter().flatten());
        let apart = apart.fold(0.0f64, |s, (a, b)| s.max((a - b).abs()));
        // Derivatives are solved to 10⁻⁸.
        assert!(largest > 0.0 && apart < 1e-6 * largest, "{alpha}: {apart} {largest}");
        assert!((told.force_n - found.force_n).abs() < 1e-6 * found.force_n.abs(), "{alpha}");
    }
    let mut full = material.clone();
    full.terms.resize(MAX_TERMS, material.terms[0]);
    let refused = model.tangent(&full, &state).unwrap().further_term_sensitivities(&exponents);
    assert!(matches!(refused, Err(SolveError::TooManyTerms { .. })));
}
