//! Digests of files.

use super::{ReadError, files_below, open_regular};
use sha2::{Digest, Sha256};
use std::io::Read;
use std::path::Path;

/// SHA-256 of the content of a regular file, hexadecimal. The file is not held in memory.
///
/// # Errors
/// [`ReadError::NotRegular`], [`ReadError::Io`].
pub fn digest_of_file(path: &Path) -> Result<String, ReadError> {
    let mut file = open_regular(path)?;
    let mut hash = Sha256::new();
    let mut block = vec![0u8; 1 << 16];
    loop {
        match file.read(&mut block)? {
            0 => return Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()),
            length => hash.update(&block[..length]),
        }
    }
}

/// SHA-256 of the content of a regular file, or of the names and contents of all files of a folder and below it,
/// hexadecimal. No file is held in memory.
///
/// # Errors
/// Those of [`files_below`] and [`digest_of_file`].
pub fn digest_of_path(path: &Path) -> Result<String, ReadError> {
    if !std::fs::metadata(path)?.is_dir() {
        return digest_of_file(path);
    }
    let mut hash = Sha256::new();
    for file in files_below(path)? {
        let name = file.strip_prefix(path).unwrap_or(&file).to_string_lossy().into_owned();
        hash.update((name.len() as u64).to_le_bytes());
        hash.update(name.as_bytes());
        hash.update(digest_of_file(&file)?.as_bytes());
    }
    Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}
