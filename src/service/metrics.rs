//! `/metrics` in Prometheus' text format.

use super::signal::Signal;
use super::store::Store;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// Method, route, status.
type RequestKind = (String, String, u16);

/// What the service counts.
#[derive(Default)]
pub struct Metrics {
    /// Requests and their seconds by (method, route, status).
    requests: Mutex<BTreeMap<RequestKind, (u64, f64)>>,
    /// Requests turned away because of too many at a time.
    pub turned_away: AtomicU64,
}

impl Metrics {
    /// Counts a request.
    pub fn count(&self, method: &str, route: &str, status: u16, seconds: f64) {
        let mut requests = self.requests.lock().unwrap_or_else(PoisonError::into_inner);
        let entry = requests.entry((method.into(), route.into(), status)).or_default();
        entry.0 += 1;
        entry.1 += seconds;
    }

    /// The text; `now` holds name, help and value of what is counted at this moment.
    pub fn to_text(&self, store: &Store, signal: &Signal, now: &[(&'static str, &'static str, usize)]) -> String {
        let mut text = String::new();
        let head = |text: &mut String, name: &str, kind: &str, help: &str| {
            let _ = writeln!(text, "# HELP {name} {help}\n# TYPE {name} {kind}");
        };
        head(&mut text, "lambdak_requests_total", "counter", "Requests by method, route and status.");
        let requests = self.requests.lock().unwrap_or_else(PoisonError::into_inner).clone();
        for ((method, route, status), (count, _)) in &requests {
            let _ = writeln!(
                text,
                "lambdak_requests_total{{method=\"{method}\",route=\"{route}\",status=\"{status}\"}} {count}"
            );
        }
        head(&mut text, "lambdak_request_seconds_total", "counter", "Seconds spent on requests.");
        for ((method, route, status), (_, seconds)) in &requests {
            let _ = writeln!(
                text,
                "lambdak_request_seconds_total{{method=\"{method}\",route=\"{route}\",status=\"{status}\"}} {seconds:.6}"
            );
        }
        let mut single = |name: &str, kind: &str, help: &str, value: f64| {
            head(&mut text, name, kind, help);
            let _ = writeln!(text, "{name} {value}");
        };
        let int = |a: &AtomicU64| a.load(Ordering::Relaxed) as f64;
        for (name, help, count) in now {
            single(name, "gauge", help, *count as f64);
        }
        single("lambdak_turned_away_total", "counter", "Requests refused as too many.", int(&self.turned_away));
        single("lambdak_tasks_finished_total", "counter", "Tasks finished by this process.", int(&signal.finished));
        single("lambdak_tasks_failed_total", "counter", "Tasks failed in this process.", int(&signal.failed));
        single("lambdak_task_seconds_total", "counter", "Seconds of tasks run here.", int(&signal.busy_ms) / 1e3);
        if let Ok(workers) = store.num_workers() {
            single("lambdak_workers", "gauge", "Workers seen within a minute.", workers as f64);
        }
        if let Ok((jobs, tasks)) = store.counts() {
            let _ = writeln!(text, "# HELP lambdak_jobs Jobs by kind and state.\n# TYPE lambdak_jobs gauge");
            for (kind, state, count) in jobs {
                let _ = writeln!(text, "lambdak_jobs{{kind=\"{kind}\",state=\"{state}\"}} {count}");
            }
            let _ = writeln!(text, "# HELP lambdak_tasks Tasks by state.\n# TYPE lambdak_tasks gauge");
            for (state, count) in tasks {
                let _ = writeln!(text, "lambdak_tasks{{state=\"{state}\"}} {count}");
            }
        }
        text
    }
}
