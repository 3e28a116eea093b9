//! Killed at random points, a sweep loses nothing and gets every result once, equal to an undisturbed run's.

#[path = "common/prerequisites.rs"]
mod prerequisites;
mod service_common;

use lambdak::service::store::{Finished, MAX_LOSSES, NewJob, NewTask, Store, TaskResult};
use prerequisites::Missing;
use serde_json::Value;
use service_common::{Service, lambdak, small_sweep};
use std::process::{Child, Stdio};
use std::time::Duration;

const NUM_TASKS: usize = 200;
const LONG: Duration = Duration::from_secs(1500);

/// A small generator; the seed makes a failing run repeatable.
struct Random(u64);

impl Random {
    fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % n
    }
}

/// What an undisturbed run yields.
fn undisturbed() -> Value {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &[]);
    let job = service.submit("sweeps", &small_sweep(NUM_TASKS));
    assert_eq!(service.wait(&job, LONG)["state"], "succeeded");
    service.get(&format!("{job}/result")).json()
}

/// Every task has one result, taken once.
fn check(service: &Service, job: &str, expected: &Value, completions: &[(i64, i64)]) {
    let view = service.wait(job, LONG);
    assert_eq!(view["state"], "succeeded", "{view}");
    assert_eq!(view["num_done"].as_u64(), Some(NUM_TASKS as u64));
    let result = service.get(&format!("{job}/result")).json();
    assert_eq!(result["evaluations"].as_array().unwrap().len(), NUM_TASKS);
    assert!(&result == expected, "the result differs from the undisturbed run's");
    assert_eq!(completions.len(), NUM_TASKS);
    assert!(completions.iter().all(|c| c.1 == 1), "{completions:?}");
}

fn completions(store: &Store, job: &str) -> Vec<(i64, i64)> {
    let id = job.rsplit('/').next().unwrap();
    store.tasks(id).unwrap().iter().map(|t| (t.index, t.completions)).collect()
}

fn sqlite_service_killed_at_random_points() {
    let expected = undisturbed();
    let folder = tempfile::tempdir().unwrap();
    let mut service = Service::start(folder.path(), &[]);
    let job = service.submit("sweeps", &small_sweep(NUM_TASKS));
    let mut random = Random(7);
    let mut kills = 0;
    loop {
        // An idle machine ends the sweep within seconds.
        std::thread::sleep(Duration::from_millis(60 + random.below(250)));
        let view = service.get(&job).json();
        if view["state"] == "succeeded" {
            break;
        }
        service.kill();
        kills += 1;
        service = Service::start(folder.path(), &[]);
        // Later kills come further apart, so that the sweep ends on a slow machine too.
        if kills >= 12 {
            break;
        }
    }
    eprintln!("killed {kills} times");
    assert!(kills >= 3, "the sweep was too fast to be killed: {kills}");
    service.wait(&job, LONG);
    let view = service.wait(&job, LONG);
    assert_eq!(view["state"], "succeeded", "{view}");
    let result = service.get(&format!("{job}/result")).json();
    service.kill();
    let store = Store::open_folder(folder.path()).unwrap();
    let taken = completions(&store, &job);
    drop(store);
    let service = Service::start(folder.path(), &["--slots", "0"]);
    assert!(result == expected);
    check(&service, &job, &expected, &taken);
}

/// A worker process; killed when dropped.
struct Worker(Child);

impl Worker {
    fn start(url: &str) -> Worker {
        Worker(
            lambdak()
                .args(["worker", "--slots", "1", "--threads", "1", "--lease-s", "3", "--database", url])
                .stderr(Stdio::null())
                .spawn()
                .unwrap(),
        )
    }

    fn kill(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.kill();
    }
}

/// A database of its own on the test server.
fn database(name: &str) -> Result<String, Missing> {
    let url = prerequisites::postgres()?;
    let mut client = postgres::Client::connect(&url, postgres::NoTls).unwrap();
    client.batch_execute(&format!("DROP DATABASE IF EXISTS {name} WITH (FORCE)")).unwrap();
    client.batch_execute(&format!("CREATE DATABASE {name}")).unwrap();
    let (server, _) = url.rsplit_once('/').unwrap();
    Ok(format!("{server}/{name}"))
}

fn postgres_workers_and_service_killed_at_random_points() -> Result<(), Missing> {
    let url = database("lambdak_kill")?;
    let expected = undisturbed();
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--slots", "0", "--database", url.as_str()];
    let mut service = Service::start(folder.path(), &arguments);
    let job = service.submit("sweeps", &small_sweep(NUM_TASKS));
    let mut workers: Vec<Worker> = (0..2).map(|_| Worker::start(&url)).collect();
    let mut random = Random(11);
    let mut kills = 0;
    while kills < 16 {
        std::thread::sleep(Duration::from_millis(100 + random.below(700)));
        if service.get(&job).json()["state"] == "succeeded" {
            break;
        }
        match random.below(3) as usize {
            2 => {
                service.kill();
                service = Service::start(folder.path(), &arguments);
            }
            n => {
                workers[n].kill();
                workers[n] = Worker::start(&url);
            }
        }
        kills += 1;
    }
    eprintln!("killed {kills} times");
    assert!(kills >= 3, "the sweep was too fast to be killed: {kills}");
    service.wait(&job, LONG);
    let store = Store::connect(&url).unwrap();
    check(&service, &job, &expected, &completions(&store, &job));
    Ok(())
}

