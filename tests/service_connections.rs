//! More requests at once than the service takes: a line of the table in docs/security.md.

#[path = "common/prerequisites.rs"]
mod prerequisites;
mod service_common;

use prerequisites::{Missing, Prerequisite};
use service_common::Service;

fn too_many_requests_are_turned_away() -> Result<(), Missing> {
    use std::io::Write;
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    // Requests whose bodies do not come are in work until their time is up.
    let head = format!(
        "POST /v1/evaluations HTTP/1.1\r\nhost: {}\r\ncontent-type: application/json\r\ncontent-length: 9\r\n\r\n",
        service.address
    );
    let mut waiting = Vec::new();
    for _ in 0..520 {
        // Where the process may not open so many files, what is open is what there is.
        let Ok(mut stream) = std::net::TcpStream::connect(&service.address) else { break };
        stream.write_all(head.as_bytes()).unwrap();
        waiting.push(stream);
    }
    if waiting.len() < 520 {
        let reason = format!("only {} connections may be open", waiting.len());
        return Err(Missing::new(Prerequisite::OpenFiles, reason));
    }
    let started = std::time::Instant::now();
    let reply = loop {
        let reply = service.get("/v1/jobs");
        if reply.status != 200 || started.elapsed().as_secs() > 25 {
            break reply;
        }
    };
    assert_eq!((reply.status, reply.cause().as_str()), (429, "too-many-requests"));
    assert!(reply.header("retry-after").is_some());
    drop(waiting);
    let started = std::time::Instant::now();
    while service.get("/v1/jobs").status != 200 {
        assert!(started.elapsed().as_secs() < 60, "the service does not recover");
    }
    Ok(())
}

prerequisites::test_binary!(too_many_requests_are_turned_away);
