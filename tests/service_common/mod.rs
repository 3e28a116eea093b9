//! The real binary on a free port, and a small HTTP client.
#![allow(dead_code)]

pub mod tar;

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A running `lambdak serve`; killed when dropped.
pub struct Service {
    pub child: Child,
    pub address: String,
    pub token: Option<String>,
}

/// A reply.
#[derive(Debug)]
pub struct Reply {
    pub status: u16,
    pub headers: Vec<(String, String)>,
    pub body: Vec<u8>,
}

impl Reply {
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body)
            .unwrap_or_else(|e| panic!("{e}: {} {}", self.status, String::from_utf8_lossy(&self.body)))
    }

    pub fn header(&self, name: &str) -> Option<&str> {
        self.headers.iter().find(|h| h.0.eq_ignore_ascii_case(name)).map(|h| h.1.as_str())
    }

    /// Name of the problem's cause.
    pub fn cause(&self) -> String {
        assert_eq!(self.header("content-type"), Some("application/problem+json"), "{self:?}");
        self.json()["type"].as_str().unwrap_or_default().rsplit(':').next().unwrap_or_default().to_string()
    }
}

pub fn lambdak() -> Command {
    Command::new(env!("CARGO_BIN_EXE_lambdak"))
}

/// What a request is refused for that does not fit its schema, and one that fits and cannot be computed.
pub const MISFIT: (u16, &str) = (400, "schema-mismatch");
pub const UNFIT: (u16, &str) = (422, "invalid-input");

impl Reply {
    /// Holds the reply to be a refusal of this status and cause whose first error is at `pointer`.
    pub fn is_refused(&self, (status, cause): (u16, &str), pointer: &str) {
        let body = self.json();
        let found = (self.status, self.cause(), body["errors"][0]["pointer"].as_str().unwrap_or_default().to_string());
        assert_eq!(found, (status, cause.to_string(), pointer.to_string()), "{body}");
    }
}

impl Service {
    pub fn start(data: &Path, more: &[&str]) -> Service {
        let mut child = lambdak()
            .args(["serve", "--listen", "127.0.0.1:0", "--data"])
            .arg(data)
            .args(more)
            .stdout(Stdio::piped())
            .stderr(if std::env::var_os("LAMBDAK_TEST_LOG").is_some() { Stdio::inherit() } else { Stdio::null() })
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address = line.trim().trim_start_matches("http://").trim_end_matches('/').to_string();
        assert!(!address.is_empty(), "the service did not start");
        Service { child, address, token: None }
    }

    /// Sends bytes as they are and reads the whole reply.
    pub fn raw(&self, request: &[u8]) -> Option<Reply> {
        let mut stream = TcpStream::connect(&self.address).ok()?;
        stream.set_read_timeout(Some(Duration::from_secs(120))).unwrap();
        stream.write_all(request).ok()?;
        read_reply(stream)
    }

    pub fn call(&self, method: &str, path: &str, more: &[(&str, &str)], body: &[u8]) -> Reply {
        self.try_call(method, path, more, body).unwrap_or_else(|| panic!("no reply to {method} {path}"))
    }

    pub fn try_call(&self, method: &str, path: &str, more: &[(&str, &str)], body: &[u8]) -> Option<Reply> {
        let mut head = format!("{method} {path} HTTP/1.1\r\nhost: {}\r\nconnection: close\r\n", self.address);
        if let Some(token) = &self.token {
            head += &format!("authorization: Bearer {token}\r\n");
        }
        for (name, value) in more {
            head += &format!("{name}: {value}\r\n");
        }
        if method == "POST" {
            head += &format!("content-length: {}\r\n", body.len());
        }
        head += "\r\n";
        self.raw(&[head.as_bytes(), body].concat())
    }

    pub fn get(&self, path: &str) -> Reply {
        self.call("GET", path, &[], b"")
    }

    pub fn post(&self, path: &str, body: &Value) -> Reply {
        self.call("POST", path, &[("content-type", "application/json")], body.to_string().as_bytes())
    }

    /// Posts a job and gives its address.
    pub fn submit(&self, kind: &str, body: &Value) -> String {
        let reply = self.post(&format!("/v1/{kind}"), body);
        assert_eq!(reply.status, 202, "{}", String::from_utf8_lossy(&reply.body));
        reply.header("location").unwrap().to_string()
    }

