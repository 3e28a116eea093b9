//! Concealed causes recovered, controls left alone.

use super::super::model::Physics;
use super::*;
use crate::homogeneous::HomogeneousTest;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

/// Load–unload at a rate (1/s) to `end`, `num` samples, scaled to the test's rest.
fn ramp(name: &str, test: HomogeneousTest, rate: f64, end: f64, num: usize) -> LoadCurve {
    let height = end - test.rest();
    let time: Vec<f64> = (1..=num).map(|i| 2.0 * height.abs() / rate * i as f64 / num as f64).collect();
    let drive: Vec<f64> = time
        .iter()
        .map(|t| {
            let p = rate * t / height.abs();
            test.rest() + height * if p < 1.0 { p } else { 2.0 - p }
        })
        .collect();
    LoadCurve::new(name, test, &time, &drive, &vec![0.0; num]).unwrap()
}

fn add(layout: &Layout, x: &[f64], curves: &mut [LoadCurve], noise_kpa: f64, seed: u64) {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    for (i, curve) in curves.iter_mut().enumerate() {
        curve.nominal_stress_kpa = synthetic_stress(layout, x, curve, i)
            .iter()
            .map(|s| s + noise_kpa * rng.sample::<f64, _>(StandardNormal))
            .collect();
    }
}

fn never() -> bool {
    false
}

/// μα = 20 kPa at α = 2.4, with `physics`; the elastic material comes first in `x`.
fn layout(physics: Physics, num_curves: usize) -> Layout {
    Layout { signs: vec![1.0], physics, num_curves }
}

fn parameter<'v>(verdict: &'v LoadCurveVerdict, cause: &str, name: &str) -> Option<&'v super::super::CauseParameter> {
    verdict.causes.iter().find(|c| c.name == cause)?.parameters.iter().find(|p| p.name == name)
}

fn holds(p: Option<&super::super::CauseParameter>, truth: f64) -> bool {
    p.and_then(|p| p.interval_95).is_some_and(|[low, high]| low <= truth && truth <= high)
}

/// 100 draws: relaxation (g = 0.5, τ = 12 s) behind 1 % noise at two rates. Named first in at least 95 %, intervals of
/// g and τ hold the truth in 90 to 99 % (binomial 95 % ± 4 %), and the third rate is predicted better by the causes
/// than without.
#[test]
fn hidden_relaxation_is_named_and_measured() {
    let truth = layout(Physics { num_relaxations: 1, ..Physics::default() }, 2);
    let x = [20f64.ln(), 2.4, 0.5, 12f64.ln()];
    let (mut named, mut g, mut tau, mut better) = (0, 0, 0, 0);
    for seed in 0..100 {
        let mut curves = vec![
            ramp("slow", HomogeneousTest::Uniaxial, 0.01, 2.0, 60),
            ramp("fast", HomogeneousTest::Uniaxial, 0.1, 2.0, 60),
            ramp("held", HomogeneousTest::Uniaxial, 0.04, 2.3, 60),
        ];
        add(&truth, &x, &mut curves, 0.15, seed);
        curves[2].num_fitted = 0;
        let v = analyse_load_curve(&curves, &LoadCurveOptions::default(), &never).unwrap();
        named += usize::from(v.causes.first().is_some_and(|c| c.name == "relaxation") && v.causes.len() == 1);
        g += usize::from(holds(parameter(&v, "relaxation", "g_1"), 0.5));
        tau += usize::from(holds(parameter(&v, "relaxation", "tau_1_s"), 12.0));
        better += usize::from(v.kept_back[0].after.rms_error_kpa < 0.2 && v.kept_back[0].before.rms_error_kpa > 0.4);
    }
    println!("relaxation alone named in {named} of 100; inside: g {g}, tau {tau}; predicted better in {better}");
    assert!(named >= 95 && better >= 95, "{named} {better}");
    assert!((90..=99).contains(&g) && (90..=99).contains(&tau), "{g} {tau}");
}

