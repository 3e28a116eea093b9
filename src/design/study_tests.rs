//! Studies that cannot be searched are refused before any work, each rule with its pointer.

use super::{Study, StudyError};
use serde_json::{Value, json};
use std::path::Path;

/// A study that spells everything out.
fn whole() -> Value {
    let material =
        |mu: f64| json!({ "schema": "ogden/1", "bulk_kpa": 2000.0, "terms": [{ "mu_kpa": mu, "alpha": 1.9 }] });
    json!({
        "schema": "study/1",
        "name": "test",
        "base": {
            "schema": "specimen/1", "name": "one hole", "test": "double_lap_shear",
            "block": { "length_mm": 25.4, "thickness_mm": 6.4, "width_mm": 19.1 },
            "holes": [{ "axis": "thickness", "center_mm": [0.0, 0.0], "diameter_mm": 5.0 }],
            "drive_mm": [5.0]
        },
        "materials": [{ "name": "soft", "material": material(17.0) }, { "name": "stiff", "material": material(34.0) }],
        "scan": { "voxel_mm": [1.0, 0.5, 0.75], "noise_sd_mm": [0.05, 0.05, 0.05], "force_sd_n": 0.02 },
        "vary": { "hole_count": { "min": 0, "max": 2 }, "axes": ["thickness"], "drive_mm": { "min": 3.0, "max": 6.0 } },
        "limits": { "min_ligament_hole_hole_mm": 2.0, "min_ligament_hole_edge_mm": 2.0, "punches_mm": [3.0, 5.0] }
    })
}

/// Pointers of what is wrong with the study after a change of the fields at these pointers.
fn pointers(changes: &[(&str, Value)]) -> Vec<String> {
    let mut value = whole();
    for (pointer, new) in changes {
        let (parent, name) = pointer.rsplit_once('/').expect("a pointer");
        match value.pointer_mut(parent).expect("the parent is there") {
            Value::Object(fields) => drop(fields.insert(name.into(), new.clone())),
            list => list[name.parse::<usize>().expect("an index")] = new.clone(),
        }
    }
    assert!(Study::from_json(&value.to_string(), Path::new("/nowhere")).is_err(), "{changes:?}");
    Study::from_request(&value).expect_err("it is refused").into_iter().map(|e| e.pointer).collect()
}

#[test]
fn a_whole_study_is_read_in_both_ways() {
    let value = whole();
    let from_request = Study::from_request(&value).expect("it is valid");
    assert_eq!(Study::from_json(&value.to_string(), Path::new("/nowhere")).expect("it is valid"), from_request);
    assert_eq!(from_request.field_errors(), []);
}

/// A protocol is read and tells studies apart; a study without one is written as before there was one.
#[test]
fn a_study_may_have_a_protocol() {
    let plain = Study::from_request(&whole()).expect("it is valid");
    assert!(serde_json::to_value(&plain).expect("it is JSON").get("protocol").is_none());
    let mut value = whole();
    value["protocol"] = json!({ "force_drive_mm": [5.0, 2.0, 2.0], "force_gain_sd": 0.01 });
    let study = Study::from_request(&value).expect("it is valid");
    assert_ne!(super::study_hash(&study), super::study_hash(&plain));
    // Each drive once, in order, and those before the scan alone.
    assert_eq!(study.protocol.on_the_way_to(5.0).force_drives_mm(), [2.0]);
    assert_eq!(study.protocol.force_drives_mm(), [2.0, 5.0]);
    value["protocol"]["force_drive_mm"][1] = json!(0.0);
    let errors = Study::from_request(&value).expect_err("it is refused");
    assert_eq!(errors.iter().map(|e| e.pointer.as_str()).collect::<Vec<_>>(), ["/protocol/force_drive_mm/1"]);
}

