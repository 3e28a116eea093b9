//! What every result carries so that it can be made again: the program's version and a hash of its inputs.

use sha2::{Digest, Sha256};

/// Version of the program.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The build: the first 12 hexadecimal digits of the SHA-256 of the running program's file; `unknown` where it cannot
/// be read.
pub fn build_id() -> String {
    let bytes = std::env::current_exe().and_then(std::fs::read);
    bytes.map_or("unknown".into(), |b| Sha256::digest(b).iter().take(6).map(|byte| format!("{byte:02x}")).collect())
}

/// SHA-256 of a JSON value, hexadecimal. Object keys are sorted by `serde_json`, numbers are written with the digits
/// that read back to the same bits.
pub fn input_hash(inputs: &serde_json::Value) -> String {
    Sha256::digest(inputs.to_string().as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect()
}
