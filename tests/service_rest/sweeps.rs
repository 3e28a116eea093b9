//! Lists of evaluations, and the queue that they fill.

use super::LONG;
use super::service_common::{MISFIT, Service, UNFIT, small_evaluation, small_sweep};
use serde_json::{Value, json};

#[test]
fn a_sweep_holds_every_evaluation_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &[]);
    let job = service.submit("sweeps", &small_sweep(5));
    let view = service.wait(&job, LONG);
    assert_eq!((view["state"].as_str(), view["num_done"].as_i64()), (Some("succeeded"), Some(5)), "{view}");
    let result = service.get(&format!("{job}/result")).json();
    let forces: Vec<f64> = result["evaluations"]
        .as_array()
        .unwrap()
        .iter()
        .map(|e| e["evaluation"]["steps"][0]["force_n"].as_f64().unwrap())
        .collect();
    assert!(forces.len() == 5 && forces.windows(2).all(|w| w[0] < w[1]), "{forces:?}");
    let csv = service.get(&format!("{job}/artefacts/table.csv"));
    let text = String::from_utf8(csv.body).unwrap();
    assert_eq!(text.lines().count(), 6);
    assert!(text.starts_with("index,specimen,/drive_mm/0,drive_mm,force_n,"), "{text}");
    let parquet = service.get(&format!("{job}/artefacts/table.parquet"));
    assert_eq!(parquet.header("content-type"), Some("application/vnd.apache.parquet"));
    assert!(parquet.body.starts_with(b"PAR1") && parquet.body.ends_with(b"PAR1"));
}

#[test]
fn a_sample_of_ranges_follows_its_seed() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    let body = |count: usize, seed: u64| {
        json!({ "base": small_evaluation(1.0), "vary": [{ "pointer": "/drive_mm/0", "range": [0.5, 2.5] }],
                "sample": { "count": count, "seed": seed } })
    };
    let drawn = |body: &Value| {
        let job = service.submit("sweeps", body);
        assert_eq!(service.get(&format!("{job}/request")).json(), *body);
        service.get(&job).json()["num_tasks"].as_u64().unwrap()
    };
    assert_eq!((drawn(&body(4, 1)), drawn(&body(7, 2))), (4, 7));
    for (refusal, pointer, wrong) in [
        (MISFIT, "/sample/count", body(0, 1)),
        (
            UNFIT,
            "/vary/0/range",
            json!({ "base": small_evaluation(1.0), "vary": [{ "pointer": "/drive_mm/0", "range": [1.0, 2.0] }] }),
        ),
        (
            UNFIT,
            "/vary/0/pointer",
            json!({ "base": small_evaluation(1.0), "vary": [{ "pointer": "/nothing", "values": [1.0] }] }),
        ),
        (
            UNFIT,
            "/vary/0/values/1",
            json!({ "base": small_evaluation(1.0), "vary": [{ "pointer": "/drive_mm/0", "values": [1.0, 0.0] }] }),
        ),
        (MISFIT, "/base/material/bulk_kpa", {
            let mut wrong = body(2, 1);
            wrong["base"]["material"]["bulk_kpa"] = json!(-1.0);
            wrong
        }),
        (MISFIT, "/evaluations/1/specimen/block/width_mm", {
            let mut second = small_evaluation(1.0);
            second["specimen"]["block"]["width_mm"] = json!(-5.0);
            json!({ "evaluations": [small_evaluation(1.0), second] })
        }),
    ] {
        service.post("/v1/sweeps", &wrong).is_refused(refusal, pointer);
    }
}

#[test]
fn ten_thousand_points_are_queued_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    let begin = std::time::Instant::now();
    let job = service.submit("sweeps", &small_sweep(10_000));
    let seconds = begin.elapsed().as_secs_f64();
    eprintln!("10,000 points were queued in {seconds:.2} s");
    assert_eq!(service.get(&job).json()["num_tasks"], 10_000);
}

#[test]
fn a_full_queue_says_when_to_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0", "--max-queued", "2"]);
    service.submit("evaluations", &small_evaluation(1.0));
    let reply = service.post("/v1/sweeps", &small_sweep(3));
    assert_eq!((reply.status, reply.cause().as_str()), (429, "queue-full"));
    let after = reply.header("retry-after").unwrap().parse::<u32>().unwrap();
    assert!(after > 0 && reply.json()["retry_after_s"] == after);
}
