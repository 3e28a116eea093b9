use super::*;
use crate::calibration::Observed;
use crate::diagnosis::scene::Scene;
use crate::diagnosis::test_recordings::{FORCE_SD_N, MESH_FACTOR, inference_of, material, recorded};

/// A material that is off in modulus and exponent: a fit finds the right one. One that is to come below any deviance
/// ends where it starts, because no step promises that; one whose goal is within reach ends where it would without.
#[test]
fn a_fit_that_cannot_come_to_its_goal_ends() {
    let recording = recorded(&material(), &Scene::default(), MESH_FACTOR);
    let observed = Observed::new(&recording, FORCE_SD_N).unwrap();
    let mut inference = inference_of(&observed);
    let measured = inference.laboratory.measured();
    let mut soft = material();
    soft.terms[0].mu_kpa *= 0.67;
    soft.terms[0].alpha += 1.0;
    let mut fit = |goal: Option<f64>| {
        inference.settings.goal = goal;
        inference.fit(&measured, &soft, &[]).unwrap()
    };
    let free = fit(None);
    let (near, far) = (fit(Some(2.0 * free.deviance)), fit(Some(-1e12)));
    let (found, sd) = (free.material.terms[0].mu_kpa, free.sd[1]);
    assert!((found - material().terms[0].mu_kpa).abs() < 4.0 * sd, "{found} {sd}");
    assert!(
        (near.deviance - free.deviance).abs() < inference.settings.tolerance,
        "{} {}",
        near.deviance,
        free.deviance
    );
    assert_eq!((far.iterations, far.material.terms[0].mu_kpa), (0, soft.terms[0].mu_kpa));
    assert!(far.deviance > 1.5 * free.deviance && free.iterations > 0, "{} {}", far.deviance, free.deviance);
}

/// A trial that is far from the equilibria found last has none for a fit; a prediction of its own looks for it from
/// everywhere.
#[test]
fn a_trial_starts_from_what_was_found_last_alone() {
    let recording = recorded(&material(), &Scene::default(), MESH_FACTOR);
    let observed = Observed::new(&recording, FORCE_SD_N).unwrap();
    let mut inference = inference_of(&observed);
    let (scene, never) = (Scene::default(), || false);
    let laboratory = &mut inference.laboratory;
    // Without an equilibrium found before, both look everywhere.
    let first = laboratory.predict_from(&material(), &scene, Starts::FoundLast, &never).unwrap();
    let near = laboratory.predict_from(&material(), &scene, Starts::FoundLast, &never).unwrap();
    assert!(near.trace.plus(-1.0, &first.trace).rms_mm() < 1e-6);
    let mut hopeless = material();
    // Ogden's terms of opposite sign: no stable material.
    hopeless.terms[0].mu_kpa = -hopeless.terms[0].mu_kpa;
    assert!(laboratory.predict_from(&hopeless, &scene, Starts::FoundLast, &never).is_err());
    // What failed leaves the equilibria from which the next trial starts.
    let again = laboratory.predict_from(&material(), &scene, Starts::FoundLast, &never).unwrap();
    assert!(again.trace.plus(-1.0, &first.trace).rms_mm() < 1e-6);
}
