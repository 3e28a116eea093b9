//! The service as its users see it: jobs, results, errors, access.

mod service_common;

use serde_json::{Value, json};
use service_common::{Service, lambdak, shipped, small_evaluation, small_sweep};
use std::io::{Read, Write};
use std::time::Duration;

const LONG: Duration = Duration::from_secs(600);

#[test]
fn openapi_document_is_current() {
    let (_, text) = lambdak::service::open_api();
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/api/openapi.json");
    if std::env::var_os("LAMBDAK_WRITE_OPENAPI").is_some() {
        std::fs::write(path, &text).unwrap();
    }
    let kept = std::fs::read_to_string(path).unwrap();
    assert!(kept == text, "api/openapi.json is not what the code says; LAMBDAK_WRITE_OPENAPI=1 writes it");
    let document: Value = serde_json::from_str(&text).unwrap();
    assert!(document["openapi"].as_str().unwrap().starts_with("3.1"));
    let mut names = Vec::new();
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            names.push(operation["operationId"].as_str().unwrap_or_else(|| panic!("{method} {path}")).to_string());
            for (media_type, content) in operation["requestBody"]["content"].as_object().into_iter().flatten() {
                let is_binary = content["schema"]["$ref"] == "#/components/schemas/Binary";
                assert!(is_binary || content.get("example").is_some(), "{method} {path} {media_type}");
            }
        }
    }
    let count = names.len();
    names.sort();
    names.dedup();
    assert_eq!(names.len(), count, "an operationId is there twice");
    assert_eq!(document["components"]["schemas"]["Binary"]["format"], "binary");
    let mut bare = Vec::new();
    find_bare_objects(&document, "", &mut bare);
    // Results of other programs' versions are compared as they are.
    bare.retain(|path| !path.contains("/ComparedPair/"));
    assert!(bare.is_empty(), "objects without fields: {bare:?}");
}

/// What the document shows as a request is one: the service takes it, but for recordings that it does not have.
#[test]
fn every_example_of_the_document_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    let document = service.get("/openapi.json").json();
    let mut count = 0;
    for (path, item) in document["paths"].as_object().unwrap() {
        let Some(example) = item["post"]["requestBody"]["content"]["application/json"].get("example") else { continue };
        // Whole results would fill pages: the example of a comparison shows its form alone.
        if path == "/v1/comparisons" {
            continue;
        }
        // The check of a specimen starts nothing anyway.
        let reply = service.post(&format!("{path}?dry_run=true"), example);
        let body = reply.json();
        let names_recording = body["errors"][0]["pointer"].as_str().is_some_and(|p| p.starts_with("/recording"));
        assert!(reply.status == 200 || reply.status == 422 && names_recording, "{path}: {body}");
        count += 1;
    }
    assert_eq!(count, 17);
}

/// Schemas of objects of which nothing is said.
fn find_bare_objects(value: &Value, path: &str, found: &mut Vec<String>) {
    match value {
        Value::Object(fields) => {
            let says = ["properties", "additionalProperties", "allOf", "oneOf"].iter().any(|k| fields.contains_key(*k));
            if fields.get("type") == Some(&json!("object")) && !says {
                found.push(path.into());
            }
            for (name, value) in fields {
                // Examples are no schemas.
                if name != "example" && name != "default" {
                    find_bare_objects(value, &format!("{path}/{name}"), found);
                }
            }
        }
        Value::Array(items) => {
            for (index, value) in items.iter().enumerate() {
                find_bare_objects(value, &format!("{path}/{index}"), found);
            }
        }
        _ => {}
    }
}

#[test]
fn an_evaluation_from_post_to_artefact() {
    let folder = tempfile::tempdir().unwrap();
    let mut service = Service::start(folder.path(), &[]);
    let body = small_evaluation(2.0);
    let job = service.submit("evaluations", &body);
    let view = service.wait(&job, LONG);
    assert_eq!(view["state"], "succeeded", "{view}");
    let result = service.get(&format!("{job}/result"));
    assert_eq!(result.json()["schema"], "evaluation/1");
    assert!(result.json()["steps"][0]["force_n"].as_f64().unwrap() > 0.0);
    // Content addressing: the same content is not sent again.
    let tag = result.header("etag").unwrap().to_string();
    let again = service.call("GET", &format!("{job}/result"), &[("if-none-match", &tag)], b"");
    assert_eq!((again.status, again.body.len()), (304, 0));
    let list = service.get(&format!("{job}/artefacts")).json();
    let names: Vec<&str> = list["artefacts"].as_array().unwrap().iter().map(|a| a["name"].as_str().unwrap()).collect();
    for name in ["histogram.svg", "solution.vtu", "specimen.dxf", "specimen.stl", "surface.json"] {
        assert!(names.contains(&name), "{name} is not among {names:?}");
        let file = service.get(&format!("{job}/artefacts/{name}"));
        assert_eq!(file.status, 200);
        assert!(!file.body.is_empty());
    }
    // The same evaluation is not computed again: not by another job, not after a crash.
    let second = service.wait(&service.submit("evaluations", &body), LONG);
    assert_eq!(second["state"], "succeeded");
    service.kill();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    let third = service.submit("evaluations", &body);
    let view = service.get(&third).json();
    assert_eq!(view["state"], "succeeded", "without any slot the result can only be the kept one: {view}");
    assert_eq!(service.get(&format!("{third}/result")).body, result.body);
    // Nor as a part of a sweep.
    let sweep = service.submit("sweeps", &json!({ "evaluations": [body] }));
    assert_eq!(service.get(&sweep).json()["num_done"], 1);
}