#[test]
fn each_rule_has_its_pointer() {
    for (pointer, bad) in [
        ("/base/drive_mm/0", json!(0.0)),
        ("/base/holes/0/diameter_mm", json!(0.0)),
        ("/materials/1/material/terms/0/alpha", json!(0.0)),
        ("/materials/1/name", json!("soft")),
        ("/materials/0/relative_sd", json!(0.6)),
        ("/materials/0/weight", json!(0.0)),
        ("/scan/voxel_mm/0", json!(0.0)),
        ("/scan/noise_sd_mm/2", json!(-1.0)),
        ("/scan/force_sd_n", json!(0.0)),
        ("/vary/axes", json!([])),
        ("/vary/hole_count/max", json!(9)),
        ("/vary/hole_count/min", json!(3)),
        ("/vary/drive_mm/min", json!(0.0)),
        ("/vary/drive_mm/max", json!(2.0)),
        ("/limits/min_ligament_hole_edge_mm", json!(-1.0)),
        ("/limits/punches_mm/1", json!(0.0)),
        ("/limits/punches_mm", json!([])),
        ("/limits/max_holes", json!(65)),
        ("/limits/symmetry", json!("mirror_y")),
        ("/objective", json!({ "kind": "shape" })),
        ("/objective", json!({ "parameter_weights": { "mu_9": 1.0 } })),
        ("/budget", json!({ "explore": 0 })),
        ("/name", json!("a".repeat(201))),
        ("/schema", json!("study/2")),
        ("/base/length_mm", json!(3)),
    ] {
        let found = pointers(&[(pointer, bad)]);
        assert!(found.iter().all(|f| f.starts_with(pointer)), "{pointer}: {found:?}");
    }
}

/// No direction of holes matters only where holes are asked for.
#[test]
fn no_direction_is_needed_without_holes() {
    let mut value = whole();
    value["vary"]["axes"] = json!([]);
    value["vary"]["hole_count"] = json!({ "min": 0, "max": 0 });
    assert!(Study::from_request(&value).is_ok());
    value["vary"]["hole_count"]["max"] = 1.into();
    value["vary"].as_object_mut().map(|vary| vary.remove("axes"));
    let study = Study::from_request(&value).expect("the base's direction stays");
    assert_eq!(study.axes(), [crate::specimen::HoleAxis::Thickness]);
}

#[test]
fn all_errors_come_at_once() {
    let found = pointers(&[
        ("/scan/voxel_mm", json!([0.0, 1.0, 1.0])),
        ("/vary/axes", json!([])),
        ("/materials/1/name", json!("soft")),
        ("/base/samples_in_parallel", json!(0)),
    ]);
    assert_eq!(found, ["/base/samples_in_parallel", "/scan/voxel_mm/0", "/materials/1/name", "/vary/axes"]);
}

/// Plates are pressed together by a quarter of what is between them at most, and grips not at all.
#[test]
fn precompression_that_varies_has_plates() {
    let range = |min: f64, max: f64| ("/vary/precompression_mm", json!({ "min": min, "max": max }));
    let mut value = whole();
    value["vary"]["precompression_mm"] = range(-1.6, 0.4).1;
    assert!(Study::from_request(&value).is_ok());
    assert_eq!(pointers(&[range(-30.0, 0.4)]), ["/vary/precompression_mm/min"]);
    assert_eq!(pointers(&[range(-1.0, 30.0)]), ["/vary/precompression_mm/max"]);
    assert_eq!(pointers(&[range(0.4, -1.0)]), ["/vary/precompression_mm/max"]);
    let found = pointers(&[range(0.0, 0.4), ("/vary/tests", json!(["uniaxial"]))]);
    assert_eq!(found, ["/vary/precompression_mm"]);
}

/// A force across plates is limited where there are plates, and by more than none.
#[test]
fn a_force_across_plates_has_plates() {
    let limit = |value: f64| ("/limits/max_normal_force_n", json!(value));
    let mut value = whole();
    value["limits"]["max_normal_force_n"] = json!(12.0);
    assert_eq!(Study::from_request(&value).map(|s| s.limits.max_normal_force_n).ok(), Some(Some(12.0)));
    // It holds for those of the designs that have plates.
    value["vary"]["tests"] = json!(["uniaxial", "double_lap_shear"]);
    assert!(Study::from_request(&value).is_ok());
    assert_eq!(pointers(&[limit(12.0), ("/vary/tests", json!(["uniaxial"]))]), ["/limits/max_normal_force_n"]);
    assert_eq!(pointers(&[limit(0.0)]), ["/limits/max_normal_force_n"]);
}

/// Only a dumb-bell of free gauge has one that may vary, and no dumb-bell is sheared.
#[test]
fn a_gauge_that_varies_is_there() {
    let range = json!({ "min": 4.0, "max": 8.0 });
    assert_eq!(pointers(&[("/vary/gauge_width_mm", range.clone())]), ["/vary/gauge_width_mm"]);
    let base: serde_json::Value =
        serde_json::from_str(include_str!("../../geometries/short-dumbbell.json")).expect("shipped");
    let pulled = [("/base", base), ("/vary/tests", json!(["uniaxial"])), ("/vary/gauge_width_mm", range)];
    // Nothing is wrong with them but what is wrong beside them.
    let mut changes = pulled.to_vec();
    changes.push(("/vary/gauge_length_mm", json!({ "min": 4.0, "max": 3.0 })));
    assert_eq!(pointers(&changes), ["/vary/gauge_length_mm/max"]);
    changes[1] = ("/vary/tests", json!(["uniaxial", "double_lap_shear"]));
    assert_eq!(pointers(&changes), ["/vary/gauge_length_mm/max", "/vary/tests"]);
}

