//! Who may do what, and whether the service lives.

use super::service_common::{Service, add_token, lambdak, set_quota, small_evaluation};
use serde_json::{Value, json};

#[test]
fn tokens_roles_and_quotas() {
    let folder = tempfile::tempdir().unwrap();
    let tokens = folder.path().join("tokens.json");
    let [reader, anna, bert] = ["rita:read", "anna:submit", "bert:submit"].map(|name| add_token(&tokens, name));
    let text = std::fs::read_to_string(&tokens).unwrap();
    assert!(!text.contains(&anna), "tokens are kept as hashes only");
    let file: Value = serde_json::from_str(&text).unwrap();
    set_quota(&tokens, 1, "max_queued_tasks", 2);
    set_quota(&tokens, 1, "max_elements", 100);
    let data = folder.path().join("data");
    let mut service = Service::start(&data, &["--slots", "0", "--tokens", tokens.to_str().unwrap()]);
    assert_eq!((service.get("/v1/jobs").status, service.get("/healthz").status), (401, 200));
    assert_eq!(service.get("/v1/jobs").header("www-authenticate"), Some("Bearer"));
    for forged in ["lk_forged", "", &reader[..reader.len() - 1], &format!("{reader}0"), &reader.to_uppercase()] {
        service.token = Some(forged.into());
        assert_eq!(service.get("/v1/jobs").cause(), "unauthorized", "{forged}");
    }
    service.token = None;
    for value in [format!("Basic {reader}"), reader.clone(), format!("Bearer {reader}, Bearer {reader}")] {
        let reply = service.call("GET", "/v1/jobs", &[("authorization", &value)], b"");
        assert_eq!((reply.status, reply.cause().as_str()), (401, "unauthorized"), "{value}");
    }
    // The hash that is kept opens nothing.
    let kept = file["tokens"][0]["sha256"].as_str().unwrap_or("0").to_string();
    let reply = service.call("GET", "/v1/jobs", &[("authorization", &format!("Bearer {kept}"))], b"");
    assert_eq!(reply.status, 401);
    service.token = Some(reader);
    assert_eq!(service.get("/v1/jobs").status, 200);
    assert_eq!(service.post("/v1/evaluations", &small_evaluation(1.0)).cause(), "forbidden");
    assert_eq!(service.get("/metrics").cause(), "forbidden");
    service.token = Some(anna);
    let job = service.submit("evaluations", &small_evaluation(1.0));
    service.submit("evaluations", &small_evaluation(2.0));
    let third = service.post("/v1/evaluations", &small_evaluation(3.0));
    assert_eq!((third.status, third.cause().as_str()), (429, "quota"));
    assert!(third.header("retry-after").unwrap().parse::<u32>().unwrap() > 0);
    let mut fine = small_evaluation(1.0);
    fine["mesh"] = json!("1");
    assert_eq!(service.post("/v1/evaluations", &fine).cause(), "too-big-a-problem");
    service.token = Some(bert);
    assert_eq!(service.post(&format!("{job}/cancel"), &json!({})).cause(), "forbidden");
}

#[test]
fn other_addresses_need_tokens() {
    let folder = tempfile::tempdir().unwrap();
    let out = lambdak().args(["serve", "--listen", "0.0.0.0:0", "--data"]).arg(folder.path()).output().unwrap();
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains("--tokens"));
}

#[test]
fn health_metrics_and_request_ids() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    assert_eq!((service.get("/healthz").status, service.get("/readyz").status), (200, 200));
    let reply = service.call("GET", "/v1/jobs", &[("x-request-id", "abc-1")], b"");
    assert_eq!(reply.header("x-request-id"), Some("abc-1"));
    let text = String::from_utf8(service.get("/metrics").body).unwrap();
    assert!(text.contains("lambdak_requests_total{method=\"GET\",route=\"/v1/jobs\",status=\"200\"} 1"), "{text}");
    assert!(text.contains("# TYPE lambdak_jobs gauge"));
}

#[test]
fn a_folder_has_one_service() {
    let folder = tempfile::tempdir().unwrap();
    let _service = Service::start(folder.path(), &["--slots", "0"]);
    let out = lambdak().args(["serve", "--listen", "127.0.0.1:0", "--data"]).arg(folder.path()).output().unwrap();
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains("in use"));
}
