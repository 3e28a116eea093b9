//! Deleting jobs and recordings.

use super::LONG;
use super::service_common::{Service, add_token, small_evaluation, small_scan};
use serde_json::json;

#[test]
fn jobs_and_recordings_can_be_deleted() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &[]);
    let scan = small_scan(1.0);
    let job = service.submit("scans", &scan);
    assert_eq!(service.wait(&job, LONG)["state"], "succeeded");
    let recording = service.get(&format!("{job}/result")).json()["recording"].as_str().unwrap().to_string();
    let recording = format!("/v1/recordings/{recording}");
    let delete = |path: &str| service.call("DELETE", path, &[], b"");
    let artefacts = service.get(&format!("{job}/artefacts")).json();
    assert_eq!(delete(&job).status, 204);
    assert_eq!(delete(&job).cause(), "not-found");
    assert_eq!(service.get(&job).cause(), "not-found");
    for artefact in artefacts["artefacts"].as_array().unwrap() {
        assert_eq!(service.get(artefact["href"].as_str().unwrap()).status, 404);
    }
    // The recording that it made is a thing of its own, with all its files.
    assert_eq!(service.get(&recording).status, 200);
    let same = service.submit("scans", &scan);
    assert_eq!(service.wait(&same, LONG)["state"], "succeeded", "what was deleted is computed again");
    assert_eq!(delete(&recording).status, 204);
    assert_eq!(service.get(&recording).cause(), "not-found");
    assert_eq!(service.get("/v1/recordings").json()["recordings"], json!([]));
}

#[test]
fn what_is_in_use_or_somebody_elses_is_not_deleted() {
    let folder = tempfile::tempdir().unwrap();
    let tokens = folder.path().join("tokens.json");
    let [anna, ben, reader] = ["anna:submit", "ben:submit", "cleo:read"].map(|name| add_token(&tokens, name));
    let mut service =
        Service::start(&folder.path().join("data"), &["--slots", "0", "--tokens", tokens.to_str().unwrap()]);
    service.token = Some(anna.clone());
    let job = service.submit("evaluations", &small_evaluation(1.0));
    let mut delete = |token: &str, path: &str| {
        service.token = Some(token.into());
        let reply = service.call("DELETE", path, &[], b"");
        if reply.status == 204 { "gone".into() } else { reply.cause() }
    };
    assert_eq!(delete(&anna, &job), "wrong-state", "it has not ended");
    assert_eq!(delete(&ben, &job), "forbidden");
    assert_eq!(delete(&reader, &job), "forbidden");
    service.token = Some(anna.clone());
    assert_eq!(service.call("POST", &format!("{job}/cancel"), &[], b"").status, 200);
    assert_eq!(service.call("DELETE", &job, &[], b"").status, 204);
}
