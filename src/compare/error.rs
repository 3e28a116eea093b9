//! Why two results cannot be compared.

use std::path::PathBuf;

/// Why there is no comparison.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CompareError {
    /// A file cannot be read.
    #[error("cannot read {}: {message}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        message: String,
    },
    /// A file is no result.
    #[error("{} is not a result that can be compared: {message}", path.display())]
    NotAResult {
        /// The file.
        path: PathBuf,
        /// Why.
        message: String,
    },
    /// The results are of different kinds or inputs.
    #[error("not comparable: {}", reasons.join("; "))]
    NotComparable {
        /// Every reason.
        reasons: Vec<String>,
    },
    /// A file of one folder is missing in the other.
    #[error("{} has no counterpart in {}", path.display(), other.display())]
    NoCounterpart {
        /// The file.
        path: PathBuf,
        /// The folder that lacks it.
        other: PathBuf,
    },
}