#[test]
fn a_sweep_holds_every_evaluation_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &[]);
    let job = service.submit("sweeps", &small_sweep(5));
    let view = service.wait(&job, LONG);
    assert_eq!((view["state"].as_str(), view["num_done"].as_i64()), (Some("succeeded"), Some(5)), "{view}");
    let result = service.get(&format!("{job}/result")).json();
    let forces: Vec<f64> = result["evaluations"]
        .as_array()
        .unwrap()
        .iter()
        .map(|e| e["evaluation"]["steps"][0]["force_n"].as_f64().unwrap())
        .collect();
    assert!(forces.len() == 5 && forces.windows(2).all(|w| w[0] < w[1]), "{forces:?}");
    let csv = service.get(&format!("{job}/artefacts/table.csv"));
    let text = String::from_utf8(csv.body).unwrap();
    assert_eq!(text.lines().count(), 6);
    assert!(text.starts_with("index,specimen,/drive_mm/0,drive_mm,force_n,"), "{text}");
    let parquet = service.get(&format!("{job}/artefacts/table.parquet"));
    assert_eq!(parquet.header("content-type"), Some("application/vnd.apache.parquet"));
    assert!(parquet.body.starts_with(b"PAR1") && parquet.body.ends_with(b"PAR1"));
}

#[test]
fn a_sample_of_ranges_follows_its_seed() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    let body = |count: usize, seed: u64| {
        json!({ "base": small_evaluation(1.0), "vary": [{ "pointer": "/drive_mm/0", "range": [0.5, 2.5] }],
                "sample": { "count": count, "seed": seed } })
    };
    let drawn = |body: &Value| {
        let job = service.submit("sweeps", body);
        assert_eq!(service.get(&format!("{job}/request")).json(), *body);
        service.get(&job).json()["num_tasks"].as_u64().unwrap()
    };
    assert_eq!((drawn(&body(4, 1)), drawn(&body(7, 2))), (4, 7));
    for (pointer, wrong) in [
        ("/sample/count", body(0, 1)),
        (
            "/vary/0/range",
            json!({ "base": small_evaluation(1.0), "vary": [{ "pointer": "/drive_mm/0", "range": [1.0, 2.0] }] }),
        ),
        (
            "/vary/0/pointer",
            json!({ "base": small_evaluation(1.0), "vary": [{ "pointer": "/nothing", "values": [1.0] }] }),
        ),
        (
            "/vary/0/values/1",
            json!({ "base": small_evaluation(1.0), "vary": [{ "pointer": "/drive_mm/0", "values": [1.0, -2.0] }] }),
        ),
        ("/base/material/bulk_kpa", {
            let mut wrong = body(2, 1);
            wrong["base"]["material"]["bulk_kpa"] = json!(-1.0);
            wrong
        }),
        ("/evaluations/1/specimen/block/width_mm", {
            let mut second = small_evaluation(1.0);
            second["specimen"]["block"]["width_mm"] = json!(-5.0);
            json!({ "evaluations": [small_evaluation(1.0), second] })
        }),
    ] {
        let reply = service.post("/v1/sweeps", &wrong);
        assert_eq!(reply.status, 422, "{pointer}");
        assert_eq!(reply.json()["errors"][0]["pointer"], pointer, "{}", reply.json());
    }
}

