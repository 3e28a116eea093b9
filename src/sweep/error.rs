//! What can go wrong with a sweep.

use super::shard::Shard;
use super::study_error::SweepStudyError;
use std::path::PathBuf;

/// Why results of a sweep cannot be read or kept.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// Reading failed.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Writing failed; what was written before is kept.
    #[error(
        "cannot write {}: {source}; the {kept} results written before are kept; make room and run the same command again",
        path.display()
    )]
    Write {
        /// The file.
        path: PathBuf,
        /// Results that the file holds.
        kept: usize,
        /// Why.
        source: std::io::Error,
    },
    /// The file is something else; it is left alone.
    #[error("{} is not a shard of a sweep (its first line is no header); choose another --out folder or remove the file", path.display())]
    NotAShard {
        /// The file.
        path: PathBuf,
    },
    /// A line that is not the last one is damaged.
    #[error(
        "{}: line {line} is damaged ({problem}); remove that line, and its task is computed again",
        path.display()
    )]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// The file belongs to another study or version.
    #[error(
        "{} belongs to another study or version (its hash is {found}, this study's {expected}); \
         the study was changed: choose another --out folder, or restore the study",
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
    /// Two files hold different results of one task.
    #[error(
        "task {task} has different results in {} and {}; the files are mixed, or machines of different kind computed it: remove one of the two",
        first.display(),
        second.display()
    )]
    Conflict {
        /// The task.
        task: usize,
        /// One file.
        first: PathBuf,
        /// The other.
        second: PathBuf,
    },
    /// Another process writes the file.
    #[error("{} is being written by another process; wait for it or stop it", path.display())]
    Locked {
        /// The file.
        path: PathBuf,
    },
    /// There are no shards.
    #[error("{} holds no shards of a sweep (shard-*.jsonl)", path.display())]
    Empty {
        /// The folder.
        path: PathBuf,
    },
    /// Results are missing.
    #[error("{missing} of {total} results are missing, the first is task {first}; {}", hint(shards))]
    Incomplete {
        /// Results missing.
        missing: usize,
        /// Tasks of the study.
        total: usize,
        /// The first missing task.
        first: usize,
        /// Shards that are begun or expected and not complete.
        shards: Vec<Shard>,
    },
}

fn hint(shards: &[Shard]) -> String {
    if shards.is_empty() {
        return "run the sweep again to compute them".into();
    }
    let list: Vec<String> = shards.iter().map(|s| format!("--shard {s}")).collect();
    format!("run again: {}", list.join(", "))
}

/// Why a sweep did not finish.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SweepError {
    /// The study.
    #[error(transparent)]
    Study(#[from] SweepStudyError),
    /// The results.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The table could not be encoded as Parquet.
    #[error("the table cannot be encoded as Parquet: {message}")]
    Parquet {
        /// Why.
        message: String,
    },
    /// Stopped from outside.
    #[error("stopped after {done} of {total} tasks")]
    Stopped {
        /// Results kept.
        done: usize,
        /// Tasks of this shard.
        total: usize,
    },
}
