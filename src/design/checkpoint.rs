//! The checkpoint: every finished evaluation as one line of JSON, so that a stopped or crashed search goes on where it
//! was.
//!
//! The search is deterministic, so a resumed run asks for the same evaluations in the same order and takes them from
//! here; floats are written with the digits that read back to the same bits. A half-written last line is dropped.

use crate::file::read_limited;
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
    /// The file holds something else; it is left alone.
    #[error("{} is not a checkpoint (its first line is no header); choose another --out folder or remove the file", path.display())]
    NotACheckpoint {
        /// The file.
        path: PathBuf,
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

/// Largest checkpoint that is read, bytes; one of a long search has some hundred megabytes.
const MAX_BYTES: u64 = 1 << 34;

/// What the evaluations hold. Those of another meaning must not be read: their lists of derivatives are told apart by
/// place alone.
const FORMAT: &str = "evaluations/4";

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
        let study_hash = format!("{study_hash}, {FORMAT}");
        let mut known = HashMap::new();
        let mut good_bytes = 0u64;
        // A header cut off by a crash has no line end; a whole line that is no header was written by something else.
        let mut lines_of_something_else = false;
        if path.exists() {
            let bytes = read_limited(path, MAX_BYTES).map_err(|error| fail(error.into_io()))?;
            let text = String::from_utf8_lossy(&bytes);
            lines_of_something_else = text.contains('\n');
            for (number, line) in text.split_inclusive('\n').enumerate() {
                let Ok(parsed) = serde_json::from_str::<Line>(line) else { break };
                if !line.ends_with('\n') {
                    break;
                }
                if number == 0 {
                    let found = parsed.value.as_str().unwrap_or_default().to_string();
                    if found != study_hash {
                        return Err(CheckpointError::OtherStudy { path: path.into(), found, expected: study_hash });
                    }
                } else {
                    known.insert(parsed.key, parsed.value);
                }
                good_bytes += line.len() as u64;
            }
        }
        if good_bytes == 0 && lines_of_something_else {
            return Err(CheckpointError::NotACheckpoint { path: path.into() });
        }
        let mut file = OpenOptions::new().create(true).append(true).open(path).map_err(fail)?;
        file.set_len(good_bytes).map_err(fail)?;
        if good_bytes == 0 {
            let header = Line { key: "study".into(), value: study_hash.clone().into() };
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
        let reopened = Checkpoint::open(&path, "abc").expect("the half line is dropped");
        assert_eq!(reopened.num_resumed(), 1);
        assert_eq!(reopened.get_or("a", || None::<f64>), Some(0.1 + 0.2));
        assert_eq!(reopened.get_or("b", || Some(2.0)), Some(2.0));
        drop(reopened);
        assert_eq!(Checkpoint::open(&path, "abc").expect("still good").num_resumed(), 2);
        assert!(matches!(Checkpoint::open(&path, "other"), Err(CheckpointError::OtherStudy { .. })));
    }

    /// A file that is no checkpoint is refused and left as it is; a header cut off by a crash is written anew.
    #[test]
    fn leaves_other_files_alone() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("notes.txt");
        for other in ["shopping list\nmilk\n", "\u{0}\u{1}\n", "{}\n", "[1, 2]\n{\"key\":\"a\",\"value\":1}\n"] {
            std::fs::write(&path, other).expect("writable");
            let refused = Checkpoint::open(&path, "abc");
            assert!(matches!(refused, Err(CheckpointError::NotACheckpoint { .. })), "{other:?}");
            assert_eq!(std::fs::read_to_string(&path).expect("readable"), other);
        }
        std::fs::write(&path, b"\xff\xfe\n").expect("writable");
        assert!(matches!(Checkpoint::open(&path, "abc"), Err(CheckpointError::NotACheckpoint { .. })));
        std::fs::write(&path, "{\"key\":\"stu").expect("writable");
        assert_eq!(Checkpoint::open(&path, "abc").expect("begun anew").num_resumed(), 0);
        assert_eq!(Checkpoint::open(&path, "abc").expect("a good file").num_resumed(), 0);
    }

    /// A damaged line ends what is trusted: the lines before it are kept, what follows is computed again.
    #[test]
    fn trusts_nothing_behind_a_damaged_line() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("checkpoint.jsonl");
        let first = Checkpoint::open(&path, "abc").expect("a new file");
        for (key, value) in [("a", 1.0), ("b", 2.0), ("c", 3.0)] {
            first.get_or(key, || Some(value));
        }
        drop(first);
        let text = std::fs::read_to_string(&path).expect("readable");
        std::fs::write(&path, text.replace("\"b\"", "\"b")).expect("writable");
        let reopened = Checkpoint::open(&path, "abc").expect("usable");
        assert_eq!(reopened.num_resumed(), 1);
        assert_eq!(reopened.get_or("c", || Some(4.0)), Some(4.0));
    }

    /// Every finite float comes back with its bits, also through the file.
    #[test]
    fn floats_keep_their_bits() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("checkpoint.jsonl");
        let mut bits = 0x9e37_79b9_7f4a_7c15u64;
        let values: Vec<f64> = std::iter::repeat_with(|| {
            // xorshift: any bit pattern.
            bits ^= bits << 13;
            bits ^= bits >> 7;
            bits ^= bits << 17;
            f64::from_bits(bits)
        })
        .filter(|v| v.is_finite())
        .take(20_000)
        .collect();
        let first = Checkpoint::open(&path, "abc").expect("a new file");
        first.get_or("a", || Some(values.clone()));
        drop(first);
        let reopened = Checkpoint::open(&path, "abc").expect("usable");
        let back = reopened.get_or("a", || None::<Vec<f64>>).expect("it is there");
        assert!(values.iter().zip(&back).all(|(a, b)| a.to_bits() == b.to_bits()));
    }
}