    /// Waits until the job has ended.
    pub fn wait(&self, job: &str, limit: Duration) -> Value {
        let started = Instant::now();
        loop {
            let view = self.get(job).json();
            if !matches!(view["state"].as_str(), Some("queued" | "running")) {
                return view;
            }
            assert!(started.elapsed() < limit, "not finished in {limit:?}: {view}");
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// kill -9.
    pub fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        self.kill();
    }
}

fn read_reply(stream: TcpStream) -> Option<Reply> {
    let mut reader = BufReader::new(stream);
    let mut line = String::new();
    reader.read_line(&mut line).ok()?;
    let status = line.split(' ').nth(1)?.parse().ok()?;
    let mut headers = Vec::new();
    loop {
        let mut line = String::new();
        reader.read_line(&mut line).ok()?;
        let Some((name, value)) = line.trim_end().split_once(':') else { break };
        headers.push((name.to_string(), value.trim().to_string()));
    }
    let mut body = Vec::new();
    reader.read_to_end(&mut body).ok()?;
    let is_chunked = headers.iter().any(|h| h.0.eq_ignore_ascii_case("transfer-encoding"));
    Some(Reply { status, headers, body: if is_chunked { unchunk(&body) } else { body } })
}

fn unchunk(mut rest: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    while let Some(end) = rest.windows(2).position(|w| w == b"\r\n") {
        let length = usize::from_str_radix(&String::from_utf8_lossy(&rest[..end]), 16).unwrap_or(0);
        if length == 0 || rest.len() < end + 2 + length {
            break;
        }
        out.extend_from_slice(&rest[end + 2..end + 2 + length]);
        rest = rest.get(end + 4 + length..).unwrap_or_default();
    }
    out
}

pub fn shipped(name: &str) -> Value {
    let path = format!("{}/geometries/{name}", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// An evaluation that takes a fraction of a second: a coarse mesh, large voxels, one drive.
pub fn small_evaluation(drive_mm: f64) -> Value {
    json!({
        "specimen": shipped("solid-shear.json"), "material": shipped("materials/ecoflex-0020.json"),
        "scan": { "voxel_mm": [2.0, 1.0, 2.0], "noise_sd_mm": [0.05, 0.05, 0.05], "force_sd_n": 0.02 },
        "drive_mm": [drive_mm], "mesh": "5",
    })
}

/// A sweep of so many different small evaluations.
pub fn small_sweep(count: usize) -> Value {
    let values: Vec<f64> = (0..count).map(|i| 0.5 + 2.0 * i as f64 / count as f64).collect();
    json!({ "name": "kill", "base": small_evaluation(1.0), "vary": [{ "pointer": "/drive_mm/0", "values": values }] })
}

/// A scan that takes a fraction of a second, and leaves a recording.
pub fn small_scan(drive_mm: f64) -> Value {
    json!({
        "specimen": shipped("solid-shear.json"), "drive_mm": [drive_mm], "mesh": 5.0, "voxel_mm": [2.0, 1.0, 2.0],
        "mm_per_radian": [2.0, 2.0, 2.0], "noise_sd_mm": [0.01, 0.01, 0.01],
    })
}

/// Adds a token NAME:ROLE to the file, and gives it.
pub fn add_token(tokens: &Path, name: &str) -> String {
    let made = lambdak().args(["serve", "--add-token", name, "--tokens"]).arg(tokens).output().unwrap();
    assert!(made.status.success(), "{made:?}");
    String::from_utf8(made.stdout).unwrap().trim().to_string()
}

/// Sets a quota of the file's token of this index.
pub fn set_quota(tokens: &Path, index: usize, quota: &str, value: u64) {
    let mut file: Value = serde_json::from_str(&std::fs::read_to_string(tokens).unwrap()).unwrap();
    file["tokens"][index][quota] = json!(value);
    std::fs::write(tokens, file.to_string()).unwrap();
}

/// A tar file of plain files.
pub fn tar_of(files: &[(&str, &[u8])]) -> Vec<u8> {
    files.iter().flat_map(|(name, bytes)| tar::tar_entry(name, b'0', bytes)).collect()
}
