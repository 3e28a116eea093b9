//! A stopped `lambdak design`: what was found is written and marked as unfinished, the exit code says so, and the same command
//! goes on to the end.

use std::path::Path;
use std::process::{Command, Output};

/// A study that takes seconds: the bar, at most one hole, no verification.
fn write_study(folder: &Path) -> std::path::PathBuf {
    let geometries = Path::new(env!("CARGO_MANIFEST_DIR")).join("geometries");
    let text = std::fs::read_to_string(geometries.join("studies/uniaxial-bar.json")).unwrap();
    let mut study: serde_json::Value = serde_json::from_str(&text).unwrap();
    study["base"] = geometries.join("uniaxial-bar.json").to_str().unwrap().into();
    study["materials"][0]["material"] = geometries.join("materials/ecoflex-0020.json").to_str().unwrap().into();
    study["materials"][0]["relative_sd"] = 0.0.into();
    study["vary"]["hole_count"] = serde_json::json!({ "min": 0, "max": 1 });
    study["budget"] = serde_json::json!({ "explore": 6, "refine": 1, "iterations": 3, "confirm": 1 });
    study["verification"] = serde_json::json!({ "is_on": false });
    let path = folder.join("study.json");
    std::fs::write(&path, study.to_string()).unwrap();
    path
}

fn design(study: &Path, out: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lambdak"));
    command.arg("design").arg(study).arg("--out").arg(out).args(more).output().unwrap()
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn a_stopped_search_leaves_its_best_and_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let study = write_study(folder.path());
    let out = folder.path().join("out");
    // From a limit that ends the run at once, doubled until it gets through.
    let mut minutes = 0.002;
    let (mut stops, mut bests) = (0, 0);
    loop {
        let output = design(&study, &out, &["--time-limit", &minutes.to_string()]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        if output.status.success() {
            break;
        }
        assert_eq!(output.status.code(), Some(130), "{said}");
        assert!(said.contains("stopped after"), "{said}");
        assert!(output.stdout.is_empty(), "a stopped run has no result to print");
        let unfinished = json(&out.join("unfinished-design.json"));
        assert_eq!(unfinished["schema"], "unfinished-design/1");
        assert_eq!(unfinished["is_finished"], false);
        if unfinished["best"].is_object() {
            bests += 1;
            let specimen = json(&out.join("unfinished-best-specimen.json"));
            assert_eq!(specimen["schema"], "specimen/1");
            assert!(specimen["name"].as_str().unwrap().contains("unfinished"));
        }
        assert!(!out.join("design.json").exists());
        stops += 1;
        minutes *= 1.5;
        assert!(minutes < 10.0, "the search does not end");
    }
    assert!(stops > 0 && bests > 0, "{stops} stops, {bests} with a design");
    assert_eq!(json(&out.join("design.json"))["schema"], "design/1");
    assert!(!out.join("unfinished-design.json").exists(), "what is out of date is removed");
}

#[test]
fn a_wrong_time_limit_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let study = write_study(folder.path());
    for wrong in ["0", "NaN", "-1"] {
        let output = design(&study, &folder.path().join("out"), &[&format!("--time-limit={wrong}")]);
        assert_eq!(output.status.code(), Some(2), "{wrong}");
    }
}
