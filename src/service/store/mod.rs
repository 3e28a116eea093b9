//! Where jobs, tasks, results and artefacts are kept: SQLite in the data folder, or PostgreSQL shared by several
//! machines.
//!
//! | Invariant | Kept by |
//! |---|---|
//! | a task is run by one worker at a time | a claim is a transaction that takes a lease (SKIP LOCKED in PostgreSQL) |
//! | a task has exactly one result | a result is taken only from the attempt that holds it (`attempt` fences late) |
//! | equal evaluations are computed once | results are kept under their content's key; equal tasks never run together |
//! | a task that ends its worker cannot do so for ever | [`MAX_LOSSES`], then it is put aside with a problem |

mod artefact_row;
mod blobs;
mod database;
mod error;
mod jobs;
mod removal;
mod tasks;
mod uploads;

pub use artefact_row::ArtefactRow;
pub use database::{Database, Row, Transaction, Value};
pub use error::StoreError;
pub use jobs::{Idempotency, JobFilter, JobRow, NewJob, NewTask, Submitted, TaskRow};
pub use removal::Removed;
pub use tasks::{Claimed, Finished, TaskResult};
pub use uploads::{KeptFile, NewUpload, UploadFile, UploadRow};

use crate::provenance::VERSION;
use sha2::{Digest, Sha256};
use std::path::Path;

/// How often a task may lose its worker, without a new checkpoint between, before it is put aside.
pub const MAX_LOSSES: i64 = 5;
/// Ending of the key of an evaluation kept without pictures; one with pictures serves too.
pub const NUMBERS_ONLY: &str = ":numbers";
/// What the disk must still take for the service to be ready, bytes.
const PROBE_BYTES: usize = 64 << 10;
/// Version of the tables.
const SCHEMA_VERSION: &str = "2";

