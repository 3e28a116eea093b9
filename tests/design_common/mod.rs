//! What the tests of `lambdak design` share: a small study, and running the real binary.

#![allow(dead_code)] // Each test binary uses a part.

use std::path::Path;
use std::process::{Command, Output};

/// A study that takes seconds: the bar, at most one hole, no verification.
pub fn write_study(folder: &Path) -> std::path::PathBuf {
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

pub fn design(study: &Path, out: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lambdak"));
    command.arg("design").arg(study).arg("--out").arg(out).args(more).output().unwrap()
}

pub fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}
