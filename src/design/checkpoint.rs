//! The checkpoint: every finished evaluation as one line of JSON, so that a stopped or crashed search goes on where it was.
//!
//! The search is deterministic, so a resumed run asks for the same evaluations in the same order and takes them from here;
//! floats are written with the digits that read back to the same bits. A half-written last line is dropped.

use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Why a checkpoint cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// Reading or writing failed.
    #[error("checkpoint {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It belongs to another study or version.
    #[error(
        "checkpoint {} belongs to another study or version (its hash is {found}, this study's {expected}); \
         delete it or choose another --out folder",
        path.display()
    )]
    OtherStudy {
        /// The file.
        path: PathBuf,
        /// Hash in the file.
        found: String,
        /// Hash of this study.
        expected: String,
    },
}

#[derive(Serialize, Deserialize)]
struct Line {
    key: String,
    value: serde_json::Value,
}

/// Evaluations by key, in memory and, where there is a file, on disk.
pub struct Checkpoint {
    known: Mutex<HashMap<String, serde_json::Value>>,
    file: Mutex<Option<File>>,
    /// Set when an evaluation could not be appended (a full disk, say); the search goes on without the file.
    failure: Mutex<Option<std::io::Error>>,
    num_resumed: usize,
}

impl Checkpoint {
    /// In memory only.
    pub fn in_memory() -> Checkpoint {
        Checkpoint { known: Mutex::default(), file: Mutex::new(None), failure: Mutex::default(), num_resumed: 0 }
    }

    /// Opens or makes the file at `path` for the study with this hash.
    ///
    /// # Errors
    /// [`CheckpointError`].
    pub fn open(path: &Path, study_hash: &str) -> Result<Checkpoint, CheckpointError> {
        let fail = |source| CheckpointError::Io { path: path.into(), source };
        let mut known = HashMap::new();
        let mut good_bytes = 0u64;
        if path.exists() {
            let text = std::fs::read_to_string(path).map_err(fail)?;
            for (number, line) in text.split_inclusive('\n').enumerate() {
                let Ok(parsed) = serde_json::from_str::<Line>(line) else { break };
                if !line.ends_with('\n') {
                    break;
                }
                if number == 0 {
                    let found = parsed.value.as_str().unwrap_or_default().to_string();
                    if found != study_hash {
                        return Err(CheckpointError::OtherStudy {
                            path: path.into(),
                            found,
                            expected: study_hash.into(),
                        });
                    }
                } else {
                    known.insert(parsed.key, parsed.value);
                }
                good_bytes += line.len() as u64;
            }
        }
        let mut file = OpenOptions::new().create(true).append(true).open(path).map_err(fail)?;
        file.set_len(good_bytes).map_err(fail)?;
        if good_bytes == 0 {
            let header = Line { key: "study".into(), value: study_hash.into() };
            writeln!(file, "{}", serde_json::to_string(&header).unwrap_or_default()).map_err(fail)?;
        }
        Ok(Checkpoint {
            num_resumed: known.len(),
            known: Mutex::new(known),
            file: Mutex::new(Some(file)),
            failure: Mutex::default(),
        })
    }

    /// Evaluations found in the file when it was opened.
    pub fn num_resumed(&self) -> usize {
        self.num_resumed
    }

    /// Why the file could not be written, if that happened.
    pub fn write_failure(&self) -> Option<String> {
        self.failure.lock().ok()?.as_ref().map(std::string::ToString::to_string)
    }

    /// The value under `key`, computed and kept unless it is known; a `None` is not kept (a cancelled evaluation).
    pub fn get_or<T: Serialize + DeserializeOwned>(&self, key: &str, compute: impl FnOnce() -> Option<T>) -> Option<T> {
        if let Ok(known) = self.known.lock()
            && let Some(value) = known.get(key)
            && let Ok(value) = T::deserialize(value)
        {
            return Some(value);
        }
        let value = compute()?;
        let line = Line { key: key.into(), value: serde_json::to_value(&value).ok()? };
        if let (Ok(mut file), Ok(text)) = (self.file.lock(), serde_json::to_string(&line))
            && let Some(open) = file.as_mut()
            && let Err(error) = open.write_all(format!("{text}\n").as_bytes())
        {
            *file = None;
            if let Ok(mut failure) = self.failure.lock() {
                *failure = Some(error);
            }
        }
        if let Ok(mut known) = self.known.lock() {
            known.insert(line.key, line.value);
        }
        Some(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn survives_a_half_written_line_and_refuses_another_study() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("checkpoint.jsonl");
        let first = Checkpoint::open(&path, "abc").expect("a new file");
        // 0.1 + 0.2 has no short decimal form: the bits must come back.
        assert_eq!(first.get_or("a", || Some(0.1f64 + 0.2)), Some(0.1 + 0.2));
        drop(first);
        let mut file = OpenOptions::new().append(true).open(&path).expect("it exists");
        file.write_all(b"{\"key\":\"b\",\"val").expect("writable");
        drop(file);
        let again = Checkpoint::open(&path, "abc").expect("the half line is dropped");
        assert_eq!(again.num_resumed(), 1);
        assert_eq!(again.get_or("a", || None::<f64>), Some(0.1 + 0.2));
        assert_eq!(again.get_or("b", || Some(2.0)), Some(2.0));
        drop(again);
        assert_eq!(Checkpoint::open(&path, "abc").expect("still good").num_resumed(), 2);
        assert!(matches!(Checkpoint::open(&path, "other"), Err(CheckpointError::OtherStudy { .. })));
    }
}
