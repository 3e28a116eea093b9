//! What a command can fail with, and the exit code that says so.

use std::path::PathBuf;

/// A failed command.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CliError {
    /// A file could not be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file or folder could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The input is not usable.
    #[error("{}: {message}", path.display())]
    Input {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        message: String,
    },
    /// An option's value is not usable.
    #[error("--{option}: {message}")]
    Option {
        /// The option.
        option: &'static str,
        /// What is wrong with it.
        message: String,
    },
    /// Fields of the request do not hold what they may hold; one line each.
    #[error("{}", .0.join("\nlambdak: "))]
    Fields(Vec<String>),
    /// The folder holds the results of another command.
    #[error("{} holds the results of `lambdak {command}`; choose another --out folder", path.display())]
    FolderTaken {
        /// The folder.
        path: PathBuf,
        /// Whose results lie there.
        command: String,
    },
    /// What an earlier run kept belongs to other work.
    #[error("{0}")]
    Checkpoint(String),
    /// The computation did not succeed.
    #[error("{0}")]
    Numerics(String),
    /// Results of a sweep cannot be read, kept or put together.
    #[error(transparent)]
    Store(#[from] crate::sweep::StoreError),
    /// Results cannot be compared.
    #[error(transparent)]
    Compare(#[from] crate::compare::CompareError),
    /// The compared result is worse.
    #[error("{0}")]
    Worse(String),
    /// The cluster did not do it.
    #[error("{0}")]
    Cluster(String),
    /// Ctrl-C.
    #[error("stopped; {0}")]
    Interrupted(String),
}

impl CliError {
    /// 1 for a compared result that is worse, 2 for bad input, 3 for a computation that did not succeed, 4 for a file
    /// that cannot be written, 130 after Ctrl-C.
    pub fn exit_code(&self) -> u8 {
        match self {
            CliError::Read { .. } | CliError::Input { .. } | CliError::Option { .. } => 2,
            CliError::Fields(_) | CliError::FolderTaken { .. } | CliError::Checkpoint(_) => 2,
            CliError::Numerics(_) | CliError::Cluster(_) => 3,
            CliError::Write { .. } | CliError::Store(crate::sweep::StoreError::Write { .. }) => 4,
            CliError::Store(_) | CliError::Compare(_) => 2,
            CliError::Worse(_) => 1,
            CliError::Interrupted(_) => 130,
        }
    }
}
