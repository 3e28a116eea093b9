//! Slow senders and many connections: lines of the table in docs/security.md.

#[path = "common/prerequisites.rs"]
mod prerequisites;
mod service_common;

use prerequisites::{Missing, Prerequisite};
use serde_json::json;
use service_common::{Service, lambdak, shipped};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Open connections that would be more than the places of all requests in work.
const MANY: usize = 520;

/// A service with two tokens: of one who reads, and of one who submits.
fn closed_service(folder: &std::path::Path) -> (Service, [String; 2]) {
    let tokens = folder.join("tokens.json");
    let tokens = tokens.to_str().unwrap();
    let make = |name: &str| {
        let made = lambdak().args(["serve", "--tokens", tokens, "--add-token", name]).output().unwrap();
        assert!(made.status.success());
        String::from_utf8(made.stdout).unwrap().trim().to_string()
    };
    let secrets = [make("mallory:read"), make("anna:submit")];
    (Service::start(&folder.join("data"), &["--slots", "0", "--tokens", tokens]), secrets)
}

/// Begins requests with a body of which nothing comes.
fn slow_bodies(service: &Service, path: &str, secret: &str, count: usize) -> Vec<TcpStream> {
    let head = format!(
        "POST {path} HTTP/1.1\r\nhost: {}\r\nauthorization: Bearer {secret}\r\ncontent-type: application/json\r\n\
         content-length: 9000\r\n\r\n",
        service.address
    );
    let mut open = Vec::new();
    for _ in 0..count {
        // Where the process may not open so many files, what is open is what there is.
        let Ok(mut stream) = TcpStream::connect(&service.address) else { break };
        let _ = stream.write_all(head.as_bytes());
        open.push(stream);
    }
    open
}

/// Status of what came back so far; none where nothing has.
fn status(stream: &mut TcpStream, wait: Duration) -> Option<u16> {
    stream.set_read_timeout(Some(wait)).unwrap();
    let mut bytes = [0u8; 12];
    stream.read_exact(&mut bytes).ok()?;
    std::str::from_utf8(&bytes[9..12]).ok()?.parse().ok()
}

fn slow_bodies_of_a_reader_shut_nobody_out() -> Result<(), Missing> {
    let folder = tempfile::tempdir().unwrap();
    let (mut service, [reader, submitter]) = closed_service(folder.path());
    let begin = Instant::now();
    // A reader may check specimens; what it may not do is refused before a body is waited for.
    let mut open = slow_bodies(&service, "/v1/specimens/check", &reader, MANY);
    if open.len() < MANY {
        return Err(Missing::new(Prerequisite::OpenFiles, format!("only {} connections may be open", open.len())));
    }
    let mut refused = slow_bodies(&service, "/v1/evaluations", &reader, 1);
    assert_eq!(status(&mut refused[0], Duration::from_secs(20)), Some(403));
    for _ in 0..20 {
        for path in ["/healthz", "/readyz", "/"] {
            assert_eq!(service.get(path).status, 200, "{path}");
        }
        service.token = Some(submitter.clone());
        assert_eq!(service.get("/v1/jobs").status, 200);
        let body = json!({ "specimen": shipped("solid-shear.json") });
        assert_eq!(service.post("/v1/specimens/check", &body).status, 200);
        // The reader's own bodies are at their limit; looking is not.
        service.token = Some(reader.clone());
        assert_eq!(service.get("/v1/jobs").status, 200);
        if begin.elapsed() < Duration::from_secs(8) {
            let reply = service.post("/v1/specimens/check", &body);
            assert_eq!((reply.status, reply.cause().as_str()), (429, "too-many-requests"));
            assert!(reply.json()["detail"].as_str().unwrap().contains("one token"));
        }
    }
    eprintln!("{MANY} slow bodies: 140 answers to others in {:.1} s", begin.elapsed().as_secs_f64());
    // What came was answered: most at once as too many, those within the share when their time was up.
    let statuses: Vec<Option<u16>> = open.iter_mut().map(|s| status(s, Duration::from_secs(30))).collect();
    let count = |wanted: u16| statuses.iter().filter(|s| **s == Some(wanted)).count();
    assert_eq!((count(408), count(429)), (16, MANY - 16), "{statuses:?}");
    drop(open);
    let body = json!({ "specimen": shipped("solid-shear.json") });
    assert_eq!(service.post("/v1/specimens/check", &body).status, 200);
    Ok(())
}

fn slow_uploads_shut_nobody_out() -> Result<(), Missing> {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    let head = format!(
        "POST /v1/recordings HTTP/1.1\r\nhost: {}\r\ncontent-type: application/x-tar\r\ncontent-length: 500000000\r\n\r\n",
        service.address
    );
    let mut open: Vec<TcpStream> = (0..8)
        .map(|_| {
            let mut stream = TcpStream::connect(&service.address).unwrap();
            stream.write_all(head.as_bytes()).unwrap();
            stream
        })
        .collect();
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(service.get("/v1/jobs").status, 200);
    let body = json!({ "specimen": shipped("solid-shear.json") });
    assert_eq!(service.post("/v1/specimens/check", &body).status, 200);
    // A byte a second is slower than the least rate: the sender is told so soon after its first ten seconds.
    let begin = Instant::now();
    let mut statuses = Vec::new();
    for stream in &mut open {
        let mut found = None;
        while found.is_none() && begin.elapsed() < Duration::from_secs(40) {
            let _ = stream.write_all(b"x");
            found = status(stream, Duration::from_secs(1));
        }
        statuses.push(found);
    }
    let count = |wanted: u16| statuses.iter().filter(|s| **s == Some(wanted)).count();
    assert_eq!((count(408), count(429)), (2, 6), "{statuses:?}");
    Ok(())
}

prerequisites::test_binary!(slow_bodies_of_a_reader_shut_nobody_out, slow_uploads_shut_nobody_out);
