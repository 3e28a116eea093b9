//! A stopped `lambdak design`: what was found is written and marked as unfinished, the exit code says so, and the same
//! command goes on to the end.

mod design_common;

use design_common::{design, json, write_study};
use std::process::Command;

#[test]
fn a_stopped_search_leaves_its_best_and_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let study = write_study(folder.path());
    let out = folder.path().join("out");
    // From a limit that ends the run at once, raised until it gets through.
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
        // By little: a stop is to fall between the first design that is confirmed and the end.
        minutes *= 1.15;
        assert!(minutes < 10.0, "the search does not end");
    }
    assert!(stops > 0 && bests > 0, "{stops} stops, {bests} with a design");
    assert_eq!(json(&out.join("design.json"))["schema"], "design/1");
    assert!(!out.join("unfinished-design.json").exists(), "what is out of date is removed");
    its_result_can_be_compared(&out.join("design.json"));
}

/// Better, worse and not comparable, as `lambdak compare` says it.
fn its_result_can_be_compared(found: &std::path::Path) {
    let changed = |name: &str, change: &dyn Fn(&mut serde_json::Value)| {
        let mut result = json(found);
        change(&mut result);
        let path = found.with_file_name(name);
        std::fs::write(&path, result.to_string()).unwrap();
        path
    };
    let worse = changed("worse.json", &|r| {
        let objective = r["best"]["objective"].as_f64().unwrap();
        r["best"]["objective"] = (0.9 * objective).into();
    });
    let other = changed("other.json", &|r| r["objective"]["combine"] = "maximin".into());
    let junit = found.with_file_name("junit.xml");
    for (current, code) in [(found, 0), (&*worse, 1), (&*other, 2)] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lambdak"));
        let output = command.arg("compare").arg(found).arg(current).arg("--junit").arg(&junit).output().unwrap();
        let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert_eq!(output.status.code(), Some(code), "{said}");
        // What cannot be compared is an error for a CI, not nothing.
        let report = std::fs::read_to_string(&junit).unwrap();
        assert_eq!(report.contains("<failure") || report.contains("<error"), code != 0, "{report}");
    }
}

#[test]
fn ctrl_c_keeps_what_was_found() {
    let folder = tempfile::tempdir().unwrap();
    let study = write_study(folder.path());
    let out = folder.path().join("out");
    let mut child = Command::new(env!("CARGO_BIN_EXE_lambdak"))
        .arg("design")
        .arg(&study)
        .arg("--out")
        .arg(&out)
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    // The first evaluation is kept as it comes.
    let checkpoint = || {
        std::fs::read_dir(&out)
            .is_ok_and(|d| d.flatten().any(|f| f.file_name().to_string_lossy().contains("checkpoint")))
    };
    while !checkpoint() {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it could be stopped");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let told = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(told.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(json(&out.join("unfinished-design.json"))["is_finished"], false);
    let again = design(&study, &out, &[]);
    assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));
    assert!(out.join("design.json").exists());
}

/// The search of a study that is verified by more draws is taken from the checkpoint, its verification is not.
#[test]
fn more_draws_are_verified_anew() {
    let folder = tempfile::tempdir().unwrap();
    let study = write_study(folder.path());
    let out = folder.path().join("out");
    for draws in [1, 2] {
        let mut asked = json(&study);
        asked["verification"] = serde_json::json!({ "is_on": true, "draws": draws });
        std::fs::write(&study, asked.to_string()).unwrap();
        let output = design(&study, &out, &[]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{said}");
        assert_eq!(said.contains("taken from the checkpoint"), draws == 2, "{said}");
        let verified = &json(&out.join("design.json"))["verification"];
        for row in verified["best"].as_array().unwrap().iter().chain(verified["base"].as_array().unwrap()) {
            assert_eq!(row["draws"], draws, "{row}");
        }
    }
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
