use super::super::study_error::SweepStudyError;
use super::super::task::{TaskInputs, tasks};
use super::*;
use std::path::Path;

/// A solid block and a bar; `patch` changes the study's JSON.
fn study(patch: impl Fn(&mut serde_json::Value)) -> Result<SweepStudy, SweepStudyError> {
    let mut value = serde_json::json!({
        "schema": "sweep-study/1",
        "name": "test",
        "base": {
            "schema": "specimen/1", "name": "two holes", "test": "double_lap_shear",
            "block": { "length_mm": 25.4, "thickness_mm": 6.4, "width_mm": 19.1 },
            "holes": [
                { "axis": "thickness", "center_mm": [-4.0, 0.0], "diameter_mm": 5.0 },
                { "axis": "thickness", "center_mm": [4.0, 0.0], "diameter_mm": 5.0 }
            ],
            "drive_mm": [5.0]
        },
        "materials": [
            { "name": "soft", "material": { "schema": "ogden/1", "bulk_kpa": 2000.0, "terms": [{ "mu_kpa": 17.0, "alpha": 1.9 }] } },
            { "name": "stiff", "material": { "schema": "ogden/1", "bulk_kpa": 4000.0, "terms": [{ "mu_kpa": 34.0, "alpha": 1.9 }] } }
        ],
        "scan": { "voxel_mm": [1.0, 0.5, 0.75], "noise_sd_mm": [0.05, 0.05, 0.05], "force_sd_n": 0.02 },
        "variables": [
            { "name": "gap_mm", "sets": ["-holes[0].x_mm", "holes[1].x_mm"], "values": [4.0, 6.0] },
            { "name": "drive_mm", "sets": ["drive_mm"], "range": { "min": 3.0, "max": 5.0, "count": 3 } }
        ],
        "sampling": { "kind": "grid" }
    });
    patch(&mut value);
    SweepStudy::from_json(&value.to_string(), Path::new("."))
}

#[test]
fn a_grid_has_every_combination_and_every_material() {
    let study = study(|_| {}).expect("a good study");
    assert_eq!((study.num_points(), study.num_tasks()), (6, 12));
    let tasks = tasks(&study);
    let values: Vec<&[f64]> = tasks.iter().step_by(2).map(|t| t.values.as_slice()).collect();
    assert_eq!(values, [[4.0, 3.0], [4.0, 4.0], [4.0, 5.0], [6.0, 3.0], [6.0, 4.0], [6.0, 5.0]]);
    assert!(tasks.iter().enumerate().all(|(i, t)| t.index == i && t.point == i / 2 && t.material == i % 2));
    let TaskInputs { specimen, material, .. } = tasks[11].inputs(&study);
    assert_eq!([specimen.holes[0].center_mm[0], specimen.holes[1].center_mm[0]], [-6.0, 6.0]);
    assert_eq!((specimen.drive_mm, material.bulk_kpa), (vec![5.0], 4000.0));
}

#[test]
fn a_latin_hypercube_hits_every_stratum_once() {
    let study = study(|v| {
        v["sampling"] = serde_json::json!({ "kind": "latin_hypercube", "count": 25 });
        for (index, (min, max)) in [(4.0, 6.0), (3.0, 5.0)].into_iter().enumerate() {
            let variable = v["variables"][index].as_object_mut().expect("an object");
            variable.remove("values");
            variable.insert("range".into(), serde_json::json!({ "min": min, "max": max }));
        }
    })
    .expect("a good study");
    let tasks = tasks(&study);
    for (v, min) in [(0, 4.0), (1, 3.0)] {
        let mut strata: Vec<usize> =
            tasks.iter().step_by(2).map(|t| ((t.values[v] - min) / 2.0 * 25.0) as usize).collect();
        strata.sort_unstable();
        assert_eq!(strata, (0..25).collect::<Vec<_>>());
    }
    assert_eq!(tasks, super::super::task::tasks(&study.clone()), "the same study gives the same points");
    let other = SweepStudy { seed: 2, ..study.clone() };
    assert_ne!(tasks, super::super::task::tasks(&other));
    assert_ne!(study.hash(), other.hash());
}

/// What a study written out with all that it names reads back to is the study, with the same hash.
#[test]
fn writing_and_reading_keeps_the_hash() {
    let original = study(|v| v["variables"][0]["values"] = serde_json::json!([0.1 + 0.2, 6.0])).expect("a good study");
    let text = serde_json::to_string_pretty(&original).expect("serialises");
    let again = SweepStudy::from_json(&text, Path::new("/nowhere")).expect("it stands alone");
    assert_eq!((again.hash(), &again), (original.hash(), &original));
}