/// What of a fixture does not fit together is told where it stands.
#[test]
fn blocks_and_what_varies_of_them_fit_together() {
    let range = json!({ "min": 5.0, "max": 8.0 });
    let one_more = json!([{ "block": { "length_mm": 25.4, "thickness_mm": 8.0, "width_mm": 19.1 } }]);
    let like_first = json!([{ "is_like_first": true, "thickness_mm": range }]);
    let others = ("/base/other_samples", one_more);
    let blocks = |n: u32| ("/protocol", json!({ "blocks_scanned": n }));
    // Nothing is wrong with them but what is wrong beside them.
    let fine = [others.clone(), ("/vary/other_samples", like_first.clone()), blocks(2), ("/vary/axes", json!([]))];
    assert_eq!(pointers(&fine), ["/vary/axes"]);
    assert_eq!(pointers(&[("/vary/other_samples", like_first)]), ["/vary/other_samples"]);
    assert_eq!(pointers(&[blocks(9)]), ["/protocol/blocks_scanned"]);
    assert_eq!(pointers(&[("/protocol", json!({ "scan_share": [0.5, 0.5] }))]), ["/protocol/scan_share"]);
    let both = json!([{ "is_like_first": true, "length_mm": range }]);
    assert_eq!(pointers(&[others.clone(), ("/vary/other_samples", both)]), ["/vary/other_samples/0/is_like_first"]);
    let told_apart = pointers(&[others, ("/objective", json!({ "kind": "tell_apart" }))]);
    assert_eq!(told_apart, ["/objective/kind"]);
}

/// What would be found is told of one block by the scan's voxels alone, and of causes that every recording is tested
/// for.
#[test]
fn a_study_of_what_would_be_found_is_checked() {
    let detect = |more: Value| {
        let mut objective = json!({ "kind": "detect" });
        objective.as_object_mut().expect("an object").extend(more.as_object().expect("an object").clone());
        ("/objective", objective)
    };
    let budget = |refine: usize| ("/budget", json!({ "refine": refine }));
    let mut fine = whole();
    fine["objective"] = json!({ "kind": "detect", "causes": ["gain", "hole/center_error_x_mm"] });
    fine["budget"] = json!({ "refine": 0 });
    assert!(Study::from_request(&fine).is_ok());
    assert_eq!(pointers(&[detect(json!({})), budget(3)]), ["/objective/kind"]);
    assert_eq!(
        pointers(&[detect(json!({})), budget(0), ("/materials/0/relative_sd", json!(0.1))]),
        ["/objective/kind"]
    );
    assert_eq!(pointers(&[detect(json!({ "causes": ["debond"] })), budget(0)]), ["/objective/causes"]);
    assert_eq!(pointers(&[("/objective", json!({ "causes": ["gain"] }))]), ["/objective/causes"]);
    assert_eq!(
        pointers(&[
            detect(json!({})),
            budget(0),
            ("/protocol", json!({ "blocks_scanned": 2 })),
            ("/base/samples_in_parallel", json!(2))
        ]),
        ["/objective/kind"]
    );
}

#[test]
fn a_request_names_no_files() {
    assert_eq!(pointers(&[("/base", json!("two-hole-shear.json"))]), ["/base"]);
    assert_eq!(pointers(&[("/materials/1/material", json!("soft.json"))]), ["/materials/1/material"]);
}

#[test]
fn numbers_that_are_none_are_refused() {
    let mut study = Study::from_request(&whole()).expect("it is valid");
    study.scan.force_sd_n = f64::NAN;
    study.vary.drive_mm.max = f64::INFINITY;
    study.materials[0].weight = f64::NAN;
    let found: Vec<String> = study.field_errors().into_iter().map(|e| e.pointer).collect();
    assert_eq!(found, ["/scan/force_sd_n", "/materials/0/weight", "/vary/drive_mm/max"]);
    assert!(matches!(study.validate(), Err(StudyError::Scan(_))));
}
