//! Recordings: made, kept, calibrated on.

use super::LONG;
use super::service_common::{MISFIT, Service, UNFIT, add_token, set_quota, shipped, small_scan, tar_of};
use serde_json::json;

const TOO_BIG: (u16, &str) = (422, "too-big-a-problem");

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
    // Its files are there for whoever wants to look at it.
    let files = service.get(&format!("/v1/recordings/{recording}/files")).json();
    let files = files["artefacts"].as_array().unwrap();
    assert!(files.iter().any(|f| f["name"] == "mask.nii.gz" && f["media_type"] == "application/gzip"), "{files:?}");
    for file in files {
        let reply = service.get(file["href"].as_str().unwrap());
        assert_eq!((reply.status, reply.header("content-type")), (200, file["media_type"].as_str()), "{file}");
        assert_eq!(reply.body.len() as u64, file["num_bytes"].as_u64().unwrap(), "{file}");
        let tag = format!("\"{}\"", file["sha256"].as_str().unwrap());
        assert_eq!(reply.header("etag"), Some(tag.as_str()), "{file}");
    }
    for absent in ["/v1/recordings/none/files", &format!("/v1/recordings/{recording}/files/none.nii.gz")] {
        assert_eq!(service.get(absent).cause(), "not-found");
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
    let study = service.get("/v1/library").json()["studies"][0].clone();
    for (kind, request) in [
        ("calibrations", calibration.clone()),
        ("diagnoses", json!({ "recording": recording, "mesh_factor": 4.0 })),
        ("next-scans", json!({ "recordings": [recording], "study": study, "num_terms": 1 })),
    ] {
        let cost = service.post(&format!("/v1/{kind}?dry_run=true"), &request).json();
        assert!(cost["estimated_seconds"].as_f64().is_some_and(|seconds| seconds > 0.0), "{kind}: {cost}");
    }
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
    for (refusal, pointer, wrong) in [
        (UNFIT, "/recordings/1", json!({ "recordings": [recording, "none"] })),
        (MISFIT, "/recordings", json!({ "recordings": [] })),
        (MISFIT, "/num_terms", json!({ "recordings": [recording], "num_terms": 9 })),
        (MISFIT, "/rule", json!({ "recordings": [recording], "rule": "guess" })),
        (TOO_BIG, "/mesh_factor", json!({ "recordings": [recording], "mesh_factor": 0.2 })),
    ] {
        service.post("/v1/calibrations", &wrong).is_refused(refusal, pointer);
    }
    for (refusal, pointer, value) in [
        (UNFIT, "/noise_sd_mm/1", json!({ "noise_sd_mm": [0.1, 0.0, 0.1] })),
        (UNFIT, "/voxel_mm", json!({ "voxel_mm": [0.001, 0.001, 0.001] })),
        (UNFIT, "/offset_voxels/2", json!({ "offset_voxels": [0.0, 0.0, 2.0] })),
        (UNFIT, "/kspace/keep", json!({ "kspace": { "keep": [0.5, 0.0, 1.0] } })),
        (MISFIT, "/force_sd_n", json!({ "force_sd_n": -1.0 })),
        (UNFIT, "/filter", json!({ "filter": "hamming2" })),
    ] {
        let mut wrong = raw.clone();
        wrong.as_object_mut().unwrap().extend(value.as_object().unwrap().clone());
        service.post("/v1/scans", &wrong).is_refused(refusal, pointer);
    }
}

/// Where a token's space is full, the answer names what could go, and nobody is told to come back. What a job makes
/// counts like what is uploaded.
#[test]
fn a_full_space_names_what_to_delete() {
    let folder = tempfile::tempdir().unwrap();
    let tokens = folder.path().join("tokens.json");
    let secret = add_token(&tokens, "anna:submit");
    let start = || {
        let mut service = Service::start(&folder.path().join("data"), &["--tokens", tokens.to_str().unwrap()]);
        service.token = Some(secret.clone());
        service
    };
    let mut service = start();
    let job = service.submit("scans", &small_scan(1.0));
    assert_eq!(service.wait(&job, LONG)["state"], "succeeded");
    let kept = service.get(&format!("{job}/result")).json()["recording"].as_str().unwrap().to_string();
    service.kill();
    set_quota(&tokens, 0, "max_recordings_bytes", 100);
    let service = start();
    let reply = service.call("POST", "/v1/recordings", &[("content-type", "application/x-tar")], &[0; 1024]);
    assert_eq!((reply.status, reply.cause().as_str()), (507, "no-space"));
    assert!(reply.header("retry-after").is_none());
    let detail = reply.json()["detail"].as_str().unwrap().to_string();
    assert!(detail.contains("DELETE /v1/recordings/ID") && detail.contains(&kept), "{detail}");
    assert!(!detail.contains(" 0.0 "), "a few kilobytes are no more nothing than a gigabyte: {detail}");
    // Another recording does not fit, neither from a job; the same one takes no more.
    let view = service.wait(&service.submit("scans", &small_scan(1.1)), LONG);
    assert_eq!((view["state"].as_str(), view["problem"]["status"].as_u64()), (Some("failed"), Some(507)), "{view}");
    assert!(view["problem"]["detail"].as_str().unwrap().contains(&kept), "{view}");
    let again = service.wait(&service.submit("scans", &small_scan(1.0)), LONG);
    assert_eq!(again["state"], "succeeded", "{again}");
}

