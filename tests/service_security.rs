//! What is tried against the service and what comes back: one test per line of the table in docs/security.md.

mod service_common;

use serde_json::json;
use service_common::{Service, shipped, small_evaluation};

fn service() -> (tempfile::TempDir, Service) {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    (folder, service)
}

#[test]
fn paths_do_not_leave_the_page_or_the_job() {
    let (_folder, service) = service();
    let job = service.submit("evaluations", &small_evaluation(1.0));
    for path in [
        "/assets/../Cargo.toml".to_string(),
        "/assets/..%2f..%2fetc%2fpasswd".to_string(),
        "/assets/%2e%2e%2fmain.rs".to_string(),
        format!("{job}/artefacts/..%2f..%2flambdak.sqlite"),
        format!("{job}/artefacts/%2fetc%2fpasswd"),
    ] {
        assert_eq!(service.get(&path).cause(), "not-found", "{path}");
    }
}

#[test]
fn studies_cannot_name_files() {
    let (_folder, service) = service();
    let mut study = shipped("studies/two-hole-shear.json");
    for name in ["/etc/passwd", "../two-hole-shear.json", "http://127.0.0.1/x", "file:///etc/passwd"] {
        study["base"] = json!(name);
        let reply = service.post("/v1/designs", &study);
        assert_eq!((reply.status, reply.json()["errors"][0]["pointer"].as_str()), (422, Some("/base")), "{name}");
    }
    study["base"] = shipped("two-hole-shear.json");
    let reply = service.post("/v1/designs", &study);
    assert_eq!(reply.json()["errors"][0]["pointer"], "/materials/0/material");
}

#[test]
fn bodies_are_bounded() {
    let (_folder, service) = service();
    let long = vec![b' '; 5 << 20];
    let reply = service.call("POST", "/v1/evaluations", &[("content-type", "application/json")], &long);
    assert_eq!((reply.status, reply.cause().as_str()), (413, "too-large"));
    // Brackets that nest deeper than any parser's stack likes.
    let deep = "[".repeat(200_000);
    let reply = service.call("POST", "/v1/evaluations", &[("content-type", "application/json")], deep.as_bytes());
    assert_eq!((reply.status, reply.cause().as_str()), (400, "invalid-json"));
}

#[test]
fn sizes_are_bounded() {
    let (_folder, service) = service();
    let mut body = small_evaluation(1.0);
    body["scan"]["voxel_mm"] = json!([0.001, 0.001, 0.001]);
    assert_eq!(service.post("/v1/evaluations", &body).cause(), "invalid-input");
    let values: Vec<f64> = (0..200).map(f64::from).collect();
    let axis = json!({ "pointer": "/drive_mm/0", "values": values });
    let sweep = json!({ "base": small_evaluation(1.0), "vary": [axis, axis, axis, axis, axis, axis, axis, axis] });
    assert_eq!(service.post("/v1/sweeps", &sweep).cause(), "invalid-input");
}

#[test]
fn other_sites_cannot_use_the_service() {
    let (_folder, service) = service();
    let body = small_evaluation(1.0).to_string();
    let json = ("content-type", "application/json");
    let reply = service.call("POST", "/v1/evaluations", &[json, ("sec-fetch-site", "cross-site")], body.as_bytes());
    assert_eq!((reply.status, reply.cause().as_str()), (403, "forbidden"));
    // A form of another site can send text/plain without asking first.
    let reply = service.call("POST", "/v1/evaluations", &[("content-type", "text/plain")], body.as_bytes());
    assert_eq!(reply.status, 415);
    // Another site asks first and gets no leave.
    let origin = ("origin", "https://example.org");
    let reply = service.call("OPTIONS", "/v1/evaluations", &[origin, ("access-control-request-method", "POST")], b"");
    assert!(reply.header("access-control-allow-origin").is_none());
    // A name of another site that resolves to this machine.
    let reply = service.raw(b"GET /v1/jobs HTTP/1.1\r\nhost: evil.example\r\nconnection: close\r\n\r\n").unwrap();
    assert_eq!((reply.status, reply.cause().as_str()), (400, "bad-host"));
}

#[test]
fn smuggled_headers_are_refused() {
    let (_folder, service) = service();
    let host = &service.address;
    for head in [
        format!(
            "POST /v1/evaluations HTTP/1.1\r\nhost: {host}\r\ncontent-length: 5\r\ntransfer-encoding: chunked\r\nconnection: close\r\n\r\n0\r\n\r\n"
        ),
        format!(
            "POST /v1/evaluations HTTP/1.1\r\nhost: {host}\r\ncontent-length: 5\r\ncontent-length: 6\r\nconnection: close\r\n\r\nabcde"
        ),
        format!("GET /v1/jobs HTTP/1.1\r\nhost: {host}\r\nhost: {host}\r\nconnection: close\r\n\r\n"),
        format!("GET /v1/jobs HTTP/1.1\r\nhost: {host}\r\nbad header: 1\r\nconnection: close\r\n\r\n"),
    ] {
        let reply = service.raw(head.as_bytes());
        assert!(reply.is_none_or(|r| (400..500).contains(&r.status)), "{head}");
    }
    // An id from outside with line breaks never reaches the log or the answer.
    let reply = service.call("GET", "/v1/jobs", &[("x-request-id", "a b;c")], b"");
    assert_ne!(reply.header("x-request-id"), Some("a b;c"));
}

#[test]
fn answers_carry_protective_headers() {
    let (_folder, service) = service();
    let page = service.get("/");
    assert!(page.header("content-security-policy").unwrap().contains("default-src 'none'"));
    for path in ["/", "/v1/jobs", "/nowhere"] {
        assert_eq!(service.get(path).header("x-content-type-options"), Some("nosniff"), "{path}");
    }
}

/// A tar entry with a right checksum.
fn tar_entry(name: &str, kind: u8, bytes: &[u8]) -> Vec<u8> {
    let mut header = [0u8; 512];
    header[..name.len()].copy_from_slice(name.as_bytes());
    header[124..135].copy_from_slice(format!("{:011o}", bytes.len()).as_bytes());
    header[148..156].fill(b' ');
    header[156] = kind;
    let sum: u64 = header.iter().map(|b| u64::from(*b)).sum();
    header[148..154].copy_from_slice(format!("{sum:06o}").as_bytes());
    header[154] = 0;
    let mut out = header.to_vec();
    out.extend_from_slice(bytes);
    out.resize(out.len().div_ceil(512) * 512, 0);
    out
}

#[test]
fn uploads_are_recordings_or_refused() {
    let (_folder, service) = service();
    let send = |body: &[u8]| service.call("POST", "/v1/recordings", &[("content-type", "application/x-tar")], body);
    for (what, body) in [
        ("no tar", b"hello".to_vec()),
        ("a path", tar_entry("../../etc/cron.d/x", b'0', b"x")),
        ("a link", tar_entry("mask.nii.gz", b'2', b"")),
        ("no recording", tar_entry("recording.json", b'0', b"{}")),
        ("a length that is not there", tar_entry("u.nii", b'0', &[0; 600])[..700].to_vec()),
    ] {
        let reply = send(&body);
        assert_eq!((reply.status, reply.cause().as_str()), (422, "unsafe-upload"), "{what}");
        assert!(!String::from_utf8_lossy(&reply.body).contains("/tmp/"), "{what}: no paths of the machine");
    }
    assert_eq!(service.get("/v1/recordings").json()["recordings"].as_array().unwrap().len(), 0);
    let reply = service.post("/v1/diagnoses", &json!({ "recording": "../../x" }));
    assert_eq!(reply.json()["errors"][0]["pointer"], "/recording");
}
