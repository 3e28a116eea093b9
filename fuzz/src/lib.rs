//! What the fuzz targets share: memory as an upload to the service has it, and files for readers that take a path.

use lambdak::file::{MemoryLimit, ReadingMemory};
use std::path::{Path, PathBuf};

/// Memory of one reading.
pub fn memory() -> ReadingMemory {
    MemoryLimit::upload().begin()
}

/// Writes `contents` to a file of this process that has `name`, folders included.
pub fn file(name: &str, contents: &[u8]) -> PathBuf {
    let path = folder().join(name);
    if let Some(parent) = path.parent() {
        std::fs::create_dir_all(parent).expect("a folder for temporary files");
    }
    std::fs::write(&path, contents).expect("a temporary file");
    path
}

/// The folder of this process.
fn folder() -> PathBuf {
    // Memory where there is such a folder: a target writes some thousand files per second.
    let shared = Path::new("/dev/shm");
    let parent = if shared.is_dir() { shared.into() } else { std::env::temp_dir() };
    parent.join(format!("lambdak-fuzz-{}", std::process::id()))
}

/// The parts of `data` between bytes of 255, which no text holds; as many as asked for, the last ones empty.
pub fn parts<const N: usize>(data: &[u8]) -> [&[u8]; N] {
    let mut all = data.splitn(N, |byte| *byte == 255);
    std::array::from_fn(|_| all.next().unwrap_or_default())
}
