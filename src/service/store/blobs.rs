//! Contents under their SHA-256, in parts: whoever writes or reads one holds a part of it and never the whole.

use super::{Store, StoreError, Transaction, sha256_hex};
use std::io::{Read, Write};

/// Length of a part, bytes; the last one is shorter.
const PART_BYTES: u64 = 256 << 10;

impl Store {
    /// Bytes under a SHA-256.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn blob(&self, sha: &str) -> Result<Option<Vec<u8>>, StoreError> {
        if self.blob_length(sha)?.is_none() {
            return Ok(None);
        }
        let rows = self.database.read("SELECT bytes FROM blob_parts WHERE sha = $1 ORDER BY part", &[sha.into()])?;
        Ok(Some(rows.iter().flat_map(|r| r.blob(0)).collect()))
    }

    /// Length of what lies under a SHA-256, bytes.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn blob_length(&self, sha: &str) -> Result<Option<u64>, StoreError> {
        let rows = self.database.read("SELECT num_bytes FROM blobs WHERE sha = $1", &[sha.into()])?;
        Ok(rows.first().map(|r| r.int(0).unsigned_abs()))
    }

    /// A part of what lies under a SHA-256, from 0; none past the last one.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn blob_part(&self, sha: &str, part: i64) -> Result<Option<Vec<u8>>, StoreError> {
        let rows = self
            .database
            .read("SELECT bytes FROM blob_parts WHERE sha = $1 AND part = $2", &[sha.into(), part.into()])?;
        Ok(rows.first().map(|r| r.blob(0)))
    }

    /// Writes what lies under a SHA-256, part by part; nothing where nothing lies there.
    ///
    /// # Errors
    /// [`StoreError`]; [`StoreError::Unwritable`] where `sink` fails.
    pub fn copy_blob(&self, sha: &str, sink: &mut dyn Write) -> Result<(), StoreError> {
        for part in 0.. {
            let Some(bytes) = self.blob_part(sha, part)? else { break };
            sink.write_all(&bytes).map_err(StoreError::Unwritable)?;
        }
        Ok(())
    }
}

/// Keeps the `length` bytes of `source`, whose SHA-256 is known; equal contents are kept once.
pub(super) fn put_blob(t: &mut Transaction, sha: &str, length: u64, source: &mut dyn Read) -> Result<(), StoreError> {
    let made = t.execute(
        "INSERT INTO blobs (sha, num_bytes) VALUES ($1, $2) ON CONFLICT DO NOTHING",
        &[sha.into(), i64::try_from(length).unwrap_or(i64::MAX).into()],
    )?;
    if made == 0 {
        return Ok(());
    }
    let mut read = 0;
    for part in 0i64.. {
        let mut bytes = Vec::new();
        Read::take(&mut *source, PART_BYTES).read_to_end(&mut bytes).map_err(StoreError::Unreadable)?;
        if bytes.is_empty() {
            break;
        }
        read += bytes.len() as u64;
        t.execute(
            "INSERT INTO blob_parts (sha, part, bytes) VALUES ($1, $2, $3)",
            &[sha.into(), part.into(), bytes.into()],
        )?;
    }
    if read == length { Ok(()) } else { Err(StoreError::Corrupt { what: "file that changed while it was kept" }) }
}

/// Keeps bytes that are at hand; their SHA-256.
pub(super) fn put_bytes(t: &mut Transaction, mut bytes: &[u8]) -> Result<String, StoreError> {
    let (sha, length) = (sha256_hex(bytes), bytes.len() as u64);
    put_blob(t, &sha, length, &mut bytes)?;
    Ok(sha)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contents_come_back_in_parts_and_whole() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open_folder(folder.path()).expect("a store");
        let length = 2 * PART_BYTES as usize + 17;
        for content in [Vec::new(), b"short".to_vec(), (0..length).map(|i| (i % 251) as u8).collect()] {
            let keep = || store.database.transact(&|t| put_bytes(t, &content)).expect("kept");
            let sha = keep();
            assert_eq!(keep(), sha, "kept once");
            assert_eq!(store.blob(&sha).expect("an answer").as_deref(), Some(content.as_slice()));
            assert_eq!(store.blob_length(&sha).expect("an answer"), Some(content.len() as u64));
            let mut copied = Vec::new();
            store.copy_blob(&sha, &mut copied).expect("copied");
            assert_eq!(copied, content);
        }
        assert_eq!(store.blob("none").expect("an answer"), None);
        assert_eq!(store.blob_part("none", 0).expect("an answer"), None);
    }

    #[test]
    fn a_file_that_is_shorter_than_it_was_is_not_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open_folder(folder.path()).expect("a store");
        let kept = store.database.transact(&|t| put_blob(t, "sha", 10, &mut b"short".as_slice()));
        assert!(matches!(kept, Err(StoreError::Corrupt { .. })));
        assert_eq!(store.blob("sha").expect("an answer"), None);
    }
}
