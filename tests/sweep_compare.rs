//! `lambdak compare` as a user calls it.

mod sweep_common;

use std::path::Path;
use sweep_common::*;

fn compare(base: &Path, current: &Path, more: &[&str]) -> (i32, String, String) {
    let output = lambdak().arg("compare").arg(base).arg(current).args(more).output().expect("it runs");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}

fn evaluate(voxel: &str, mesh: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let output = lambdak()
        .arg("evaluate")
        .arg(root.join("geometries/solid-shear.json"))
        .args(["--drive", "2", "--json", "--voxel", voxel, "--mesh", mesh])
        .output()
        .expect("it runs");
    assert_success(&output);
    String::from_utf8(output.stdout).expect("JSON is text")
}

#[test]
fn evaluations_are_judged() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("writable");
        path
    };
    let text = evaluate("1", "4");
    let a = file("a.json", &text);
    let larger = file("larger.json", &text.replace("\"sum\": ", "\"sum\": 9"));
    assert_eq!(compare(&a, &a, &[]).0, 0);
    let (code, out, err) = compare(&larger, &a, &[]);
    assert_eq!(code, 1, "{out}{err}");
    assert!(out.contains("integrated sensitivity to mu_1, sum") && out.contains("worse"), "{out}");
    assert_eq!(compare(&a, &larger, &[]).0, 0, "better is not worse");
    assert_eq!(compare(&a, &larger, &["--strict"]).0, 1, "but a change");
    assert_eq!(compare(&larger, &a, &["--rel-tol", "1"]).0, 0, "a wide tolerance");

    let (junit, markdown) = (folder.path().join("r/junit.xml"), folder.path().join("summary.md"));
    let paths = [junit.to_str().expect("text"), markdown.to_str().expect("text")];
    assert_eq!(compare(&larger, &a, &["--junit", paths[0], "--markdown", paths[1]]).0, 1);
    assert!(std::fs::read_to_string(&junit).expect("written").contains("failures=\"1\""));
    assert!(std::fs::read_to_string(&markdown).expect("written").contains("| worse |"));
    let (_, json, _) = compare(&larger, &a, &["--json"]);
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!((&json["schema"], &json["is_worse"]), (&"comparison/1".into(), &true.into()));

    // Not comparable, with the reason.
    let other_voxels = file("voxels.json", &evaluate("2", "4"));
    let other_mesh = file("mesh.json", &evaluate("1", "5"));
    for (other, reason) in [(&other_voxels, "voxel size in mm"), (&other_mesh, "mesh: ")] {
        let (code, _, err) = compare(&a, other, &[]);
        assert_eq!(code, 2, "{err}");
        assert!(err.contains("not comparable") && err.contains(reason), "{err}");
    }
    assert_eq!(compare(&a, &other_mesh, &["--across-inputs", "--rel-tol", "0.5"]).0, 0);
    let broken = file("broken.json", &text[..text.len() / 2]);
    let solve = file("solve.json", "{ \"schema\": \"solve/1\" }");
    for (other, reason) in [(&broken, "is not a result"), (&solve, "its schema is 'solve/1'")] {
        let (code, _, err) = compare(&a, other, &[]);
        assert_eq!(code, 2, "{err}");
        assert!(err.contains(reason), "{err}");
    }
    assert_eq!(compare(&a, &folder.path().join("nothing.json"), &[]).0, 2);
}

#[test]
fn sweeps_and_folders_are_judged() {
    let folder = tempfile::tempdir().expect("a folder");
    let study = write_study(folder.path(), 3, 9);
    let out = folder.path().join("out");
    assert_success(&sweep(&study, &out, &[]));
    let (base, current) = (folder.path().join("base"), folder.path().join("current"));
    for side in [&base, &current] {
        std::fs::create_dir(side).expect("writable");
        std::fs::copy(out.join("sweep.json"), side.join("sweep.json")).expect("writable");
    }
    let (code, text, err) = compare(&base, &current, &[]);
    assert_eq!(code, 0, "{text}{err}");
    assert!(text.contains("sweep (sweep/1)"), "{text}");
    // A task that fails now.
    let result = std::fs::read_to_string(out.join("sweep.json")).expect("readable");
    let worse = result.replacen("\"done\"", "\"failed\"", 1);
    std::fs::write(current.join("sweep.json"), worse).expect("writable");
    let (code, text, _) = compare(&base, &current, &[]);
    assert_eq!(code, 1, "{text}");
    assert!(text.contains("task 0: done"), "{text}");
    std::fs::copy(out.join("sweep.json"), base.join("more.json")).expect("writable");
    let (code, _, err) = compare(&base, &current, &[]);
    assert_eq!(code, 2);
    assert!(err.contains("more.json has no counterpart"), "{err}");
}
