//! The results on disk: one append-only file of JSON lines per shard.
//!
//! A line is `{"sha256":"<16 digits>","record":…}`; the digits are the start of the SHA-256 of the record's text. The
//! first record is the header with the study's hash, each other one a task with its outcome. A line is written at once
//! and synced before the next. A torn last line (a kill, a crash, a full disk) is dropped; its task is computed again.

use super::error::StoreError;
use super::shard::Shard;
use super::task::Outcome;
use crate::file::read_limited;
use crate::provenance::VERSION;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

const HEAD: &str = "{\"sha256\":\"";
const MIDDLE: &str = "\",\"record\":";
/// Digits of the checksum: 64 bits, far more than torn lines need.
const DIGITS: usize = 16;
/// Largest shard that is read, bytes: ten million results take a few gigabytes.
const MAX_SHARD_BYTES: u64 = 1 << 36;
/// A requeued task may meet its predecessor's lock while that one dies.
const LOCK_ATTEMPTS: usize = 20;
const LOCK_PAUSE: Duration = Duration::from_millis(250);

/// First record of a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    schema: String,
    study_hash: String,
    version: String,
    shard: Shard,
    num_tasks: usize,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Record {
    task: usize,
    outcome: Outcome,
}

/// What a file holds.
#[derive(Clone, Debug)]
pub struct ShardContents {
    /// Which part of the sweep the file was begun for; none in a file whose header was torn.
    pub shard: Option<Shard>,
    /// Results by task.
    pub outcomes: BTreeMap<usize, Outcome>,
    /// Bytes up to the end of the last whole line.
    pub good_bytes: u64,
}

/// Results of a whole folder.
#[derive(Clone, Debug, Default)]
pub struct Collected {
    /// Results by task.
    pub outcomes: BTreeMap<usize, Outcome>,
    /// Shards whose files were found.
    pub shards: Vec<Shard>,
}

/// Name of a shard's file.
pub fn shard_path(folder: &Path, shard: Shard) -> PathBuf {
    let width = shard.count.to_string().len();
    folder.join(format!("shard-{:0width$}-of-{}.jsonl", shard.index, shard.count))
}

fn line_of<T: Serialize>(record: &T) -> Result<String, std::io::Error> {
    let text = serde_json::to_string(record)?;
    Ok(format!("{HEAD}{}{MIDDLE}{text}}}\n", checksum(&text)))
}

fn checksum(text: &str) -> String {
    Sha256::digest(text.as_bytes()).iter().take(DIGITS / 2).map(|byte| format!("{byte:02x}")).collect()
}

/// The record's text of a whole line, or what is wrong with the line.
fn record_of(line: &[u8]) -> Result<&str, &'static str> {
    let text = std::str::from_utf8(line).map_err(|_| "it is not text")?;
    let rest = text.strip_prefix(HEAD).ok_or("it does not begin with a checksum")?;
    let (sum, rest) = rest.split_at_checked(DIGITS).ok_or("it is cut short")?;
    let record = rest
        .strip_prefix(MIDDLE)
        .and_then(|r| r.strip_suffix('\n'))
        .and_then(|r| r.strip_suffix('}'))
        .ok_or("it is cut short")?;
    if checksum(record) == sum { Ok(record) } else { Err("its checksum is wrong") }
}

/// Reads a shard's file.
///
/// # Errors
/// [`StoreError::Read`], [`StoreError::NotAShard`], [`StoreError::OtherStudy`], [`StoreError::Damaged`] for a line that
/// is not the last one.
pub fn read_shard(path: &Path, study_hash: &str) -> Result<ShardContents, StoreError> {
    let bytes = read_limited(path, MAX_SHARD_BYTES)
        .map_err(|error| StoreError::Read { path: path.into(), source: error.into_io() })?;
    let mut contents = ShardContents { shard: None, outcomes: BTreeMap::new(), good_bytes: 0 };
    let mut num_tasks = 0;
    let total = bytes.len() as u64;
    for (index, line) in bytes.split_inclusive(|b| *b == b'\n').enumerate() {
        let is_last = contents.good_bytes + line.len() as u64 == total;
        let damaged = |problem| StoreError::Damaged { path: path.into(), line: index + 1, problem };
        let is_whole = line.ends_with(b"\n");
        let record = match record_of(line) {
            Ok(record) => record,
            // A torn header is the beginning of one; anything else was written by something else.
            Err(_) if index == 0 && (is_whole || !HEAD.as_bytes().starts_with(&line[..line.len().min(HEAD.len())])) => {
                return Err(StoreError::NotAShard { path: path.into() });
            }
            Err(_) if is_last => break,
            Err(problem) => return Err(damaged(problem)),
        };
        if index == 0 {
            let header: Header =
                serde_json::from_str(record).map_err(|_| StoreError::NotAShard { path: path.into() })?;
            if header.study_hash != study_hash || header.version != VERSION {
                let (found, expected) = (header.study_hash, study_hash.into());
                return Err(StoreError::OtherStudy { path: path.into(), found, expected });
            }
            num_tasks = header.num_tasks;
            contents.shard = Some(header.shard);
        } else {
            let record: Record = serde_json::from_str(record).map_err(|_| damaged("it holds no result"))?;
            if record.task >= num_tasks {
                return Err(damaged("its task does not exist"));
            }
            if contents.outcomes.get(&record.task).is_some_and(|known| *known != record.outcome) {
                let (first, second) = (path.into(), path.into());
                return Err(StoreError::Conflict { task: record.task, first, second });
            }
            contents.outcomes.insert(record.task, record.outcome);
        }
        contents.good_bytes += line.len() as u64;
    }
    Ok(contents)
}