#[test]
fn a_scan_becomes_a_recording_that_is_calibrated() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &[]);
    let mut specimen = shipped("solid-shear.json");
    specimen["drive_mm"] = json!([4.0]);
    let body = json!({
        "specimen": specimen, "material": shipped("materials/ecoflex-0020.json"), "mesh": "2.5",
        "voxel_mm": [2.0, 0.7, 2.0], "mm_per_radian": [0.4, 0.4, 0.4], "noise_sd_mm": [0.01, 0.01, 0.01], "seed": 5,
    });
    let job = service.submit("scans", &body);
    let view = service.wait(&job, LONG);
    assert_eq!(view["state"], "succeeded", "{view}");
    let result = service.get(&format!("{job}/result")).json();
    assert_eq!(result["schema"], "scan/1");
    let recording = result["recording"].as_str().unwrap();
    let kept = service.get(&format!("/v1/recordings/{recording}")).json();
    assert_eq!(kept["summary"]["num_voxels"], result["num_voxels"]);
    for name in ["u_1.nii.gz", "sd_1.nii.gz", "mask.nii.gz"] {
        let image = service.get(&format!("{job}/artefacts/{name}"));
        assert_eq!((image.status, image.header("content-type")), (200, Some("application/gzip")), "{name}");
        assert!(image.body.starts_with(&[0x1f, 0x8b]), "{name}");
    }
    // Raw phases are a recording too, which an import makes displacements of.
    let mut raw = body;
    raw["is_raw"] = json!(true);
    let job = service.submit("scans", &raw);
    assert_eq!(service.wait(&job, LONG)["state"], "succeeded");
    let phases = service.get(&format!("{job}/result")).json()["recording"].clone();
    let import = service.submit("imports", &json!({ "recording": phases }));
    assert_eq!(service.wait(&import, LONG)["state"], "succeeded");
    let imported = service.get(&format!("{import}/result")).json();
    let id = imported["recording"].as_str().unwrap();
    assert_eq!(service.get(&format!("/v1/recordings/{id}")).json()["summary"]["num_voxels"], imported["num_voxels"]);
    assert_eq!(service.get(&format!("{job}/artefacts/px_1.nii.gz")).status, 200);

    let calibration = json!({ "recordings": [recording], "num_terms": 1, "mesh_factor": 2.5, "has_mesh_allowance": false, "num_starts": 1 });
    let job = service.submit("calibrations", &calibration);
    let view = service.wait(&job, LONG);
    assert_eq!(view["state"], "succeeded", "{view}");
    let result = service.get(&format!("{job}/result")).json();
    assert_eq!(result["schema"], "calibration/1");
    let terms = shipped("materials/ecoflex-0020.json")["terms"].clone();
    let truth = 0.5 * terms[0]["mu_kpa"].as_f64().unwrap() * terms[0]["alpha"].as_f64().unwrap();
    let found = result["initial_shear_modulus_kpa"]["value"].as_f64().unwrap();
    // One mesh made and fitted the data: noise alone lies between them, far below a twentieth.
    assert!((found / truth - 1.0).abs() < 0.05, "{found} for {truth}");
    for name in ["measured_1_1.nii.gz", "model_1_1.nii.gz", "misfit_1_1.nii.gz", "report.html", "material.json"] {
        assert_eq!(service.get(&format!("{job}/artefacts/{name}")).status, 200, "{name}");
    }
    for (pointer, wrong) in [
        ("/recordings/1", json!({ "recordings": [recording, "none"] })),
        ("/recordings", json!({ "recordings": [] })),
        ("/num_terms", json!({ "recordings": [recording], "num_terms": 9 })),
        ("/rule", json!({ "recordings": [recording], "rule": "guess" })),
        ("/mesh_factor", json!({ "recordings": [recording], "mesh_factor": 0.2 })),
    ] {
        let reply = service.post("/v1/calibrations", &wrong);
        assert_eq!((reply.status, reply.json()["errors"][0]["pointer"].as_str()), (422, Some(pointer)), "{wrong}");
    }
    for (pointer, value) in [
        ("/noise_sd_mm/1", json!({ "noise_sd_mm": [0.1, 0.0, 0.1] })),
        ("/voxel_mm", json!({ "voxel_mm": [0.001, 0.001, 0.001] })),
        ("/offset_voxels/2", json!({ "offset_voxels": [0.0, 0.0, 2.0] })),
        ("/kspace/keep", json!({ "kspace": { "keep": [0.5, 0.0, 1.0] } })),
        ("/force_sd_n", json!({ "force_sd_n": -1.0 })),
        ("/filter", json!({ "filter": "hamming2" })),
    ] {
        let mut wrong = raw.clone();
        wrong.as_object_mut().unwrap().extend(value.as_object().unwrap().clone());
        let reply = service.post("/v1/scans", &wrong);
        assert_eq!((reply.status, reply.json()["errors"][0]["pointer"].as_str()), (422, Some(pointer)), "{value}");
    }
}

