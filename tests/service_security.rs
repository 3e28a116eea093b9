//! What is tried against the service and what comes back: one test per line of the table in docs/security.md.

mod service_common;

use serde_json::json;
use service_common::tar::tar_entry;
use service_common::{MISFIT, Service, UNFIT, shipped, small_evaluation};

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
        service.post("/v1/designs", &study).is_refused(MISFIT, "/base");
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
    // A base of a thousand drives, ten thousand times.
    let mut large = small_evaluation(1.0);
    large["drive_mm"] = (1..=1000).map(|n| json!(0.002 * f64::from(n))).collect();
    let values: Vec<f64> = (1..=10_000).map(|n| 0.0002 * f64::from(n)).collect();
    let sweep = json!({ "base": large, "vary": [{ "pointer": "/drive_mm/0", "values": values }] });
    service.post("/v1/sweeps", &sweep).is_refused(UNFIT, "/base");
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
fn a_request_within_a_request_is_not_answered() {
    use std::io::{Read, Write};
    let (_folder, service) = service();
    let host = &service.address;
    let inner = format!("GET /v1/me HTTP/1.1\r\nhost: {host}\r\n\r\n");
    let length = inner.len();
    for framing in [
        format!("content-length: {length}\r\ntransfer-encoding: chunked"),
        format!("transfer-encoding: chunked\r\ncontent-length: {length}"),
        "transfer-encoding: xchunked".to_string(),
        "transfer-encoding: chunked, identity".to_string(),
        "transfer-encoding: identity\r\ntransfer-encoding: chunked\r\ncontent-length: 0".to_string(),
        "content-length: +0".to_string(),
        "content-length: 0, 0".to_string(),
        "content-length : 0\r\n folded: 1".to_string(),
    ] {
        let head =
            format!("POST /v1/evaluations HTTP/1.1\r\nhost: {host}\r\ncontent-type: text/plain\r\n{framing}\r\n\r\n");
        let mut stream = std::net::TcpStream::connect(host).unwrap();
        stream.set_read_timeout(Some(std::time::Duration::from_secs(20))).unwrap();
        stream.write_all(format!("{head}0\r\n\r\n{inner}").as_bytes()).unwrap();
        stream.shutdown(std::net::Shutdown::Write).unwrap();
        let mut text = Vec::new();
        let _ = stream.read_to_end(&mut text);
        let text = String::from_utf8_lossy(&text);
        assert!(!text.contains("\"needs_token\""), "{framing}: {text}");
        assert!(text.is_empty() || text.starts_with("HTTP/1.1 4"), "{framing}: {text}");
    }
    // Heads that do not end.
    let long = format!("GET /v1/jobs HTTP/1.1\r\nhost: {host}\r\nx: {}\r\n\r\n", "a".repeat(1 << 20));
    assert!(service.raw(long.as_bytes()).is_none_or(|r| (400..500).contains(&r.status)));
    let many = "x: 1\r\n".repeat(1000);
    let many = format!("GET /v1/jobs HTTP/1.1\r\nhost: {host}\r\n{many}\r\n");
    assert!(service.raw(many.as_bytes()).is_none_or(|r| (400..500).contains(&r.status)));
    assert_eq!(service.get("/healthz").status, 200);
}

#[test]
fn a_slow_head_ends_the_connection() {
    use std::io::{Read, Write};
    let (_folder, service) = service();
    let mut stream = std::net::TcpStream::connect(&service.address).unwrap();
    stream.write_all(b"GET /v1/jobs HTTP/1.1\r\nhost: ").unwrap();
    // The limit is 10 s; a busy machine may be late.
    stream.set_read_timeout(Some(std::time::Duration::from_secs(60))).unwrap();
    let started = std::time::Instant::now();
    let mut text = Vec::new();
    let _ = stream.read_to_end(&mut text);
    assert!(started.elapsed().as_secs() < 59, "the connection is still open");
}

#[test]
fn nothing_is_fetched_from_anywhere() {
    let (_folder, service) = service();
    let trap = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    trap.set_nonblocking(true).unwrap();
    let url = format!("http://{}/x.json", trap.local_addr().unwrap());
    let mut study = shipped("studies/two-hole-shear.json");
    study["base"] = json!(url);
    let mut evaluation = small_evaluation(1.0);
    evaluation["specimen"] = json!(url);
    let mut named = small_evaluation(1.0);
    named["specimen"]["name"] = json!(url);
    for (kind, body, status) in [
        ("designs", study, 400),
        ("evaluations", evaluation, 400),
        ("evaluations", named, 202),
        ("sweeps", json!({ "base": url }), 400),
        ("scans", json!({ "specimen": url, "material": url }), 400),
        ("diagnoses", json!({ "recording": url }), 422),
        ("calibrations", json!({ "recordings": [url] }), 422),
    ] {
        assert_eq!(service.post(&format!("/v1/{kind}"), &body).status, status, "{kind} {body}");
    }
    let tar = tar_entry("recording.json", b'0', json!({ "specimen": url, "mask": url }).to_string().as_bytes());
    assert_eq!(service.call("POST", "/v1/recordings", &[("content-type", "application/x-tar")], &tar).status, 422);
    assert!(trap.accept().is_err(), "something was fetched");
}