/// Results of all shards' files in some folders.
///
/// # Errors
/// [`StoreError`]; folders without any file are no error.
pub fn collect(folders: &[&Path], study_hash: &str) -> Result<Collected, StoreError> {
    let mut all = Collected::default();
    let mut origin: BTreeMap<usize, usize> = BTreeMap::new();
    let mut files: Vec<PathBuf> = Vec::new();
    for folder in folders {
        let fail = |source| StoreError::Read { path: (*folder).into(), source };
        let entries = match std::fs::read_dir(folder) {
            Ok(entries) => entries,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => continue,
            Err(e) => return Err(fail(e)),
        };
        for entry in entries {
            let path = entry.map_err(fail)?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if name.starts_with("shard-") && name.ends_with(".jsonl") {
                files.push(path);
            }
        }
    }
    files.sort();
    for (number, path) in files.iter().enumerate() {
        let contents = read_shard(path, study_hash)?;
        all.shards.extend(contents.shard);
        for (task, outcome) in contents.outcomes {
            match all.outcomes.get(&task) {
                Some(known) if *known != outcome => {
                    let first = origin.get(&task).map_or_else(PathBuf::new, |i| files[*i].clone());
                    return Err(StoreError::Conflict { task, first, second: path.clone() });
                }
                Some(_) => {}
                None => {
                    origin.insert(task, number);
                    all.outcomes.insert(task, outcome);
                }
            }
        }
    }
    all.shards.sort();
    all.shards.dedup();
    Ok(all)
}

impl Collected {
    /// Ok where every task has its result.
    ///
    /// # Errors
    /// [`StoreError::Incomplete`] with the shards to run again.
    pub fn check_complete(&self, num_tasks: usize) -> Result<(), StoreError> {
        let missing: Vec<usize> = (0..num_tasks).filter(|t| !self.outcomes.contains_key(t)).collect();
        let Some(&first) = missing.first() else { return Ok(()) };
        // The shards asked for, had one division been meant: that of the files found.
        let counts: std::collections::BTreeSet<usize> = self.shards.iter().map(|s| s.count).collect();
        let mut shards = Vec::new();
        if let (1, Some(&count)) = (counts.len(), counts.first()) {
            let indices: std::collections::BTreeSet<usize> = missing.iter().map(|t| t % count + 1).collect();
            shards = indices.into_iter().map(|index| Shard { index, count }).collect();
        }
        Err(StoreError::Incomplete { missing: missing.len(), total: num_tasks, first, shards })
    }
}

/// Appends results to a shard's file, which no other process may write meanwhile.
#[derive(Debug)]
pub struct ShardWriter {
    file: File,
    path: PathBuf,
    good_bytes: u64,
    num_results: usize,
}

impl ShardWriter {
    /// Opens or begins the file of `shard` in `folder`; a torn last line is cut off.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn open(folder: &Path, shard: Shard, study_hash: &str, num_tasks: usize) -> Result<Self, StoreError> {
        let path = shard_path(folder, shard);
        let fail = |source| StoreError::Write { path: path.clone(), kept: 0, source };
        std::fs::create_dir_all(folder).map_err(fail)?;
        let file = OpenOptions::new().read(true).append(true).create(true).open(&path).map_err(fail)?;
        lock(&file, &path)?;
        let contents = read_shard(&path, study_hash)?;
        file.set_len(contents.good_bytes).map_err(fail)?;
        let mut writer = ShardWriter {
            file,
            path: path.clone(),
            good_bytes: contents.good_bytes,
            num_results: contents.outcomes.len(),
        };
        if contents.good_bytes == 0 {
            let (schema, version) = ("sweep-shard/1".into(), VERSION.into());
            writer.append_line(&Header { schema, study_hash: study_hash.into(), version, shard, num_tasks })?;
            sync_folder(folder);
        }
        Ok(writer)
    }

    /// Appends a result and waits until the disk has it.
    ///
    /// # Errors
    /// [`StoreError::Write`]; the file then ends with the last whole line.
    pub fn append(&mut self, task: usize, outcome: Outcome) -> Result<(), StoreError> {
        self.append_line(&Record { task, outcome })?;
        self.num_results += 1;
        Ok(())
    }

    fn append_line<T: Serialize>(&mut self, record: &T) -> Result<(), StoreError> {
        let written = line_of(record).and_then(|line| {
            self.file.write_all(line.as_bytes())?;
            self.file.sync_data()?;
            Ok(line.len() as u64)
        });
        match written {
            Ok(length) => {
                self.good_bytes += length;
                Ok(())
            }
            Err(source) => {
                // Should this fail as well, the torn line is dropped by the next reader.
                let _ = self.file.set_len(self.good_bytes);
                Err(StoreError::Write { path: self.path.clone(), kept: self.num_results, source })
            }
        }
    }
}

fn lock(file: &File, path: &Path) -> Result<(), StoreError> {
    for attempt in 0..LOCK_ATTEMPTS {
        match file.try_lock() {
            Ok(()) => return Ok(()),
            // Some network file systems have no locks; the results' own checks remain.
            Err(TryLockError::Error(_)) => return Ok(()),
            Err(TryLockError::WouldBlock) if attempt + 1 < LOCK_ATTEMPTS => std::thread::sleep(LOCK_PAUSE),
            Err(TryLockError::WouldBlock) => {}
        }
    }
    Err(StoreError::Locked { path: path.into() })
}

/// Makes a new file's name last; where folders cannot be synced, the file system does it in its own time.
fn sync_folder(folder: &Path) {
    if let Ok(folder) = File::open(folder) {
        let _ = folder.sync_all();
    }
}

#[cfg(test)]
#[path = "store_tests.rs"]
mod tests;