#[test]
fn a_design_reports_progress_and_can_be_cancelled_and_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &[]);
    let library = service.get("/v1/library").json();
    let mut study = library["studies"][1].clone();
    study["budget"] = json!({ "explore": 6, "refine": 1, "iterations": 1, "confirm": 1 });
    study["verification"] = json!({ "is_on": false, "draws": 1 });
    let job = service.submit("designs", &study);
    let started = std::time::Instant::now();
    while service.get(&job).json()["progress"]["done"].as_u64().unwrap_or(0) == 0 {
        assert!(started.elapsed() < LONG, "no progress");
        std::thread::sleep(Duration::from_millis(50));
    }
    assert_eq!(service.post(&format!("{job}/cancel"), &json!({})).json()["state"], "cancelled");
    assert_eq!(service.get(&format!("{job}/result")).cause(), "not-finished");
    assert_eq!(service.post(&format!("{job}/resume"), &json!({})).json()["state"], "queued");
    let view = service.wait(&job, LONG);
    assert_eq!(view["state"], "succeeded", "{view}");
    let result = service.get(&format!("{job}/result")).json();
    assert_eq!(result["schema"], "design/1");
    assert!(result["best"]["objective"].as_f64().unwrap() > 0.0);
    assert_eq!(service.get(&format!("{job}/artefacts/report.html")).header("content-type"), Some("text/html"));
    assert_eq!(service.post(&format!("{job}/cancel"), &json!({})).cause(), "wrong-state");
}

#[test]
fn events_tell_every_state_and_end() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &[]);
    let job = service.submit("evaluations", &small_evaluation(1.7));
    // The stream ends by itself when the job has ended, so the whole reply can be read.
    let reply = service.get(&format!("{job}/events"));
    assert_eq!(reply.header("content-type"), Some("text/event-stream"));
    let text = String::from_utf8(reply.body).unwrap();
    let last = text.lines().rfind(|l| l.starts_with("data: ")).unwrap();
    let view: Value = serde_json::from_str(&last["data: ".len()..]).unwrap();
    assert_eq!(view["state"], "succeeded", "{text}");
}

#[test]
fn problems_point_at_fields() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    let with = |pointer: &str, value: Value| {
        let mut body = small_evaluation(2.0);
        *body.pointer_mut(pointer).unwrap() = value;
        service.post("/v1/evaluations", &body)
    };
    for (pointer, value) in [
        ("/specimen/block/length_mm", json!("long")),
        ("/specimen/block/length_mm", json!(-1.0)),
        ("/material/bulk_kpa", json!(null)),
        ("/drive_mm/0", json!(-3.0)),
        ("/mesh", json!("finest")),
    ] {
        let reply = with(pointer, value.clone());
        assert_eq!((reply.status, reply.cause().as_str()), (422, "invalid-input"), "{pointer} {value}");
        assert_eq!(reply.json()["errors"][0]["pointer"], pointer, "{}", reply.json());
    }
    let mut unknown = small_evaluation(2.0);
    unknown["specimen"]["hight_mm"] = json!(1);
    let reply = service.post("/v1/evaluations", &unknown);
    assert_eq!(reply.json()["errors"][0]["pointer"], "/specimen/hight_mm", "{}", reply.json());
    let reply = service.call("POST", "/v1/evaluations", &[("content-type", "application/json")], b"{");
    assert_eq!((reply.status, reply.cause().as_str()), (400, "invalid-json"));
    let reply = service.call("POST", "/v1/evaluations", &[("content-type", "text/plain")], b"{}");
    assert_eq!((reply.status, reply.cause().as_str()), (415, "unsupported-media-type"));
    assert_eq!(service.get("/v1/jobs/none").cause(), "not-found");
    assert_eq!(service.get("/nowhere").cause(), "not-found");
    assert_eq!(service.call("DELETE", "/v1/jobs", &[], b"").cause(), "method-not-allowed");
    assert_eq!(with("/mesh", json!("0.2")).cause(), "too-big-a-problem");
    assert_eq!(service.get("/v1/jobs?limit=0").cause(), "invalid-parameter");
}

#[test]
fn the_same_key_gives_the_same_job() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    let send = |drive: f64| {
        let body = small_evaluation(drive).to_string();
        let headers = [("content-type", "application/json"), ("idempotency-key", "k-1")];
        service.call("POST", "/v1/evaluations", &headers, body.as_bytes())
    };
    let (first, second, other) = (send(1.0), send(1.0), send(2.0));
    assert_eq!((first.status, second.status), (202, 202));
    assert_eq!(first.header("location"), second.header("location"));
    assert_eq!((other.status, other.cause().as_str()), (409, "key-reused"));
    assert_eq!(service.get("/v1/jobs").json()["jobs"].as_array().unwrap().len(), 1);
}