/// SHA-256, hexadecimal.
pub fn sha256_hex(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The storage. All methods block; asynchronous callers use a blocking thread.
pub struct Store {
    pub(super) database: Database,
    /// The data folder, where there is one.
    folder: Option<std::path::PathBuf>,
    /// Held as long as the service owns its data folder.
    _lock: Option<std::fs::File>,
}

impl Store {
    /// SQLite in `folder`, which this process then owns.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn open_folder(folder: &Path) -> Result<Store, StoreError> {
        let fail = |source| StoreError::Folder { path: folder.into(), source };
        std::fs::create_dir_all(folder).map_err(fail)?;
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            std::fs::set_permissions(folder, std::fs::Permissions::from_mode(0o700)).map_err(fail)?;
        }
        let lock = std::fs::File::create(folder.join("lock")).map_err(fail)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(std::fs::TryLockError::WouldBlock) => return Err(StoreError::FolderInUse { path: folder.into() }),
            Err(std::fs::TryLockError::Error(source)) => return Err(fail(source)),
        }
        let database = Database::open_sqlite(&folder.join("lambdak.sqlite"))?;
        let store = Store { database, folder: Some(folder.into()), _lock: Some(lock) };
        store.prepare()?;
        Ok(store)
    }

    /// PostgreSQL at `postgres://…`.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn connect(url: &str) -> Result<Store, StoreError> {
        let store = Store { database: Database::connect_postgres(url)?, folder: None, _lock: None };
        store.prepare()?;
        Ok(store)
    }

    /// Whether several machines may share it.
    pub fn is_shared(&self) -> bool {
        self.database.is_shared()
    }

    fn prepare(&self) -> Result<(), StoreError> {
        self.database.transact(&|t| {
            if let Transaction::Postgres(inner) = t {
                // Two programs that start together make the tables once.
                inner.execute("SELECT pg_advisory_xact_lock(7153402)", &[])?;
            }
            t.batch("CREATE TABLE IF NOT EXISTS meta (key TEXT PRIMARY KEY, value TEXT NOT NULL)")?;
            let was = t.query("SELECT value FROM meta WHERE key = 'schema'", &[])?;
            let found = was.first().map_or(SCHEMA_VERSION.into(), |r| r.text(0));
            let is_of_version_1 = found == "1";
            if !is_of_version_1 && found != SCHEMA_VERSION {
                return Err(StoreError::OtherSchema { found, expected: SCHEMA_VERSION });
            }
            if is_of_version_1 {
                // What is known of evaluations is there to save time: jobs hold their results themselves.
                t.batch("DROP TABLE results")?;
            }
            t.batch(include_str!("schema.sql"))?;
            if is_of_version_1 {
                t.batch(include_str!("from_version_1.sql"))?;
            }
            t.execute(
                "INSERT INTO meta (key, value) VALUES ('schema', $1) ON CONFLICT DO NOTHING",
                &[SCHEMA_VERSION.into()],
            )?;
            t.execute("INSERT INTO revisions (id, last) VALUES (1, 0) ON CONFLICT DO NOTHING", &[])?;
            Ok(())
        })
    }

    /// Called by the service at its start: says its version to the workers, frees what a crashed process of this folder
    /// held, and puts unfinished jobs of other versions aside.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn start_service(&self, version_problem: &str) -> Result<(), StoreError> {
        let is_shared = self.is_shared();
        self.database.transact(&|t| {
            t.execute(
                "INSERT INTO meta (key, value) VALUES ('version', $1) \
                 ON CONFLICT (key) DO UPDATE SET value = excluded.value",
                &[VERSION.into()],
            )?;
            if !is_shared {
                t.execute("UPDATE tasks SET lease_ms = 0 WHERE state = 'running'", &[])?;
            }
            let stale = t.query(
                "SELECT id FROM jobs WHERE state IN ('queued', 'running') AND version <> $1",
                &[VERSION.into()],
            )?;
            for job in stale {
                jobs::end_job(t, &job.text(0), "failed", version_problem)?;
            }
            Ok(())
        })
    }

    /// Called by a worker at its start.
    ///
    /// # Errors
    /// [`StoreError::OtherVersion`] where the service is of another version.
    pub fn check_version(&self) -> Result<(), StoreError> {
        let rows = self.database.read("SELECT value FROM meta WHERE key = 'version'", &[])?;
        match rows.first().map(|r| r.text(0)) {
            Some(service) if service != VERSION => Err(StoreError::OtherVersion { service, worker: VERSION.into() }),
            _ => Ok(()),
        }
    }

    /// Whether the database answers, and takes what is written: a row, and some of its file's disk.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn check_ready(&self) -> Result<(), StoreError> {
        self.database.read("SELECT 1", &[])?;
        if let Some(folder) = &self.folder {
            // A file of the database may have room in it while its disk is full.
            let path = folder.join("ready-probe");
            let written = std::fs::write(&path, vec![0x5a; PROBE_BYTES]);
            let removed = std::fs::remove_file(&path);
            written.and(removed).map_err(|source| StoreError::Folder { path: folder.clone(), source })?;
        }
        self.database.transact(&|t| {
            t.execute(
                "INSERT INTO meta (key, value) VALUES ('ready', 'yes') \
                 ON CONFLICT (key) DO UPDATE SET value = excluded.value",
                &[],
            )?;
            Ok(())
        })
    }
}

/// The next revision; taking it serialises writers, so revisions become visible in their order.
fn next_revision(t: &mut Transaction) -> Result<i64, StoreError> {
    let rows = t.query("UPDATE revisions SET last = last + 1 WHERE id = 1 RETURNING last", &[])?;
    rows.first().map(|r| r.int(0)).ok_or(StoreError::Corrupt { what: "revision" })
}

/// Marks a job as changed.
fn touch(t: &mut Transaction, job: &str) -> Result<(), StoreError> {
    let revision = next_revision(t)?;
    t.execute("UPDATE jobs SET revision = $1 WHERE id = $2", &[revision.into(), job.into()])?;
    Ok(())
}

