//! What is known before a job runs: limits, drawings, costs.

use super::LONG;
use super::service_common::{Service, shipped, small_evaluation};
use serde_json::{Value, json};

#[test]
fn a_check_answers_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    let study = shipped("studies/two-hole-shear.json");
    let body = json!({ "specimen": shipped("two-hole-shear.json"), "limits": study["limits"] });
    let found = service.post("/v1/specimens/check", &body).json();
    assert_eq!(found["is_valid"], true, "{found}");
    assert!(found["drawing_svg"].as_str().unwrap().starts_with("<svg"));
    assert!(found["cost"]["num_elements"].as_u64().unwrap() > 100);
    let mut broken = body;
    broken["specimen"]["holes"][0]["diameter_mm"] = json!(9.0);
    let found = service.post("/v1/specimens/check", &broken).json();
    assert_eq!(found["is_valid"], false);
}

/// The check says which limits it has checked, and solves for force and stretch where it is given a material.
#[test]
fn a_check_says_what_it_checked() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    let mut specimen = shipped("two-hole-shear.json");
    specimen["drive_mm"] = json!([5.0, 9.0]);
    let mut limits = shipped("studies/two-hole-shear.json")["limits"].clone();
    limits["max_drive_mm"] = json!(7.0);
    limits["max_force_n"] = json!(200.0);
    limits["max_normal_force_n"] = json!(100.0);
    limits["max_local_stretch"] = json!(1.5);
    let body = json!({ "specimen": specimen, "limits": limits });
    let found = service.post("/v1/specimens/check", &body).json();
    assert_eq!(found["is_valid"], false, "{found}");
    let margin = |found: &Value, name: &str| {
        found["margins"].as_array().unwrap().iter().find(|m| m["name"] == name).cloned().unwrap_or_default()
    };
    assert_eq!(margin(&found, "max_drive_mm")["value"], 9.0);
    assert_eq!(margin(&found, "max_drive_mm")["is_satisfied"], false);
    let names = |list: &Value| -> Vec<String> {
        list.as_array().unwrap().iter().map(|u| u["name"].as_str().unwrap().to_string()).collect()
    };
    assert_eq!(names(&found["unchecked"]), ["max_force_n", "max_normal_force_n", "max_local_stretch"]);
    let mut with_material = body;
    with_material["material"] = shipped("materials/ecoflex-0020.json");
    with_material["specimen"]["drive_mm"] = json!([5.0, 6.0]);
    let begin = std::time::Instant::now();
    let found = service.post("/v1/specimens/check", &with_material).json();
    eprintln!("solved for the check in {:.2} s", begin.elapsed().as_secs_f64());
    assert_eq!(found["unchecked"], json!([]));
    let force = margin(&found, "max_force_n")["value"].as_f64().unwrap();
    assert!((1.0..100.0).contains(&force), "{force}");
    let across = margin(&found, "max_normal_force_n")["value"].as_f64().unwrap();
    assert!((0.01..force).contains(&across), "{across} N across the plates, {force} N along them");
    assert!(margin(&found, "max_local_stretch")["value"].as_f64().unwrap() > 1.5);
    assert_eq!(
        (&found["is_valid"], &margin(&found, "max_local_stretch")["is_satisfied"]),
        (&json!(false), &json!(false))
    );
}

/// A specimen with so many holes and drives that its evaluation takes hours is refused with the estimate, and a dry run
/// tells what a job would take.
#[test]
fn costs_are_shown_and_limited() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0", "--max-job-hours", "0.1"]);
    let mut costly = small_evaluation(1.0);
    costly["specimen"] = shipped("two-hole-shear.json");
    costly["mesh"] = json!("standard");
    costly["drive_mm"] = (1..=1000).map(|n| json!(0.005 * f64::from(n))).collect();
    let refused = service.post("/v1/evaluations", &costly);
    assert_eq!((refused.status, refused.cause().as_str()), (422, "too-costly"));
    let detail = refused.json()["detail"].as_str().unwrap().to_string();
    assert!(detail.contains("limit: 0.1 h") && detail.contains("--max-job-hours"), "{detail}");
    let estimate = service.post("/v1/evaluations?dry_run=true", &small_evaluation(1.0));
    assert_eq!(estimate.status, 200);
    let estimate = estimate.json();
    assert_eq!((&estimate["num_tasks"], &estimate["most_seconds"]), (&json!(1), &json!(360.0)));
    let seconds = estimate["estimated_seconds"].as_f64().unwrap();
    assert!((0.001..10.0).contains(&seconds), "{seconds}");
    assert_eq!(service.get("/v1/jobs").json()["jobs"].as_array().unwrap().len(), 0, "a dry run starts nothing");
    let cost = service.post("/v1/specimens/check", &json!({ "specimen": costly["specimen"] })).json()["cost"].clone();
    assert!(cost["seconds"].as_f64().unwrap() > 0.0 && cost["most_seconds"] == 360.0, "{cost}");
    // The document's own examples; a whole proof takes hours.
    let document = service.get("/openapi.json").json();
    for (kind, status) in
        [("solves", 200), ("sweeps", 200), ("sweep-studies", 200), ("scans", 200), ("designs", 200), ("proofs", 422)]
    {
        let mut request =
            document["paths"][format!("/v1/{kind}")]["post"]["requestBody"]["content"]["application/json"]["example"]
                .clone();
        if kind == "proofs" {
            request = json!({});
        }
        let reply = service.post(&format!("/v1/{kind}?dry_run=true"), &request);
        let body = reply.json();
        assert_eq!(reply.status, status, "{kind}: {body}");
        let is_known = status == 422 || body["estimated_seconds"].as_f64().is_some_and(|seconds| seconds > 0.0);
        assert!(is_known, "{kind}: {body}");
    }
    let unknown = service.post("/v1/evaluations?dryrun=true", &small_evaluation(1.0));
    assert_eq!((unknown.status, unknown.cause().as_str()), (400, "invalid-parameter"));
}

/// A task that still runs when its time is up ends with a problem, and its job can be resumed for as long again.
#[test]
fn a_task_ends_when_its_time_is_up() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "1", "--max-job-hours", "0.0003"]);
    let begin = std::time::Instant::now();
    // Of the paper's tables nothing is estimated beforehand.
    let job = service.submit("paper-tables", &json!({ "mesh_factor": 1.4 }));
    let view = service.wait(&job, LONG);
    assert_eq!(view["state"], "failed", "{view}");
    assert!(view["problem"]["type"].as_str().unwrap().ends_with(":time-limit"), "{view}");
    eprintln!("a task of 1.1 s ended after {:.1} s", begin.elapsed().as_secs_f64());
    assert_eq!(service.call("POST", &format!("{job}/resume"), &[], b"").json()["state"], "queued");
    service.wait(&job, LONG);
}