#[test]
fn tokens_roles_and_quotas() {
    let folder = tempfile::tempdir().unwrap();
    let tokens = folder.path().join("tokens.json");
    let add = |name: &str| {
        let out = lambdak().args(["serve", "--add-token", name, "--tokens"]).arg(&tokens).output().unwrap();
        assert!(out.status.success());
        String::from_utf8(out.stdout).unwrap().trim().to_string()
    };
    let (reader, anna, bert) = (add("rita:read"), add("anna:submit"), add("bert:submit"));
    let text = std::fs::read_to_string(&tokens).unwrap();
    assert!(!text.contains(&anna), "tokens are kept as hashes only");
    let mut file: Value = serde_json::from_str(&text).unwrap();
    file["tokens"][1]["max_queued_tasks"] = json!(2);
    file["tokens"][1]["max_elements"] = json!(100);
    std::fs::write(&tokens, file.to_string()).unwrap();
    let data = folder.path().join("data");
    let mut service = Service::start(&data, &["--slots", "0", "--tokens", tokens.to_str().unwrap()]);
    assert_eq!((service.get("/v1/jobs").status, service.get("/healthz").status), (401, 200));
    assert_eq!(service.get("/v1/jobs").header("www-authenticate"), Some("Bearer"));
    for forged in ["lk_forged", "", &reader[..reader.len() - 1], &format!("{reader}0"), &reader.to_uppercase()] {
        service.token = Some(forged.into());
        assert_eq!(service.get("/v1/jobs").cause(), "unauthorized", "{forged}");
    }
    service.token = None;
    for value in [format!("Basic {reader}"), reader.clone(), format!("Bearer {reader}, Bearer {reader}")] {
        let reply = service.call("GET", "/v1/jobs", &[("authorization", &value)], b"");
        assert_eq!((reply.status, reply.cause().as_str()), (401, "unauthorized"), "{value}");
    }
    // The hash that is kept opens nothing.
    let kept = file["tokens"][0]["sha256"].as_str().unwrap_or("0").to_string();
    let reply = service.call("GET", "/v1/jobs", &[("authorization", &format!("Bearer {kept}"))], b"");
    assert_eq!(reply.status, 401);
    service.token = Some(reader);
    assert_eq!(service.get("/v1/jobs").status, 200);
    assert_eq!(service.post("/v1/evaluations", &small_evaluation(1.0)).cause(), "forbidden");
    assert_eq!(service.get("/metrics").cause(), "forbidden");
    service.token = Some(anna);
    let job = service.submit("evaluations", &small_evaluation(1.0));
    service.submit("evaluations", &small_evaluation(2.0));
    let third = service.post("/v1/evaluations", &small_evaluation(3.0));
    assert_eq!((third.status, third.cause().as_str()), (429, "quota"));
    assert!(third.header("retry-after").unwrap().parse::<u32>().unwrap() > 0);
    let mut fine = small_evaluation(1.0);
    fine["mesh"] = json!("1");
    assert_eq!(service.post("/v1/evaluations", &fine).cause(), "too-big-a-problem");
    service.token = Some(bert);
    assert_eq!(service.post(&format!("{job}/cancel"), &json!({})).cause(), "forbidden");
}

#[test]
fn other_addresses_need_tokens() {
    let folder = tempfile::tempdir().unwrap();
    let out = lambdak().args(["serve", "--listen", "0.0.0.0:0", "--data"]).arg(folder.path()).output().unwrap();
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains("--tokens"));
}

#[test]
fn health_metrics_and_request_ids() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    assert_eq!((service.get("/healthz").status, service.get("/readyz").status), (200, 200));
    let reply = service.call("GET", "/v1/jobs", &[("x-request-id", "abc-1")], b"");
    assert_eq!(reply.header("x-request-id"), Some("abc-1"));
    let text = String::from_utf8(service.get("/metrics").body).unwrap();
    assert!(text.contains("lambdak_requests_total{method=\"GET\",route=\"/v1/jobs\",status=\"200\"} 1"), "{text}");
    assert!(text.contains("# TYPE lambdak_jobs gauge"));
}

#[test]
fn a_folder_has_one_service() {
    let folder = tempfile::tempdir().unwrap();
    let _service = Service::start(folder.path(), &["--slots", "0"]);
    let out = lambdak().args(["serve", "--listen", "127.0.0.1:0", "--data"]).arg(folder.path()).output().unwrap();
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains("in use"));
}

