//! Structured logs: one JSON object per line on stderr.

use std::time::{SystemTime, UNIX_EPOCH};

/// Milliseconds since 1970, for logs only.
fn now_ms() -> u128 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_millis())
}

/// Writes one line. A closed stderr is not an error.
pub fn event(level: &str, name: &str, fields: &serde_json::Value) {
    use std::io::Write;
    let line = serde_json::json!({ "time_ms": now_ms() as u64, "level": level, "event": name, "fields": fields });
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// Something worth knowing.
pub fn info(name: &str, fields: &serde_json::Value) {
    event("info", name, fields);
}

/// Something that failed.
pub fn error(name: &str, message: &str) {
    event("error", name, &serde_json::json!({ "message": message }));
}
