//! The Python client and its example run against the service.

#[path = "common/prerequisites.rs"]
mod prerequisites;
mod service_common;

use prerequisites::Missing;
use service_common::Service;
use std::io::{Read, Write};
use std::process::Command;

fn python_example_runs() -> Result<(), Missing> {
    prerequisites::python()?;
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &[]);
    let out = Command::new("python3")
        .arg("-B")
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/api/python/example.py"))
        .arg(format!("http://{}", service.address))
        .output()
        .unwrap();
    let (text, errors) = (String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr));
    assert!(out.status.success(), "{text}\n{errors}");
    for part in ["gain of the best over the base", "verdict:", "residual_after_1.nii.gz", "misfit_1_2.nii.gz"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    eprintln!("{text}");
    Ok(())
}

/// A service that says to come back in an hour gets a caller who is told so, not one that sleeps for an hour.
fn the_python_client_does_not_sleep_for_hours() -> Result<(), Missing> {
    prerequisites::python()?;
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let _ = stream.read(&mut [0; 4096]);
            let body = r#"{"type":"urn:lambdak:problem:queue-full","title":"full","detail":"come back","status":429}"#;
            let head = "HTTP/1.1 429 Too Many Requests\r\nretry-after: 3600\r\nconnection: close\r\n";
            let _ = stream.write_all(format!("{head}content-length: {}\r\n\r\n{body}", body.len()).as_bytes());
        }
    });
    let program = format!(
        "from lambdak_client import Client, ProblemError\n\
         try:\n    Client('http://{address}').library()\n\
         except ProblemError as error:\n    print('told:', error.kind)\n"
    );
    let begin = std::time::Instant::now();
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/api/python");
    let out = Command::new("python3").args(["-B", "-c", &program]).env("PYTHONPATH", folder).output().unwrap();
    assert_eq!(String::from_utf8_lossy(&out.stdout).trim(), "told: queue-full", "{out:?}");
    assert!(begin.elapsed().as_secs() < 30, "{:?}", begin.elapsed());
    Ok(())
}

prerequisites::test_binary!(python_example_runs, the_python_client_does_not_sleep_for_hours);