#[cfg(unix)]
#[test]
fn a_shutdown_ends_streams_and_keeps_the_job() {
    let folder = tempfile::tempdir().unwrap();
    let mut service = Service::start(folder.path(), &["--slots", "0"]);
    let job = service.submit("evaluations", &small_evaluation(1.1));
    let mut stream = std::net::TcpStream::connect(&service.address).unwrap();
    write!(stream, "GET {job}/events HTTP/1.1\r\nhost: {}\r\n\r\n", service.address).unwrap();
    std::thread::sleep(Duration::from_millis(500));
    terminate(&service);
    // For a moment it still answers, so that whoever sends it requests hears that it goes.
    let started = std::time::Instant::now();
    let reply = loop {
        let reply = service.get("/readyz");
        if reply.status != 200 {
            break reply;
        }
        assert!(started.elapsed() < Duration::from_secs(10), "still ready");
    };
    assert_eq!((reply.status, reply.cause().as_str()), (503, "shutting-down"));
    assert!(reply.header("retry-after").is_some());
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    assert!(text.contains("event: job") && text.contains("event: shutdown"), "{text}");
    assert!(service.child.wait().unwrap().success());
    let service = Service::start(folder.path(), &[]);
    assert_eq!(service.wait(&job, LONG)["state"], "succeeded");
}

#[cfg(unix)]
fn terminate(service: &Service) {
    let id = service.child.id().to_string();
    assert!(std::process::Command::new("kill").args(["-TERM", &id]).status().unwrap().success());
}

#[cfg(unix)]
#[test]
fn a_shutdown_keeps_the_checkpoint_of_a_running_design() {
    let folder = tempfile::tempdir().unwrap();
    let mut service = Service::start(folder.path(), &[]);
    let mut study = service.get("/v1/library").json()["studies"][1].clone();
    study["budget"] = json!({ "explore": 8, "refine": 1, "iterations": 1, "confirm": 1 });
    study["verification"] = json!({ "is_on": false, "draws": 1 });
    let job = service.submit("designs", &study);
    let started = std::time::Instant::now();
    while service.get(&job).json()["progress"]["done"].as_u64().unwrap_or(0) < 2 {
        assert!(started.elapsed() < LONG, "no progress");
        std::thread::sleep(Duration::from_millis(20));
    }
    terminate(&service);
    assert!(service.child.wait().unwrap().success());
    {
        let store = lambdak::service::store::Store::open_folder(folder.path()).unwrap();
        // A lease that is over at once: the task is only looked at.
        let task = store.claim("look", -1, "{}").unwrap().expect("the task is back in the queue");
        let kept = store.checkpoint(&task).unwrap().expect("a checkpoint is kept");
        let text = String::from_utf8(kept).unwrap();
        assert!(text.lines().count() >= 3, "a header and two evaluations at least: {text}");
    }
    let service = Service::start(folder.path(), &[]);
    let view = service.wait(&job, LONG);
    assert_eq!(view["state"], "succeeded", "{view}");
}

#[test]
fn a_full_queue_says_when_to_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0", "--max-queued", "2"]);
    service.submit("evaluations", &small_evaluation(1.0));
    let reply = service.post("/v1/sweeps", &small_sweep(3));
    assert_eq!((reply.status, reply.cause().as_str()), (429, "queue-full"));
    let after = reply.header("retry-after").unwrap().parse::<u32>().unwrap();
    assert!(after > 0 && reply.json()["retry_after_s"] == after);
}

#[test]
fn a_check_answers_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    let study = shipped("studies/two-hole-shear.json");
    let body = json!({ "specimen": shipped("two-hole-shear.json"), "limits": study["limits"] });
    let found = service.post("/v1/specimens/check", &body).json();
    assert_eq!(found["is_valid"], true, "{found}");
    assert!(found["drawing_svg"].as_str().unwrap().starts_with("<svg"));
    assert!(found["cost"]["num_elements"].as_u64().unwrap() > 100);
    let mut broken = body;
    broken["specimen"]["holes"][0]["diameter_mm"] = json!(9.0);
    let found = service.post("/v1/specimens/check", &broken).json();
    assert_eq!(found["is_valid"], false);
}