/// 100 draws: softening (r = 2, m = 2 kPa, β = 0.1) over two amplitudes.
#[test]
fn hidden_softening_is_named_and_measured() {
    let truth = layout(Physics { has_softening: true, ..Physics::default() }, 2);
    let x = [20f64.ln(), 2.4, 0.5, 2f64.ln(), 0.1];
    let (mut named, mut inside) = (0, [0; 3]);
    for seed in 0..100 {
        let mut curves = vec![
            ramp("small", HomogeneousTest::Uniaxial, 0.05, 1.6, 60),
            ramp("large", HomogeneousTest::Uniaxial, 0.05, 2.4, 60),
        ];
        add(&truth, &x, &mut curves, 0.1, 500 + seed);
        let v = analyse_load_curve(&curves, &LoadCurveOptions::default(), &never).unwrap();
        named += usize::from(v.causes.first().is_some_and(|c| c.name == "mullins") && v.causes.len() == 1);
        for (k, (name, truth)) in [("r", 2.0), ("m_kpa", 2.0), ("beta", 0.1)].into_iter().enumerate() {
            inside[k] += usize::from(holds(parameter(&v, "mullins", name), truth));
        }
    }
    println!("softening alone named in {named} of 100; inside {inside:?}");
    assert!(named >= 95, "{named}");
    assert!(inside.iter().all(|n| (88..=100).contains(n)), "{inside:?}");
}

/// 200 elastic controls, tension and shear in turn: a cause is named in at most 2 %.
#[test]
fn controls_name_no_cause() {
    let truth = layout(Physics::default(), 2);
    let x = [20f64.ln(), 2.4];
    let (mut named, mut clean) = (Vec::new(), 0);
    for seed in 0..200 {
        let (test, end) =
            if seed % 2 == 0 { (HomogeneousTest::Uniaxial, 2.0) } else { (HomogeneousTest::SimpleShear, 1.2) };
        let mut curves = vec![ramp("a", test, 0.01, end, 50), ramp("b", test, 0.1, end, 50)];
        add(&truth, &x, &mut curves, 0.1, 9000 + seed);
        let v = analyse_load_curve(&curves, &LoadCurveOptions::default(), &never).unwrap();
        named.extend(v.causes.iter().map(|c| c.name.clone()));
        clean += usize::from(v.verdict == Verdict::NoMismatch);
    }
    println!("controls: named {named:?}, no mismatch in {clean} of 200");
    assert!(named.len() <= 4, "{named:?}");
    assert!(clean >= 190, "{clean}");
}

/// Faults of the load cell and of the test, each alone: named first, with its value inside its interval.
#[test]
fn faults_of_the_test_are_named() {
    let base = [20f64.ln(), 2.4];
    let offset = Physics { has_offset: true, ..Physics::default() };
    let gain = Physics { has_gain: true, ..Physics::default() };
    let friction = Physics { has_friction: true, ..Physics::default() };
    for (name, physics, value) in
        [("cell_offset", offset, 0.8), ("cell_gain", gain, 1.08), ("cell_friction", friction, 0.5)]
    {
        let mut curves = vec![
            ramp("a", HomogeneousTest::Uniaxial, 0.02, 1.8, 60),
            ramp("b", HomogeneousTest::Uniaxial, 0.02, 2.2, 60),
        ];
        let x = [base[0], base[1], value];
        add(&layout(physics, 2), &x, &mut curves, 0.1, 77);
        let v = analyse_load_curve(&curves, &LoadCurveOptions::default(), &never).unwrap();
        println!("{name}: {} {:?}", v.summary, v.causes);
        assert_eq!(v.causes.first().map(|c| c.name.as_str()), Some(name), "{:?}", v.causes);
        let [low, high] = v.causes[0].parameters[0].interval_95.unwrap();
        assert!(low - 0.05 < value && value < high + 0.05, "{:?}", v.causes);
    }
}

