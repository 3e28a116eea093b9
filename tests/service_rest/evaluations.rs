//! Evaluations: from a request to its files, and what is said of requests that cannot be run.

use super::LONG;
use super::service_common::{MISFIT, Service, UNFIT, small_evaluation};
use serde_json::{Value, json};

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
fn problems_point_at_fields() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    let with = |pointer: &str, value: Value| {
        let mut body = small_evaluation(2.0);
        *body.pointer_mut(pointer).unwrap() = value;
        service.post("/v1/evaluations", &body)
    };
    for (refusal, pointer, value) in [
        (MISFIT, "/specimen/block/length_mm", json!("long")),
        (MISFIT, "/specimen/block/length_mm", json!(-1.0)),
        (MISFIT, "/material/bulk_kpa", json!(null)),
        (UNFIT, "/drive_mm/0", json!(0.0)),
        (UNFIT, "/mesh", json!("finest")),
    ] {
        with(pointer, value).is_refused(refusal, pointer);
    }
    let mut unknown = small_evaluation(2.0);
    unknown["specimen"]["hight_mm"] = json!(1);
    service.post("/v1/evaluations", &unknown).is_refused(MISFIT, "/specimen/hight_mm");
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
