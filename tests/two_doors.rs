//! The same request through the command and through the service gives the same result to the byte, for every kind of
//! job.

mod service_common;

use lambdak::job::KINDS;
use serde_json::{Value, json};
use service_common::{Service, lambdak, shipped, small_evaluation, small_sweep};
use std::path::Path;
use std::time::Duration;

const LONG: Duration = Duration::from_secs(600);

/// What a kind of job is asked, by the command and by the service: only the names of recordings differ.
struct Asked {
    command: &'static str,
    here: Value,
    there: Value,
}

impl Asked {
    fn alike(command: &'static str, request: Value) -> Asked {
        Asked { command, here: request.clone(), there: request }
    }
}

fn small_scan(is_raw: bool) -> Value {
    json!({
        "specimen": shipped("solid-shear.json"), "drive_mm": [1.0, 2.0], "mesh": "4", "voxel_mm": [2.0, 0.8, 2.0],
        "is_raw": is_raw, "seed": 3, "name": "small",
    })
}

/// Runs the command and gives what it prints; its files go to `folder`.
fn run(command: &str, request: &Value, folder: &Path) -> Vec<u8> {
    let file = folder.with_extension("request.json");
    std::fs::write(&file, request.to_string()).unwrap();
    let output = lambdak().args(["run", command, "--json", "--out"]).arg(folder).arg(&file).output().unwrap();
    assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

/// Uploads a folder and gives the recording's identifier.
fn upload(service: &Service, folder: &Path) -> String {
    let tar = std::process::Command::new("tar").arg("-cf").arg("-").arg("-C").arg(folder).arg(".").output().unwrap();
    assert!(tar.status.success());
    let reply = service.call("POST", "/v1/recordings", &[("content-type", "application/x-tar")], &tar.stdout);
    assert_eq!(reply.status, 201, "{}", String::from_utf8_lossy(&reply.body));
    reply.json()["id"].as_str().unwrap().to_string()
}

/// A curve of a neo-Hookean strip with a little waviness, as CSV.
fn curve(time: bool) -> String {
    let mut text =
        String::from(if time { "time_s,stretch,nominal_stress_kpa\n" } else { "stretch,nominal_stress_kpa\n" });
    for n in 0..30 {
        let stretch = 1.0 + 0.03 * f64::from(n);
        let stress = 10.0 * (stretch - stretch.powi(-2)) + 0.01 * f64::from(n % 3);
        let row = format!("{stretch},{stress}\n");
        text += &if time { format!("{n},{row}") } else { row };
    }
    text
}

/// A search so small that it takes seconds.
fn small_study() -> Value {
    let mut study = shipped("studies/two-hole-shear-same-block.json");
    study["base"] = shipped("solid-shear.json");
    study["base"]["block"] = json!({ "length_mm": 12.7, "thickness_mm": 6.4, "width_mm": 9.6 });
    study["materials"] = json!([{ "name": "one term", "material": shipped("materials/ecoflex-0020.json") }]);
    study["scan"]["voxel_mm"] = json!([2.0, 0.8, 2.0]);
    study["vary"]["hole_count"] = json!({ "min": 0, "max": 0 });
    study["budget"] = json!({ "explore": 4, "refine": 1, "iterations": 1, "propose": 2, "confirm": 1 });
    study["verification"] = json!({ "is_on": false });
    study
}

fn small_sweep_study() -> Value {
    let mut study = shipped("sweeps/bar-grid.json");
    study["base"] = shipped("uniaxial-bar.json");
    study["materials"] = json!([{ "name": "one term", "material": shipped("materials/ecoflex-0020.json") }]);
    study["mesh"] = json!(5.0);
    study
}

/// Requests of every kind; `scans` are the folders and identifiers of a recording and of its raw phases.
fn requests(evaluation: &Value, scans: [(&Path, &str); 2]) -> Vec<Asked> {
    let [(folder, id), (raw_folder, raw_id)] = scans;
    let with = |mut request: Value, field: &str, value: Value| {
        request[field] = value;
        request
    };
    let both = |command, request: Value, field: &str, here: Value, there: Value| Asked {
        command,
        here: with(request.clone(), field, here),
        there: with(request, field, there),
    };
    let path = |p: &Path| p.to_str().unwrap().to_string();
    let calibration = json!({ "num_terms": 1, "mesh_factor": 4.0, "has_mesh_allowance": false, "num_starts": 1 });
    let next = json!({ "study": small_study(), "num_terms": 1, "mesh_factor": 4.0, "num_drives": 1 });
    let diagnosis = json!({ "mesh_factor": 4.0, "max_causes": 1 });
    let solve = json!({ "specimen": shipped("two-hole-shear.json"), "drive_mm": [2.0], "mesh": 4.0 });
    let solve = with(solve, "arrays", json!(["mat", "hdf5", "vtkhdf"]));
    vec![
        Asked::alike("solve", solve),
        Asked::alike("evaluate", small_evaluation(1.5)),
        Asked::alike("evaluate-list", small_sweep(2)),
        Asked::alike("scan", small_scan(false)),
        both("import", json!({}), "recording", path(raw_folder).into(), raw_id.into()),
        both("calibrate", calibration, "recordings", json!([path(folder)]), json!([id])),
        both("next", next, "recordings", json!([path(folder)]), json!([id])),
        both("diagnose", diagnosis.clone(), "recording", path(folder).into(), id.into()),
        both("diagnose", diagnosis, "recordings", json!([path(folder), path(folder)]), json!([id, id])),
        Asked::alike(
            "diagnose-curves",
            json!({ "curves": [{ "test": "uniaxial", "name": "pull", "csv": curve(true) }] }),
        ),
        Asked::alike(
            "curves",
            json!({ "curves": [{ "test": "uniaxial", "csv": curve(false) }], "fit": { "max_terms": 1 } }),
        ),
        Asked::alike("uniaxial", json!({ "csv": curve(false), "fit": { "max_terms": 1 } })),
        Asked::alike("export-material", json!({ "material": shipped("materials/ecoflex-0020-two-term.json") })),
        Asked::alike("export-model", json!({ "specimen": shipped("solid-shear.json"), "mesh": 4.0 })),
        both("export-recording", json!({}), "recording", path(folder).into(), id.into()),
        Asked::alike("design", small_study()),
        Asked::alike("sweep", small_sweep_study()),
        Asked::alike("compare", json!({ "pairs": [{ "name": "same", "base": evaluation, "current": evaluation }] })),
        Asked::alike("paper-tables", json!({ "mesh_factor": 5.0 })),
        Asked::alike(
            "prove-diagnosis",
            json!({ "per_cause": 0, "unknown": 0, "controls": 1, "only": ["none"], "mesh_factor": 5.0 }),
        ),
        Asked::alike(
            "prove-diagnosis",
            json!({ "has_several": true, "recordings": 0, "unknown": 0, "controls": 1, "mesh_factor": 5.0 }),
        ),
    ]
}

#[test]
fn every_kind_of_job_gives_the_same_bytes_through_both_doors() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let service = Service::start(&place("data"), &[]);
    let evaluation: Value = serde_json::from_slice(&run("evaluate", &small_evaluation(1.0), &place("base"))).unwrap();
    run("scan", &small_scan(false), &place("scan"));
    run("scan", &small_scan(true), &place("raw"));
    let (id, raw_id) = (upload(&service, &place("scan")), upload(&service, &place("raw")));
    let asked = requests(&evaluation, [(&place("scan"), &id), (&place("raw"), &raw_id)]);
    let mut covered: Vec<&str> = asked.iter().map(|a| a.command).collect();
    let mut kinds: Vec<&str> = KINDS.iter().map(|k| k.command).collect();
    covered.sort_unstable();
    covered.dedup();
    kinds.sort_unstable();
    assert_eq!(covered, kinds, "every kind of job is asked through both doors");
    for (index, a) in asked.iter().enumerate() {
        let kind = KINDS.iter().find(|k| k.command == a.command).unwrap();
        let started = std::time::Instant::now();
        let job = service.submit(kind.collection, &a.there);
        let results = place(&format!("{index}-{}", a.command));
        let here = run(a.command, &a.here, &results);
        let view = service.wait(&job, LONG);
        assert_eq!(view["state"], "succeeded", "{}: {view}", a.command);
        eprintln!("{}: {:.1} s", a.command, started.elapsed().as_secs_f64());
        let there = service.get(&format!("{job}/result")).body;
        assert!(
            here == there,
            "{}: {} against {}",
            a.command,
            String::from_utf8_lossy(&here),
            String::from_utf8_lossy(&there)
        );
        let errors = kind.result().errors(&serde_json::from_slice(&there).unwrap());
        assert!(errors.is_empty(), "{}: not as the document says: {errors:#?}", a.command);
        // The files have the same names, and but for pages that name the time nothing differs in them.
        let list = service.get(&format!("{job}/artefacts")).json();
        for artefact in list["artefacts"].as_array().unwrap() {
            let name = artefact["name"].as_str().unwrap();
            assert!(results.join(name).is_file(), "{}: the command leaves no {name}", a.command);
        }
    }
}
