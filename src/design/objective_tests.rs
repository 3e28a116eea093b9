//! Judging by hand-made responses: what is averaged, what is the worst, what weighs how much.

use super::*;
use crate::design::aim::{Guard, Objective};
use crate::design::material_samples::sample_materials;
use std::path::Path;

fn study() -> Study {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("geometries/studies");
    let text = std::fs::read_to_string(folder.join("uniaxial-bar.json")).expect("the study is there");
    let mut study = Study::from_json(&text, &folder).expect("the study is valid");
    study.materials[0].relative_sd = 0.1;
    study.limits.max_force_n = Some(5.0);
    study.limits.max_local_stretch = Some(2.0);
    study.objective = Objective { guard_promised_sd: Guard::FirstMaterial, ..Objective::default() };
    study
}

/// One term: 𝒮 of (μ, α), relative standard deviations, criteria, force, stretch.
fn response(integrated: [f64; 2], sd: [f64; 2], force: f64, stretch: f64) -> Response {
    Response {
        log_integrated: integrated.map(f64::ln).to_vec(),
        log_relative_sd: sd.map(f64::ln).to_vec(),
        log_criteria: [0.0; 4],
        log_separation: 0.0,
        log_detectable: Vec::new(),
        log_force: force.ln(),
        normal_force_n: 0.0,
        log_stretch: stretch.ln(),
    }
}

fn judged(study: &Study, own: [Response; 3]) -> (Judged, f64) {
    let samples = sample_materials(&study.materials);
    let base = vec![response([1.0, 1.0], [0.1, 0.1], 1.0, 1.5); 3];
    let reference = Reference::new(study, &samples, &base);
    let judged = reference.judge(&Evaluated { responses: own.to_vec(), gradients: Vec::new() });
    let objective = reference.objective(&judged).exp();
    (judged, objective)
}

/// Weights ½, ¼, ¼: the central value's gain of 4 and the variants' of 1 average to 4^½ = 2. The limits are those of
/// the worst sample: a force of 6 N with one variant breaks 5 N although the mean keeps it.
#[test]
fn gains_are_averaged_and_limits_are_the_worst() {
    let own = [
        response([4.0, 9.0], [0.05, 0.05], 1.0, 1.5),
        response([1.0, 1.0], [0.05, 0.20], 6.0, 1.5),
        response([1.0, 1.0], [0.05, 0.05], 1.0, 1.9),
    ];
    let (judged, objective) = judged(&study(), own);
    // Closed form; rounding only, here and below.
    assert!((objective - 2.0).abs() < 1e-12, "{objective}");
    let expected = [2.0f64, 0.5, 5.0 / 6.0, 2.0 / 1.9];
    for (found, expected) in judged.worst_margins[0].iter().zip(expected) {
        assert!((found - expected.ln()).abs() < 1e-12, "{found} {expected}");
    }
    // Every sample's margins are there for the search.
    assert_eq!(judged.margins.len(), 3 * 4);
}

/// A search at the central value sees 4 N at the base; its confirmation, which knows the variants, 4.5 N. A design of
/// 4.6 N in the search is then known to break 5 N, one of 4.4 N to keep it. What the confirmation finds smaller (the
/// stretch) loosens nothing.
#[test]
fn limits_are_lowered_by_what_the_confirmation_of_the_base_shows() {
    let mut study = study();
    let all = sample_materials(&study.materials);
    study.materials[0].relative_sd = 0.0;
    let central = sample_materials(&study.materials);
    let of = |force, stretch| response([1.0, 1.0], [0.1, 0.1], force, stretch);
    let confirmed = Reference::new(&study, &all, &[of(3.9, 1.4), of(4.5, 1.4), of(3.5, 1.4)]).of_base();
    let searched = Reference::new(&study, &central, &[of(4.0, 1.5)]);
    let lowered = searched.lowered(&confirmed.worst_margins, &searched.of_base().worst_margins);
    let margins = |force| lowered.judge(&Evaluated { responses: vec![of(force, 1.5)], gradients: Vec::new() }).margins;
    let [force, stretch] = [2, 3];
    for (in_search, expected) in [(4.4, 4.95), (4.6, 5.175)] {
        let expected: f64 = 5.0 / expected;
        assert!((margins(in_search)[force] - expected.ln()).abs() < 1e-12, "{in_search} N");
    }
    assert!((margins(4.0)[stretch] - (2.0f64 / 1.5).ln()).abs() < 1e-12);
}

/// The force across the plates is limited from both sides: 12 N and −12 N break a limit of 10 N by a fifth, and the
/// slope of each margin is that of the force over the limit, with one sign or the other, where there is no force, too.
#[test]
fn the_force_across_the_plates_is_limited_either_way() {
    let mut study = study();
    study.materials[0].relative_sd = 0.0;
    study.limits.max_normal_force_n = Some(10.0);
    let samples = sample_materials(&study.materials);
    let of = |normal_force_n: f64| Response { normal_force_n, ..response([1.0, 1.0], [0.1, 0.1], 1.0, 1.5) };
    let reference = Reference::new(&study, &samples, &[of(0.0)]);
    let [together, apart] = [3, 4];
    for force_n in [12.0, -12.0, 0.0] {
        let mut slope = vec![0.0; of(0.0).to_vector().len()];
        slope[10] = 2.0;
        let gradients = vec![vec![slope]];
        let judged = reference.judge(&Evaluated { responses: vec![of(force_n)], gradients });
        // Closed forms; rounding only.
        for (margin, sign) in [(together, 1.0), (apart, -1.0)] {
            assert!((judged.margins[margin] - (1.0 - sign * force_n / 10.0)).abs() < 1e-12);
            assert!((judged.margin_gradients[0][margin] + sign * 0.2).abs() < 1e-12);
        }
    }
    assert_eq!(reference.limit_name(0, apart), "the force that pushes the plates apart");
}

#[test]
fn weights_and_kinds_combine_as_written() {
    let own = [0, 1, 2].map(|_| response([4.0, 9.0], [0.2, 0.025], 1.0, 1.5));
    let mut study = study();
    study.objective.combine = Combine::Weighted;
    study.objective.parameter_weights = [("mu_1".to_string(), 3.0)].into();
    assert!((judged(&study, own.clone()).1 - (4.0f64.powi(3) * 9.0).powf(0.25)).abs() < 1e-12);
    study.objective.parameter_weights = [("mu_1".to_string(), 0.0)].into();
    assert!((judged(&study, own.clone()).1 - 9.0).abs() < 1e-12);
    // With standard deviations as well: gains 4, 9, ½, 4.
    study.objective = Objective { kind: ObjectiveKind::SensitivityAndPromisedSd, ..Objective::default() };
    assert!((judged(&study, own.clone()).1 - 0.5).abs() < 1e-12);
    study.objective.combine = Combine::GeometricMean;
    assert!((judged(&study, own).1 - 72.0f64.powf(0.25)).abs() < 1e-12);
}
