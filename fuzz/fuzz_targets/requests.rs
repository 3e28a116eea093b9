//! The request of a job of any kind: the first byte says of which.
#![no_main]

use lambdak::job::KINDS;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((kind, body)) = data.split_first() else { return };
    let Ok(request) = serde_json::from_slice::<serde_json::Value>(body) else { return };
    let kind = &KINDS[usize::from(*kind) % KINDS.len()];
    if let Ok(job) = kind.job(&request) {
        job.title();
        job.inputs();
    }
});