/// A specimen with so many holes and drives that its evaluation takes hours is refused with the estimate, and a dry run
/// tells what a job would take.
#[test]
fn costs_are_shown_and_limited() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0", "--max-job-hours", "0.1"]);
    let mut costly = small_evaluation(1.0);
    costly["specimen"] = shipped("two-hole-shear.json");
    costly["mesh"] = json!("standard");
    costly["drive_mm"] = (1..=1000).map(|n| json!(0.005 * f64::from(n))).collect();
    let refused = service.post("/v1/evaluations", &costly);
    assert_eq!((refused.status, refused.cause().as_str()), (422, "too-costly"));
    let detail = refused.json()["detail"].as_str().unwrap().to_string();
    assert!(detail.contains("limit: 0.1 h") && detail.contains("--max-job-hours"), "{detail}");
    let estimate = service.post("/v1/evaluations?dry_run=true", &small_evaluation(1.0));
    assert_eq!(estimate.status, 200);
    let estimate = estimate.json();
    assert_eq!((&estimate["num_tasks"], &estimate["most_seconds"]), (&json!(1), &json!(360.0)));
    let seconds = estimate["estimated_seconds"].as_f64().unwrap();
    assert!((0.001..10.0).contains(&seconds), "{seconds}");
    assert_eq!(service.get("/v1/jobs").json()["jobs"].as_array().unwrap().len(), 0, "a dry run starts nothing");
    let cost = service.post("/v1/specimens/check", &json!({ "specimen": costly["specimen"] })).json()["cost"].clone();
    assert!(cost["seconds"].as_f64().unwrap() > 0.0 && cost["most_seconds"] == 360.0, "{cost}");
    let unknown = service.post("/v1/evaluations?dryrun=true", &small_evaluation(1.0));
    assert_eq!((unknown.status, unknown.cause().as_str()), (400, "invalid-parameter"));
}

/// A task that still runs when its time is up ends with a problem, and its job can be resumed for as long again.
#[test]
fn a_task_ends_when_its_time_is_up() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "1", "--max-job-hours", "0.0003"]);
    let proof = json!({ "per_cause": 0, "unknown": 0, "controls": 50, "only": ["none"], "mesh_factor": 4.0 });
    let begin = std::time::Instant::now();
    let job = service.submit("proofs", &proof);
    let view = service.wait(&job, LONG);
    assert_eq!(view["state"], "failed", "{view}");
    assert!(view["problem"]["type"].as_str().unwrap().ends_with(":time-limit"), "{view}");
    eprintln!("a task of 1.1 s ended after {:.1} s", begin.elapsed().as_secs_f64());
    assert_eq!(service.call("POST", &format!("{job}/resume"), &[], b"").json()["state"], "queued");
    service.wait(&job, LONG);
}

#[test]
fn ten_thousand_points_are_queued_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    let begin = std::time::Instant::now();
    let job = service.submit("sweeps", &small_sweep(10_000));
    let seconds = begin.elapsed().as_secs_f64();
    eprintln!("10,000 points were queued in {seconds:.2} s");
    assert_eq!(service.get(&job).json()["num_tasks"], 10_000);
}

#[test]
fn jobs_and_recordings_can_be_deleted() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &[]);
    let scan = json!({
        "specimen": shipped("solid-shear.json"), "drive_mm": [1.0], "mesh": 5.0, "voxel_mm": [2.0, 1.0, 2.0],
        "mm_per_radian": [2.0, 2.0, 2.0], "noise_sd_mm": [0.01, 0.01, 0.01],
    });
    let job = service.submit("scans", &scan);
    assert_eq!(service.wait(&job, LONG)["state"], "succeeded");
    let recording = service.get(&format!("{job}/result")).json()["recording"].as_str().unwrap().to_string();
    let recording = format!("/v1/recordings/{recording}");
    let delete = |path: &str| service.call("DELETE", path, &[], b"");
    let artefacts = service.get(&format!("{job}/artefacts")).json();
    assert_eq!(delete(&job).status, 204);
    assert_eq!(delete(&job).cause(), "not-found");
    assert_eq!(service.get(&job).cause(), "not-found");
    for artefact in artefacts["artefacts"].as_array().unwrap() {
        assert_eq!(service.get(artefact["href"].as_str().unwrap()).status, 404);
    }
    // The recording that it made is a thing of its own, with all its files.
    assert_eq!(service.get(&recording).status, 200);
    let same = service.submit("scans", &scan);
    assert_eq!(service.wait(&same, LONG)["state"], "succeeded", "what was deleted is computed again");
    assert_eq!(delete(&recording).status, 204);
    assert_eq!(service.get(&recording).cause(), "not-found");
    assert_eq!(service.get("/v1/recordings").json()["recordings"], json!([]));
}

#[test]
fn what_is_in_use_or_somebody_elses_is_not_deleted() {
    let folder = tempfile::tempdir().unwrap();
    let tokens = folder.path().join("tokens.json");
    let tokens = tokens.to_str().unwrap();
    let token = |name: &str| {
        let made = lambdak().args(["serve", "--tokens", tokens, "--add-token", name]).output().unwrap();
        String::from_utf8(made.stdout).unwrap().trim().to_string()
    };
    let [anna, ben, reader] = ["anna:submit", "ben:submit", "cleo:read"].map(token);
    let mut service = Service::start(&folder.path().join("data"), &["--slots", "0", "--tokens", tokens]);
    service.token = Some(anna.clone());
    let job = service.submit("evaluations", &small_evaluation(1.0));
    let mut delete = |token: &str, path: &str| {
        service.token = Some(token.into());
        let reply = service.call("DELETE", path, &[], b"");
        if reply.status == 204 { "gone".into() } else { reply.cause() }
    };
    assert_eq!(delete(&anna, &job), "wrong-state", "it has not ended");
    assert_eq!(delete(&ben, &job), "forbidden");
    assert_eq!(delete(&reader, &job), "forbidden");
    service.token = Some(anna.clone());
    assert_eq!(service.call("POST", &format!("{job}/cancel"), &[], b"").status, 200);
    assert_eq!(service.call("DELETE", &job, &[], b"").status, 204);
}