/// Locks a job's row on PostgreSQL, so that everything that ends tasks of one job takes its locks in the same order.
fn lock_job(t: &mut Transaction, job: &str) -> Result<bool, StoreError> {
    let sql = match t {
        Transaction::Sqlite(_) => "SELECT id FROM jobs WHERE id = $1",
        Transaction::Postgres(_) => "SELECT id FROM jobs WHERE id = $1 FOR UPDATE",
    };
    Ok(!t.query(sql, &[job.into()])?.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tables as version 1 had them, with a job that reads an upload and a file that both share.
    const VERSION_1: &str = "
        CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL);
        INSERT INTO meta VALUES ('schema', '1');
        CREATE TABLE jobs (
            id TEXT PRIMARY KEY, kind TEXT NOT NULL, owner TEXT NOT NULL, title TEXT NOT NULL, body TEXT NOT NULL,
            version TEXT NOT NULL, state TEXT NOT NULL, num_tasks BIGINT NOT NULL, num_done BIGINT NOT NULL,
            progress TEXT NOT NULL, problem TEXT NOT NULL, result_sha TEXT NOT NULL, cancel_requested BIGINT NOT NULL,
            created_ms BIGINT NOT NULL, started_ms BIGINT NOT NULL, finished_ms BIGINT NOT NULL,
            revision BIGINT NOT NULL);
        INSERT INTO jobs VALUES ('job', 'calibrations', 'anna', 'a job', '{\"recordings\":[\"upload\"]}', '0', 'queued',
            1, 0, '', '', 'sha', 0, 1, 0, 0, 1);
        CREATE TABLE blobs (sha TEXT PRIMARY KEY, bytes BLOB NOT NULL, num_bytes BIGINT NOT NULL);
        INSERT INTO blobs VALUES ('sha', x'0102', 2);
        CREATE TABLE results (
            cache_key TEXT PRIMARY KEY, result_sha TEXT NOT NULL, artefacts TEXT NOT NULL, created_ms BIGINT NOT NULL);
        INSERT INTO results VALUES ('key', 'sha', '[]', 1);
        CREATE TABLE uploads (
            id TEXT PRIMARY KEY, owner TEXT NOT NULL, title TEXT NOT NULL, manifest TEXT NOT NULL,
            num_bytes BIGINT NOT NULL, created_ms BIGINT NOT NULL);
        INSERT INTO uploads VALUES ('upload', 'anna', 'an upload', '{}', 2, 1);";

    #[test]
    fn tables_of_version_1_are_taken_over() {
        let folder = tempfile::tempdir().expect("a folder");
        let old = rusqlite::Connection::open(folder.path().join("lambdak.sqlite")).expect("a file");
        old.execute_batch(VERSION_1).expect("tables");
        drop(old);
        for _ in 0..2 {
            let store = Store::open_folder(folder.path()).expect("taken over, and opened again");
            assert_eq!(store.blob("sha").expect("an answer"), Some(vec![1, 2]));
            assert_eq!(store.delete_upload("upload").expect("an answer"), Removed::InUse, "an unfinished job reads it");
            assert_eq!(store.job("job").expect("an answer").expect("the job").title, "a job");
        }
    }

    #[test]
    fn tables_of_an_unknown_version_are_left_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let other = rusqlite::Connection::open(folder.path().join("lambdak.sqlite")).expect("a file");
        let meta =
            "CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL); INSERT INTO meta VALUES ('schema', '9')";
        other.execute_batch(meta).expect("a table");
        assert!(matches!(Store::open_folder(folder.path()), Err(StoreError::OtherSchema { .. })));
        let tables = other.query_row("SELECT count(*) FROM sqlite_master WHERE type = 'table'", [], |row| row.get(0));
        assert_eq!(tables, Ok(1), "nothing was made");
    }
}
