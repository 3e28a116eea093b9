//! The finite element evaluator against differences on moved meshes.

use super::*;
use crate::design::space::subspaces;
use crate::mesh::{mesh_specimen, morphed};

fn study() -> Study {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("geometries/studies");
    let text = std::fs::read_to_string(folder.join("two-hole-shear.json")).unwrap();
    Study::from_json(&text, &folder).unwrap()
}

fn never() -> bool {
    false
}

fn outcome_at(evaluator: &FeEvaluator, specimen: &Specimen, states: &[MaterialState], motion: &Motion, t: f64) -> Outcome {
    // The mesh of the unmoved specimen with moved nodes: what the derivative means.
    let mesh = mesh_specimen(specimen, &MeshOptions::scaled(specimen, 3.0)).unwrap();
    let unmoved = ForwardModel::new(mesh.clone(), specimen).unwrap();
    let mesh = match velocity(&unmoved, specimen, motion) {
        Some(v) => morphed(&mesh, &v, t),
        None => mesh,
    };
    let mut model = ForwardModel::new(mesh, specimen).unwrap();
    let drive = specimen.drive_mm[0] + t * motion.drive_mm;
    evaluator.search_on(&mut model, drive, states, &[], &|_| false, &never).unwrap().outcome
}

/// Every entry of an outcome, for Taylor tests.
fn entries(state: &StateOutcome) -> Vec<f64> {
    let mut all = state.integrated.clone();
    all.extend(&state.information);
    all.extend([state.force_n, state.largest_stretch]);
    all
}

/// Central differences of outcomes converge to the rates with h²: holes along x and z, diameters, drive.
#[test]
fn rates_pass_the_taylor_test() {
    let mut study = study();
    study.base.holes[0].center_mm = [-4.5, 1.1];
    study.base.holes[0].diameter_mm = 4.0;
    let specimen = Specimen { drive_mm: vec![5.0], ..study.base.clone() };
    let evaluator = FeEvaluator::with_sizes(&study, 3.0, 3.0);
    let states = &material_states(&study, Fidelity::Search)[1..2];
    use crate::mesh::DesignVariable::{HoleDiameter, HoleOther, HoleX};
    let motions = [
        Motion { shape: vec![(HoleX(0), 1.0)], drive_mm: 0.0 },
        Motion { shape: vec![(HoleOther(0), 0.7), (HoleDiameter(1), -0.5)], drive_mm: 0.0 },
        Motion { shape: vec![], drive_mm: 1.0 },
    ];
    let found = evaluator.evaluate_with_rates_on(&specimen, states, &motions).unwrap();
    for (motion, rate) in motions.iter().zip(&found.rates) {
        let difference = |h: f64| -> Vec<f64> {
            let plus = entries(&outcome_at(&evaluator, &specimen, states, motion, h).states[0]);
            let minus = entries(&outcome_at(&evaluator, &specimen, states, motion, -h).states[0]);
            plus.iter().zip(&minus).map(|(p, m)| (p - m) / (2.0 * h)).collect()
        };
        let (coarse, fine, exact) = (difference(0.04), difference(0.02), entries(&rate[0]));
        for (i, exact) in exact.iter().enumerate() {
            // Richardson's extrapolation leaves h⁴ and the solver's 10⁻⁶ over h.
            let limit = (4.0 * fine[i] - coarse[i]) / 3.0;
            let scale = exact.abs().max(1e-4 * entries(&found.outcome.states[0])[i].abs());
            assert!((limit - exact).abs() < 2e-3 * scale, "{motion:?} entry {i}: {limit} {exact}");
        }
    }
}

/// The confirmed values of the published base: voxel sums near the continuum's, same forces to the meshes' accuracy.
#[test]
fn search_and_confirmation_agree() {
    let study = study();
    let evaluator = FeEvaluator::with_sizes(&study, 1.8, 1.8);
    let base = study.base_at_drive();
    let search = evaluator.evaluate(&base, Fidelity::Search, &never).unwrap();
    let confirmed = evaluator.evaluate(&base, Fidelity::Confirm, &never).unwrap();
    assert_eq!(search.states.len(), 2);
    assert_eq!(confirmed.states.len(), 6);
    assert_eq!(confirmed.evaluations.len(), 2);
    for (a, b) in search.states.iter().zip([&confirmed.states[0], &confirmed.states[3]]) {
        // The same mesh here: forces to the solver's tolerance.
        assert!((a.force_n / b.force_n - 1.0).abs() < 1e-5);
        for (a, b) in a.integrated.iter().zip(&b.integrated) {
            // Voxels at walls (their number against volume) and averages over peaks, which high exponents weigh most.
            assert!((a / b - 1.0).abs() < 0.1, "{a} {b}");
        }
    }
}

/// What one search evaluation costs, for the record (run with --ignored --nocapture).
#[test]
#[ignore = "prints times"]
fn times() {
    let study = study();
    let evaluator = FeEvaluator::new(&study);
    let mut base = study.base_at_drive();
    for name in ["symmetric", "asymmetric"] {
        let clock = std::time::Instant::now();
        let outcome = evaluator.evaluate(&base, Fidelity::Search, &never).unwrap();
        eprintln!("{name} search {:?}", clock.elapsed());
        let all = subspaces(&study);
        let space = all.iter().find(|s| s.structure.num_holes() == 2).unwrap();
        let motions: Vec<Motion> = (0..space.variables.len()).map(|i| space.motion(i)).collect();
        let clock = std::time::Instant::now();
        evaluator.evaluate_with_rates(&base, &motions, &|_| true, &never).unwrap();
        eprintln!("{name} all rates by {} variables {:?}", motions.len(), clock.elapsed());
        let clock = std::time::Instant::now();
        evaluator.evaluate_with_rates(&base, &motions, &|_| false, &never).unwrap();
        eprintln!("{name} rates without information {:?}", clock.elapsed());
        let clock = std::time::Instant::now();
        let confirmed = evaluator.evaluate(&base, Fidelity::Confirm, &never).unwrap();
        eprintln!("{name} confirm {:?}", clock.elapsed());
        eprintln!("{:?}\n{:?}", outcome.states[0].integrated, confirmed.states[0].integrated);
        eprintln!("stretch {} {}", outcome.states[0].largest_stretch, confirmed.states[0].largest_stretch);
        eprintln!("{:?}", confirmed.evaluations.iter().map(|e| &e.promised_sd).collect::<Vec<_>>());
        base.holes[0].center_mm[1] = 1.0;
    }
}

impl FeEvaluator<'_> {
    fn evaluate_with_rates_on(
        &self,
        specimen: &Specimen,
        states: &[MaterialState],
        motions: &[Motion],
    ) -> Result<OutcomeWithRates, EvaluationFailure> {
        self.search(specimen, states, motions, &|_| true, &never)
    }
}
