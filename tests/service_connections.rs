//! Slow senders and many connections: lines of the table in docs/security.md.

#[path = "common/prerequisites.rs"]
mod prerequisites;
mod service_common;

use prerequisites::{Missing, Prerequisite};
use serde_json::json;
use service_common::{Service, add_token, shipped, small_evaluation};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Open connections that would be more than the places of all requests in work.
const MANY: usize = 520;

/// Files that a process may have to open for [`MANY`] connections of one address: half of all connections are one's.
const OPEN_FILES: usize = 1400;

/// The limit on open files of this process, which the service inherits, is high enough.
fn check_open_files() -> Result<(), Missing> {
    let text = std::fs::read_to_string("/proc/self/limits").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("Max open files"));
    let limit = line.and_then(|line| line.split_whitespace().next()?.parse::<usize>().ok()).unwrap_or(usize::MAX);
    if limit >= OPEN_FILES {
        return Ok(());
    }
    Err(Missing::new(Prerequisite::OpenFiles, format!("a process may open {limit} files, {OPEN_FILES} are needed")))
}

/// A service with two tokens: of one who reads, and of one who submits.
fn closed_service(folder: &std::path::Path) -> (Service, [String; 2]) {
    let tokens = folder.join("tokens.json");
    let secrets = ["mallory:read", "anna:submit"].map(|name| add_token(&tokens, name));
    (Service::start(&folder.join("data"), &["--slots", "0", "--tokens", tokens.to_str().unwrap()]), secrets)
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
        let mut stream = TcpStream::connect(&service.address).unwrap();
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
    check_open_files()?;
    let folder = tempfile::tempdir().unwrap();
    let (mut service, [reader, submitter]) = closed_service(folder.path());
    let begin = Instant::now();
    // A reader may check specimens; what it may not do is refused before a body is waited for.
    let mut open = slow_bodies(&service, "/v1/specimens/check", &reader, MANY);
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

/// Readers that take nothing of megabytes hold places of their own caller alone, and none once their time is up.
fn slow_readers_are_cut_off() -> Result<(), Missing> {
    let folder = tempfile::tempdir().unwrap();
    let (mut service, [reader, submitter]) = closed_service(folder.path());
    service.token = Some(submitter.clone());
    let evaluation = small_evaluation(1.0);
    let count = 3_500_000 / evaluation.to_string().len();
    let job = service.submit("sweeps", &json!({ "evaluations": vec![evaluation; count] }));
    let large = format!("{job}/request");
    let length = service.get(&large).body.len();
    assert!(length > 3_000_000, "{length} bytes");
    // Several answers on each connection: together more than what systems hold of a connection that nobody reads.
    let answers = 8;
    let head = format!("GET {large} HTTP/1.1\r\nhost: {}\r\nauthorization: Bearer {reader}\r\n\r\n", service.address);
    let mut open: Vec<TcpStream> = (0..40)
        .map(|_| {
            let mut stream = TcpStream::connect(&service.address).unwrap();
            stream.write_all(head.repeat(answers).as_bytes()).unwrap();
            stream
        })
        .collect();
    let begin = Instant::now();
    std::thread::sleep(Duration::from_secs(3));
    // The reader's places are taken; its small answers and those of others are not concerned.
    service.token = Some(reader);
    let reply = service.get(&large);
    assert_eq!((reply.status, reply.cause().as_str()), (429, "too-many-requests"));
    assert_eq!(service.get("/v1/jobs").status, 200);
    service.token = Some(submitter);
    assert_eq!(service.get(&large).body.len(), length);
    // Nobody has read a byte: all are cut off when the time that they have saved is spent.
    while service.get("/v1/jobs").status == 200 && begin.elapsed() < Duration::from_secs(14) {
        std::thread::sleep(Duration::from_millis(500));
    }
    let received: Vec<usize> = open
        .iter_mut()
        .map(|stream| {
            stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
            let mut bytes = Vec::new();
            // A connection that is cut ends with or without an error.
            let _ = stream.read_to_end(&mut bytes);
            bytes.len()
        })
        .collect();
    assert!(received.iter().all(|bytes| *bytes < answers * length), "{received:?} of {}", answers * length);
    assert!(begin.elapsed() < Duration::from_secs(30), "{:?}", begin.elapsed());
    eprintln!(
        "40 readers of nothing were cut off; the most that a system held for one was {:?}",
        received.iter().max()
    );
    assert_eq!(service.get(&large).status, 200);
    Ok(())
}

prerequisites::test_binary!(
    slow_bodies_of_a_reader_shut_nobody_out,
    slow_uploads_shut_nobody_out,
    slow_readers_are_cut_off
);