/// Where a token's space is full, the answer names what could go, and nobody is told to come back.
#[test]
fn a_full_space_names_what_to_delete() {
    let folder = tempfile::tempdir().unwrap();
    let tokens = folder.path().join("tokens.json");
    let made =
        lambdak().args(["serve", "--tokens"]).arg(&tokens).args(["--add-token", "anna:submit"]).output().unwrap();
    let secret = String::from_utf8(made.stdout).unwrap().trim().to_string();
    let mut file: Value = serde_json::from_str(&std::fs::read_to_string(&tokens).unwrap()).unwrap();
    file["tokens"][0]["max_recordings_bytes"] = json!(100);
    std::fs::write(&tokens, file.to_string()).unwrap();
    let mut service = Service::start(&folder.path().join("data"), &["--tokens", tokens.to_str().unwrap()]);
    service.token = Some(secret);
    let scan = json!({
        "specimen": shipped("solid-shear.json"), "drive_mm": [1.0], "mesh": 5.0, "voxel_mm": [2.0, 1.0, 2.0],
        "mm_per_radian": [2.0, 2.0, 2.0], "noise_sd_mm": [0.01, 0.01, 0.01],
    });
    let job = service.submit("scans", &scan);
    assert_eq!(service.wait(&job, LONG)["state"], "succeeded");
    let kept = service.get(&format!("{job}/result")).json()["recording"].as_str().unwrap().to_string();
    let reply = service.call("POST", "/v1/recordings", &[("content-type", "application/x-tar")], &[0; 1024]);
    assert_eq!((reply.status, reply.cause().as_str()), (507, "no-space"));
    assert!(reply.header("retry-after").is_none());
    let detail = reply.json()["detail"].as_str().unwrap().to_string();
    assert!(detail.contains("DELETE /v1/recordings/ID") && detail.contains(&kept), "{detail}");
}

/// The check says which limits it has checked, and solves for force and stretch where it is given a material.
#[test]
fn a_check_says_what_it_checked() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    let mut specimen = shipped("two-hole-shear.json");
    specimen["drive_mm"] = json!([5.0, 9.0]);
    let mut limits = shipped("studies/two-hole-shear.json")["limits"].clone();
    limits["max_drive_mm"] = json!(7.0);
    limits["max_force_n"] = json!(200.0);
    limits["max_local_stretch"] = json!(1.5);
    let body = json!({ "specimen": specimen, "limits": limits });
    let found = service.post("/v1/specimens/check", &body).json();
    assert_eq!(found["is_valid"], false, "{found}");
    let margin = |found: &Value, name: &str| {
        found["margins"].as_array().unwrap().iter().find(|m| m["name"] == name).cloned().unwrap_or_default()
    };
    assert_eq!(margin(&found, "max_drive_mm")["value"], 9.0);
    assert_eq!(margin(&found, "max_drive_mm")["is_satisfied"], false);
    let names = |list: &Value| -> Vec<String> {
        list.as_array().unwrap().iter().map(|u| u["name"].as_str().unwrap().to_string()).collect()
    };
    assert_eq!(names(&found["unchecked"]), ["max_force_n", "max_local_stretch"]);
    let mut with_material = body;
    with_material["material"] = shipped("materials/ecoflex-0020.json");
    with_material["specimen"]["drive_mm"] = json!([5.0, 6.0]);
    let begin = std::time::Instant::now();
    let found = service.post("/v1/specimens/check", &with_material).json();
    eprintln!("solved for the check in {:.2} s", begin.elapsed().as_secs_f64());
    assert_eq!(found["unchecked"], json!([]));
    let force = margin(&found, "max_force_n")["value"].as_f64().unwrap();
    assert!((1.0..100.0).contains(&force), "{force}");
    assert!(margin(&found, "max_local_stretch")["value"].as_f64().unwrap() > 1.5);
    assert_eq!(
        (&found["is_valid"], &margin(&found, "max_local_stretch")["is_satisfied"]),
        (&json!(false), &json!(false))
    );
}
