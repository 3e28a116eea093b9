//! Jobs while they run: progress, events, cancelling, the service's end.

use super::LONG;
use super::service_common::{Service, small_evaluation};
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::time::Duration;

#[test]
fn a_design_reports_progress_and_can_be_cancelled_and_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &[]);
    let library = service.get("/v1/library").json();
    let mut study = library["studies"][1].clone();
    study["budget"] = json!({ "explore": 6, "refine": 1, "iterations": 1, "propose": 4, "confirm": 1 });
    study["verification"] = json!({ "is_on": false, "draws": 1 });
    let job = service.submit("designs", &study);
    let started = std::time::Instant::now();
    while service.get(&job).json()["progress"]["done"].as_u64().unwrap_or(0) == 0 {
        assert!(started.elapsed() < LONG, "no progress");
        std::thread::sleep(Duration::from_millis(50));
    }
    assert_eq!(service.post(&format!("{job}/cancel"), &json!({})).json()["state"], "cancelled");
    assert_eq!(service.get(&format!("{job}/result")).cause(), "not-finished");
    // A worker may have taken it before the reply is written.
    let resumed = service.post(&format!("{job}/resume"), &json!({})).json();
    assert!(["queued", "running"].iter().any(|state| resumed["state"] == *state), "{resumed}");
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
    study["budget"] = json!({ "explore": 8, "refine": 1, "iterations": 1, "propose": 4, "confirm": 1 });
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
