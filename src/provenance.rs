//! What every result carries so that it can be made again: the program's version and a hash of its inputs.

/// Version of the program.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The build: the first 12 hexadecimal digits of the SHA-256 of the running program's file; `unknown` where it cannot
/// be read.
#[cfg(feature = "calibration")]
pub fn build_id() -> String {
    let digest = std::env::current_exe().ok().and_then(|path| crate::file::digest_of_file(&path).ok());
    digest.map_or("unknown".into(), |d| d.chars().take(12).collect())
}

/// SHA-256 of a JSON value, hexadecimal. Object keys are sorted by `serde_json`, numbers are written with the digits
/// that read back to the same bits.
pub fn input_hash(inputs: &serde_json::Value) -> String {
    hmac_sha256::Hash::hash(inputs.to_string().as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect()
}
