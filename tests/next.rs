//! The next scan: promises against what is known afterwards, verdicts on a precision, wrong laws, limits.

use lambdak::calibration::{Observed, SyntheticScan};
use lambdak::design::Study;
use lambdak::fem::SolveOptions;
use lambdak::material::Material;
use lambdak::mesh::MeshOptions;
use lambdak::next::{NextOptions, NextResult, Plan, Precision, StopVerdict, advise};
use lambdak::recording::Filter;
use lambdak::sensitivity::{DriveSelection, EvaluationOptions, evaluate};
use lambdak::specimen::Specimen;
use serde_json::json;

/// Element size of truth and fits relative to standard: one mesh for both, so that no mesh error is among the misfit.
const MESH: f64 = 4.0;

fn study(protocol: &serde_json::Value, limits: &serde_json::Value) -> Study {
    let mut all = json!({ "min_ligament_hole_hole_mm": 1.0, "min_ligament_hole_edge_mm": 1.0,
        "diameter_mm": { "min": 1.0, "max": 3.0 } });
    for (name, value) in limits.as_object().unwrap() {
        all[name] = value.clone();
    }
    let study = json!({
        "schema": "study/1", "name": "block", "protocol": protocol, "limits": all,
        "base": { "schema": "specimen/1", "name": "block", "test": "double_lap_shear", "drive_mm": [2.0], "holes": [],
            "block": { "length_mm": 12.0, "thickness_mm": 4.0, "width_mm": 9.0 }, "samples_in_parallel": 2 },
        "materials": [{ "name": "one term", "material": { "schema": "ogden/1", "bulk_kpa": 400.0,
            "terms": [{ "mu_kpa": 17.0, "alpha": 1.91 }] } }],
        "scan": { "voxel_mm": [1.0, 0.5, 1.0], "noise_sd_mm": [0.05, 0.05, 0.05], "force_sd_n": 0.02 },
        "vary": { "hole_count": { "min": 0, "max": 0 }, "drive_mm": { "min": 2.0, "max": 4.0 } }
    });
    Study::from_json(&study.to_string(), std::path::Path::new(".")).unwrap()
}

fn plain() -> Study {
    study(&json!({}), &json!({}))
}

fn one_term() -> Material {
    Material::new(400.0, [(17.0, 1.91)]).unwrap()
}

fn record(study: &Study, truth: &Material, drive_mm: f64, draw: u64) -> Observed {
    let driven = Specimen { drive_mm: vec![drive_mm], ..study.base.clone() };
    let mesh = MeshOptions::scaled(&driven, MESH);
    let scan =
        SyntheticScan::new(&driven, truth, &study.scan, &study.protocol, &mesh, &SolveOptions::default(), &|| false)
            .unwrap();
    let recording = scan.recording("made", &driven, &scan.draw(7, draw), Filter::None).unwrap();
    let observed = Observed::new(&recording, study.scan.force_sd_n).unwrap();
    observed.with_protocol(&recording, &study.protocol, study.scan.force_sd_n).unwrap()
}

fn options(precision: Option<f64>) -> NextOptions {
    NextOptions {
        num_terms: Some(1),
        mesh_factor: MESH,
        has_mesh_correction: false,
        num_drives: 2,
        precision: Precision { of_all: precision, ..Precision::default() },
        ..NextOptions::default()
    }
}

fn ask(study: &Study, observed: &[Observed], options: &NextOptions) -> NextResult {
    let names = vec!["made".to_string(); observed.len()];
    let plan = Plan { study, specimens: vec![study.base.clone()] };
    advise((observed, &names), &plan, options, String::new(), &|_| (), &|| false).unwrap()
}

/// What a candidate promises is what is known once it has been scanned.
#[test]
fn promises_are_kept() {
    let study = plain();
    let first = record(&study, &one_term(), 2.0, 0);
    let advice = ask(&study, std::slice::from_ref(&first), &options(None));
    assert_eq!(advice.misfit.structured_by_component_mm, [0.0; 3], "the law is the truth's, on the truth's mesh");
    assert_eq!(advice.candidates.len(), 2, "two drives; the recording is the smaller one of them");
    assert!(advice.candidates[0].gain_per_minute >= advice.candidates[1].gain_per_minute);
    for candidate in &advice.candidates {
        assert_eq!(candidate.is_repeat, candidate.drive_mm == [2.0]);
        let second = record(&study, &one_term(), candidate.drive_mm[0], 1);
        let after = ask(&study, &[first.clone(), second], &options(None));
        for (p, promised) in after.parameters.iter().zip(&candidate.promised_relative_sd) {
            // The estimate moves by some standard deviations of a few per cent, and the information with it.
            assert!((p.relative_sd / promised - 1.0).abs() < 0.1, "{}: {} for {promised}", p.name, p.relative_sd);
        }
    }
}