/// Files of another program become a recording where the request of an import lies beside them; what does not fit is
/// said, without a path of the service.
#[test]
fn files_of_another_program_become_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &[]);
    let matlab = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/import/v73.mat")).unwrap();
    let request = json!({
        "files": ["scan.mat"], "form": "matlab", "name": "from matlab", "specimen": shipped("two-hole-shear.json"),
    });
    let upload = |request: &serde_json::Value| {
        let body = tar_of(&[("import.json", request.to_string().as_bytes()), ("scan.mat", &matlab)]);
        service.call("POST", "/v1/recordings", &[("content-type", "application/x-tar")], &body)
    };
    let reply = upload(&request);
    assert_eq!(reply.status, 201, "{}", String::from_utf8_lossy(&reply.body));
    let kept = reply.json();
    assert_eq!((kept["title"].as_str(), kept["summary"]["num_voxels"].as_u64()), (Some("from matlab"), Some(119)));
    let names = service.get(&format!("{}/files", reply.header("location").unwrap())).json();
    assert!(names["artefacts"].as_array().unwrap().iter().any(|file| file["name"] == "recording.json"), "{names}");
    for (status, change) in [
        (404, json!({ "files": ["other.mat"] })),
        (404, json!({ "files": ["../scan.mat"] })),
        (422, json!({ "unit": "m" })),
        (422, json!({ "form": "points" })),
        (404, json!({ "recording": "some", "files": [] })),
        (422, json!({ "unknown": 1 })),
    ] {
        let mut wrong = request.clone();
        wrong.as_object_mut().unwrap().extend(change.as_object().unwrap().clone());
        let reply = upload(&wrong);
        let text = String::from_utf8_lossy(&reply.body).into_owned();
        assert_eq!(reply.status, status, "{change}: {text}");
        assert!(!text.contains("/tmp") && !text.contains("lambdak-"), "{text}");
    }
}

/// A table of points as cameras' programs in Europe write it, with `µ` in one byte or in UTF-16, becomes a recording
/// from the page as from the command.
#[test]
fn tables_in_other_codes_become_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &[]);
    let mut table = String::from("x [µm];y [µm];z [µm];ux [µm];uy [µm];uz [µm]\n");
    for n in 0..10 * 8 * 4 {
        let [i, j, k] = [n % 10, n / 10 % 8, n / 80].map(f64::from);
        let (x, y, z) = (-11.43 + 2.54 * i, -2.8 + 0.8 * j, -7.1625 + 4.775 * k);
        table += &format!("{};{};{};{};0;0\n", 1e3 * x, 1e3 * y, 1e3 * z, 700.0 * y).replace('.', ",");
    }
    let latin: Vec<u8> = table.chars().map(|c| u8::try_from(c).unwrap()).collect();
    let utf16 = format!("\u{feff}{table}").encode_utf16().flat_map(u16::to_le_bytes).collect();
    for bytes in [latin, utf16, table.into_bytes()] {
        let request = json!({
            "files": ["points.csv"], "form": "points", "specimen": shipped("solid-shear.json"), "drive_mm": [5.0],
        });
        let body = tar_of(&[("import.json", request.to_string().as_bytes()), ("points.csv", &bytes)]);
        let reply = service.call("POST", "/v1/recordings", &[("content-type", "application/x-tar")], &body);
        assert_eq!(reply.status, 201, "{}", String::from_utf8_lossy(&reply.body));
        assert_eq!(reply.json()["summary"]["num_voxels"], 320);
    }
}