fn two_workers_share_a_sweep() -> Result<(), Missing> {
    let url = database("lambdak_share")?;
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0", "--database", url.as_str()]);
    let _workers: Vec<Worker> = (0..2).map(|_| Worker::start(&url)).collect();
    let job = service.submit("sweeps", &small_sweep(NUM_TASKS));
    assert_eq!(service.wait(&job, LONG)["state"], "succeeded");
    let mut client = postgres::Client::connect(&url, postgres::NoTls).unwrap();
    let id = job.rsplit('/').next().unwrap();
    let rows = client
        .query("SELECT worker, COUNT(*) FROM tasks WHERE job_id = $1 AND role <> 'gather' GROUP BY worker", &[&id])
        .unwrap();
    let shares: Vec<i64> = rows.iter().map(|row| row.get(1)).collect();
    eprintln!("tasks per worker: {shares:?}");
    assert_eq!(shares.iter().sum::<i64>(), NUM_TASKS as i64);
    // Half each on idle cores, which then takes half the time; whatever else runs on this machine may slow one of them.
    assert!(shares.len() == 2 && shares.iter().all(|n| *n >= NUM_TASKS as i64 / 5), "{shares:?}");
    Ok(())
}

/// Workers as a Slurm job array take a sweep of the service and end when nothing is left.
fn a_cluster_takes_a_sweep() -> Result<(), Missing> {
    let url = database("lambdak_cluster")?;
    prerequisites::slurm()?;
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0", "--database", url.as_str()]);
    let job = service.submit("sweeps", &small_sweep(NUM_TASKS));
    let workers = folder.path().join("workers");
    let output = lambdak()
        .args(["worker", "--slurm", "--tasks", "2", "--time", "30", "--mem", "500M", "--idle-exit-s", "2", "--folder"])
        .arg(&workers)
        .env("LAMBDAK_DATABASE", &url)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let number = String::from_utf8(output.stdout).unwrap().trim().to_string();
    assert_eq!(service.wait(&job, LONG)["state"], "succeeded");
    let script = std::fs::read_to_string(workers.join("array.sh")).unwrap();
    assert!(!script.contains("postgres://"), "the address is no part of the script");
    let begin = std::time::Instant::now();
    loop {
        let queue = std::process::Command::new("squeue").args(["-h", "-j", &number]).output().unwrap();
        // Empty, or an error once the controller has forgotten the job.
        if queue.stdout.is_empty() {
            break;
        }
        assert!(begin.elapsed() < LONG, "the workers did not end");
        std::thread::sleep(Duration::from_millis(200));
    }
    Ok(())
}

fn a_task_that_ends_its_workers_is_put_aside_and_late_results_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    check_fence(&Store::open_folder(&folder.path().join("data")).unwrap());
}

fn postgres_puts_a_task_aside_and_refuses_late_results() -> Result<(), Missing> {
    check_fence(&Store::connect(&database("lambdak_fence")?).unwrap());
    Ok(())
}

/// A task that ends its workers is put aside, and what comes from an attempt that is over is refused.
fn check_fence(store: &Store) {
    let job = NewJob {
        id: "j".into(),
        kind: "evaluations".into(),
        owner: "o".into(),
        title: String::new(),
        body: "{}".into(),
        inputs: Vec::new(),
        tasks: vec![NewTask { input: "{}".into(), cache_key: "k".into() }],
        has_gather: false,
    };
    store.submit(&job, None, 10, None).unwrap();
    // A lease that is over at once stands for a worker that was killed or sleeps.
    let first = store.claim("a", -1, "{}").unwrap().unwrap();
    let second = store.claim("b", 60_000, "{}").unwrap().unwrap();
    assert_eq!((first.attempt, second.attempt), (1, 2));
    let result = TaskResult { result: b"1".to_vec(), artefacts: Vec::new() };
    assert_eq!(store.finish(&first, "a", &result).unwrap(), Finished::NotOurs);
    assert_eq!(store.heartbeat(&first, "a", 60_000, "").unwrap(), Finished::NotOurs);
    assert!(store.claim("c", 60_000, "{}").unwrap().is_none(), "the second attempt holds it");
    store.cancel("j").unwrap();
    assert_eq!(store.finish(&second, "b", &result).unwrap(), Finished::NotOurs);
    assert!(store.resume("j").unwrap());
    for _ in 0..MAX_LOSSES {
        assert!(store.claim("d", -1, "{\"dead\":1}").unwrap().is_some());
    }
    assert!(store.claim("e", 60_000, "{\"dead\":1}").unwrap().is_none());
    let job = store.job("j").unwrap().unwrap();
    assert_eq!((job.state.as_str(), job.problem.as_str()), ("failed", "{\"dead\":1}"));
    assert!(store.resume("j").unwrap());
    let last = store.claim("f", 60_000, "{}").unwrap().unwrap();
    assert_eq!(store.finish(&last, "f", &result).unwrap(), Finished::Taken);
    assert_eq!(store.finish(&last, "f", &result).unwrap(), Finished::NotOurs);
    assert_eq!(store.tasks("j").unwrap()[0].completions, 1);
}

fn a_worker_of_another_version_is_told() -> Result<(), Missing> {
    let url = database("lambdak_version")?;
    let store = Store::connect(&url).unwrap();
    store.start_service("{}").unwrap();
    let mut client = postgres::Client::connect(&url, postgres::NoTls).unwrap();
    client.batch_execute("UPDATE meta SET value = '99.0.0' WHERE key = 'version'").unwrap();
    let out = lambdak().args(["worker", "--database", &url]).output().unwrap();
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains("99.0.0"));
    Ok(())
}

prerequisites::test_binary!(
    sqlite_service_killed_at_random_points,
    postgres_workers_and_service_killed_at_random_points,
    two_workers_share_a_sweep,
    a_cluster_takes_a_sweep,
    a_task_that_ends_its_workers_is_put_aside_and_late_results_are_refused,
    postgres_puts_a_task_aside_and_refuses_late_results,
    a_worker_of_another_version_is_told,
);
