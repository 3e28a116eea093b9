//! The input hash covers all that a job reads: a changed voxel, stretch or option changes it; where files lie does not.

use lambdak::job::{InputFile, Job, JobError, Progress, Surroundings, kind_of_command};
use lambdak::recording::{RawRecording, ReadLimits, ReadRecording, Recording};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Recordings from folders, and nothing else.
struct Folders;

impl Surroundings for Folders {
    fn recording(&self, name: &str) -> Result<ReadRecording, JobError> {
        let unreadable = |e: &dyn std::fmt::Display| JobError::Unreadable { name: name.into(), message: e.to_string() };
        Recording::read_with_digest(Path::new(name), &ReadLimits::default()).map_err(|e| unreadable(&e))
    }

    fn raw_recording(&self, name: &str) -> Result<ReadRecording<RawRecording>, JobError> {
        let unreadable = |e: &dyn std::fmt::Display| JobError::Unreadable { name: name.into(), message: e.to_string() };
        RawRecording::read_with_digest(Path::new(name), &ReadLimits::default()).map_err(|e| unreadable(&e))
    }

    fn file(&self, name: &str) -> Result<InputFile, JobError> {
        Err(JobError::Unreadable { name: name.into(), message: "no files here".into() })
    }

    fn progress(&self, _: &Progress) {}

    fn is_cancelled(&self) -> bool {
        false
    }

    fn checkpoint(&self, _: &str) -> Option<PathBuf> {
        None
    }
}

fn job(command: &str, request: &Value) -> Job {
    kind_of_command(command).unwrap().job(request).unwrap_or_else(|e| panic!("{command}: {e:?}"))
}

fn hash(command: &str, request: &Value) -> String {
    job(command, request).input_hash(&Folders).unwrap()
}

/// A recording made by the program, in a folder of its own.
fn recording(folder: &Path) {
    let file = |name: &str| -> Value {
        let path = format!("{}/geometries/{name}", env!("CARGO_MANIFEST_DIR"));
        serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
    };
    let request = json!({
        "specimen": file("solid-shear.json"), "drive_mm": [1.0], "mesh": "5", "voxel_mm": [3.0, 1.0, 3.0], "seed": 3,
    });
    let outcome = lambdak::job::run(&job("scan", &request), &Folders).unwrap();
    std::fs::create_dir_all(folder).unwrap();
    for (name, bytes) in outcome.recording() {
        std::fs::write(folder.join(name), bytes).unwrap();
    }
}

fn copied(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        std::fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}

#[test]
fn every_voxel_of_a_recording_is_in_the_hash_and_its_place_is_not() {
    let scratch = tempfile::tempdir().unwrap();
    let place = |name: &str| scratch.path().join(name);
    recording(&place("first"));
    copied(&place("first"), &place("moved"));
    copied(&place("first"), &place("changed"));
    // One voxel, by a micrometre.
    let mut found = Recording::read(&place("changed"), &ReadLimits::default()).unwrap();
    let voxel = found.steps[0].displacement.iter_mut().find(|u| u[0].is_finite()).unwrap();
    voxel[0] += 1e-3;
    found.write(&place("changed")).unwrap();
    std::fs::write(place("moved").join("notes.txt"), "a file that is not read").unwrap();
    let name = |n: &str| place(n).to_str().unwrap().to_string();
    let calibration = |n: &str| json!({ "recordings": [name(n)], "num_terms": 1 });
    let diagnosis = |n: &str| json!({ "recording": name(n) });
    for (command, request) in
        [("calibrate", &calibration as &dyn Fn(&str) -> Value), ("diagnose", &diagnosis as &dyn Fn(&str) -> Value)]
    {
        let first = hash(command, &request("first"));
        assert_eq!(first, hash(command, &request("moved")), "{command}: where a recording lies is no input");
        assert_ne!(first, hash(command, &request("changed")), "{command}: a voxel is an input");
    }
    // The loading history is read too.
    copied(&place("first"), &place("loaded"));
    let load = std::fs::read_to_string(place("loaded").join("load.csv")).unwrap();
    std::fs::write(place("loaded").join("load.csv"), load.trim_end().to_string() + "\n1000,0,0\n").unwrap();
    assert_ne!(hash("diagnose", &diagnosis("first")), hash("diagnose", &diagnosis("loaded")));
    // Every option is.
    let base = calibration("first");
    for (field, value) in [
        ("num_terms", json!(2)),
        ("rule", json!("decrement")),
        ("decrement", json!(0.5)),
        ("objective", json!("paper")),
        ("beta", json!(1.0)),
        ("mesh_factor", json!(1.5)),
        ("has_mesh_allowance", json!(false)),
        ("num_starts", json!(4)),
        ("end_margin_mm", json!(0.5)),
        ("has_profiles", json!(true)),
        ("has_contours", json!(true)),
    ] {
        let mut changed = base.clone();
        changed[field] = value;
        assert_ne!(hash("calibrate", &base), hash("calibrate", &changed), "{field}");
    }
    // A default that is written out is no other request.
    let mut spelled = base.clone();
    spelled["rule"] = json!("bic");
    assert_eq!(hash("calibrate", &base), hash("calibrate", &spelled));
}

#[test]
fn every_stretch_of_a_curve_is_in_the_hash() {
    let table = |last: &str| format!("stretch,nominal_stress_kpa\n1.1,2.5\n1.2,4.6\n1.3,6.4\n{last},8.1\n");
    for command in ["curves", "diagnose-curves"] {
        let request = |last: &str| json!({ "curves": [{ "test": "uniaxial", "csv": table(last) }] });
        assert_ne!(hash(command, &request("1.4")), hash(command, &request("1.41")), "{command}");
        let mut shear = request("1.4");
        shear["curves"][0]["test"] = json!("pure_shear");
        assert_ne!(hash(command, &request("1.4")), hash(command, &shear), "{command}");
    }
    let uniaxial = |last: &str| json!({ "csv": table(last) });
    assert_ne!(hash("uniaxial", &uniaxial("1.4")), hash("uniaxial", &uniaxial("1.41")));
}