#[test]
fn names_are_values_for_the_database_and_text_for_the_page() {
    let (_folder, service) = service();
    for id in ["'%20OR%201=1--", "%22;DROP%20TABLE%20jobs;--", "%00", "%25"] {
        assert_eq!(service.get(&format!("/v1/jobs/{id}")).cause(), "not-found", "{id}");
        assert_eq!(service.get(&format!("/v1/recordings/{id}")).cause(), "not-found", "{id}");
    }
    let mut body = small_evaluation(1.0);
    let name = "<script>alert(1)</script>'; DROP TABLE jobs;--";
    body["specimen"]["name"] = json!(name);
    let job = service.submit("evaluations", &body);
    let view = service.get(&job);
    assert_eq!((view.json()["title"].as_str(), view.header("content-type")), (Some(name), Some("application/json")));
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
    // A length above the limit is refused before anything of that length is there.
    let mut long = tar_entry("u_1.nii.gz", b'0', b"");
    long[124..135].copy_from_slice(b"17777777777");
    long[148..156].fill(b' ');
    let sum: u64 = long.iter().map(|b| u64::from(*b)).sum();
    long[148..154].copy_from_slice(format!("{sum:06o}").as_bytes());
    long[154] = 0;
    let reply = send(&long);
    assert_eq!((reply.status, reply.cause().as_str()), (413, "too-large"));
    // A few kilobytes that say they are sixty-four thousand million numbers, and unpack to fifty megabytes of nothing.
    let mut header = vec![0u8; 352];
    header[0..4].copy_from_slice(&348i32.to_le_bytes());
    for (n, value) in [3i16, 4000, 4000, 4000, 1, 1].into_iter().enumerate() {
        header[40 + 2 * n..42 + 2 * n].copy_from_slice(&value.to_le_bytes());
    }
    header[70..72].copy_from_slice(&16i16.to_le_bytes());
    header[72..74].copy_from_slice(&32i16.to_le_bytes());
    header[108..112].copy_from_slice(&352f32.to_le_bytes());
    header[123] = 2;
    header[254..256].copy_from_slice(&1i16.to_le_bytes());
    for at in [280, 300, 320] {
        header[at..at + 4].copy_from_slice(&1f32.to_le_bytes());
    }
    header[344..348].copy_from_slice(b"n+1\0");
    header.resize(50 << 20, 0);
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut packed, &header).unwrap();
    let packed = packed.finish().unwrap();
    assert!(packed.len() < 1 << 20);
    let recording = json!({
        "schema": "mru-recording/1", "id": "bomb", "specimen": shipped("solid-shear.json"), "mask": "mask.nii.gz", "acquisition": { "voxel_mm": [1.0, 1.0, 1.0] },
        "steps": [{ "drive_mm": 1.0, "force_n": null, "displacement": "u_1.nii.gz" }],
    });
    let bomb = [
        tar_entry("recording.json", b'0', recording.to_string().as_bytes()),
        tar_entry("mask.nii.gz", b'0', &packed),
        tar_entry("u_1.nii.gz", b'0', &packed),
    ]
    .concat();
    let started = std::time::Instant::now();
    let reply = send(&bomb);
    assert_eq!((reply.status, reply.cause().as_str()), (413, "too-large"), "{reply:?}");
    eprintln!("bomb: {} in {:?}", reply.json()["detail"], started.elapsed());
    assert_eq!(service.get("/v1/recordings").json()["recordings"].as_array().unwrap().len(), 0);
    let reply = service.post("/v1/diagnoses", &json!({ "recording": "../../x" }));
    assert_eq!(reply.json()["errors"][0]["pointer"], "/recording");
}

/// Browsers that do not say Sec-Fetch-Site name the page's origin; a cancel needs no body, and so no leave to post.
#[test]
fn pages_of_other_origins_cancel_and_delete_nothing() {
    let (_folder, service) = service();
    let job = service.submit("evaluations", &small_evaluation(1.0));
    let cancel = format!("{job}/cancel");
    for origin in ["https://evil.example", "null", "http://127.0.0.1:1"] {
        for (method, path) in [("POST", &cancel), ("DELETE", &job)] {
            let reply = service.call(method, path, &[("origin", origin)], b"");
            assert_eq!((reply.status, reply.cause().as_str()), (403, "forbidden"), "{origin} {method}");
        }
    }
    let reply =
        service.call("POST", &cancel, &[("origin", "https://evil.example"), ("sec-fetch-site", "cross-site")], b"");
    assert_eq!(reply.status, 403);
    assert_eq!(service.get(&job).json()["state"], "queued");
    let own = format!("http://{}", service.address);
    assert_eq!(service.call("POST", &cancel, &[("origin", &own)], b"").status, 200);
}

#[test]
fn names_and_numbers_are_fit_to_be_shown() {
    let (_folder, service) = service();
    let mut body = small_evaluation(1.0);
    body["specimen"]["name"] = json!("block\u{202e}gnp.\u{200b}exe");
    let job = service.submit("evaluations", &body);
    assert_eq!(service.get(&job).json()["title"], "blockgnp.exe");
    body["specimen"]["block"]["length_mm"] = json!(1e308);
    let reply = service.post("/v1/evaluations", &body);
    let text = String::from_utf8_lossy(&reply.body).into_owned();
    assert!(reply.status == 400 && text.contains("1e308") && !text.contains("00000000000000000000000"), "{text}");
}

#[test]
fn a_wrong_token_is_told_from_none() {
    let folder = tempfile::tempdir().unwrap();
    let tokens = folder.path().join("tokens.json");
    let tokens = tokens.to_str().unwrap();
    let made =
        service_common::lambdak().args(["serve", "--tokens", tokens, "--add-token", "anna:read"]).output().unwrap();
    assert!(made.status.success());
    let mut service = Service::start(&folder.path().join("data"), &["--slots", "0", "--tokens", tokens]);
    let detail = |service: &Service| {
        let reply = service.get("/v1/jobs");
        assert_eq!((reply.status, reply.cause().as_str()), (401, "unauthorized"));
        reply.json()["detail"].as_str().unwrap().to_string()
    };
    assert!(detail(&service).contains("send the header"));
    service.token = Some("lk_wrong".into());
    assert!(detail(&service).contains("this token is none of the service's"));
}