/// What is known after one scan is what an evaluation at the estimate promises, forces read on the way and unknown gain
/// and zero of the load cell included: two ways to the same information. A second scan is worth what it then brings.
#[test]
fn forces_on_the_way_are_counted() {
    let protocol = json!({ "force_drive_mm": [1.0, 2.0], "force_gain_sd": 0.02, "force_zero_sd_n": 0.05 });
    let study = study(&protocol, &json!({}));
    let first = record(&study, &one_term(), 3.0, 0);
    assert_eq!(first.on_the_way.len(), 2);
    let driven = Specimen { drive_mm: vec![3.0], ..study.base.clone() };
    let now = ask(&study, std::slice::from_ref(&first), &options(None));
    let evaluation = EvaluationOptions {
        mesh: MeshOptions::scaled(&driven, MESH),
        protocol: study.protocol.clone(),
        ..EvaluationOptions::standard(&driven)
    };
    let drives = DriveSelection::DriveMm(driven.drive_mm.clone());
    let (promised, _) = evaluate(&driven, &now.material, &study.scan, &drives, &evaluation, &|| false).unwrap();
    for p in &now.parameters {
        let of_evaluation = promised.promised_sd.iter().find(|sd| sd.parameter == p.name).unwrap().relative_sd.unwrap();
        // Equilibria of two tolerances.
        assert!((p.relative_sd / of_evaluation - 1.0).abs() < 1e-4, "{}: {} {of_evaluation}", p.name, p.relative_sd);
    }
    let less = ask(&study, &[first.without_readings()], &options(None));
    assert!(now.parameters[0].relative_sd < 0.98 * less.parameters[0].relative_sd, "{less:?}");
    let again = NextOptions { drives_mm: Some(vec![3.0]), ..options(None) };
    let candidate = &ask(&study, std::slice::from_ref(&first), &again).candidates[0];
    assert!(candidate.is_repeat && candidate.force_drive_mm == [1.0, 2.0]);
    let after = ask(&study, &[first, record(&study, &one_term(), 3.0, 1)], &options(None));
    for (p, promised) in after.parameters.iter().zip(&candidate.promised_relative_sd) {
        // The estimate moves by some standard deviations of a few per cent, and the information with it.
        assert!((p.relative_sd / promised - 1.0).abs() < 0.1, "{}: {} for {promised}", p.name, p.relative_sd);
    }
}

/// The number of scans that is named suffices, and one less does not, by the law of independent scans sd² ~ 1/n.
#[test]
fn it_says_when_it_is_enough() {
    let study = plain();
    let observed = [record(&study, &one_term(), 2.0, 0)];
    let now = ask(&study, &observed, &options(Some(1.0)));
    let stop = now.stop.as_ref().unwrap();
    assert_eq!((stop.verdict, stop.num_scans), (StopVerdict::Reached, Some(0)));
    assert!(now.sentence.starts_with("Enough"), "{}", now.sentence);
    let worst = now.parameters.iter().map(|p| p.relative_sd).fold(0.0, f64::max);
    // Repeats alone, so that sd² ~ 1/n holds: a third of the sd takes nine scans, of which one is done.
    let repeats = NextOptions { drives_mm: Some(vec![2.0]), ..options(Some(worst / 2.999)) };
    let more = ask(&study, &observed, &repeats);
    let stop = more.stop.unwrap();
    assert_eq!(stop.verdict, StopVerdict::MoreScans);
    // Voxels on the study's grid are those of the recording; averages over materials move it by one.
    assert!((7..=9).contains(&stop.num_scans.unwrap()), "{:?}", stop.num_scans);
}

/// A load cell whose gain is known to 5 per cent holds μ₁ back whatever is scanned: its gain is that of all scans.
#[test]
fn a_common_gain_holds_back() {
    let study = study(&json!({ "force_gain_sd": 0.05 }), &json!({}));
    let advice = ask(&study, &[record(&study, &one_term(), 2.0, 0)], &options(Some(0.02)));
    let stop = advice.stop.unwrap();
    assert_eq!((stop.verdict, stop.num_scans), (StopVerdict::OutOfReach, None));
    assert_eq!(stop.held_back_by.as_deref(), Some("mu_1"));
    // μ₁ is in proportion to the force.
    assert!((stop.reachable_relative_sd.unwrap() / 0.05 - 1.0).abs() < 0.05);
}

/// A law that cannot be right leaves a misfit, is less sure of itself than noise alone allows, and repeats do not help
/// it as they would help a right one.
#[test]
fn a_wrong_law_is_not_sure_of_itself() {
    let study = plain();
    let two_terms = Material::new(400.0, [(0.05, 14.0), (-8.0, -4.0)]).unwrap();
    let wrong = ask(&study, &[record(&study, &two_terms, 4.0, 0)], &options(Some(0.001)));
    let right = ask(&study, &[record(&study, &one_term(), 4.0, 0)], &options(Some(0.001)));
    assert!(wrong.misfit.structured_by_component_mm.iter().any(|mm| *mm > 0.0));
    let repeat = |result: &NextResult| {
        let repeat = result.candidates.iter().find(|c| c.is_repeat).unwrap();
        repeat.gain
    };
    // Of a right law a second scan takes ln √2.
    assert!((repeat(&right) - 0.5 * 2f64.ln()).abs() < 0.05, "{}", repeat(&right));
    assert!(repeat(&wrong) < 0.9 * repeat(&right), "{} against {}", repeat(&wrong), repeat(&right));
}

/// Candidates beyond the study's limits are listed with the limit.
#[test]
fn limits_are_kept() {
    let free = plain();
    let first = record(&free, &one_term(), 2.0, 0);
    let force = ask(&free, std::slice::from_ref(&first), &options(None));
    let largest = force.candidates.iter().map(|c| c.force_n).fold(0.0, f64::max);
    let limited = study(&json!({}), &json!({ "max_force_n": 0.9 * largest }));
    let advice = ask(&limited, &[first], &options(None));
    assert_eq!(advice.candidates.len(), 1);
    assert_eq!(advice.left_out.len(), 1);
    assert!(advice.left_out[0].reason.contains("max_force_n"), "{}", advice.left_out[0].reason);
}