#[test]
fn bad_studies_are_refused_with_what_to_change() {
    type Patch = fn(&mut serde_json::Value);
    let bad: [(Patch, &str); 14] = [
        (|v| v["schema"] = "study/1".into(), "schema is 'study/1'"),
        (|v| v["extra"] = 1.into(), "extra"),
        (|v| v["materials"] = serde_json::json!([]), "at least one"),
        (|v| v["materials"][1]["name"] = "soft".into(), "two materials are called 'soft'"),
        (|v| v["mesh"] = 9.0.into(), "mesh is 9"),
        (|v| v["variables"][0]["name"] = "gap".into(), "must end in '_mm'"),
        (|v| v["variables"][0]["name"] = "force_n".into(), "a column of this name"),
        (|v| v["variables"][0]["name"] = "drive_mm".into(), "same name"),
        (|v| v["variables"][0]["sets"][0] = "holes[2].x_mm".into(), "has 2 holes"),
        (|v| v["variables"][0]["sets"][0] = "holes[0].z_mm".into(), "which does not exist; known"),
        (|v| v["variables"][0]["range"] = serde_json::json!({ "min": 1.0, "max": 2.0 }), "either values or a range"),
        (|v| v["variables"][1]["range"]["min"] = 9.0.into(), "min 9 exceeds max 5"),
        (|v| v["variables"][1]["range"]["count"] = 0.into(), "at least one value"),
        (|v| v["sampling"] = serde_json::json!({ "kind": "latin_hypercube", "count": 3 }), "a range, and no values"),
    ];
    for (patch, expected) in bad {
        let message = study(patch).expect_err(expected).to_string();
        assert!(message.contains(expected), "'{message}' does not say '{expected}'");
    }
    let short_row = |v: &mut serde_json::Value| {
        v["sampling"] = serde_json::json!({ "kind": "list", "rows": [[1.0, 2.0], [1.0]] });
        v["variables"][0].as_object_mut().map(|o| o.remove("values"));
        v["variables"][1].as_object_mut().map(|o| o.remove("range"));
    };
    assert!(matches!(study(short_row), Err(SweepStudyError::RowLength { row: 1, found: 1, expected: 2 })));
}

/// Each rule has its pointer, and all errors come at once.
#[test]
fn errors_have_pointers() {
    let mut study = study(|_| {}).expect("a good study");
    study.materials[1].name = "soft".into();
    study.scan.voxel_mm[0] = 0.0;
    study.variables[1].sets[0] = "holes[1].x_mm".into();
    study.variables[0].values = Some(vec![4.0, f64::NAN]);
    let pointers = |study: &SweepStudy| study.field_errors().into_iter().map(|e| e.pointer).collect::<Vec<_>>();
    let expected = ["/materials/1/name", "/scan/voxel_mm/0", "/variables/0/values/1", "/variables/1/sets/0"];
    assert_eq!(pointers(&study), expected);
    assert!(study.validate().is_err());
}

#[test]
fn one_number_is_set_by_one_variable() {
    let refused = |sets: serde_json::Value| {
        let error = study(|v| v["variables"][1]["sets"] = sets.clone()).expect_err("refused");
        matches!(error, SweepStudyError::SameTarget { .. })
    };
    assert!(refused(serde_json::json!(["holes[1].x_mm"])));
    assert!(refused(serde_json::json!(["-holes[1].x_mm"])));
    assert!(refused(serde_json::json!(["drive_mm", "drive_mm"])));
}

/// A scan without extent or noise is no result of a design but a mistake in the study.
#[test]
fn values_for_the_scan_are_positive() {
    let of = |values: &[f64]| {
        study(|v| {
            v["variables"][1] =
                serde_json::json!({ "name": "voxel_mm", "sets": ["scan.voxel_mm[0]"], "values": values });
        })
    };
    assert!(of(&[0.5, 1.0]).is_ok());
    for bad in [0.0, -1.0] {
        let error = of(&[1.0, bad]).expect_err("refused");
        assert!(error.to_string().starts_with("variables[1].values[1] is"), "{error}");
    }
}

/// A design that cannot be made is a result with its reason, not an end of the sweep.
#[test]
fn failures_are_typed() {
    use super::super::task::Outcome;
    let study = study(|v| v["variables"][0]["values"] = serde_json::json!([4.0, 2.0, 30.0])).expect("a good study");
    let tasks = tasks(&study);
    for index in [6, 12] {
        let outcome = tasks[index].evaluate(&study, &|| false);
        assert!(matches!(&outcome, Some(Outcome::Failed { kind, .. }) if kind == "specimen"), "{outcome:?}");
    }
    assert_eq!(tasks[0].evaluate(&study, &|| true), None, "a cancelled task is no result");
}