/// A strip in tension and a cylinder in compression (shape factor 0.417) whose platens hold it to 60 % of full bonding.
#[test]
fn barrelling_is_named_beside_a_tension_test() {
    let mut curves = vec![
        ramp("tension", HomogeneousTest::Uniaxial, 0.02, 1.8, 60),
        ramp("compression", HomogeneousTest::Uniaxial, 0.02, 0.6, 60),
    ];
    curves[1].shape_factor = Some(0.417);
    let truth = 0.6 * 2.0 * 0.417 * 0.417;
    let physics = Physics { has_barrelling: true, ..Physics::default() };
    add(&layout(physics, 2), &[20f64.ln(), 2.4, truth], &mut curves, 0.1, 3);
    let v = analyse_load_curve(&curves, &LoadCurveOptions::default(), &never).unwrap();
    println!("{} {:?}", v.summary, v.causes);
    assert_eq!(v.causes[0].name, "barrelling", "{}", v.summary);
    assert!(holds(parameter(&v, "barrelling", "bonding"), 0.6), "{:?}", v.causes);
}

/// One long recording: the first half is fitted, the second half predicted.
#[test]
fn the_rest_of_a_recording_is_predicted() {
    let truth = layout(Physics { num_relaxations: 1, ..Physics::default() }, 1);
    let mut curve = ramp("long", HomogeneousTest::PureShear, 0.02, 1.8, 160);
    // Twice up and down.
    let height = 0.8;
    curve.drive = (1..=160_i32).map(|i| 1.0 + height * (1.0 - ((f64::from(i) / 40.0) % 2.0 - 1.0).abs())).collect();
    let mut curves = vec![curve];
    add(&truth, &[20f64.ln(), 2.4, 0.5, 12f64.ln()], &mut curves, 0.1, 11);
    curves[0].num_fitted = 80;
    let v = analyse_load_curve(&curves, &LoadCurveOptions::default(), &never).unwrap();
    println!("{}", v.summary);
    assert_eq!(v.causes[0].name, "relaxation");
    assert_eq!((v.fitted[0].after.num_points, v.kept_back[0].after.num_points), (80, 80));
    // Noise is 0.1 kPa; the parameters' scatter adds to it.
    assert!(v.kept_back[0].after.rms_error_kpa < 0.2 && v.kept_back[0].before.rms_error_kpa > 0.3, "{}", v.summary);
}

/// A cause outside the list, a grip that sticks and slips: found, and called unexplained.
#[test]
fn what_no_hypothesis_explains_is_called_so() {
    let mut curves = vec![ramp("a", HomogeneousTest::Uniaxial, 0.02, 2.0, 200)];
    add(&layout(Physics::default(), 1), &[20f64.ln(), 2.4], &mut curves, 0.05, 5);
    for i in 0..200 {
        curves[0].nominal_stress_kpa[i] += 1.5 * (0.25 * i as f64).sin();
    }
    let v = analyse_load_curve(&curves, &LoadCurveOptions::default(), &never).unwrap();
    assert_eq!(v.verdict, Verdict::Unexplained, "{}", v.summary);
}

#[test]
fn bad_input_is_refused() {
    let curve = ramp("a", HomogeneousTest::Uniaxial, 0.02, 2.0, 60);
    let all = |c: LoadCurve, o: &LoadCurveOptions| analyse_load_curve(&[c], o, &never);
    let options = LoadCurveOptions::default();
    assert!(matches!(
        all(curve.clone().kept_back(), &options),
        Err(LoadCurveAnalysisError::TooFewData { num_fitted: 0, .. })
    ));
    let bad = LoadCurveOptions { noise_sd_kpa: Some(0.0), ..options.clone() };
    assert!(matches!(all(curve.clone(), &bad), Err(LoadCurveAnalysisError::Setting { .. })));
    let mut broken = curve;
    broken.nominal_stress_kpa[4] = f64::NAN;
    assert!(matches!(all(broken, &options), Err(LoadCurveAnalysisError::Curve(_))));
}
