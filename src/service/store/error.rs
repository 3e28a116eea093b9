//! What can go wrong with the storage.

/// A failure of the storage.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// SQLite.
    #[error("the data folder's database: {0}")]
    Sqlite(#[from] rusqlite::Error),
    /// PostgreSQL.
    #[error("the PostgreSQL server: {0}{detail}", detail = .0.as_db_error().map_or(String::new(), |e| format!(": {}", e.message())))]
    Postgres(#[from] postgres::Error),
    /// The address of the database cannot be read.
    #[error("the database's address cannot be read; give postgres://USER:PASSWORD@HOST:PORT/NAME")]
    Address,
    /// The data folder cannot be used.
    #[error("data folder {}: {source}", path.display())]
    Folder {
        /// The folder.
        path: std::path::PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Another service owns the data folder.
    #[error("data folder {} is in use by another service; stop that one or choose another folder", path.display())]
    FolderInUse {
        /// The folder.
        path: std::path::PathBuf,
    },
    /// The database was made by another version of the tables.
    #[error(
        "the database holds tables of version {found}, this program needs {expected}; use another database or the matching program"
    )]
    OtherSchema {
        /// Version found.
        found: String,
        /// Version needed.
        expected: &'static str,
    },
    /// The service runs another version of the program.
    #[error(
        "the service runs lambdak {service}, this worker is {worker}; results of two versions are never mixed: install lambdak {service} here"
    )]
    OtherVersion {
        /// The service's version.
        service: String,
        /// This program's.
        worker: String,
    },
    /// Too much is queued.
    #[error("{queued} tasks are queued of at most {limit}; wait until some have finished")]
    QueueFull {
        /// Tasks queued or running, those asked for included.
        queued: usize,
        /// Most.
        limit: usize,
        /// Whether it is the token's own quota.
        is_quota: bool,
    },
    /// A file to keep cannot be read.
    #[error("a file to keep cannot be read: {0}")]
    Unreadable(std::io::Error),
    /// A file that is kept cannot be written where it is wanted.
    #[error("a kept file cannot be written: {0}")]
    Unwritable(std::io::Error),
    /// A value in the database is not what was written.
    #[error("the database holds an unreadable {what}")]
    Corrupt {
        /// What.
        what: &'static str,
    },
}

impl StoreError {
    /// Whether the same transaction may succeed when tried again: another one was in the way.
    pub fn is_conflict(&self) -> bool {
        use postgres::error::SqlState;
        match self {
            StoreError::Postgres(e) => matches!(
                e.code(),
                Some(
                    &SqlState::T_R_DEADLOCK_DETECTED
                        | &SqlState::T_R_SERIALIZATION_FAILURE
                        | &SqlState::UNIQUE_VIOLATION
                )
            ),
            _ => false,
        }
    }
}
